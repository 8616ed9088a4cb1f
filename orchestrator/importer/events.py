"""Events and steps as observers see them, and event mode, which resolves events."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.eventful import EventfulInstance
from vibroimpact.orchestrator.fmi.instance import Instance
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.ticks import Ticks
from vibroimpact.orchestrator.importer.wiring import CallList, StatusCall, Transfer

#: Event iterations at one instant, above which a component counts as never settling.
EVENT_ITERATIONS = 100


@dataclass(frozen=True, slots=True)
class Event:
    """An event: its time (s), its index among those at the same time (superdense time), and its component."""

    time: float
    index: int
    component: str


@dataclass(frozen=True, slots=True)
class StepWatcher:
    """Observes steps: called before a step with (time), after it with (time, end).

    Attributes
    ----------
    patience : callable or None
        Returns the wall time, s, for which steps may pass unseen; the observer may see the end of the last of them.
        None: it observes every step.
    """

    before: Callable[[float], None]
    after: Callable[[float, float], None]
    patience: Callable[[], float] | None = None


@dataclass(frozen=True, slots=True)
class LateEvents:
    """Receives events after they have passed; events beyond its room are reported at once, by `on_event`.

    Attributes
    ----------
    room : callable
        Returns the number of further events that may pass before it is called.
    report : callable
        Called with the passed events, shape (event, 3): time (s), index among those at the same time, and place of the
        component in `Importer.components`.
    """

    room: Callable[[], int]
    report: Callable[[NDArray[np.float64]], None]


#: No event may pass: each is reported when it happens.
NO_EVENTS = LateEvents(lambda: 0, lambda events: None)


class EventMode:
    """Resolves events: carries values, updates discrete states until all are settled, returns to step mode.

    It is given all components of an importer; components with event mode take part. `behind` are the transfers
    that no component makes just before its own step.
    """

    def __init__(
        self, components: Sequence[Component], transfers: Sequence[Transfer], behind: Sequence[Transfer]
    ) -> None:
        with_events = [c.instance for c in components if c.event_mode]
        self.instances = [i for i in with_events if isinstance(i, EventfulInstance)]
        """The instances that take part."""
        enter = [StatusCall(i.enter_event_call, i, "EnterEventMode") for i in self.instances]
        update = [StatusCall(i.update_call, i, "UpdateDiscreteStates") for i in self.instances]
        leave = [StatusCall(i.enter_step_call, i, "EnterStepMode") for i in self.instances]
        # at an event the inputs from components stepped earlier have the values of that instant already
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
        """Resolve the events at `time`, s, and let clocks tick; returns whether a component requests the run's end.

        A component that fails, or never settles, raises ComponentError.
        """
        if ticks:
            self._enter()
            ends = self._tick(time, ticks)
            self.leave()
            return ends
        self.begin()
        ends = False
        for instance in self.instances:
            if instance.decisions.value:
                ends = self._iterate(time)
                break
        self.leave()
        return ends

    def _tick(self, time: float, ticks: Ticks) -> bool:
        """Let clocks tick until all are settled; returns whether a component requests the run's end.

        The variables of a clock are set and read before the event iteration, which ends its tick.
        """
        ends = False
        for _ in range(EVENT_ITERATIONS):
            ticks.set(time)
            self._moves()
            while ticks.trigger():
                self._moves()
            ticks.keep_values()
            self._update()
            ticks.look(time)
            ends = ends or any(instance.event_wants_to_end for instance in self.instances)
            if not (ticks.are_due(time) or any(i.needs_update.value for i in self.instances)):
                return ends
        if ticks.are_due(time):
            raise ticks.endless_error(time, EVENT_ITERATIONS)
        raise self.endless_error(time)

    def begin_run(self, time: float, ticks: Ticks) -> bool:
        """Leave the event mode after initialization, as `resolve` does."""
        if not self.instances:
            return False
        if ticks:
            ends = self._tick(time, ticks)
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
        function = endless[0].prefix + endless[0].update_word
        return ComponentError(
            f"{names}: {function}: expected event iteration to end, got another request after "
            f"{EVENT_ITERATIONS} iterations at time {time:.17g}.",
            instance=names,
            function=function,
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
    """Does an event reach this component's inputs? Other components have received them before their step."""
    return component.event_mode or component.event_times is not None
