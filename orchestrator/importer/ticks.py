"""The clocks of an importer's components (FMI 3.0, 2.2.8.3): time events that the importer raises, and their triggers.

A timed clock is an input. It ticks at the instants that its FMU or its description gives; the step of all components
ends there. A triggered output clock ticks by itself in event mode, and so do the input clocks that it is connected to,
at the same instant. A clock's variables are read and written while it ticks, and keep their values between ticks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.clock_calls import ClockedInstance, Interval
from vibroimpact.orchestrator.fmi.clocks import CHANGING, COUNTDOWN, TUNABLE, Clock
from vibroimpact.orchestrator.importer.component import SAME_INSTANT, Component
from vibroimpact.orchestrator.importer.described import kind_of
from vibroimpact.orchestrator.importer.specification import ConnectionSpec


def joins_clocks(connection: ConnectionSpec, components: Mapping[str, Component]) -> bool:
    """Does the connection lead from a clock to a clock?"""
    owner, name = connection.source
    return kind_of(components[owner].variables[name]) == "Clock"


@dataclass(slots=True)
class _Timed:
    """One timed clock in a run: its interval, its first tick and its next tick, s.

    A periodic clock ticks at `first + count * interval`.
    """

    component: Component
    declared: Clock
    interval: Fraction = Fraction(1)
    first: Fraction = Fraction(0)
    count: int = 0
    next: float = math.inf
    has_ticked: bool = False
    """It has ticked since its FMU was last asked for an interval."""

    def begin(self, start: float) -> None:
        """Start a run: in initialization mode an FMU gives the intervals that its description leaves open."""
        self.next, self.has_ticked = math.inf, False
        if not self.declared.is_periodic:
            self._schedule(start, is_first=True)
            return
        interval, shift = self.declared.interval, self.declared.shift
        if interval is None:
            instance, reference = instance_of(self.component), self.declared.reference
            known, qualifier = instance.clock_interval(reference)
            known = math.nan if qualifier is Interval.not_yet_known else known
            delay = instance.clock_shift(reference)
            if not (math.isfinite(known) and known > 0.0 and math.isfinite(delay) and delay >= 0.0):
                raise self.error(f"an interval > 0 and a shift >= 0, got {known:g} s and {delay:g} s", start)
            interval, shift = Fraction(known), Fraction(delay)
        self.interval, self.first, self.count = interval, Fraction(start) + shift, 0
        self.next = float(self.first)

    def pass_tick(self, time: float) -> None:
        """Note the tick at `time`, s, and find the next one, if it is known already."""
        self.has_ticked = True
        if not self.declared.is_periodic:
            self.next = math.inf
            return
        self.count += 1
        self.next = float(self.first + self.count * self.interval)
        if self.next <= time + room_of(time):
            got = f"an interval that rounding does not lose, got {float(self.interval):.3g} s"
            raise self.error(got, time)

    def look(self, time: float) -> None:
        """Ask the FMU for its interval after an event iteration at `time`, s, where the interval may have changed."""
        kind = self.declared.variability
        if kind == TUNABLE and self.declared.interval is None:
            self._retune(time)
        elif kind == COUNTDOWN or (kind == CHANGING and self.has_ticked):
            self._schedule(time, is_first=False)
        self.has_ticked = False

    def _retune(self, time: float) -> None:
        known, qualifier = instance_of(self.component).clock_interval(self.declared.reference)
        if qualifier is not Interval.changed or known == float(self.interval):
            return
        if not (math.isfinite(known) and known > 0.0):
            raise self.error(f"an interval > 0, got {known:g} s", time)
        # a new interval counts from the present event, not from the last tick
        self.interval, self.first, self.count = Fraction(known), Fraction(time), 1
        self.next = float(self.first + self.interval)

    def _schedule(self, time: float, *, is_first: bool) -> None:
        known, qualifier = instance_of(self.component).clock_interval(self.declared.reference)
        is_open = self.declared.variability == COUNTDOWN
        if is_open and qualifier is Interval.not_yet_known:
            self.next = math.inf
        elif qualifier is Interval.changed or (is_first and qualifier is Interval.unchanged) or not is_open:
            if qualifier is Interval.not_yet_known or not (math.isfinite(known) and known >= 0.0):
                got = "none" if qualifier is Interval.not_yet_known else f"{known:g} s"
                raise self.error(f"an interval >= 0, got {got}", time)
            self.next = float(Fraction(time) + Fraction(known))

    def error(self, what: str, time: float) -> ComponentError:
        """Return the error that the clock was expected to have something at `time`, s."""
        return ComponentError(
            f"{self.component.name}: clock {self.declared.name}: expected {what} at time {time:.12g}.",
            instance=self.component.name,
            time=time,
        )


class Ticks:
    """The clocks of all components of an importer; `next` is the time of the next known tick, s, or infinite.

    Parameters
    ----------
    components : iterable of Component
        All components.
    connections : sequence of ConnectionSpec
        The connections between clocks.
    """

    def __init__(self, components: Iterable[Component], connections: Sequence[ConnectionSpec] = ()) -> None:
        clocked = [component for component in components if component.capabilities.clocks]
        self._components = clocked
        clocks = {(c.name, clock.name): (c, clock) for c in clocked for clock in c.capabilities.clocks}
        self._timed = [_Timed(c, clock) for c, clock in clocks.values() if clock.is_timed]
        self._fed = {
            source: [clocks[c.target] for c in connections if c.source == source]
            for source, (_, clock) in clocks.items()
            if not clock.is_input
        }
        self._outputs = [clocks[source] for source in self._fed]
        reached = {c.target for c in connections}
        self._idle = [
            f"{owner}.{name}"
            for (owner, name), (_, clock) in clocks.items()
            if clock.is_input and not clock.is_timed and (owner, name) not in reached
        ]
        self.next = math.inf

    def __bool__(self) -> bool:
        """Whether there is any clock."""
        return bool(self._components)

    def begin(self, start: float) -> None:
        """Start a run at `start`, s; its components are in initialization mode.

        ComponentError: a clock has no interval.
        """
        for clock in self._timed:
            clock.begin(start)
        self._find_next()

    def are_due(self, time: float) -> bool:
        """Does a timed clock tick at `time`, s?"""
        return self.next <= time + room_of(time)

    def set(self, time: float) -> None:
        """Let the due clocks tick; their components are in event mode.

        ComponentError: a component refuses, or an interval is lost in the rounding of the time.
        """
        ticking: dict[str, tuple[Component, list[int]]] = {}
        for clock in self._timed:
            if clock.next <= time + room_of(time):
                found = ticking.setdefault(clock.component.name, (clock.component, []))
                found[1].append(clock.declared.reference)
                clock.pass_tick(time)
        for component, references in ticking.values():
            instance_of(component).set_clocks(references)
            component.ticking = frozenset(references)
        self._find_next()

    def trigger(self) -> bool:
        """Find the output clocks that tick, and let their input clocks tick; return whether any was found."""
        found = False
        for component, clock in self._outputs:
            own = component.ticking or frozenset()
            if clock.reference in own or (clock.gates and clock.gates.isdisjoint(own)):
                continue
            if not instance_of(component).has_ticked(clock.reference):
                continue
            found = True
            component.ticking = own | {clock.reference}
            for target, fed in self._fed[component.name, clock.name]:
                others = target.ticking or frozenset()
                if fed.reference not in others:
                    instance_of(target).set_clocks([fed.reference])
                    target.ticking = others | {fed.reference}
        return found

    def keep_values(self) -> None:
        """Read the variables of the clocks that tick: they keep these values until the next tick."""
        for component in self._components:
            if component.ticking:
                component.read_clocked()
            component.ticking = frozenset()

    def look(self, time: float, component: Component | None = None) -> None:
        """Ask for the intervals that an event iteration at `time`, s, of one component or of all may have changed."""
        for clock in self._timed:
            if component is None or clock.component is component:
                clock.look(time)
        self._find_next()

    def endless_error(self, time: float, iterations: int) -> ComponentError:
        """Return the error of a clock that ticks at `time`, s, again and again."""
        clock = min(self._timed, key=lambda each: each.next)
        return clock.error(f"ticks that end, got {iterations} at one instant", time)

    def remarks(self) -> list[str]:
        """Return the remarks on clocks that never tick."""
        return [
            f"the triggered input clock {name} is connected to none, and never ticks" for name in self._idle
        ]

    def _find_next(self) -> None:
        self.next = min((clock.next for clock in self._timed), default=math.inf)


def instance_of(component: Component) -> ClockedInstance:
    """Return the instance of a component with clocks."""
    assert isinstance(component.instance, ClockedInstance)
    return component.instance


def room_of(time: float) -> float:
    """Return the distance, s, up to which an instant counts as `time`, s."""
    return SAME_INSTANT * (1.0 + abs(time))
