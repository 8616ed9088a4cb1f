"""A trial of a scene of the short form by the package's own drivers, over all of its time or a part of it."""

from __future__ import annotations

import time

from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.run.parameters import float_parameters, state_variables
from vibroimpact.orchestrator.run.point import driver_of
from vibroimpact.orchestrator.run.record import DeadlineReached, ImpactLimitReached
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.observation import (
    IMPACT_CONTACT,
    IMPACT_TIME,
    IMPACT_VELOCITY,
    LATE,
    Observation,
)
from vibroimpact.orchestrator.study.ways.span import window_of


class DrivenTrial:
    """A body and its stops, fused or coupled as in the scene, over the first part of its time.

    `start` is the state at the start of the last recording: displacements (m), then velocities (m/s), of the
    oscillator, the masses or the modes. It is empty until a run has reached the recording.
    """

    is_guarded = False

    def __init__(self, scene: Scene, part: float = 1.0, wrap: Wrapper | None = None) -> None:
        self._scene, self._floats = scene, float_parameters(scene, None)
        self._window = window_of(scene, self._floats, part)
        how = "coupled" if scene.execution.how == "coupled" else "fused"
        self._driver = driver_of(scene, how, wrap=None if wrap is None else (lambda name: wrap))
        self._driver.watch(contacts=len(scene.stops), state=state_variables(scene))
        self._extremes = self._driver.inputs(["record.displacement_min", "record.displacement_max"])
        self.start: tuple[float, ...] = ()

    def run(self) -> Observation:
        """Simulate the part once."""
        began, driver, failure = time.perf_counter(), self._driver, ""
        begin, end = self._window
        self.start = ()
        driver.begin(self._floats, self._scene.execution.deadline)
        try:
            driver.advance(begin)
            self.start = self._state()
            driver.record(impacts=True, extrema=True, periods=False)
            driver.advance(end)
        except DeadlineReached:
            failure = LATE
        except ImpactLimitReached:
            failure = f"impact_limit: {self._scene.execution.impact_limit} impacts"
        lowest, highest = map(float, self._extremes.get())
        return Observation(
            driver.impacts()[:, [IMPACT_TIME, IMPACT_VELOCITY, IMPACT_CONTACT]],
            lowest,
            highest,
            driver.observed(),
            seconds=time.perf_counter() - began,
            failure=failure,
            reached=driver.time / end,
        )

    def _state(self) -> tuple[float, ...]:
        whole = self._driver.whole_state()
        return self._driver.observed() if whole is None else tuple(whole.tolist())

    def close(self) -> None:
        """Free the components."""
        self._driver.close()
