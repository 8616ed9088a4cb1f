"""Runs the points of a general scene: any FMUs, coupled by the importer."""

from __future__ import annotations

import math
import platform
import re
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.fmus.errors import ComponentError, LateComponentError, LostComponentError, SceneError
from vibroimpact.orchestrator.fmi.instance import LogOf, WrapOf
from vibroimpact.orchestrator.importer.aliasing import SampledRates
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.contact_impacts import ContactImpacts, impact_rows
from vibroimpact.orchestrator.importer.energy import InterfaceEnergy
from vibroimpact.orchestrator.importer.events import Event, LateEvents
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.own_grid import Divisions, step_remarks
from vibroimpact.orchestrator.importer.sampling import Sampler
from vibroimpact.orchestrator.importer.specification import COUPLING_TOLERANCE, PairSpec
from vibroimpact.orchestrator.run.empty_record import MOST_CONTACTS, empty_record, records_impacts
from vibroimpact.orchestrator.run.record import (
    Deadline,
    DeadlineReached,
    ImpactLimitReached,
    in_time_order,
)
from vibroimpact.orchestrator.run.runner import Runner
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.component_numbers import component_variable, is_step

NO_ROWS = np.empty((0, 3))
#: Added to rows of events, whose column of components counts from 0; the dataset counts from 1.
COUNTED_FROM_ONE = np.array([0.0, 0.0, 1.0])


def _divisions(scene: Scene) -> Divisions:
    """Return the times that divide the runs of a scene."""
    swept = [axis.values for axis in scene.sweep if is_step(scene.components, axis.key)]
    record = scene.record
    ends = (record.transient_time, record.transient_time + record.recorded_time)
    return Divisions(tuple(map(float, swept[0])) if swept else (scene.macro_step,), ends)


class GeneralRunner(Runner):
    """Runs points of one scene of components in this process; all points share the component instances.

    `execution` is `coupled`, or `auto`, which means `coupled`. For a component's name, `log` returns the receiver of
    its log lines, and `wrap` the wrapper of its FMU's functions. `instruction_set` is the machine architecture, and
    `fmu_hashes` has the SHA-256 of each component's FMU.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        execution: str = "auto",
        log: LogOf | None = None,
        wrap: WrapOf | None = None,
    ) -> None:
        if execution not in ("auto", "coupled") or scene.is_one_body:
            problem = (
                f'{scene.source}: execution.how: expected "coupled" for a general scene, got "{execution}".'
            )
            raise SceneError([problem])
        self.execution = "coupled"
        self.instruction_set = platform.machine()
        self.scene = scene
        self._log, self._wrap = log, wrap
        self._deadline = Deadline()
        self._build()
        self.fmu_hashes = {name: c.sha256 for name, c in self._importer.components.items()}
        self._events: list[NDArray[np.float64]] = []  # rows of time, index and component, counted from 1
        self._recording = False

    @property
    def _impacts(self) -> list[ContactImpacts]:
        """The impacts of each contact, in the order of the scene."""
        stops, pairs = map(iter, self._importer.contacts.impacts)
        return [next(pairs if isinstance(each, PairSpec) else stops) for each in self.scene.contacts]

    def _build(self) -> None:
        """Make the importer with its watchers, its sampler and its energy balance."""
        scene = self.scene
        self._importer = Importer(
            scene.components,
            scene.connections,
            scene.events,
            scene.stop_contacts,
            scene.pairs,
            exchange=scene.execution.exchange,
            macro_step="auto" if scene.execution.adapts else scene.macro_step,
            coupling_tolerance=scene.execution.coupling_tolerance or COUPLING_TOLERANCE,
            divisions=_divisions(scene),
            log=self._log,
            wrap=self._wrap,
        )
        self._names = tuple(self._importer.components)
        self._importer.on_event = self._note_event
        self._importer.late_events = LateEvents(lambda: self._limit - self._seen, self._note_late)
        self._importer.on_pause = self._deadline.refuse_late
        self._importer.watchers.append(self._deadline.watcher)
        self._energy = InterfaceEnergy(self._importer, scene.connections)
        self._sampler = self._make_sampler(scene)
        self._rates = SampledRates(self._importer)
        self._broken = self._is_freed = False

    def _make_sampler(self, scene: Scene) -> Sampler | None:
        names, formed = (
            [component_variable(name) for name in chosen] for chosen in (scene.sampled, scene.sample_forms)
        )
        return Sampler(self._importer, names, scene.sampling_rate, formed) if names else None

    def run(self, values: Mapping[str, float], start: tuple[float, ...] | None = None) -> RunRecord:
        """Run one point from the scene's start values; a general scene does not carry states over.

        The loss of a component elsewhere is the outcome of the point. ComponentError: a component fails, with its
        instance, function and time.
        """
        began = time.perf_counter()
        try:
            return self._run_whole(values, began)
        except LostComponentError as loss:
            outcome = Outcome.timeout if isinstance(loss, LateComponentError) else Outcome.crash
            return empty_record(self.scene, outcome, str(loss), time.perf_counter() - began)

    def _run_whole(self, values: Mapping[str, float], began: float) -> RunRecord:
        scene = self.scene.at(values) if values else self.scene
        if self._broken:
            self._rebuild()
        self._broken = True  # until this run ends well: after an error FMI allows little but freeing
        try:
            outcome, message = self._run(scene)
        except ComponentError as error:
            if not error.function.endswith("Reset"):
                raise
            self._rebuild()  # the reset after the run before has failed, which is no fault of this run
            outcome, message = self._run(scene)
        self._broken = False
        return self._record(outcome, message, time.perf_counter() - began)

    def _rebuild(self) -> None:
        """Make all components anew."""
        if not self._is_freed:
            self.close()
        self._build()

    def _run(self, scene: Scene) -> tuple[Outcome, str]:
        record, execution = scene.record, scene.execution
        self._deadline.begin(execution.deadline)
        self._limit, self._seen = execution.impact_limit, 0
        # a recording from time 0 includes the events at time 0
        self._events, self._recording = [], record.transient_time == 0.0
        start: dict[tuple[str, str], Value] = {
            (c.name, name): value for c in scene.components for name, value in c.parameters.items()
        }
        self._importer.keeps_start = False
        for component in self._importer.components.values():
            component.instance.log.take()  # discard messages of the point before
        self._set_gains(scene)
        self._importer.macro_step = math.inf if scene.execution.adapts else scene.macro_step
        self._importer.contacts.take_numbers(scene.stop_contacts, scene.pairs)
        start_time = scene.start_time
        first = start_time + record.transient_time
        end = start_time + (record.transient_time + record.recorded_time)
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # overflow is refused at the end of the run
                self._importer.begin(start_time, start)
                self._energy.begin(scene.connections)
                self._importer.advance(first)
                self._recording = True
                if record.transient_time:
                    for impacts in self._impacts:
                        impacts.forget()
                if self._sampler is not None:
                    self._sampler.begin(first, end)
                self._importer.advance(end)
        except ImpactLimitReached:
            return (
                Outcome.impact_limit,
                f"impact_limit: {self._limit} events at time {self._importer.time:.17g}",
            )
        except DeadlineReached:
            text = f"deadline: {execution.deadline} s passed at time {self._importer.time:.17g}"
            return Outcome.timeout, text
        self._refuse_not_finite()
        return Outcome.ok, "; ".join(self._remarks())

    def _remarks(self) -> list[str]:
        """Return remarks on a successful run that a reader of its results must know."""
        remarks = [
            f"{watch.component.name}.{watch.event.variable}: its events accumulated at time {watch.last_time:.17g}; "
            "those after it are not located"
            for watch in self._importer.watches
            if watch.accumulated
        ]
        remarks += [
            f"{name} changed the rounding of numbers in its process; it was set back after each of its steps"
            for name, component in self._importer.components.items()
            if component.instance.changed_rounding
        ]
        if self.scene.record.impacts and len(self.scene.contacts) > MOST_CONTACTS:
            remarks.append(
                f"{len(self.scene.contacts)} contacts: of more than {MOST_CONTACTS} no impacts are kept"
            )
        remarks += [*self._importer.contacts.remarks(), *self._energy.remarks()]
        remarks += [*self._importer.loops.remarks(), *self._importer.ticks.remarks()]
        remarks += self._rates.remarks()
        remarks += [
            f"{name} made no instance with the event mode that it declares, and ran without"
            for name, component in self._importer.components.items()
            if component.refuses_events
        ]
        if self._importer.wants_to_end:
            remarks.append(f"a component asked for the end at time {self._importer.time:.17g}")
            if self._importer.overrun > self._importer.time:
                remarks.append(
                    f"others, which could not be taken back, had been stepped to {self._importer.overrun:.17g}"
                )
        return remarks + self._remarks_on_steps()

    def _remarks_on_steps(self) -> list[str]:
        """Return the remarks on components whose steps have sizes of their own."""
        rate, first = self.scene.sampling_rate, self.scene.record.transient_time
        sampled = {component_variable(name)[0] for name in self.scene.sampled} if rate else set()
        return self._importer.grids.remarks() + [
            remark
            for name, component in self._importer.components.items()
            for remark in step_remarks(
                component, self._importer.macro_step, (first, 1.0 / rate) if name in sampled else None
            )
        ]

    def _set_gains(self, scene: Scene) -> None:
        changed = False
        for transfer in (*self._importer.transfers, *self._importer.loops.transfers):
            for connection in scene.connections:
                if transfer.carries(connection) and transfer.gain_of(connection) != connection.gain:
                    transfer.set_gain(connection, connection.gain)
                    changed = True
        if changed:
            self._importer.plan_moves()

    def _refuse_not_finite(self) -> None:
        """Raise ComponentError with component and time unless all samples are finite.

        NaN is allowed in variables whose description names it, such as the phase of the last impact before the first.
        """
        if self._sampler is None:
            return
        rows = self._sampler.rows
        names = self.scene.plain_samples
        has_none = [self._is_without_value_at_times(name) for name in names]
        bad = np.argwhere(~(np.isfinite(rows) | (np.isnan(rows) & [False, *has_none])))
        if len(bad):
            row, column = bad[0]
            name = names[column - 1]
            raise _not_finite(name, rows[row, column], rows[row, 0])
        for name, values in zip(self.scene.sample_forms, self._formed_samples() or (), strict=True):
            if values.dtype.kind != "f":
                continue
            bad = np.argwhere(
                ~(np.isfinite(values) | (np.isnan(values) & self._is_without_value_at_times(name)))
            )
            if len(bad):
                raise _not_finite(name, values[tuple(bad[0])], rows[bad[0][0], 0])

    def _formed_samples(self) -> tuple[NDArray[Any], ...] | None:
        """Return the samples of arrays, texts, enumerations and long integers; None without any."""
        forms, sampler = self.scene.sample_forms.values(), self._sampler
        if sampler is None or not forms:
            return None
        return tuple(sampler.formed(place, form.dtype, form.shape) for place, form in enumerate(forms))

    def _is_without_value_at_times(self, reference: str) -> bool:
        component, name = component_variable(reference)
        variable = self._importer.components[component].variables[name]
        return "nan" in re.findall(r"\w+", (variable.description or "").lower())

    # ---- events of a run ----

    def _note_late(self, events: NDArray[np.float64]) -> None:
        self._seen += len(events)
        if self._recording:
            self._events.append(events + COUNTED_FROM_ONE)

    def _note_event(self, event: Event) -> None:
        self._seen += 1
        if self._seen > self._limit:
            raise ImpactLimitReached
        if self._recording:
            row = (event.time, event.index, self._names.index(event.component))
            self._events.append(np.array([row]) + COUNTED_FROM_ONE)

    def _record(self, outcome: Outcome, message: str, seconds: float) -> RunRecord:
        adaptive = self._importer.adaptive
        return RunRecord(
            outcome=outcome,
            message=message,
            samples=None if self._sampler is None else self._sampler.rows,
            formed_samples=self._formed_samples(),
            seconds=seconds,
            events=in_time_order(np.concatenate([NO_ROWS, *self._events]))
            if self.scene.record.impacts
            else None,
            impacts=impact_rows(self._impacts) if records_impacts(self.scene) else None,
            energy_residual=self._energy.residuals() if self._energy.names else None,
            chosen_steps=None if adaptive is None else adaptive.record.row(),
            step_trace=None if adaptive is None or self.scene.sweep else adaptive.trace,
            loop_residual=self._importer.loops.residual if self._importer.loops.names else None,
        )

    def close(self) -> None:
        """Free the components."""
        self._is_freed = True  # what cannot be made anew after this has nothing to be freed again
        self._energy.free()
        self._importer.free()


def _not_finite(name: str, value: float, time: float) -> ComponentError:
    """Return the error of a sample that is no finite number."""
    return ComponentError(
        f"{name}: expected a finite value, got {value} at time {time:.17g}.",
        instance=component_variable(name)[0],
        time=float(time),
    )
