"""The plain steps of an importer, in C: from event to event by the FMUs' own functions.

A step is plain where only components and connections have a part in it. Other outcomes are left to `master`, which is
the reference: a failed call, a request for the end, an event to be reported at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from ctypes import addressof, c_double, c_int32, c_int64, c_void_p
from dataclasses import dataclass

import numpy as np

from vibroimpact.fmus.core.coupling import (
    CallKind,
    CouplingCall,
    CouplingCalls,
    CouplingComponent,
    CouplingEnd,
    CouplingPlan,
    CouplingProgress,
    CouplingRun,
    advance_coupled,
)
from vibroimpact.orchestrator.fmi.eventful import EventfulInstance
from vibroimpact.orchestrator.fmi.instance import (
    NO_STATE_PRIOR_TO_POINT,
    STEP_ROUNDING,
    TIME_ROUNDING,
    CallNotes,
    Instance,
)
from vibroimpact.orchestrator.fmi.variables import Setter, VariableGroup
from vibroimpact.orchestrator.importer.component import SAME_INSTANT, Component
from vibroimpact.orchestrator.importer.events import EVENT_ITERATIONS, EventMode, LateEvents
from vibroimpact.orchestrator.importer.wiring import CallList, Scaling, StatusCall

#: Longest wall time of one call, s: signals and deadlines are handled between two calls.
MOST_SECONDS = 0.05
#: Most events that pass before they are reported.
MOST_EVENTS = 512


@dataclass(frozen=True, slots=True)
class Made:
    """The steps up to the component at `place` are made; that component returned `status`."""

    place: int
    status: int


class PlainLoop:
    """Plain steps of components.

    Parameters
    ----------
    components : sequence of Component
        In the order in which they are stepped.
    numbers : mapping of str to int
        The number that reports the events of each component, by its name.
    start : CallList or None
        Moves before a step.
    inputs : sequence of CallList or None
        Moves before the step of each component.
    event_mode : EventMode
        Resolves the events of the components.
    saves : bool
        A step may have to be repeated: states are saved before it.
    progress : CouplingProgress
        Time, communication points and counts of the run.

    Attributes
    ----------
    plan : CouplingPlan
        The calls of all components.
    run : CouplingRun
        The state that the last call has left.
    """

    def __init__(
        self,
        components: Sequence[Component],
        numbers: Mapping[str, int],
        start: CallList | None,
        inputs: Sequence[CallList | None],
        event_mode: EventMode,
        *,
        saves: bool,
        progress: CouplingProgress,
    ) -> None:
        self._components, self._numbers, self._progress = list(components), numbers, progress
        self._known: list[tuple[Instance, str]] = []
        self._kept: list[object] = []  # memory whose addresses C code holds
        self._events = np.zeros((MOST_EVENTS, 3))
        self._events_address = int(self._events.ctypes.data)
        self._noted, self._noted_time = c_int64(0), c_double(math.nan)
        own = addressof(self._noted), addressof(self._noted_time)
        notes = components[0].instance.wrap
        noted = (notes.call_address, notes.time_address) if isinstance(notes, CallNotes) else own
        steps = [self.component(c, i) for c, i in zip(components, inputs, strict=True)]
        decisions = [addressof(instance.decisions) for instance in event_mode.instances]
        self._steps = (CouplingComponent * len(steps))(*steps)
        self._stepped = [(c.instance, step) for c, step in zip(components, self._steps, strict=True)]
        self._decisions = (c_void_p * max(1, len(decisions)))(*decisions)
        self.plan = CouplingPlan(
            components=self._steps,
            count=len(steps),
            saves=saves,
            start=self.calls(() if start is None else start.calls),
            begin=self.calls(event_mode.begin.calls),
            again=self.calls(event_mode.again.calls),
            leave=self.calls(event_mode.leave.calls),
            decisions=self._decisions,
            deciding=len(decisions),
            most_iterations=EVENT_ITERATIONS,
            no_state_prior=NO_STATE_PRIOR_TO_POINT,
            same_instant=SAME_INSTANT,
            time_rounding=TIME_ROUNDING,
            step_rounding=STEP_ROUNDING,
            noted_call=noted[0],
            noted_time=noted[1],
        )
        self._at_event = (c_int32 * len(steps))()
        self.run = CouplingRun(at_event=self._at_event)

    # ---- the plan ----

    def component(
        self, component: Component, inputs: CallList | None, slot: c_void_p | None = None
    ) -> CouplingComponent:
        """Return a component by its calls, with a slot for its saved states; None: that of the start of a step."""
        instance = component.instance
        kind = CallKind.step3 if isinstance(instance, EventfulInstance) else CallKind.step2
        times = component.event_times
        reads = [] if times is None else [StatusCall(times.get_call, instance, f"Get{times.name}", times)]
        return CouplingComponent(
            step=self._call(instance, "DoStep", kind=kind),
            inputs=self.calls(() if inputs is None else inputs.calls),
            save=self._states(component, CallKind.save, slot),
            restore=self._states(component, CallKind.restore, slot),
            event_times=self.calls(reads),
            event_mode=component.event_mode,
            may_return_early=component.event_mode,
            number=self._numbers[component.name],
            internal_step=instance.internal_step,
            **instance.step_memory,
        )

    def _states(self, component: Component, kind: CallKind, slot: c_void_p | None) -> CouplingCalls:
        if not component.has_states:
            return CouplingCalls()
        return self.array([self.state_call(component, kind, component.at_start if slot is None else slot)])

    def state_call(self, component: Component, kind: CallKind, slot: c_void_p) -> CouplingCall:
        """Return the call that saves or restores the state in a slot."""
        verb = "Get" if kind is CallKind.save else "Set"
        return self._call(
            component.instance, verb + component.instance.state_word, kind=kind, values=addressof(slot)
        )

    def calls(self, calls: Iterable[StatusCall]) -> CouplingCalls:
        """Return calls in the form for C code."""
        return self.array([self._moved(call) for call in calls])

    def array(self, calls: Sequence[CouplingCall]) -> CouplingCalls:
        """Return calls as an array, whose memory this loop keeps."""
        array = (CouplingCall * max(1, len(calls)))(*calls)
        self._kept.append(array)
        return CouplingCalls(array, len(calls))

    def _moved(self, call: StatusCall) -> CouplingCall:
        """Return a call in the form for C code."""
        instance, moved = call.instance, call.moved
        if isinstance(moved, Scaling):
            self._kept.append(moved)
            arrays = {
                "from": moved.read,
                "gains": moved.gains,
                "offsets": moved.offsets,
                "values": moved.write,
            }
            addresses = {name: array.ctypes.data for name, array in arrays.items() if array is not None}
            return CouplingCall(kind=CallKind.scale, value_count=moved.write.size, **addresses)
        if isinstance(moved, VariableGroup):
            self._kept.append(moved)
            return self._call(
                instance,
                call.function,
                moved.setter if call.function == f"Set{moved.name}" else None,
                kind=CallKind.move3 if instance.fmi_version == "3.0" else CallKind.move2,
                references=moved.references_address,
                count=len(moved.references),
                values=moved.values.ctypes.data,
                value_count=moved.values.size,
            )
        if isinstance(instance, EventfulInstance) and call.function == "UpdateDiscreteStates":
            return self._call(
                instance, call.function, kind=CallKind.update, values=addressof(instance.decisions)
            )
        return self._call(instance, call.function, kind=CallKind.plain)

    def _call(
        self, instance: Instance, function: str, setter: Setter | None = None, **fields: int
    ) -> CouplingCall:
        self._known.append((instance, function))
        place = len(self._known) - 1
        name = instance.prefix + function
        note = instance.wrap.number_of(name) if isinstance(instance.wrap, CallNotes) else place + 1
        address, owner = (
            instance.call_of(function) if setter is None else (setter.function.value, setter.owner.value)
        )
        return CouplingCall(
            function=address,
            instance=owner,
            place=place,
            note=note,
            **fields,
        )

    # ---- a run ----

    def advance(
        self, end: float, macro_step: float, seconds: float, late: LateEvents | None, *, hears_pauses: bool
    ) -> CouplingEnd:
        """Make plain steps to the end (s), each at most `macro_step` long, in at most `seconds` of wall time.

        `late` receives the events that pass, if it is given. With `hears_pauses` a step that ends early without an
        event is left to the caller. The result is `done` or `listen`, or the state of an unfinished step: `run` has
        that step, and the caller finishes it.
        """
        run = self.run
        run.end, run.macro_step, run.hears_pauses = end, macro_step, hears_pauses
        run.most_seconds = seconds
        run.wants_to_end, run.events_used = False, 0
        run.events = None if late is None else self._events_address
        run.events_room = 0 if late is None else min(MOST_EVENTS, late.room())
        self.give_times()
        came_to = advance_coupled(self.plan, self._progress, run)
        self.take_times()
        if late is not None and run.events_used:
            late.report(self._events[: run.events_used])
        return came_to

    def give_times(self) -> None:
        """Give C code the times and the step sizes of the components."""
        for instance, step in self._stepped:
            step.time, step.only_step = instance.time, instance.only_step

    def take_times(self) -> None:
        """Take the times of the components, s, that C code has reached."""
        for instance, step in self._stepped:
            instance.take_time(step.time)

    def at_event(self) -> list[Component]:
        """Return the components at an event at the end of the unfinished step."""
        return [self._components[i] for i in self._at_event[: self.run.arrived]]

    def explain_cut(self) -> None:
        """Raise the error of a component whose step is cut to a size that it does not take."""
        run = self.run
        self._components[run.at].instance.refuse_cut(run.start, run.goal - run.start)

    def explain(self) -> None:
        """Raise the error of the call that failed."""
        instance, function = self._known[self.run.at]
        instance.check(self.run.status, function.replace("FMUstate", "FMUState"))

    def explain_step(self) -> None:
        """Raise the error of the step that failed."""
        self._components[self.run.at].instance.take_step(self.run.status)

    def call_under_way(self) -> tuple[Instance, str, float] | None:
        """Return the FMU call that C code is in, as another thread sees it, and its time, s, or None."""
        place = self._noted.value - 1
        if place < 0:
            return None
        instance, function = self._known[place]
        return instance, function, self._noted_time.value


def can_loop(components: Iterable[Component], lists: Iterable[CallList | None]) -> bool:
    """Can the calls of these lists, and the steps of these components, be made in C?

    Not with functions of an FMU that are wrapped by more than notes or called elsewhere, nor with converted values
    other than real numbers.
    """
    components = list(components)
    if not all(component.instance.runs_here for component in components):
        return False
    wraps = [component.instance.wrap for component in components]
    notes = {w.call_address if isinstance(w, CallNotes) else None for w in wraps}
    is_noted = all(w is None or isinstance(w, CallNotes) for w in wraps) and len(notes) == 1
    calls = [call for found in lists if found is not None for call in found.calls]
    return is_noted and all(call.function != "convert" or call.moved is not None for call in calls)
