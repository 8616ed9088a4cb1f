"""Trials that no scene asks for: a body coupled by FMI 2.0, by plain steps of equal size, or integrated by CVode.

Each simulates the body and the stops of a scene of the short form from its start to its end, as its own run does, and
observes the same.
"""

from __future__ import annotations

import math
import time

import numpy as np

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.fmus.packaging.fmpy_door import integrated
from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.importer.component import Component, Value
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
from vibroimpact.orchestrator.run.fused import BodyDriver
from vibroimpact.orchestrator.run.parameters import FMU_NAMES, float_parameters, integer_parameters
from vibroimpact.orchestrator.run.point import recorded_window
from vibroimpact.orchestrator.run.record import Deadline, DeadlineReached
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.models import RestitutionStop
from vibroimpact.orchestrator.study.observation import Floats, Observation

LATE = "did not finish"
ROWS_A_PERIOD = 4
"""Rows of an integration in a period, times the square of the number of modes: an integrator's steps between two rows
are limited. The impacts have rows of their own."""
LOST = 1e3
"""Displacement, over the scene's own, above which a motion is lost."""


class CoupledTrial:
    """The body and its stops, each an FMU of one version of FMI.

    Parameters
    ----------
    scene : Scene
        Of the short form.
    version : str
        `3.0` or `2.0`, of all components.
    wrap : callable or None
        Wraps the functions of the FMUs.
    """

    def __init__(self, scene: Scene, version: str, wrap: Wrapper | None = None) -> None:
        self._floats, integers = float_parameters(scene, None), integer_parameters(scene)
        self._window = recorded_window(scene, self._floats)
        stops = len(scene.stops)
        body = ComponentSpec(BODY, fmu_path(FMU_NAMES[scene.body.kind], version), body_integers(integers))
        links = connections_of(stops)
        step = scene.execution.macro_step
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
            self._switch.values[:] = True
            self._switch.set()
            self._importer.advance(end)
            self._note(None)  # an event is told before it is resolved: the last one is counted here
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


class PlainStepsTrial:
    """An oscillator on rigid stops that is looked at after steps of equal size, as an importer without events does.

    Where it is found beyond a stop its velocity is turned round. Between two such corrections its motion is exact:
    all of the error is that of the steps.

    Parameters
    ----------
    scene : Scene
        Of an oscillator with rigid stops.
    step : float
        Its size, s.
    wrap : callable or None
        Wraps the functions of the FMU.
    """

    def __init__(self, scene: Scene, step: float, wrap: Wrapper | None = None) -> None:
        self._scene, self._step = scene, step
        own = {"impact_limit": scene.execution.impact_limit}
        floats = {n: v for n, v in float_parameters(scene, None).items() if not n.startswith("contact[")}
        self._floats = floats
        of = None if wrap is None else (lambda name: wrap)
        self._driver = BodyDriver(floats, own, FMU_NAMES[scene.body.kind], wrap=of)
        self._stops = [s for s in scene.stops if isinstance(s, RestitutionStop)]

    def run(self) -> Observation:
        """Simulate the scene once."""
        began, driver, scene = time.perf_counter(), self._driver, self._scene
        begin, end = recorded_window(scene, self._floats)
        w = self._floats.get("forcing.angular_frequency", 0.0)
        phase = self._floats.get("forcing.phase", 0.0)
        limit = math.inf if scene.execution.deadline is None else began + scene.execution.deadline
        signs = [1.0 if stop.side == "upper" else -1.0 for stop in self._stops]
        impacts: list[tuple[float, float, float]] = []
        lowest, highest, origin, failure = math.inf, -math.inf, 0.0, ""
        driver.begin(self._floats, scene.execution.deadline)
        count = math.ceil(end / self._step)
        try:
            for i in range(1, count + 1):
                now = min(i * self._step, end)
                driver.advance(now - origin)
                x, v = driver.observed()
                if now > begin:
                    lowest, highest = min(lowest, x), max(highest, x)
                for k, stop in enumerate(self._stops):
                    if signs[k] * (x - stop.position) > 0.0 and signs[k] * v > 0.0:
                        if now > begin:
                            impacts.append((now, abs(v), k + 1.0))
                        start = {"displacement_start": x, "velocity_start": -stop.restitution * v}
                        moved = {"forcing.phase": (phase + w * now) % (2.0 * math.pi)} if w else {}
                        driver.begin(self._floats | start | moved, scene.execution.deadline)
                        origin = now
                if time.perf_counter() > limit:
                    raise DeadlineReached
        except DeadlineReached:
            failure = LATE
        found = np.array(impacts).reshape(-1, 3)
        return Observation(
            found, lowest, highest, driver.observed(), seconds=time.perf_counter() - began, failure=failure
        )

    def close(self) -> None:
        """Free the body."""
        self._driver.close()


class PlainForcesTrial:
    """An oscillator and its yielding stops, each an FMU, that exchange motion and force after steps of equal size.

    What a tool does that knows no events: the stop's force is held over a step.

    Parameters
    ----------
    scene : Scene
        Of an oscillator with yielding stops.
    exchange : str
        `jacobi`: the stop sees the motion at the start of a step. `gauss_seidel`: that at its end.
    step : float
        Its size, s.
    wrap : callable or None
        Wraps the functions of the FMUs.
    """

    def __init__(self, scene: Scene, exchange: str, step: float, wrap: Wrapper | None = None) -> None:
        self._scene, self._step, self._newest = scene, step, exchange == "gauss_seidel"
        floats, integers = float_parameters(scene, None), integer_parameters(scene)
        self._floats = {n: v for n, v in floats.items() if not n.startswith("contact[")}
        of = None if wrap is None else (lambda name: wrap)
        name = FMU_NAMES[scene.body.kind]
        self._driver = BodyDriver(self._floats, {"impact_limit": integers["impact_limit"]}, name, wrap=of)
        self._force = self._driver.inputs(["force"])
        self._motion = self._driver.inputs(["displacement", "velocity"])
        ports = range(1, len(scene.stops) + 1)
        sources = stop_parameters(len(scene.stops), floats)
        self._stops: list[Component] = []
        self._own: list[dict[str, Value]] = []
        self._first = True
        for k in ports:
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
        begin, end = recorded_window(scene, self._floats)
        impacts: list[tuple[float, float, float]] = []
        touching = [False] * len(self._stops)
        lowest, highest, failure, now = math.inf, -math.inf, "", 0.0
        driver.begin(self._floats, scene.execution.deadline)
        for stop, own in zip(self._stops, self._own, strict=True):
            stop.begin(own, 0.0, first=self._first)
            stop.instance.exit_initialization()
        self._first = False
        try:
            self._show(self._motion.get())
            for i in range(1, math.ceil(end / self._step) + 1):
                last, now = now, min(i * self._step, end)
                answers = [float(answer.get()[0]) for answer in self._answers]
                self._force.values[0] = -sum(sign * f for sign, f in zip(self._signs, answers, strict=True))
                motion = self._motion.get().copy()
                self._force.set()
                driver.advance(now)
                self._show(self._motion.get() if self._newest else motion)
                for stop in self._stops:
                    stop.instance.step(last, now - last)
                x, v = map(float, self._motion.get())
                if now > begin:
                    lowest, highest = min(lowest, x), max(highest, x)
                for k, position in enumerate(self._positions):
                    inside = self._signs[k] * (x - position) > 0.0
                    if inside and not touching[k] and now > begin:
                        impacts.append((now, abs(v), k + 1.0))
                    touching[k] = inside
        except DeadlineReached:
            failure = LATE
        found = np.array(impacts).reshape(-1, 3)
        return Observation(
            found, lowest, highest, driver.observed(), seconds=time.perf_counter() - began, failure=failure
        )

    def _show(self, motion: Floats) -> None:
        for seen in self._seen:
            seen.values[:] = motion
            seen.set()

    def close(self) -> None:
        """Free the components."""
        self._driver.close()
        for stop in self._stops:
            stop.free()


class ModelExchangeTrial:
    """The body's FMU for model exchange, integrated by FMPy's CVode.

    Parameters
    ----------
    scene : Scene
        Of the short form.
    tolerance : float
        Of the integrator, relative.
    wrap : callable or None
        Not used: FMPy calls the FMU itself, and nobody counts its calls.
    """

    def __init__(self, scene: Scene, tolerance: float, wrap: Wrapper | None = None) -> None:
        self._scene, self._tolerance = scene, tolerance
        self._floats = float_parameters(scene, None)
        self._values = self._floats | integer_parameters(scene)
        self._fmu = fmu_path(FMU_NAMES[scene.body.kind])

    def run(self) -> Observation:
        """Simulate the scene once."""
        began, scene = time.perf_counter(), self._scene
        begin, end = recorded_window(scene, self._floats)
        limit = math.inf if scene.execution.deadline is None else began + scene.execution.deadline
        reached = 0.0

        def step_finished(now: float) -> bool:
            nonlocal reached
            reached = now
            return time.perf_counter() < limit

        ports = range(1, len(scene.stops) + 1)
        output = [f"contact[{k}].{what}" for k in ports for what in ("count", "last_time", "last_velocity")]
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
        late = reached < end * (1.0 - 1e-9) and time.perf_counter() >= limit
        found: list[Floats] = [np.empty((0, 3))]
        for k in ports:
            counts = rows[f"contact[{k}].count"]
            new = np.flatnonzero(np.diff(counts, prepend=0) > 0)
            times, velocities = (rows[f"contact[{k}].last_{what}"][new] for what in ("time", "velocity"))
            found.append(np.column_stack([times, velocities, np.full(len(new), float(k))]))
        impacts = np.concatenate(found)
        impacts = impacts[(impacts[:, 0] > begin) & (impacts[:, 0] <= end)]
        return Observation(
            impacts[np.argsort(impacts[:, 0], kind="stable")],
            final=(float(rows["displacement"][-1]), float(rows["velocity"][-1])),
            seconds=time.perf_counter() - began,
            failure=LATE if late else "",
        )

    def close(self) -> None:
        """Nothing is held between two runs."""


def far_off(found: Observation, expected: Observation) -> bool:
    """Return whether a motion has left all bounds, as one does that has fallen through its stop."""
    size = max(abs(expected.lowest), abs(expected.highest))
    reach = max(abs(found.lowest), abs(found.highest), abs(found.final[0]))
    return math.isfinite(size) and size > 0.0 and reach > LOST * size
