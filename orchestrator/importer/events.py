"""What is seen of a run from outside: its events and its steps; and event mode, which resolves them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.instance import Instance
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.ticks import Ticks
from vibroimpact.orchestrator.importer.wiring import CallList, StatusCall, Transfer

#: Event iterations at one instant before a component is taken to change its outputs for ever.
EVENT_ITERATIONS = 100


@dataclass(frozen=True, slots=True)
class Event:
    """An event: its time (s), its index among those at the same time (superdense time), and its component."""

    time: float
    index: int
    component: str


@dataclass(frozen=True, slots=True)
class StepWatcher:
    """Looks on at steps: called before a step with (time), after it with (time, end).

    Attributes
    ----------
    patience : callable or None
        Returns the seconds of wall time for which steps may pass unseen, the last of which it may see the end of;
        None: it looks at every step.
    """

    before: Callable[[float], None]
    after: Callable[[float, float], None]
    patience: Callable[[], float] | None = None


@dataclass(frozen=True, slots=True)
class LateEvents:
    """Hears of events that have passed; those beyond its room are told when they happen, by `on_event`.

    Attributes
    ----------
    room : callable
        Returns how many of the next events may pass before it hears of them.
    tell : callable
        Called with events that have passed, shape (event, 3): time (s), index among those at the same time, and the
        place of the component in `Importer.components`.
    """

    room: Callable[[], int]
    tell: Callable[[NDArray[np.float64]], None]


#: No event may pass: each is told when it happens.
NO_EVENTS = LateEvents(lambda: 0, lambda events: None)


class EventMode:
    """Resolves events: carries values, updates discrete states until all are settled, goes back to step mode.

    All components of an importer are given, of which those of FMI 3.0 with event mode take part; `behind` are the
    transfers that a component's own step has not been preceded by.
    """

    def __init__(
        self, components: Sequence[Component], transfers: Sequence[Transfer], behind: Sequence[Transfer]
    ) -> None:
        with_events = [c.instance for c in components if c.event_mode]
        self.instances = [i for i in with_events if isinstance(i, Instance3)]
        """Those that take part."""
        enter = [StatusCall(i.enter_event_call, i, "EnterEventMode") for i in self.instances]
        update = [StatusCall(i.update_call, i, "UpdateDiscreteStates") for i in self.instances]
        leave = [StatusCall(i.enter_step_call, i, "EnterStepMode") for i in self.instances]
        # at its event a component's inputs from those stepped before it are those of that instant already
        first = [call for t in behind if _takes_events(t.target) for call in t.calls()]
        moves = [call for t in transfers if _takes_events(t.target) for call in t.calls()]
        self.begin = CallList([*enter, *first, *update])
        """The calls into event mode."""
        self._enter, self._update = CallList(enter), CallList(update)
        self._moves = CallList(moves)
        self._begin_run = CallList([*first, *update])  # initialization ends in event mode
        self.again = CallList([*moves, *update])
        """The calls of one more iteration."""
        self.leave = CallList(leave)
        """The calls back to step mode."""

    def resolve(self, time: float, ticks: Ticks) -> bool:
        """Resolve the events at `time`, s, and let clocks tick; returns whether a component asks for the end.

        A component that fails, or never settles, raises ComponentError.
        """
        if ticks.are_due(time):
            self._enter()
            self._tick(time, ticks)
        else:
            self.begin()
        ends = False
        for instance in self.instances:
            if instance.decisions.value:
                ends = self._iterate(time)
                break
        self.leave()
        return ends

    def _tick(self, time: float, ticks: Ticks) -> None:
        """Let clocks tick: their variables are given and read while they do, before the event iteration ends it."""
        ticks.set(time)
        self._moves()
        ticks.keep_values()
        self._update()

    def begin_run(self, time: float, ticks: Ticks) -> bool:
        """Leave the event mode that initialization ends in, as `resolve` does."""
        if not self.instances:
            return False
        if ticks.are_due(time):
            self._tick(time, ticks)
        else:
            self._begin_run()
        ends = self._iterate(time)
        self.leave()
        return ends

    def _iterate(self, time: float) -> bool:
        for _ in range(EVENT_ITERATIONS):
            if not any(instance.needs_update.value for instance in self.instances):
                return any(instance.event_wants_to_end for instance in self.instances)
            self.again()
        raise self.endless_error(time)

    def endless_error(self, time: float) -> ComponentError:
        """Return the error of events that do not settle at `time`, s."""
        endless = [i for i in self.instances if i.needs_update.value]
        names = ", ".join(i.name for i in endless)
        return ComponentError(
            f"{names}: fmi3UpdateDiscreteStates: expected event iteration to end, got another request after "
            f"{EVENT_ITERATIONS} iterations at time {time:.17g}.",
            instance=names,
            function="fmi3UpdateDiscreteStates",
            time=time,
            log=[line for i in endless for line in i.log.take()],
        )


def standstill_error(instance: Instance, steps: int, time: float) -> ComponentError:
    """Return the error of a run that makes no progress, for the component that ends its steps."""
    return ComponentError(
        f"{instance.name}: {instance.prefix}DoStep: expected steps that advance, got {steps} without "
        f"progress at time {time:.17g}.",
        instance=instance.name,
        function=f"{instance.prefix}DoStep",
        time=time,
        log=instance.log.take(),
    )


def macro_step_error(macro_step: float, room: float, time: float) -> ComponentError:
    """Return the error of a macro step that is lost in the rounding of the time."""
    return ComponentError(
        f"macro_step: expected more than {room:.3g} s, so that time {time:.17g} advances, got {macro_step:.3g} s.",
        function="doStep",
        time=time,
    )


def _takes_events(component: Component) -> bool:
    """Does an event reach this component's inputs? Others have been given theirs before their step."""
    return component.event_mode or component.event_times is not None
