"""The input clocks of an importer's components: time events that the importer raises itself.

A clock of a constant or fixed interval ticks at `start + shift + k interval`. The step of all components ends there,
and the clock is set in event mode. A clock's variables are read and written while it ticks, and keep their values
between ticks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.clocks import InputClock
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.importer.component import SAME_INSTANT, Component


@dataclass(slots=True)
class _Clock:
    """One clock in a run: its interval, its first tick and its next tick, s."""

    component: Component
    declared: InputClock
    interval: Fraction = Fraction(1)
    first: Fraction = Fraction(0)
    count: int = 0
    next: float = math.inf

    def begin(self, start: float) -> None:
        """Start a run: in initialization mode an FMU gives the interval and shift that its description leaves open."""
        interval, shift = self.declared.interval, self.declared.shift
        if interval is None:
            instance = self.component.instance
            assert isinstance(instance, Instance3)
            known, delay = instance.clock_times(self.declared.reference)
            if not (math.isfinite(known) and known > 0.0 and math.isfinite(delay) and delay >= 0.0):
                raise self._error(f"an interval > 0 and a shift >= 0, got {known:g} s and {delay:g} s", start)
            interval, shift = Fraction(known), Fraction(delay)
        self.interval, self.first, self.count = interval, Fraction(start) + shift, 0
        self.next = float(self.first)

    def pass_tick(self, time: float) -> None:
        """Find the next tick after the one at `time`, s."""
        self.count += 1
        self.next = float(self.first + self.count * self.interval)
        if self.next <= time + _room(time):
            got = f"an interval that rounding does not lose, got {float(self.interval):.3g} s"
            raise self._error(got, time)

    def _error(self, what: str, time: float) -> ComponentError:
        return ComponentError(
            f"{self.component.name}: clock {self.declared.name}: expected {what} at time {time:.12g}.",
            instance=self.component.name,
            time=time,
        )


class Ticks:
    """The clocks of all components of an importer; `next` is the time of the next tick, s, infinite without clocks."""

    def __init__(self, components: Iterable[Component]) -> None:
        self._clocks = [_Clock(c, clock) for c in components for clock in c.capabilities.clocks]
        self._ticking: dict[str, tuple[Component, list[int]]] = {}
        self.next = math.inf

    def __bool__(self) -> bool:
        """Whether there is any clock."""
        return bool(self._clocks)

    def begin(self, start: float) -> None:
        """Start a run at `start`, s; its components are in initialization mode.

        ComponentError: a clock has no interval.
        """
        for clock in self._clocks:
            clock.begin(start)
        self._find_next()

    def are_due(self, time: float) -> bool:
        """Does a clock tick at `time`, s?"""
        return self.next <= time + _room(time)

    def set(self, time: float) -> None:
        """Let the due clocks tick; their components are in event mode.

        ComponentError: a component refuses, or an interval is lost in the rounding of the time.
        """
        self._ticking = {}
        for clock in self._clocks:
            if clock.next <= time + _room(time):
                found = self._ticking.setdefault(clock.component.name, (clock.component, []))
                found[1].append(clock.declared.reference)
                clock.pass_tick(time)
        for component, references in self._ticking.values():
            assert isinstance(component.instance, Instance3)
            component.instance.set_clocks(references)
            component.ticking = frozenset(references)
        self._find_next()

    def keep_values(self) -> None:
        """Read the variables of the clocks that tick: they keep these values until the next tick."""
        for component, _ in self._ticking.values():
            component.read_clocked()
            component.ticking = frozenset()

    def _find_next(self) -> None:
        self.next = min((clock.next for clock in self._clocks), default=math.inf)


def _room(time: float) -> float:
    return SAME_INSTANT * (1.0 + abs(time))
