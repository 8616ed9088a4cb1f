"""Trials with steps of equal size: a body and its stops, coupled as in an importer without events."""

from __future__ import annotations

import math
import time

import numpy as np

from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.importer.component import Component, Value
from vibroimpact.orchestrator.run.coupled import stop_of, stop_parameters
from vibroimpact.orchestrator.run.fused import BodyDriver
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters
from vibroimpact.orchestrator.run.record import Deadline, DeadlineReached
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.observation import LATE, Floats, Observation
from vibroimpact.orchestrator.study.ways.span import window_of
from vibroimpact.orchestrator.study.ways.strangers import stranger_of, thrown_back


class _Seen:
    """The motion as seen after steps of equal size: its extremes, and the steps that ended beyond a stop."""

    def __init__(self, begin: float) -> None:
        self._begin = begin
        self.impacts: list[tuple[float, float, float]] = []
        self.lowest, self.highest = math.inf, -math.inf

    def note(self, now: float, displacement: float) -> None:
        """Add the displacement of the observed point after a step, m."""
        if now > self._begin:
            self.lowest, self.highest = min(self.lowest, displacement), max(self.highest, displacement)

    def note_impact(self, now: float, velocity: float, stop: int) -> None:
        """Add an impact at a stop (0-based), at the end of a step that ended beyond it."""
        if now > self._begin:
            self.impacts.append((now, abs(velocity), stop + 1.0))

    def observation(
        self, final: tuple[float, float], began: float, failure: str, reached: float
    ) -> Observation:
        """Return the observation of the run."""
        found = np.array(self.impacts).reshape(-1, 3)
        return Observation(
            *(found, self.lowest, self.highest, final),
            seconds=time.perf_counter() - began,
            failure=failure,
            reached=reached,
        )


class PlainStepsTrial:
    """A body with rigid stops, observed after steps (s) of equal size, as in an importer without events.

    Where a step ends beyond a stop, an impulse there reverses the velocity by the restitution; the displacements stay.
    The motion between two impulses is exact: all of the error comes from the steps.
    """

    def __init__(self, scene: Scene, step: float, wrap: Wrapper | None = None, part: float = 1.0) -> None:
        self._scene, self._step, self._part = scene, step, part
        self._deadline = Deadline()
        stranger = stranger_of(scene)
        self._floats = stranger.floats
        of = None if wrap is None else (lambda name: wrap)
        self._driver = BodyDriver(self._floats, stranger.integers, scene.body.FMU, wrap=of)
        self._stops = [s for s in scene.stops if s.law == "restitution"]
        self._signs = [1.0 if stop.side == "upper" else -1.0 for stop in self._stops]
        self._velocity_starts, self._changes = thrown_back(scene)
        self._starts = [n.replace("velocity", "displacement") for n in self._velocity_starts]
        self._starts += self._velocity_starts
        self._motion = self._driver.inputs(["displacement", *stranger.displacements, *stranger.velocities])
        self._state = self._driver.inputs([name.replace("_start", "") for name in self._starts])

    def run(self) -> Observation:
        """Simulate the scene once."""
        began, driver, scene = time.perf_counter(), self._driver, self._scene
        begin, end = window_of(scene, self._floats, self._part)
        w = self._floats.get("forcing.angular_frequency", 0.0)
        phase = self._floats.get("forcing.phase", 0.0)
        seen, origin, now, failure = _Seen(begin), 0.0, 0.0, ""
        self._deadline.begin(scene.execution.deadline)
        driver.begin(self._floats, scene.execution.deadline)
        try:
            for i in range(1, math.ceil(end / self._step) + 1):
                now = min(i * self._step, end)
                driver.advance(now - origin)
                motion = self._motion.get()
                seen.note(now, float(motion[0]))
                state = self._thrown_back(now, motion[1:], seen)
                if state is not None:
                    start = dict(zip(self._starts, state.tolist(), strict=True))
                    moved = {"forcing.phase": (phase + w * now) % (2.0 * math.pi)} if w else {}
                    driver.begin(self._floats | start | moved, scene.execution.deadline)
                    origin = now
                self._deadline.refuse_late()
        except DeadlineReached:
            failure = LATE
        return seen.observation(driver.observed(), began, failure, now / end)

    def _thrown_back(self, now: float, motion: Floats, seen: _Seen) -> Floats | None:
        """Return the state after the impulses of all stops that the body has passed; None without an impulse."""
        displacements, velocities = motion.reshape(2, -1)
        state: Floats | None = None
        for k, stop in enumerate(self._stops):
            beyond = self._signs[k] * (displacements[k] - stop.position) > 0.0
            if beyond and self._signs[k] * velocities[k] > 0.0:
                seen.note_impact(now, velocities[k], k)
                state = self._state.get().copy() if state is None else state
                state[len(state) // 2 :] -= (1.0 + stop.restitution) * velocities[k] * self._changes[k]
        return state

    def close(self) -> None:
        """Free the body."""
        self._driver.close()


class PlainForcesTrial:
    """A body and its compliant stops, each an FMU, that exchange motion and force after steps (s) of equal size.

    A tool without events works in this way: the force of the stop is held over a step. With the exchange `jacobi` the
    stop gets the motion at the start of a step, with `gauss_seidel` the motion at its end.
    """

    def __init__(
        self, scene: Scene, exchange: str, step: float, wrap: Wrapper | None = None, part: float = 1.0
    ) -> None:
        self._scene, self._step, self._newest = scene, step, exchange == "gauss_seidel"
        self._part = part
        floats, integers, stranger = (
            float_parameters(scene, None),
            integer_parameters(scene),
            stranger_of(scene),
        )
        self._floats = stranger.floats
        of = None if wrap is None else (lambda name: wrap)
        self._driver = BodyDriver(self._floats, stranger.integers, scene.body.FMU, wrap=of)
        inputs = list(dict.fromkeys(stranger.forces))
        self._pushed = [inputs.index(name) for name in stranger.forces]
        self._force = self._driver.inputs(inputs)
        self._motion = self._driver.inputs(["displacement", *stranger.displacements, *stranger.velocities])
        sources = stop_parameters(len(scene.stops), floats)
        self._stops: list[Component] = []
        self._own: list[dict[str, Value]] = []
        self._first = True
        for k in range(1, len(scene.stops) + 1):
            stop = stop_of(k, integers)
            own: dict[str, Value] = {
                name: floats[source] for (owner, name), source in sources.items() if owner == stop.name
            }
            self._stops.append(Component(stop, wrap=wrap))
            self._own.append(own)
        self._seen = [stop.group("Float64", ["displacement", "velocity"]) for stop in self._stops]
        self._answers = [stop.group("Float64", ["applied_force"]) for stop in self._stops]
        self._signs = [1.0 if stop.side == "upper" else -1.0 for stop in scene.stops]
        self._positions = [stop.position for stop in scene.stops]

    def run(self) -> Observation:
        """Simulate the scene once."""
        began, driver, scene = time.perf_counter(), self._driver, self._scene
        begin, end = window_of(scene, self._floats, self._part)
        touching = [False] * len(self._stops)
        seen, failure, now = _Seen(begin), "", 0.0
        driver.begin(self._floats, scene.execution.deadline)
        for stop, own in zip(self._stops, self._own, strict=True):
            stop.begin(own, 0.0, first=self._first)
            stop.instance.exit_initialization()
        self._first = False
        try:
            self._show(self._motion.get()[1:])
            for i in range(1, math.ceil(end / self._step) + 1):
                last, now = now, min(i * self._step, end)
                self._push()
                before = self._motion.get()[1:].copy()
                self._force.set()
                driver.advance(now)
                motion = self._motion.get()
                self._show(motion[1:] if self._newest else before)
                for stop in self._stops:
                    stop.instance.step(last, now - last)
                seen.note(now, float(motion[0]))
                displacements, velocities = motion[1:].reshape(2, -1)
                for k, position in enumerate(self._positions):
                    inside = self._signs[k] * (displacements[k] - position) > 0.0
                    if inside and not touching[k]:
                        seen.note_impact(now, velocities[k], k)
                    touching[k] = inside
        except DeadlineReached:
            failure = LATE
        return seen.observation(driver.observed(), began, failure, now / end)

    def _push(self) -> None:
        """Write the forces of the stops into the force inputs of the body."""
        self._force.values[:] = 0.0
        for place, sign, answer in zip(self._pushed, self._signs, self._answers, strict=True):
            self._force.values[place] -= sign * answer.get()[0]

    def _show(self, motion: Floats) -> None:
        for seen, of_stop in zip(self._seen, motion.reshape(2, -1).T, strict=True):
            seen.values[:] = of_stop
            seen.set()

    def close(self) -> None:
        """Free the components."""
        self._driver.close()
        for stop in self._stops:
            stop.free()
