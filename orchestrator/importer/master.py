"""The importer: steps components together, ends the step of all at the first event, resolves it, continues."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Literal

from vibroimpact.fmus.core.coupling import CouplingEnd
from vibroimpact.orchestrator.fmi.instance import DISCARD, Wrapper
from vibroimpact.orchestrator.fmi.log import LogTail
from vibroimpact.orchestrator.importer.adaptive.coupling import needs_coupling_steps
from vibroimpact.orchestrator.importer.adaptive.steps import AdaptiveSteps
from vibroimpact.orchestrator.importer.beginning import settle_connections
from vibroimpact.orchestrator.importer.component import SAME_INSTANT, Component, Value
from vibroimpact.orchestrator.importer.contacts import CONTACT_STEPS
from vibroimpact.orchestrator.importer.events import (
    NO_EVENTS,
    Event,
    LateEvents,
    StepWatcher,
    standstill_error,
)
from vibroimpact.orchestrator.importer.own_grid import Divisions
from vibroimpact.orchestrator.importer.parts import parts_of
from vibroimpact.orchestrator.importer.plain_loop import MOST_SECONDS, Made, PlainLoop
from vibroimpact.orchestrator.importer.progress import Progress
from vibroimpact.orchestrator.importer.revision import Watch
from vibroimpact.orchestrator.importer.specification import (
    COUPLING_TOLERANCE,
    ComponentSpec,
    ConnectionSpec,
    EventSpec,
    Exchange,
    PairSpec,
    StopContactSpec,
)
from vibroimpact.orchestrator.importer.step_plan import StepPlan
from vibroimpact.orchestrator.importer.stop_contacts.contact_bond import MOST_REPETITIONS
from vibroimpact.orchestrator.importer.trial_steps import TrialSteps, refuse_discard
from vibroimpact.orchestrator.importer.wiring import SettlingInputs

#: Steps without progress after which the run ends in an error.
STANDSTILLS = 100
#: Exchange "iterated": most repetitions of a step, and the relative change at which they end.
STEP_ITERATIONS = 50
STEP_TOLERANCE = 1e-13
#: Most repetitions of a step until bodies that rest on each other and bodies that meet meanwhile agree.
PAIR_REPETITIONS = 100


class Importer(TrialSteps):
    """Couples components.

    Parameters
    ----------
    components : sequence of ComponentSpec
        In the order in which they are instantiated and, where nothing else decides, stepped.
    connections : sequence of ConnectionSpec
        Outputs to inputs, and to tunable parameters.
    events : sequence of EventSpec
        Watched variables; their components run without event mode and early return.
    contacts : sequence of StopContactSpec
        Bodies that hold a force over a step, and their stops.
    pairs : sequence of PairSpec
        Bodies that hit each other.
    exchange : str
        `jacobi`: inputs of a step's start, except of stops and formulas (`fresh_inputs`). `gauss_seidel`: the newest
        outputs of components stepped before. `iterated`: steps are repeated until the inputs at their end agree.
    macro_step : float or "auto"
        Longest communication step, s; "auto": steps follow an estimate of their errors.
    coupling_tolerance : float
        Relative error of a step with "auto".
    contact_steps : float
        Communication steps that a contact with a yielding stop is divided into (its law is another FMU's). The macro
        step may divide it further.
    divisions : Divisions or None
        The macro steps and the ends of all runs; None: `macro_step`, and multiples of it.
    log, wrap : callable or None
        Given a component's name: the receiver of its log lines, and the wrapper of its FMU's functions.

    Attributes
    ----------
    time : float
        Time reached, s.
    components : dict of str to Component
        By name.
    contacts : ContactBonds
        The contacts with yielding stops, and the pairs.
    overrun : float
        Time of components that could not be taken back when another requested the end, s; or -inf.
    steps, repeated_steps : int
        Communication steps made, and the number of steps repeated.
    on_event, on_pause : callable or None
        Called at each event with it; called when a component ends a step early without an event.
    late_events : LateEvents or None
        Receives events that may pass, in place of `on_event`; None: `on_event` is called at each event.
    steps_in_c : bool
        Plain steps are made in C, with the same bits as here.
    adaptive : AdaptiveSteps or None
        Chooses the steps with "auto"; None with a macro step, and where no connection needs one.
    """

    def __init__(
        self,
        components: Sequence[ComponentSpec],
        connections: Sequence[ConnectionSpec] = (),
        events: Sequence[EventSpec] = (),
        contacts: Sequence[StopContactSpec] = (),
        pairs: Sequence[PairSpec] = (),
        *,
        exchange: Exchange = "gauss_seidel",
        macro_step: float | Literal["auto"] = math.inf,
        coupling_tolerance: float = COUPLING_TOLERANCE,
        contact_steps: float = CONTACT_STEPS,
        divisions: Divisions | None = None,
        log: Callable[[str], LogTail] | None = None,
        wrap: Callable[[str], Wrapper] | None = None,
    ) -> None:
        self.macro_step = math.inf if macro_step == "auto" else macro_step
        cuts = divisions or Divisions((self.macro_step,))
        parts = parts_of(components, connections, events, contacts, pairs, cuts, contact_steps, log, wrap)
        self.components, self._order = parts.named, parts.components
        self.watches, self.contacts, self.transfers = parts.watches, parts.contacts, parts.transfers
        self.loops, self.tuning, self.ticks, self.grids = parts.loops, parts.tuning, parts.ticks, parts.grids
        self._progress = Progress()
        adapts = macro_step == "auto" and needs_coupling_steps(parts, contacts, pairs)
        self._plan = StepPlan(parts, exchange, self._progress, tries=adapts)
        self.adaptive: AdaptiveSteps | None = None
        if adapts:
            self.adaptive = AdaptiveSteps(parts, self._plan, exchange, contacts, pairs, coupling_tolerance)
        self.watchers: list[StepWatcher] = []
        self.keeps_start = False
        self.steps_in_c = True
        self.on_event: Callable[[Event], None] | None = None
        self.late_events: LateEvents | None = None
        self.on_pause: Callable[[], None] | None = None
        self._has_started = False

    def plan_moves(self) -> None:
        """Bind the calls of all moves again, after a transfer's buffers changed."""
        self._plan.plan_moves()

    # ---- beginning ----

    def begin(self, start_time: float = 0.0, values: Mapping[tuple[str, str], Value] | None = None) -> None:
        """Start a run: reset, set start values, initialize with connected start values, enter step mode.

        Parameters
        ----------
        start_time : float
            s.
        values : mapping of (component, variable) to value
            Start values beyond those of the components' specifications.
        """
        self._progress.begin(start_time, self.macro_step)
        self.overrun = -math.inf
        self._at_event: list[Component] = []
        self.wants_to_end = False
        for component in self._order:
            own = {name: value for (who, name), value in (values or {}).items() if who == component.name}
            component.begin(own, start_time, first=not self._has_started)
        self.grids.begin(start_time, self.macro_step)
        self._has_started = True
        settle_connections([*self.transfers, *self.tuning.transfers], self.loops, start_time)
        self._plan.keep_up()
        self.tuning.begin()
        self.ticks.begin(start_time)
        for component in self._order:
            component.instance.exit_initialization()
            component.ticking = frozenset()
        for watch in self.watches:
            watch.begin()
        self.wants_to_end = self._plan.event_mode.begin_run(start_time, self.ticks)
        self.contacts.begin(start_time)
        self._note(self.contacts.pairs.resolve(start_time))
        self._tune(start_time)
        if self.adaptive is not None:
            self.adaptive.begin(self)

    # ---- advancing ----

    def advance(self, end: float) -> None:
        """Advance to `end`, s, resolving all events on the way; stops early when a component requests the end.

        Raises
        ------
        ComponentError
            A component fails, never settles at an event, or makes no progress.
        """
        now = self._progress
        while not self.wants_to_end:
            time = now.time
            room = SAME_INSTANT * (1.0 + abs(time))
            if end - time <= room:
                now.time = max(time, end)
                return
            if now.next_point - time <= room:
                now.pass_point(self.macro_step, room)
            if self.adaptive is not None:
                self.adaptive.step(time, min(end, self.ticks.next), end)
                continue
            seconds = self._seconds_for_c()
            if seconds > 0.0 and (loop := self._plan.plain_loop) is not None:
                self._make_plain_steps(loop, end, seconds)
            else:
                self._step(time, min(now.next_point, end, self.ticks.next, self.grids.next))

    # ---- plain steps ----

    def _seconds_for_c(self) -> float:
        """Return the wall time, s, that plain steps in C may take now; 0 where this class must make the steps."""
        if self.keeps_start or not (self.steps_in_c and self.contacts.have_no_say):
            return 0.0
        seconds = MOST_SECONDS
        for watcher in self.watchers:
            seconds = 0.0 if watcher.patience is None else min(seconds, watcher.patience())
        return seconds

    def _make_plain_steps(self, loop: PlainLoop, end: float, seconds: float) -> None:
        """Make plain steps in C up to the first step that needs this class, and finish that step."""
        late = None if self.on_event is None else self.late_events or NO_EVENTS
        came_to = loop.advance(end, self.macro_step, seconds, late, hears_pauses=self.on_pause is not None)
        run = loop.run
        self.wants_to_end = bool(run.wants_to_end)
        if came_to is CouplingEnd.stepped:
            self._at_event = loop.at_event()
            overtaken = self._step_all(run.start, run.goal, Made(run.at, run.status))
            self._finish(run.start, run.target, overtaken)
        elif came_to is CouplingEnd.reached:
            self._at_event, self._reached = loop.at_event(), run.reached
            self._stopper = (self._at_event or self._order)[0]
            self._conclude(run.start, run.target)
        elif came_to is CouplingEnd.cut:
            loop.explain_cut()
        elif came_to is CouplingEnd.failed:
            loop.explain()
        elif came_to is CouplingEnd.endless:
            raise self._plan.event_mode.endless_error(self.time)

    def _step(self, time: float, target: float) -> None:
        """Make a step towards `target`."""
        self.accept(time, self.attempt(time, target))

    def attempt(self, time: float, target: float) -> float:
        """Make a step towards `target`, s, that is not concluded yet; returns its planned end."""
        contacts, plan = self.contacts, self._plan
        if contacts:
            target = contacts.begin_step(time, target)
            self._note(component.name for component in contacts.met_at_start)
        if plan.start_moves is not None:
            plan.start_moves()
        if contacts:
            contacts.apply()
        if plan.prepares or self.keeps_start or contacts.active:
            self._prepare(time)
        self.grids.take_inputs(time)
        for watcher in self.watchers:
            watcher.before(time)
        self._settle(time, self._step_all(time, target))
        return target

    def _finish(self, time: float, target: float, overtaken: float | None) -> None:
        """Finish a step that all have made, or that ended at `overtaken` with some components past this time."""
        self._settle(time, overtaken)
        self.accept(time, target)

    def _settle(self, time: float, overtaken: float | None) -> None:
        """Repeat a step until all that can go back agree on its end."""
        if overtaken is not None or self._plan.iterates:
            self._agree(time, overtaken)
        if self.contacts.active:
            self._settle_contacts(time)

    def accept(self, time: float, target: float) -> None:
        """Conclude a step: components that cannot go back make it, and its events are resolved."""
        contacts = self.contacts
        while self._plan.stateless_paths and self._reached > time:
            contacts.agree(time, self._reached)
            if (overtaken := self._step_stateless(time, self._reached)) is None:
                break
            self._agree(time, overtaken)
        if contacts:
            self._at_event += contacts.end_step(self._reached - time)
        self._conclude(time, target)

    def _conclude(self, time: float, target: float) -> None:
        """Count the step at whose end all are, and resolve its events."""
        now, end = self._progress, self._reached
        now.standstill = 0 if end > time else now.standstill + 1
        if now.standstill > STANDSTILLS:
            raise standstill_error(self._stopper.instance, STANDSTILLS, time)
        self.wants_to_end = self.grids.reach(end) or self.wants_to_end
        if self.loops.names and end > time and not self.wants_to_end:
            self._solve_loops(end)
        for watcher in self.watchers:
            watcher.after(time, end)
        now.note_step(end)
        if self._at_event:
            for watch in self.watches:
                watch.confirm()
            self._note(component.name for component in self._at_event)
        if self._at_event or self.ticks.are_due(end):
            self.wants_to_end = self._plan.event_mode.resolve(end, self.ticks) or self.wants_to_end
        elif end < target and self.on_pause is not None:
            self.on_pause()
        if self.contacts.pairs:
            self._note(self.contacts.pairs.resolve(end))
            self.wants_to_end = self.wants_to_end or self.contacts.pairs.pulses.wants_to_end
        self._tune(end)

    def _prepare(self, time: float) -> None:
        """Prepare a rarer kind of step: solve loops, note inputs, save states."""
        if self.loops.names:
            self._solve_loops(time)
        if self._plan.iterates:
            for transfer in self.transfers:
                transfer.note_begin()
        if self._plan.saves or self.keeps_start or self.contacts.active:
            self._save_start()

    def _agree(self, time: float, end: float | None) -> None:
        """Repeat a step until all components have reached one instant; `end` is the time of the first event."""
        while end is not None or (end := self._iterate(time)) is not None:
            # a component met an event before the end of the others: all go back and step to it
            self._progress.repeated_steps += 1
            if end <= time:
                self._stay(time)
                return
            self.take_back()
            end = self._step_all(time, end)

    def _settle_contacts(self, time: float) -> None:
        """Repeat a step until the yielding stops agree with the motion that their forces cause."""
        for _ in range(PAIR_REPETITIONS if self.contacts.pairs else MOST_REPETITIONS):
            end = self.contacts.revised_end(time, self._reached)
            if end is None or self._reached <= time:
                return
            self._progress.repeated_steps += 1
            self.take_back()
            self.contacts.apply()
            self._save_start()
            overtaken = self._step_all(time, end)
            if overtaken is not None or self._plan.iterates:
                self._agree(time, overtaken)

    def _step_all(self, time: float, target: float, made: Made | None = None) -> float | None:
        """Step each component in order; returns the time of an event that earlier components have passed.

        The first component may return early by itself: the later components follow to its event. The components up to
        the place of `made` have made their steps.
        """
        if made is None:
            self._at_event = []
        self.wants_to_end = False  # requests of a step that was taken back do not count
        place = 0 if made is None else made.place
        first = place == 0
        for component, inputs in self._plan.paths[place:]:
            if inputs is not None and made is None:
                inputs()
            reached = self._step_one(component, time, target, made)
            made = None
            if reached < target:
                if not (first and reached > time and (component.event_mode or self.wants_to_end)):
                    saved = self._plan.saves or self.keeps_start or self.contacts.active
                    if component.instance.wants_to_end and not (saved and component.has_states):
                        self._end_run(time, reached, target)
                        return None
                    self._stopper = component
                    return reached
                target = reached
            first = False
        self._reached = self._at_event[0].instance.time if self._at_event else target
        return None

    def _end_run(self, time: float, reached: float, target: float) -> None:
        """End the step and the run at the request of a component; the others have gone on."""
        self._reached = max(time, reached)
        self.overrun = target if len(self._order) > 1 else -math.inf

    def _stay(self, time: float) -> None:
        """End the step where it began: no step has size 0, so all but the component at its event go back."""
        for component, _ in self._plan.paths:
            if component is self._stopper:
                break
            if component.has_states:
                component.instance.restore(component.at_start)
        self._at_event = [c for c in self._at_event if c is self._stopper]
        for watch in self.watches:
            watch.forget()
        self._reached = time

    def _step_one(self, component: Component, time: float, target: float, made: Made | None = None) -> float:
        """Step one component, or take the step it has made; returns the time of its first event, or `target`."""
        instance = component.instance
        if made is None and component.stays_ahead(time, target):  # a repeated step
            return self._after_step(component, target)
        status = instance.step(time, target - time) if made is None else instance.take_step(made.status)
        if status == DISCARD:
            refuse_discard(component, time, target)
        reached = self._after_step(component, target) if instance.is_flagged else target
        if component.event_times is not None:
            reached = min(reached, self._reported(component, time, target))
        for watch in self.watches:
            if watch.component is component:
                reached = min(reached, self._watched(watch, time, target))
        return reached

    def _after_step(self, component: Component, target: float) -> float:
        """Read the flags of a step; returns where the step has ended."""
        instance = component.instance
        if instance.wants_to_end:
            self.wants_to_end = True
            if instance.time < target - SAME_INSTANT * (1.0 + abs(target)) - instance.internal_step:
                return instance.time
        if not component.event_mode:
            return target
        if instance.needs_event_mode:
            self._at_event.append(component)
        return instance.time if instance.returned_early else target

    def _reported(self, component: Component, time: float, target: float) -> float:
        """Return the event time that an FMI 2.0 component reports in the step, else `target`."""
        first = component.first_event_in(time, target)
        if first is None:
            return target
        if first == target or first <= time:  # at the start: the component has stayed there
            self._at_event.append(component)
        return first

    def _watched(self, watch: Watch, time: float, target: float) -> float:
        size = target - time
        located = watch.find(time, size)
        if located is None:
            return target
        if located >= size:
            self._at_event.append(watch.component)
            return target
        return time + located

    def _note(self, components: Iterable[str]) -> None:
        for name in components:
            index = self._progress.note_event()
            if self.on_event is not None:
                self.on_event(Event(self.time, index, name))

    def _tune(self, time: float) -> None:
        ends = bool(self.tuning) and self.tuning.resolve(time, self.ticks)
        if self.ticks.are_due(time):  # a tuned clock ticks at once
            ends = self._plan.event_mode.resolve(time, self.ticks) or ends
        self.wants_to_end = self.wants_to_end or ends

    # ---- repeated steps ----

    def _iterate(self, time: float) -> float | None:
        """Repeat a step (exchange "iterated") until its inputs are those at its end; returns an earlier event."""
        if not self._plan.iterates:
            return None
        target = self._reached
        inputs = SettlingInputs(self.transfers, STEP_TOLERANCE)
        for _ in range(STEP_ITERATIONS):
            self.loops.solve(target)
            if inputs.have_settled():
                break
            self.take_back()
            for transfer in self.transfers:
                transfer.write_over_step(target - time)
            if self.contacts.active:
                self.contacts.apply()
            self._progress.repeated_steps += 1
            self._at_event = []
            self.wants_to_end = False
            for component, _ in self._plan.paths:
                reached = self._step_one(component, time, target)
                if reached < target:
                    self._stopper = component
                    return reached
        self._reached = self._at_event[0].instance.time if self._at_event else target
        return None

    def _step_stateless(self, time: float, end: float) -> float | None:
        """Step the components without states, once the end is agreed; returns the time of an event before it."""
        for component, inputs in self._plan.stateless_paths:
            if inputs is not None:
                inputs()
            reached = self._step_one(component, time, end)
            if reached < end and self.wants_to_end:
                self._end_run(time, reached, end)
            elif reached < end:
                self._stopper = component
                return reached
        return None

    def free(self) -> None:
        """Free all components."""
        if self.adaptive is not None:
            self.adaptive.free()
        self.contacts.free()
        for component in self.components.values():
            component.free()
