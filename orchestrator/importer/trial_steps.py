"""The results of an importer's step, the saved start of it, and steps on trial."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from typing import NoReturn, Self

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.contacts import ContactBonds
from vibroimpact.orchestrator.importer.events import StepWatcher
from vibroimpact.orchestrator.importer.loops.solver import LoopSolver
from vibroimpact.orchestrator.importer.plain_loop import Made, PlainLoop
from vibroimpact.orchestrator.importer.progress import Progress
from vibroimpact.orchestrator.importer.revision import Watch
from vibroimpact.orchestrator.importer.step_plan import StepPlan

#: Makes a step between two instants, s; returns false if all components are at its start again.
TrialInC = Callable[[float, float, Progress], bool]


class DiscardedStep(ComponentError):
    """A component has discarded a step from `start` to `end`, s; `reached` is its last successful time, or NaN."""

    start = end = reached = math.nan

    @property
    def at(self) -> str:
        """The component and its function, for messages."""
        return f"{self.instance}: {self.function}"

    @property
    def reason(self) -> str:
        """The last line that the component logged."""
        return self.log[-1] if self.log else "the component logged nothing"


def refuse_discard(component: Component, start: float, end: float) -> NoReturn:
    """Raise DiscardedStep for the step from `start` to `end`, s, that a component has just discarded."""
    instance = component.instance
    try:
        instance.fail("DoStep", f"returned discard at time {instance.time:.17g}", DiscardedStep)
    except DiscardedStep as discard:
        discard.start, discard.end, discard.reached = start, end, instance.last_successful_time()
        raise


class TrialSteps:
    """The base of an importer, which makes the steps themselves."""

    loops: LoopSolver
    watches: Sequence[Watch]
    watchers: list[StepWatcher]
    _plan: StepPlan
    _progress: Progress
    _at_event: list[Component]
    _reached: float
    _order: Sequence[Component]
    _stopper: Component
    contacts: ContactBonds
    steps_in_c: bool

    def _prepare(self, time: float) -> None:
        raise NotImplementedError

    def _step_all(self, time: float, target: float, made: Made | None = None) -> float | None:
        raise NotImplementedError

    def _settle(self, time: float, overtaken: float | None) -> None:
        raise NotImplementedError

    @property
    def time(self) -> float:
        """Time reached, s."""
        return float(self._progress.time)

    @property
    def steps(self) -> int:
        """Communication steps made."""
        return int(self._progress.steps)

    @property
    def repeated_steps(self) -> int:
        """Number of steps that were repeated."""
        return int(self._progress.repeated_steps)

    @property
    def reached(self) -> float:
        """End of the last step, s."""
        return self._reached

    @property
    def is_at_event(self) -> bool:
        """Has a component ended the last step at an event?"""
        return bool(self._at_event)

    @property
    def event_time(self) -> float:
        """Time of the last resolved event, s."""
        return float(self._progress.event_time)

    def attempt_in_c(self, loop: PlainLoop, attempt: TrialInC, time: float, target: float) -> bool:
        """Make a step to `target`, s, and its halves by C code; returns false with all components at its start."""
        if not (self.steps_in_c and self.contacts.have_no_say):
            return False
        if self._plan.start_moves is not None:
            self._plan.start_moves()
        for watcher in self.watchers:
            watcher.before(time)
        if not attempt(time, target, self._progress):
            return False
        self._at_event, self._reached = loop.at_event(), loop.run.reached
        self._stopper = (self._at_event or self._order)[0]
        return True

    def double(self) -> Self:
        """Return an importer of the same components whose steps leave the results of this one as they are."""
        double = copy(self)
        double._progress, double.watchers = Progress(), []
        double.watches = [copy(watch) for watch in self.watches]
        return double

    def try_step(self, time: float, target: float) -> float:
        """Make a step that the caller takes back; returns its end, s."""
        self.make_consistent(time)
        self._prepare(time)
        self._settle(time, self._step_all(time, target))
        return self._reached

    def make_consistent(self, time: float) -> None:
        """Carry outputs to the inputs of all components that can go back, and solve loops."""
        if self.loops.names:
            self._solve_loops(time)
        else:
            self._plan.trial_moves()

    # ---- the start of a step ----

    def _solve_loops(self, time: float) -> None:
        self.loops.solve(time)
        for transfer in self._plan.looping:
            transfer.take()
        self._plan.moves_after_loops()
        self.loops.hold()

    def _save_start(self) -> None:
        for component in self._plan.saved:
            component.instance.save(component.at_start)
        for watch in self.watches:
            watch.note_start()

    def take_back(self) -> None:
        """Go back to the start of the step."""
        for component in self._plan.saved:
            component.instance.restore(component.at_start)
