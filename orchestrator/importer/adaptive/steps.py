"""Communication steps that an error estimate chooses: repeated in halves, or compared with earlier outputs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from ctypes import c_void_p
from typing import Protocol

import numpy as np

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.instance import NO_STATE_PRIOR_TO_POINT
from vibroimpact.orchestrator.importer.adaptive.chosen_loop import ChosenLoop, chosen_loop
from vibroimpact.orchestrator.importer.adaptive.controller import StepController
from vibroimpact.orchestrator.importer.adaptive.coupling import coupling_sources, halved, points_of
from vibroimpact.orchestrator.importer.adaptive.extrapolation import Extrapolation
from vibroimpact.orchestrator.importer.adaptive.outputs import Floats, Outputs
from vibroimpact.orchestrator.importer.adaptive.record import StepRecord
from vibroimpact.orchestrator.importer.component import SAME_INSTANT
from vibroimpact.orchestrator.importer.parts import Parts
from vibroimpact.orchestrator.importer.plain_loop import PlainLoop
from vibroimpact.orchestrator.importer.specification import Exchange, PairSpec, StopContactSpec
from vibroimpact.orchestrator.importer.step_plan import StepPlan
from vibroimpact.orchestrator.importer.trial_steps import DiscardedStep, TrialInC

#: First and shortest size of a step, over the time of a run, and the time in which a motion from rest has no scale.
FIRST, SHORTEST, WINDOW = 1e-6, 1e-10, 1e-3
#: First size where bodies of other tools touch: trial steps of a thousandth of it measure their masses.
FIRST_WITH_CONTACTS = 1e-4
#: Shortest size over the rounding of time.
TIME_ROUNDINGS = 16.0
#: A step up to this many times the shortest is a shortest one: ends of steps are rounded.
SAME_SHORTEST = 1.01
#: Deviation of a contact point from a straight line over a step, over its scale, at which the step shows its path.
PATH_TOLERANCE = 1e-2
#: A step up to this much longer than the first is a first one.
SAME_SIZE = 1e-9


class Stepper(Protocol):
    """An importer, whose steps may be tried."""

    @property
    def reached(self) -> float:
        """End of the last step, s."""

    def attempt(self, time: float, target: float) -> float:
        """Make a step that may be taken back; returns its planned end, s."""

    def attempt_in_c(self, loop: PlainLoop, attempt: TrialInC, time: float, target: float) -> bool:
        """Make a step with its halves in C; false: all are at its start again."""

    def take_back(self) -> None:
        """Go back to the start of the step."""

    def accept(self, time: float, target: float) -> None:
        """Conclude the step, with its events."""

    @property
    def is_at_event(self) -> bool:
        """Has the last step ended at an event?"""

    @property
    def event_time(self) -> float:
        """Time of the last event, s."""

    def double(self) -> Stepper:
        """Return a stepper of the same components, for trial steps."""

    def try_step(self, time: float, target: float) -> float:
        """Make a step that the caller takes back; returns its end, s."""

    def make_consistent(self, time: float) -> None:
        """Move all outputs to inputs, and solve loops."""


class AdaptiveSteps:
    """Chooses the communication steps of an importer.

    A step of components with states is repeated in two halves. The difference of their connected outputs and named
    states is the error, relative to each one's largest value so far. A step with a larger error than the tolerance is
    taken back. Other outputs are compared with the line through their last values, and change the next step only.

    Parameters
    ----------
    parts : Parts
        The parts of the importer.
    plan : StepPlan
        The work of a step.
    exchange : str
        The exchange of values. Its errors are of second order with `iterated` and straight inputs, else of first.
    contacts, pairs : sequences
        Contacts of bodies of other tools, whose steps show the path of the contact points.
    tolerance : float
        Relative error of a step.

    Attributes
    ----------
    order : int
        Power of its size with which the error of a step falls.
    record : StepRecord
        The steps of the present run.
    """

    def __init__(
        self,
        parts: Parts,
        plan: StepPlan,
        exchange: Exchange,
        contacts: Sequence[StopContactSpec],
        pairs: Sequence[PairSpec],
        tolerance: float,
    ) -> None:
        if not 0.0 < tolerance <= 1.0:
            raise ComponentError(f"coupling_tolerance: expected a number > 0 and <= 1, got {tolerance!r}.")
        self._parts, self._plan, self._tolerance = parts, plan, tolerance
        sources, points = coupling_sources(parts, contacts), points_of(parts.named, contacts, pairs)
        is_straight = all(t.is_straight for t in parts.transfers) and all(c.has_states for c, _, _ in sources)
        self.order = 3 if exchange == "iterated" and is_straight else 2
        self._controller = StepController(self.order)
        # the difference of one step and its halves, over the error of the one step
        self._share = 1.0 - 0.5 ** (self.order - 1)
        self._halved = Outputs(halved(parts, sources))
        others = Outputs([source for source in sources if not source[0].has_states])
        lines = [
            Extrapolation(others, tolerance, is_coupling=True),
            Extrapolation(Outputs(points), PATH_TOLERANCE, is_coupling=False),
        ]
        self._lines = [line for line in lines if len(line.outputs)]
        restorable = Outputs([source for source in sources if source[0].has_states])
        self._restorable = Extrapolation(restorable, tolerance, is_coupling=True)
        self._first_part = FIRST_WITH_CONTACTS if points else FIRST
        self._slots = {c.name: c_void_p() for c in plan.saved}
        self.record = StepRecord()
        self._loop: ChosenLoop | None = None

    @property
    def trace(self) -> Floats:
        """End (s), size (s) and error over the tolerance of the steps of the present run, shape (step, 3)."""
        return self.record.traced(self._tolerance)

    # ---- a run ----

    def begin(self, importer: Stepper) -> None:
        """Start a run of an importer: initialization has ended."""
        self._importer, self._double = importer, importer.double()
        self._span, self._is_new = 0.0, True
        self.record = StepRecord()
        stateless = any(not component.has_states for component in self._parts.components)
        # trial steps would change the inputs of a component without states in a loop
        self._all_lines = list(self._lines)
        self._can_halve = bool(len(self._halved)) and not (self._parts.loops.names and stateless)
        if len(self._restorable.outputs) and (self._parts.contacts or not self._can_halve):
            self._all_lines.append(self._restorable)
        self._find_loop()

    def _find_loop(self) -> None:
        """Find the loop in C; moves may have been planned anew, with other calls."""
        plain = self._plan.plain_loop if self._can_halve else None
        if plain is None:
            self._loop = None
        elif self._loop is None or self._loop.plain is not plain:
            self._loop = chosen_loop(self._plan, self._halved, self._slots, self._share)

    def step(self, time: float, limit: float, end: float) -> None:
        """Make one step of a chosen size.

        Parameters
        ----------
        time : float
            Start of the step, s.
        limit, end : float
            Time at which the step ends at the latest, and end of the present advance, s.

        Raises
        ------
        ComponentError
            An error stays above the tolerance at the shortest step.
        """
        self._take_span(time, end)
        with np.errstate(over="ignore", invalid="ignore"):
            self._step(time, limit)

    def _step(self, time: float, limit: float) -> None:
        importer, controller = self._importer, self._controller
        while True:
            wish = controller.end_of(time, limit)
            try:
                planned, error = self._attempt(time, wish)
                size = importer.reached - time
            except DiscardedStep as discard:
                self._shorten(time, discard)
                continue
            if error[0] <= 1.0:
                break
            self.record.rejected += 1
            controller.reject(size, error[0])
            self._bound_size(time, size, error)
            importer.take_back()
        if size <= 0.0:
            self._accept(time, planned)
            return
        self._finish(time, planned, error, cut=importer.reached < wish or wish == limit)

    def _attempt(self, time: float, wish: float) -> tuple[float, tuple[float, str]]:
        """Make a step towards `wish`, s; return its planned end, and its error with the name of an output."""
        importer, loop = self._importer, self._loop
        if loop is not None:
            loop.bound(self._shortest(time) * SAME_SHORTEST)
        if loop is not None and importer.attempt_in_c(loop.plain, loop.try_step, time, wish):
            return wish, loop.error
        planned = importer.attempt(time, wish)
        size = importer.reached - time
        return planned, self._error_of_halves(time, size) if size > 0.0 else (0.0, "")

    def _shorten(self, time: float, discard: DiscardedStep) -> None:
        """Go back before a discarded step and choose a shorter one; ComponentError at the shortest."""
        self.record.rejected += 1
        size, shortest = discard.end - time, self._shortest(time)
        if self._is_shortest(time, size):
            raise ComponentError(
                f"{discard.at}: expected a step of {shortest:.3g} s, the shortest of the run, got a discard at time "
                f"{discard.start:.12g}: {discard.reason}",
                instance=discard.instance,
                function=discard.function,
                time=discard.start,
                log=discard.log,
            )
        self._importer.take_back()
        self._controller.discard(size, discard.reached - time)
        self._controller.size = max(self._controller.size, shortest)

    def _accept(self, time: float, planned: float) -> None:
        """Conclude a step; ComponentError where a component discards it that cannot go back."""
        try:
            self._importer.accept(time, planned)
        except DiscardedStep as discard:
            component = self._parts.named[discard.instance]
            if component.has_states:
                raise
            raise ComponentError(
                f"{discard.at}: expected an FMU that can repeat the steps it discards, got one without states "
                f"(canGetAndSet{component.instance.state_word} = false) that discarded "
                f"{discard.end - discard.start:.3g} s at time {discard.start:.12g}: {discard.reason}. "
                "Give a shorter macro step as a number.",
                instance=discard.instance,
                function=discard.function,
                time=discard.start,
                log=discard.log,
            ) from None

    def _finish(self, time: float, planned: float, error: tuple[float, str], *, cut: bool) -> None:
        """Conclude a step whose error by halves is small, and choose the next size."""
        importer, reached = self._importer, self._importer.reached
        size = reached - time
        is_halved, ticks = (
            self._can_halve and not self._parts.contacts.active,
            self._parts.ticks.are_due(reached),
        )
        coupling_error = error[0]
        self._accept(time, planned)
        if ticks or importer.event_time >= reached:
            self.record.add(reached, size, error[0] * self._tolerance, cut=cut)
            self._controller.begin_anew(may_reject=is_halved)
            for line in self._all_lines:
                line.begin_anew(reached)
            return
        for line in self._all_lines:
            found = _worst(line.errors(reached, size, first=self._is_first(size)), line.outputs.names)
            if is_halved and line is self._restorable:
                continue
            error = max(error, found)
            if line.is_coupling:
                coupling_error = max(coupling_error, found[0])
        self.record.add(reached, size, coupling_error * self._tolerance, cut=cut)
        self._controller.accept(size, error[0], cut=cut)
        self._bound_size(reached, size, error)

    def _take_span(self, time: float, end: float) -> None:
        """Take the time of a run into the bounds of the sizes; the first advance begins the run."""
        self._span = max(self._span, end - time)
        if not self._is_new:
            return
        self._is_new = False
        self._controller.begin(max(self._first_part * self._span, self._shortest(time)))
        window = WINDOW * self._span
        if self._can_halve:
            self._halved.begin(window, self._tolerance)
            self._halved.learn(time, self._halved.read())
        if self._loop is not None:
            self._loop.begin(self._controller.first * (1.0 + SAME_SIZE))
        for line in self._all_lines:
            line.begin(time, window)

    def _shortest(self, time: float) -> float:
        return max(SHORTEST * self._span, TIME_ROUNDINGS * SAME_INSTANT * (1.0 + abs(time)))

    def _is_shortest(self, time: float, size: float) -> bool:
        return size <= self._shortest(time) * SAME_SHORTEST

    def _is_first(self, size: float) -> bool:
        return size <= self._controller.first * (1.0 + SAME_SIZE)

    def _bound_size(self, time: float, size: float, error: tuple[float, str]) -> None:
        """Keep the next size above the shortest; ComponentError where even this size has a large error."""
        shortest = self._shortest(time)
        if self._controller.size >= shortest:
            return
        if error[0] > 1.0 and self._is_shortest(time, size):
            raise ComponentError(
                f"macro_step: expected an error of at most {self._tolerance:g} of each value in steps of "
                f"{shortest:.3g} s, got {error[0] * self._tolerance:.3g} of {error[1]} at time {time:.12g}. "
                "Its values jump, or states that are restored give other values. Use a larger coupling_tolerance, or "
                "a number.",
                instance=error[1].partition(".")[0],
                time=time,
            )
        self._controller.size = shortest

    # ---- halves ----

    def _error_of_halves(self, time: float, size: float) -> tuple[float, str]:
        """Return the largest error of the step just made, over the tolerance, and the name of its output."""
        if not self._can_halve or self._parts.contacts.active:
            return 0.0, ""
        end, outputs, double = time + size, self._halved, self._double
        with ExitStack() as stack:
            for component in self._plan.saved:
                stack.enter_context(component.taken_back())
            double.make_consistent(end)
            whole = outputs.read()
            for component in self._plan.saved:
                component.instance.restore(component.at_start)
            double.make_consistent(time)
            start = outputs.read()
            with self._other_slots():
                middle = time + 0.5 * size
                if double.try_step(time, middle) < middle or double.is_at_event:
                    # up to the shortest size it is the event at which the whole step has ended
                    return (0.0 if self._is_shortest(time, size) else math.inf), self._halved.names[0]
                with self._prior_states():
                    # an FMU that repeats a last step that is not accepted has none after a restored state
                    for component in self._plan.saved:
                        component.instance.save(component.at_start)
                        component.instance.restore(component.at_start)
                    reached = double.try_step(middle, end)
            double.make_consistent(reached)
            halves = outputs.read()
        errors = outputs.difference(whole, halves) / self._share
        # in one step a body at rest may not have felt a force yet
        after = np.where(np.abs(halves) > np.abs(whole), halves, whole)
        errors = outputs.over_scale(errors, start, after, end, size) / self._tolerance
        if self._is_first(size):
            errors = outputs.without_first(errors, after, end)
        found = _worst(errors, outputs.names)
        if found[0] <= 1.0:
            outputs.learn(end, whole)
        return found

    @contextmanager
    def _other_slots(self) -> Iterator[None]:
        """Save the starts of steps elsewhere meanwhile: the sampling of the step needs its start."""
        kept = [(component, component.at_start) for component in self._plan.saved]
        for component in self._plan.saved:
            component.at_start = self._slots[component.name]
        try:
            yield
        finally:
            for component, slot in kept:
                component.at_start = slot

    @contextmanager
    def _prior_states(self) -> Iterator[None]:
        """Tell the components of the second half of a step that the step's start will be restored."""
        for component in self._plan.saved:
            component.instance.no_state_prior.value = False
        try:
            yield
        finally:
            for component in self._plan.saved:
                component.instance.no_state_prior.value = NO_STATE_PRIOR_TO_POINT

    def free(self) -> None:
        """Free saved states, before the components are freed."""
        for component in self._plan.saved:
            if self._slots[component.name] and not component.instance.is_fatal:
                component.instance.free_state(self._slots[component.name])


def _worst(errors: Floats, names: Sequence[str]) -> tuple[float, str]:
    """Return the largest error and its name; 0 without errors."""
    if not len(errors):
        return 0.0, ""
    place = int(np.argmax(errors))
    return float(errors[place]), names[place]
