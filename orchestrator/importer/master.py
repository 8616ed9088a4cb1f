"""The importer: steps components together, ends the step of all at the first event, resolves it, goes on."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.instance import DISCARD, Wrapper
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.fmi.log import LogTail
from vibroimpact.orchestrator.importer.component import Component, Value
from vibroimpact.orchestrator.importer.revision import Watch
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, EventSpec, Exchange
from vibroimpact.orchestrator.importer.wiring import (
    CallList,
    LoopSolver,
    StatusCall,
    Transfer,
    moves_of,
    order_of,
    transfers_of,
)

#: Event iterations at one instant before a component is taken to change its outputs for ever.
EVENT_ITERATIONS = 100
#: Steps without progress before the run is given up.
STANDSTILLS = 100
#: A communication point closer than this times (1 + |time|), s, is reached.
SAME_INSTANT = 1e-13
#: Initialization ends when no connected value changes by more than this, relative.
INITIAL_ITERATIONS = 100
#: Repetitions of a step with exchange "iterated", and the relative change at which they end.
STEP_ITERATIONS = 50
STEP_TOLERANCE = 1e-13
SMALLEST = 1e-300


@dataclass(frozen=True, slots=True)
class Event:
    """An event: its time (s), its index among those at the same time (superdense time), and its component."""

    time: float
    index: int
    component: str


@dataclass(frozen=True, slots=True)
class StepWatcher:
    """Looks on at steps: called before a step with (time), after it with (time, end)."""

    before: Callable[[float], None]
    after: Callable[[float, float], None]


class Importer:
    """Couples components.

    Parameters
    ----------
    components : sequence of ComponentSpec
        In the order in which they are instantiated and, where nothing else decides, stepped.
    connections : sequence of ConnectionSpec
        Outputs to inputs.
    events : sequence of EventSpec
        Watched variables of components without events of their own.
    exchange : str
        `jacobi`: all inputs are those of the start of a step. `gauss_seidel`: each component gets the newest
        outputs of those stepped before it. `iterated`: steps are repeated until the inputs at their end agree.
    macro_step : float
        Longest communication step, s.
    log, wrap : callable or None
        Given a component's name: where its log lines go, and what wraps the functions of its FMU.

    Attributes
    ----------
    time : float
        Time reached, s.
    components : dict of str to Component
        By name.
    steps, repeated_steps : int
        Communication steps made, and how many of them were repeated.
    """

    def __init__(
        self,
        components: Sequence[ComponentSpec],
        connections: Sequence[ConnectionSpec] = (),
        events: Sequence[EventSpec] = (),
        *,
        exchange: Exchange = "gauss_seidel",
        macro_step: float = math.inf,
        log: Callable[[str], LogTail] | None = None,
        wrap: Callable[[str], Wrapper] | None = None,
    ) -> None:
        self.components: dict[str, Component] = {}
        for spec in components:
            self.components[spec.name] = Component(
                spec, log=log(spec.name) if log else None, wrap=wrap(spec.name) if wrap else None
            )
        self.macro_step = macro_step
        self.exchange = exchange
        self.watches = [Watch(self._watchable(event), event) for event in events]
        order = order_of(connections, self.components)
        self.transfers = transfers_of(order.connections, self.components)
        self.loops = LoopSolver(order.loops, self.components)
        for name, component in self.components.items():
            component.watch_inputs(c.target[1] for c in connections if c.target[0] == name)
        self._order = _stepping_order(self.components.values())
        self._plan()
        self.watchers: list[StepWatcher] = []
        self.keeps_start = False
        self.on_event: Callable[[Event], None] | None = None
        self._begun = False
        self.time = 0.0

    def _watchable(self, event: EventSpec) -> Component:
        component = self.components[event.component]
        if not component.has_states:
            raise ComponentError(
                f"{event.component}.{event.variable}: expected a watched component that can save its state, "
                f"got one that cannot. Its events can be located only to a communication step.",
                instance=event.component,
            )
        return component

    def _plan(self) -> None:
        """Decide once what a step must do."""
        sources = [c for c in self._order if self._is_source(c)]
        alone = len(sources) == 1 and sources[0] is self._order[0] and sources[0].event_mode
        self._saves = self.exchange == "iterated" or not (alone or not sources)
        self._saved = [c for c in self._order if c.has_states]
        self._event_components = [c for c in self._order if c.event_mode]
        instances = [c.instance for c in self._event_components]
        self._event_instances = [i for i in instances if isinstance(i, Instance3)]
        self._incoming = {c.name: [t for t in self.transfers if t.target is c] for c in self._order}
        self._fresh = {c.name: self._fresh_inputs(c) for c in self._order}
        self.plan_moves()

    def plan_moves(self) -> None:
        """Bind the calls of all paths; again after a transfer's buffers changed."""
        refreshed = [t for ts in self._fresh.values() for t in ts]
        behind = [t for t in self.transfers if t not in refreshed]
        self._start_moves = moves_of(behind)
        self._paths = [(c, moves_of(self._fresh[c.name]) if self._fresh[c.name] else None) for c in self._order]
        instances = self._event_instances
        enter = [StatusCall(i.enter_event_call, i, "EnterEventMode") for i in instances]
        update = [StatusCall(i.update_call, i, "UpdateDiscreteStates") for i in instances]
        leave = [StatusCall(i.enter_step_call, i, "EnterStepMode") for i in instances]
        # at its event a component's inputs from those stepped before it are those of that instant already
        first = [call for t in behind if _takes_events(t.target) for call in t.calls()]
        again = [call for t in self.transfers if _takes_events(t.target) for call in t.calls()]
        self._enter_events = CallList(enter)
        self._first_iteration = CallList([*first, *update])
        self._next_iteration = CallList([*again, *update])
        self._leave_events = CallList(leave)

    def _is_source(self, component: Component) -> bool:
        watched = any(w.component is component for w in self.watches)
        return component.event_mode or component.event_times is not None or watched

    def _fresh_inputs(self, component: Component) -> list[Transfer]:
        """Transfers made just before a component's own step, from those stepped before it.

        With exchange "jacobi" only a component that answers at once needs them: one without event mode whose outputs
        depend on its inputs directly, such as an FMI 2.0 stop.
        """
        place = {c.name: i for i, c in enumerate(self._order)}
        earlier = [
            t for t in self._incoming[component.name] if place[t.source.name] < place[component.name]
        ]
        answers = not component.event_mode and (
            not component.has_states or any(component.depends.values())
        )
        return earlier if self.exchange != "jacobi" or answers else []

    # ---- beginning ----

    def begin(
        self, start_time: float = 0.0, values: Mapping[tuple[str, str], Value] | None = None
    ) -> None:
        """Start a run: reset, set start values, initialize with connected start values, enter step mode.

        Parameters
        ----------
        start_time : float
            s.
        values : mapping of (component, variable) to value
            Start values beyond those of the components' specifications.
        """
        self.time = self._grid_start = start_time
        self._grid_index = 0
        self.steps = self.repeated_steps = 0
        self._event_index, self._event_time = 0, -math.inf
        self._standstill = 0
        self.wants_to_end = False
        for component in self._order:
            own = {name: value for (who, name), value in (values or {}).items() if who == component.name}
            component.begin(own, start_time, first=not self._begun)
        self._begun = True
        self._settle_connections()
        for component in self._order:
            component.instance.exit_initialization()
        for watch in self.watches:
            watch.begin()
        if self._event_instances:
            self._resolve_events()

    def _settle_connections(self) -> None:
        """Carry start values over the connections until they no longer change: as many passes as chains are long."""
        for _ in range(INITIAL_ITERATIONS):
            before = [transfer.write.values.copy() for transfer in self.transfers]
            for transfer in self.transfers:
                transfer.move()
            self.loops.solve(self.time)
            after = [transfer.write.values for transfer in self.transfers]
            if all((b == a).all() for b, a in zip(before, after, strict=True)):
                return
        names = ", ".join(sorted({t.target.name for t in self.transfers}))
        raise ComponentError(
            f"initialization: expected connected start values that settle, got values that still change after "
            f"{INITIAL_ITERATIONS} passes over the inputs of {names}.",
            function="initialization",
            time=self.time,
        )

    # ---- advancing ----

    def advance(self, end: float) -> None:
        """Advance to `end`, s, resolving all events on the way; stops early when a component asks for the end.

        Raises
        ------
        ComponentError
            A component fails, never settles at an event, or makes no progress.
        """
        while not self.wants_to_end:
            target = self._next_point(end)
            if target is None:
                return
            self._step(target)

    def _next_point(self, end: float) -> float | None:
        """Next communication point: the next multiple of the macro step, or the end."""
        room = SAME_INSTANT * (1.0 + abs(self.time))
        if end - self.time <= room:
            self.time = max(self.time, end) if end - self.time > 0.0 else self.time
            return None
        if self.macro_step == math.inf:
            return end
        while self._grid_start + (self._grid_index + 1) * self.macro_step - self.time <= room:
            self._grid_index += 1
        return min(end, self._grid_start + (self._grid_index + 1) * self.macro_step)

    def _step(self, target: float) -> None:
        time = self.time
        self._start_moves()
        if self.exchange == "iterated":
            for transfer in self.transfers:
                transfer.note_begin()
        if self.loops.names:
            self.loops.solve(time)
        if self._saves or self.keeps_start:
            self._save_start()
        for watcher in self.watchers:
            watcher.before(time)
        end = self._agree(time, target)
        self._guard_progress(time, end)
        for watcher in self.watchers:
            watcher.after(time, end)
        self.time = end
        self.steps += 1
        if self._at_event:
            self._note_events()
            self._resolve_events()

    def _save_start(self) -> None:
        for component in self._saved:
            component.instance.save(component.at_start)
        for watch in self.watches:
            watch.note_start()

    def _restore_start(self) -> None:
        for component in self._saved:
            component.instance.restore(component.at_start)

    def _agree(self, time: float, target: float) -> float:
        """Step all components to the first event, or to `target`; returns where they are."""
        self._at_event: list[Component] = []
        end = self._step_all(time, target)
        while end is not None and end < target:
            # somebody met an event earlier than the others went: all go back and step to it
            self.repeated_steps += 1
            target = end
            self._restore_start()
            end = self._step_all(time, target)
        if self.exchange == "iterated":
            self._iterate(time, target)
        if self._at_event:
            target = self._at_event[0].instance.time
        return target

    def _step_all(self, time: float, target: float) -> float | None:
        """Step each component in its order; returns the time of an event that those before it have passed.

        The first component may return early by itself: those after it follow to its event.
        """
        self._at_event = []
        first = True
        for component, inputs in self._paths:
            if inputs is not None:
                inputs()
            reached = self._step_one(component, time, target)
            if reached < target:
                if not (first and component.event_mode):
                    return reached
                target = reached
            first = False
        return None

    def _step_one(self, component: Component, time: float, target: float) -> float:
        """Step one component; returns the time of its first event, or `target`."""
        instance = component.instance
        status = instance.step(time, target - time)
        if status == DISCARD:
            instance.check(3, "DoStep")
        if instance.wants_to_end:
            self.wants_to_end = True
        if component.event_mode:
            if instance.needs_event_mode:
                self._at_event.append(component)
            reached = instance.time if instance.returned_early else target
            if not self.watches:
                return reached
        else:
            reached = target
        if component.event_times is not None:
            reached = self._reported(component, target)
        for watch in self.watches:
            if watch.component is component:
                reached = min(reached, self._watched(watch, time, target))
        return reached

    def _reported(self, component: Component, target: float) -> float:
        """FMI 2.0: the event time that the component reports, when it lies in the step."""
        assert component.event_times is not None
        times = component.event_times.get()
        first = min((float(t) for t in times if not math.isnan(t)), default=math.inf)
        if first == math.inf:
            return target
        if first <= target + SAME_INSTANT * (1.0 + abs(target)):
            if first >= target - SAME_INSTANT * (1.0 + abs(target)):
                component.instance.time = first
                self._at_event.append(component)
                return target
            return first
        return target

    def _watched(self, watch: Watch, time: float, target: float) -> float:
        size = target - time
        located = watch.find(time, size)
        if located is None:
            return target
        if located >= size:
            self._at_event.append(watch.component)
            return target
        return time + located

    def _guard_progress(self, time: float, end: float) -> None:
        self._standstill = self._standstill + 1 if end <= time else 0
        if self._standstill > STANDSTILLS:
            names = ", ".join(c.name for c in self._at_event) or ", ".join(self.components)
            raise ComponentError(
                f"{names}: expected steps that advance, got {STANDSTILLS} without progress at time {time:.17g}.",
                instance=names,
                function="doStep",
                time=time,
            )

    # ---- events ----

    def _note_events(self) -> None:
        if self.on_event is None:
            return
        for component in self._at_event:
            self._event_index = self._event_index + 1 if self.time == self._event_time else 0
            self._event_time = self.time
            self.on_event(Event(self.time, self._event_index, component.name))

    def _resolve_events(self) -> None:
        """Event mode: carry values, update discrete states until all are settled, go back to step mode."""
        if self.steps:
            self._enter_events()
        self._first_iteration()
        for _ in range(EVENT_ITERATIONS):
            for instance in self._event_instances:
                if instance.needs_update.value:
                    break
            else:
                break
            self._next_iteration()
        else:
            self._endless_iteration()
        for instance in self._event_instances:
            if instance.event_wants_to_end:
                self.wants_to_end = True
        self._leave_events()

    def _endless_iteration(self) -> None:
        names = [i.name for i in self._event_instances if i.needs_update.value]
        lines = [line for i in self._event_instances for line in i.log.take()]
        raise ComponentError(
            f"{', '.join(names)}: fmi3UpdateDiscreteStates: expected event iteration to end, got another request after "
            f"{EVENT_ITERATIONS} iterations at time {self.time:.17g}.",
            instance=", ".join(names),
            function="fmi3UpdateDiscreteStates",
            time=self.time,
            log=lines,
        )

    # ---- repeated steps ----

    def _iterate(self, time: float, target: float) -> None:
        """Repeat the step until the inputs over it are those that its end gives."""
        previous: list[NDArray[Any]] | None = None
        for _ in range(STEP_ITERATIONS):
            values = [transfer.take() for transfer in self.transfers]
            if previous is not None and _settled(values, previous):
                return
            previous = values
            self._restore_start()
            for transfer in self.transfers:
                transfer.write_over_step(target - time)
            self.repeated_steps += 1
            self._at_event = []
            for component in self._order:
                self._step_one(component, time, target)

    def free(self) -> None:
        """Free all components."""
        for component in self.components.values():
            component.free()


def _stepping_order(components: Iterable[Component]) -> list[Component]:
    """Components with event mode first, then others with states, those without states last."""

    def rank(component: Component) -> int:
        if not component.has_states:
            return 2
        return 0 if component.event_mode else 1

    return sorted(components, key=rank)


def _settled(values: Sequence[NDArray[Any]], previous: Sequence[NDArray[Any]]) -> bool:
    """Do two passes over the connections agree to rounding?"""
    return all(
        np.abs(a - b).max() <= STEP_TOLERANCE * (SMALLEST + np.abs(a).max())
        for a, b in zip(values, previous, strict=True)
    )


def _takes_events(component: Component) -> bool:
    """Does an event reach this component's inputs? Others have been given theirs before their step."""
    return component.event_mode or component.event_times is not None
