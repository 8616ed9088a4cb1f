"""A ball on a shaken table in 40 digits: gravity 1, table at amplitude cos(w t + phase), bounce by bounce."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mpmath as mp

DIGITS = 60
"""Working digits: 40 are left after a sequence of bounces."""
SMALLEST = mp.mpf(10) ** -45
"""Relative speed below which the bounces have ended; those left over last less than the last digits of a time."""


@dataclass(frozen=True)
class Table:
    """A table, and the restitution of a ball on it."""

    amplitude: float
    w: float = 1.0
    phase: float = 0.0
    restitution: float = 0.5

    def turn(self, t: mp.mpf) -> mp.mpf:
        """Return the phase of the table, rad."""
        return mp.mpf(self.w) * t + mp.mpf(self.phase)

    def height(self, t: mp.mpf) -> mp.mpf:
        """Return the height of the table."""
        return mp.mpf(self.amplitude) * mp.cos(self.turn(t))

    def speed(self, t: mp.mpf) -> mp.mpf:
        """Return its speed upwards."""
        return -mp.mpf(self.amplitude) * self.w * mp.sin(self.turn(t))

    def take_off(self, t: mp.mpf) -> mp.mpf:
        """Return the first instant after t at which the table falls as fast as the ball: its acceleration is -1."""
        half = mp.acos(1 / (mp.mpf(self.amplitude) * mp.mpf(self.w) ** 2))
        turns = self.turn(t) / (2 * mp.pi)
        first = (2 * mp.pi * mp.floor(turns) - half - mp.mpf(self.phase)) / self.w
        period = 2 * mp.pi / mp.mpf(self.w)
        return next(first + k * period for k in range(3) if first + k * period > t)

    def presses(self, t: mp.mpf) -> bool:
        """Return whether a ball at rest on the table presses it."""
        return bool(1 - mp.mpf(self.w) ** 2 * self.height(t) > 0)


@dataclass(frozen=True)
class Bounce:
    """An impact, or the instant at which the ball comes to rest or takes off."""

    kind: str
    time: mp.mpf
    speed: mp.mpf


def events(table: Table, height: float, speed: float) -> Iterator[Bounce]:
    """Yield the events of a ball that starts above the table: impacts with the relative speed, rests, take-offs."""
    t, x, v = mp.mpf(0), mp.mpf(height), mp.mpf(speed)
    while True:
        hit = _next_hit(table, t, x, v)
        relative = table.speed(hit) - (v - (hit - t))
        t, x = hit, table.height(hit)
        if relative < SMALLEST and table.presses(t):
            yield Bounce("rest", t, relative)
            t = table.take_off(t)
            x, v = table.height(t), table.speed(t)
            yield Bounce("take-off", t, mp.mpf(0))
            continue
        yield Bounce("impact", t, relative)
        v = table.speed(t) + mp.mpf(table.restitution) * relative


def _next_hit(table: Table, t: mp.mpf, x: mp.mpf, v: mp.mpf) -> mp.mpf:
    """Return the first instant after t at which the ball is at the table, by a search in steps."""

    def gap(u: mp.mpf) -> mp.mpf:
        # over the time, and with differences of the table as products of sines: low bounces keep their digits
        half = mp.mpf(table.w) * u / 2
        moved = -2 * mp.mpf(table.amplitude) * mp.sin(table.turn(t) + half) * mp.sin(half)
        return (x - table.height(t)) / u + v - u / 2 - moved / u

    away, pull = v - table.speed(t), 1 - mp.mpf(table.w) ** 2 * table.height(t)
    low = mp.mpf("1e-3")
    if x == table.height(t) and away > 0 and pull > 0:
        low = min(low, away / pull)  # half of a low flight
    step = low
    while gap(low + step) > 0:
        low += step
        step = min(step * mp.mpf("1.1"), mp.mpf("0.02"))
    return t + _zero(gap, low, low + step)


def _zero(f: Callable[[mp.mpf], mp.mpf], low: mp.mpf, high: mp.mpf) -> mp.mpf:
    """Return the zero between two numbers, from f > 0 to f <= 0, to the working digits."""
    for _ in range(8):  # halvings, then secants
        middle = (low + high) / 2
        low, high = (middle, high) if f(middle) > 0 else (low, middle)
    before, after = low, high
    for _ in range(12):
        first, second = f(before), f(after)
        if second == first:
            break
        before, after = after, after - second * (after - before) / (second - first)
    return after
