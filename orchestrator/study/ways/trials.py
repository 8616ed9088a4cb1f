"""Trials that no scene can ask for: a body coupled by FMI 2.0, or integrated by CVode.

Each trial simulates the body and the stops of a scene of the short form from start to end, like the scene's own run.
Its observation has the same quantities.
"""

from __future__ import annotations

import math
import time

import numpy as np

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.energy import InterfaceEnergy
from vibroimpact.orchestrator.importer.events import Event
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec
from vibroimpact.orchestrator.run.coupled import (
    BODY,
    body_integers,
    connections_of,
    stop_of,
    stop_parameters,
)
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters
from vibroimpact.orchestrator.run.record import Deadline, DeadlineReached
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.observation import LATE, Floats, Observation
from vibroimpact.orchestrator.study.ways.span import window_of

ROWS_A_PERIOD = 4
"""Rows of an integration in a period, over the square of the number of modes: the integrator's steps between two rows
are limited. The impacts have rows of their own."""
OUT_OF_BOUNDS = 1e3
"""Displacement over the reference's largest displacement, above which a motion has left all bounds."""


class CoupledTrial:
    """The body and its stops, each an FMU of one version of FMI, `3.0` or `2.0`."""

    def __init__(self, scene: Scene, version: str, wrap: Wrapper | None = None, part: float = 1.0) -> None:
        self._floats, integers = float_parameters(scene, None), integer_parameters(scene)
        self._window = window_of(scene, self._floats, part)
        stops = len(scene.stops)
        body = ComponentSpec(BODY, fmu_path(scene.body.FMU, version), body_integers(integers))
        links = connections_of(stops)
        step = scene.execution.fixed_step
        self._importer = Importer(
            [body, *(stop_of(k, integers, version) for k in range(1, stops + 1))],
            links,
            macro_step=math.inf if step is None else step,
            exchange=scene.execution.exchange,
            wrap=None if wrap is None else (lambda name: wrap),
        )
        self._links, self._stop_floats = links, stop_parameters(stops, self._floats)
        self._energy = InterfaceEnergy(self._importer, links)
        component = self._importer.components[BODY]
        self._motion = component.group("Float64", ["displacement", "velocity"])
        self._counts = component.group("Int64", [f"contact[{k}].count" for k in range(1, stops + 1)])
        names = [f"contact[{k}].last_{what}" for k in range(1, stops + 1) for what in ("time", "velocity")]
        self._last = component.group("Float64", names)
        self._switch = component.group("Boolean", ["record.extrema"])
        self._extremes = component.group("Float64", ["record.displacement_min", "record.displacement_max"])
        self._deadline, self._seconds = Deadline(), scene.execution.deadline
        self._importer.on_event = self._note
        self._importer.on_pause = self._deadline.refuse_late
        self._importer.watchers.append(self._deadline.watcher)

    def run(self) -> Observation:
        """Simulate the scene once."""
        began = time.perf_counter()
        self._impacts: list[tuple[float, float, float]] = []
        self._recording, failure = False, ""
        values: dict[tuple[str, str], Value] = {(BODY, name): v for name, v in self._floats.items()}
        values |= {target: self._floats[source] for target, source in self._stop_floats.items()}
        self._deadline.begin(self._seconds)
        begin, end = self._window
        try:
            self._importer.begin(0.0, values)
            self._energy.begin(self._links)
            self._importer.advance(begin)
            self._recording = True
            self._counts.get()
            if begin == 0.0:
                self._counts.values[:] = 0  # contacts that the start state closes count as new
            self._switch.values[:] = True
            self._switch.set()
            self._importer.advance(end)
            self._note(None)  # `on_event` comes before the event is resolved: the last event is counted here
        except DeadlineReached:
            failure = LATE
        lowest, highest = map(float, self._extremes.get())
        displacement, velocity = map(float, self._motion.get())
        return Observation(
            np.array(self._impacts).reshape(-1, 3),
            lowest,
            highest,
            (displacement, velocity),
            float(np.abs(self._energy.residuals()).sum()) if len(self._energy.residuals()) else math.nan,
            seconds=time.perf_counter() - began,
            failure=failure,
            reached=self._importer.time / end,
        )

    def _note(self, event: Event | None) -> None:
        if not self._recording:
            return
        before = self._counts.values.copy()
        new = np.flatnonzero(self._counts.get() > before)
        if new.size:
            last = self._last.get().reshape(-1, 2)
            self._impacts += [(last[k, 0], last[k, 1], k + 1.0) for k in new]

    def close(self) -> None:
        """Free the components."""
        self._importer.free()


class ModelExchangeTrial:
    """The body's FMU for model exchange, integrated by FMPy's CVode to a relative tolerance.

    FMPy calls the FMU itself, so the calls are not counted: `wrap` is not used.
    """

    def __init__(
        self, scene: Scene, tolerance: float, wrap: Wrapper | None = None, part: float = 1.0
    ) -> None:
        self._scene, self._tolerance, self._part = scene, tolerance, part
        self._deadline = Deadline()
        self._floats = float_parameters(scene, None)
        self._values = self._floats | integer_parameters(scene)
        self._fmu = fmu_path(scene.body.FMU)

    def run(self) -> Observation:
        """Simulate the scene once."""
        from vibroimpact.fmus.packaging.fmpy_door import integrated

        began, scene = time.perf_counter(), self._scene
        begin, end = window_of(scene, self._floats, self._part)
        self._deadline.begin(None)
        reached, is_late = 0.0, False

        def step_finished(now: float) -> bool:
            nonlocal reached, is_late
            if reached == 0.0:  # the time in which FMPy loads libraries does not count
                self._deadline.begin(scene.execution.deadline)
            reached, is_late = now, self._deadline.is_over
            return not is_late

        ports = range(1, len(scene.stops) + 1)
        reported = ("count", "last_time", "last_velocity")
        output = [f"contact[{k}].{what}" for k in ports for what in reported]
        interval = (scene.period or end) / (ROWS_A_PERIOD * getattr(scene.body, "size", 1) ** 2)
        try:
            rows = integrated(
                self._fmu,
                end,
                ["displacement", "velocity", *output],
                tolerance=self._tolerance,
                start_values=self._values,
                interval=interval,
                step_finished=step_finished,
            )
        except ComponentError as error:
            return Observation(seconds=time.perf_counter() - began, failure=str(error))
        late = reached < end * (1.0 - 1e-9) and is_late
        found: list[Floats] = [np.empty((0, 3))]
        for k in ports:
            counts = rows[f"contact[{k}].count"]
            new = np.flatnonzero(np.diff(counts, prepend=0) > 0)
            times, velocities = (rows[f"contact[{k}].last_{what}"][new] for what in ("time", "velocity"))
            found.append(np.column_stack([times, velocities, np.full(len(new), float(k))]))
        impacts = np.concatenate(found)
        within = (impacts[:, 0] > begin) | (begin == 0.0)
        impacts = impacts[within & (impacts[:, 0] <= end)]
        return Observation(
            impacts[np.argsort(impacts[:, 0], kind="stable")],
            final=(float(rows["displacement"][-1]), float(rows["velocity"][-1])),
            seconds=time.perf_counter() - began,
            failure=LATE if late else "",
            reached=reached / end,
        )

    def close(self) -> None:
        """Do nothing: no resource is held between two runs."""


def far_off(found: Observation, expected: Observation) -> bool:
    """Return whether a motion has left all bounds, for example by falling through its stop."""
    size = max(abs(expected.lowest), abs(expected.highest))
    reach = max(abs(found.lowest), abs(found.highest), abs(found.final[0]))
    return math.isfinite(size) and size > 0.0 and reach > OUT_OF_BOUNDS * size
