"""A trial whose body has no stops in its FMU: the importer finds the impacts by step revision."""

from __future__ import annotations

import math
import time

import numpy as np

from vibroimpact.fmus import fmu_path
from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.contacts import CONTACT_STEPS
from vibroimpact.orchestrator.importer.events import Event
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, StopContactSpec
from vibroimpact.orchestrator.run.coupled import BODY, stop_name, stop_of, stop_parameters
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters
from vibroimpact.orchestrator.run.record import Deadline, DeadlineReached
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.observation import LATE, Observation
from vibroimpact.orchestrator.study.ways.span import window_of
from vibroimpact.orchestrator.study.ways.strangers import stranger_of


class RevisedTrial:
    """A body without stops in its FMU, like the FMU of another tool: the `[[contact]]` of general scenes.

    Steps (at most `step`, s) that end beyond a stop are repeated until they end at the stop. A compliant stop answers
    with a force held over each of `contact_steps` steps, which closes the energy balance of the contact. A rigid stop
    reverses the velocity over a very short step.
    """

    def __init__(
        self,
        scene: Scene,
        step: float,
        contact_steps: float = CONTACT_STEPS,
        wrap: Wrapper | None = None,
        part: float = 1.0,
    ) -> None:
        floats, integers = float_parameters(scene, None), integer_parameters(scene)
        self._window = window_of(scene, floats, part)
        count = len(scene.stops)
        stranger = stranger_of(scene)
        self._values: dict[tuple[str, str], Value] = {
            (BODY, name): value for name, value in stranger.floats.items()
        }
        self._values |= {target: floats[source] for target, source in stop_parameters(count, floats).items()}
        own = {name: value for name, value in stranger.integers.items() if name != "impact_limit"}
        body = ComponentSpec(BODY, fmu_path(scene.body.FMU), own)
        at = zip(stranger.displacements, stranger.velocities, stranger.forces, strict=True)
        contacts = [StopContactSpec(BODY, *names, stop_name(k)) for k, names in enumerate(at, start=1)]
        self._importer = Importer(
            [body, *(stop_of(k, integers) for k in range(1, count + 1))],
            contacts=contacts,
            macro_step=step,
            contact_steps=contact_steps,
            wrap=None if wrap is None else (lambda name: wrap),
        )
        component = self._importer.components[BODY]
        self._motion = component.group("Float64", ["displacement", "velocity"])
        self._contacts = component.group("Float64", [*stranger.displacements, *stranger.velocities])
        self._switch = component.group("Boolean", ["record.extrema"])
        self._extremes = component.group("Float64", ["record.displacement_min", "record.displacement_max"])
        self._positions = np.array([stop.position for stop in scene.stops])
        self._signs = np.array([1.0 if stop.side == "upper" else -1.0 for stop in scene.stops])
        self._deadline, self._seconds = Deadline(), scene.execution.deadline
        self._importer.on_event = self._note
        self._importer.on_pause = self._deadline.refuse_late
        self._importer.watchers.append(self._deadline.watcher)

    def run(self) -> Observation:
        """Simulate the scene once."""
        began = time.perf_counter()
        self._impacts: list[tuple[float, float, float]] = []
        begin, end = self._window
        self._recording, failure = begin == 0.0, ""
        self._deadline.begin(self._seconds)
        try:
            self._importer.begin(0.0, self._values)
            self._importer.advance(begin)
            self._recording = True
            self._switch.values[:] = True
            self._switch.set()
            self._importer.advance(end)
        except DeadlineReached:
            failure = LATE
        lowest, highest = map(float, self._extremes.get())
        displacement, velocity = map(float, self._motion.get())
        impacts = np.array(self._impacts).reshape(-1, 3)
        return Observation(
            impacts,
            lowest,
            highest,
            (displacement, velocity),
            seconds=time.perf_counter() - began,
            failure=failure,
            reached=self._importer.time / end,
        )

    def _note(self, event: Event) -> None:
        """Add an impact before its answer, at the nearest stop towards which the body moves."""
        if not self._recording:
            return
        displacements, velocities = self._contacts.get().reshape(2, -1)
        off = np.where(self._signs * velocities > 0.0, np.abs(displacements - self._positions), math.inf)
        stop = int(off.argmin())
        self._impacts.append((event.time, abs(float(velocities[stop])), stop + 1.0))

    def close(self) -> None:
        """Free the components."""
        self._importer.free()
