"""Impacts of linear bodies in 40 digits, from their matrices: no modes, nothing of the package.

Displacements, velocities, the time and each sine are one linear system z' = A z. Its flow over a step is a matrix
exponential. Where a gap may close within a step, the Taylor series of the gap has the instant as its root.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count, pairwise
from typing import TypeAlias

import mpmath as mp
import numpy as np
from scipy.optimize import brentq

DIGITS = 70
"""Working digits: 40 are left where a stop is grazed."""
STEP = 0.8
"""Step times the fastest rate: gaps have at most one peak in it."""
PARTS = 16
"""Parts of a step between which the sign of a gap is looked at."""
MOST_ROUNDS = 80
"""Rounds of Newton's method, one digit each at a graze at least."""

Number: TypeAlias = float | mp.mpf
Row = list[mp.mpf]


@dataclass(frozen=True)
class ExactSine:
    """Forces on the coordinates, forces cos(angular_frequency t + phase); constant with the frequency 0."""

    forces: Sequence[Number]
    angular_frequency: Number = 0.0
    phase: Number = 0.0


@dataclass(frozen=True)
class ExactBody:
    """The equations of motion mass x'' + damping x' + stiffness x = sum of the sines.

    Attributes
    ----------
    mass, damping, stiffness : sequence of sequence of mpf, shape (n, n)
    sines : sequence of ExactSine
    displacement, velocity : sequence of mpf, shape (n,)
        Start at time 0.
    """

    mass: Sequence[Sequence[Number]]
    damping: Sequence[Sequence[Number]]
    stiffness: Sequence[Sequence[Number]]
    sines: Sequence[ExactSine]
    displacement: Sequence[Number]
    velocity: Sequence[Number]


@dataclass(frozen=True)
class ExactStop:
    """A limit of row . x from above, position + speed t + amplitude cos(angular_frequency t + phase).

    It is rigid where its stiffness is 0. The row of a lower stop, and its position, have the other sign. The row of two
    points that hit each other is the difference of theirs.
    """

    row: Sequence[Number]
    position: Number
    restitution: Number = 0.0
    stiffness: Number = 0.0
    damping: Number = 0.0
    speed: Number = 0.0
    amplitude: Number = 0.0
    angular_frequency: Number = 0.0
    phase: Number = 0.0


@dataclass(frozen=True)
class ExactImpact:
    """An impact, or the touch-down on a stop that yields; `contact` counts from 1."""

    time: mp.mpf
    velocity: mp.mpf
    contact: int


def diagonal(numbers: Sequence[Number]) -> list[list[Number]]:
    """Return a diagonal matrix.

    >>> diagonal([1.0, 2.0])
    [[1.0, 0.0], [0.0, 2.0]]
    """
    return [[a if i == j else 0.0 for j in range(len(numbers))] for i, a in enumerate(numbers)]


class _Flow:
    """A linear system z' = A z: its flow over one step, and Taylor series within it."""

    def __init__(self, matrix: list[Row]) -> None:
        self.matrix = matrix
        rates = np.linalg.eigvals(np.array([[float(a) for a in row] for row in matrix]))
        self.step = mp.mpf(STEP / max(1e-3, float(np.abs(rates).max())))
        size = len(matrix)
        columns = [self.moved([mp.mpf(i == j) for i in range(size)], self.step) for j in range(size)]
        self._over = [list(row) for row in zip(*columns, strict=True)]

    def series(self, z: Row, time: mp.mpf) -> list[Row]:
        """Return the Taylor terms of the states at parts of `time`, in powers of the part."""
        terms, least = [z], mp.mpf(10) ** -(DIGITS + 5) * max(map(abs, z))
        for k in count(1):
            terms.append([mp.fdot(row, terms[-1]) * time / k for row in self.matrix])
            if k > 3 and max(map(abs, terms[-1])) <= least:
                return terms
        raise AssertionError

    def moved(self, z: Row, time: mp.mpf) -> Row:
        """Return the state after a time of a step at most."""
        return [mp.fsum(each) for each in zip(*self.series(z, time), strict=True)]

    def step_on(self, z: Row) -> Row:
        """Return the state after one step."""
        return [mp.fdot(row, z) for row in self._over]


class ExactMotion:
    """A body with its stops, followed from time 0, impact by impact."""

    def __init__(self, body: ExactBody, stops: Sequence[ExactStop]) -> None:
        with mp.workdps(DIGITS):
            self._n, self._stops, self._pressed = len(body.displacement), stops, frozenset[int]()
            self._flows: dict[frozenset[int], _Flow] = {}
            waves: list[ExactSine | ExactStop] = [*body.sines, *(stop for stop in stops if stop.amplitude)]
            self._inverse = mp.matrix(body.mass) ** -1
            self._free = self._matrix(body, [mp.mpf(wave.angular_frequency) for wave in waves])
            self.time = mp.mpf(0)
            self.z = [mp.mpf(x) for x in (*body.displacement, *body.velocity, 1, 0)]
            self.z += [f(mp.mpf(wave.phase)) for wave in waves for f in (mp.cos, mp.sin)]
            self._gaps = [self._gap(stop, waves) for stop in stops]
            self._rates = [_times(gap, self._free) for gap in self._gaps]

    def _matrix(self, body: ExactBody, frequencies: Sequence[mp.mpf]) -> list[Row]:
        n, size, inverse = self._n, 2 * self._n + 2 + 2 * len(frequencies), self._inverse
        springs, dashpots = inverse * mp.matrix(body.stiffness), inverse * mp.matrix(body.damping)
        found = [[mp.mpf(0)] * size for _ in range(size)]
        for i in range(n):
            found[i][n + i] = mp.mpf(1)
            found[n + i][: 2 * n] = [-m[i, j] for m in (springs, dashpots) for j in range(n)]
        for k, sine in enumerate(body.sines):
            for i, pull in enumerate(inverse * mp.matrix(sine.forces)):
                found[n + i][2 * n + 2 + 2 * k] = pull
        found[2 * n + 1][2 * n] = mp.mpf(1)
        for k, w in enumerate(frequencies, start=n + 1):
            found[2 * k][2 * k + 1], found[2 * k + 1][2 * k] = -w, w
        return found

    def _gap(self, stop: ExactStop, waves: Sequence[ExactSine | ExactStop]) -> Row:
        """Return the row of the state that is how far a point is beyond its stop."""
        row = [mp.mpf(0)] * len(self.z)
        row[: self._n] = [mp.mpf(a) for a in stop.row]
        row[2 * self._n], row[2 * self._n + 1] = -mp.mpf(stop.position), -mp.mpf(stop.speed)
        if stop.amplitude:
            row[2 * self._n + 2 + 2 * waves.index(stop)] = -mp.mpf(stop.amplitude)
        return row

    def _force(self, k: int) -> Row:
        """Return the row of the state that is the force of a stop that yields."""
        stop = self._stops[k]
        c, d = mp.mpf(stop.stiffness), mp.mpf(stop.damping)
        return [c * gap + d * rate for gap, rate in zip(self._gaps[k], self._rates[k], strict=True)]

    def _kick(self, k: int) -> Row:
        """Return the velocities that a unit impulse away from a stop makes."""
        return [-a for a in self._inverse * mp.matrix([mp.mpf(a) for a in self._stops[k].row])]

    @property
    def _flow(self) -> _Flow:
        if self._pressed not in self._flows:
            matrix = [list(row) for row in self._free]
            for k in self._pressed:
                force = self._force(k)
                for i, kick in enumerate(self._kick(k)):
                    matrix[self._n + i] = [
                        a + kick * b for a, b in zip(matrix[self._n + i], force, strict=True)
                    ]
            self._flows[self._pressed] = _Flow(matrix)
        return self._flows[self._pressed]

    def next_impact(self, end: Number = 1e9) -> ExactImpact | None:
        """Go on to the next impact, or touch-down, and through it; None where it is after `end`."""
        with mp.workdps(DIGITS):
            while self.time < end:
                flow, found = self._flow, None
                time = min(flow.step, mp.mpf(end) - self.time)
                after = flow.step_on(self.z) if time == flow.step else flow.moved(self.z, time)
                events = [(self._first_rise(row, time, after), k) for k, row in self._watched()]
                found = min((each for each in events if each[0] is not None), default=None)
                if found is None:
                    self.z, self.time = after, self.time + time
                    continue
                part, k = found
                self.z, self.time = flow.moved(self.z, part * time), self.time + part * time
                if k in self._pressed:
                    self._pressed -= {k}
                    continue
                return self._meet(k)
        return None

    def _watched(self) -> list[tuple[int, Row]]:
        """Return the rows whose rise through 0 is an event: gaps, and forces that end, with the sign changed."""
        return [
            (k, [-a for a in self._force(k)] if k in self._pressed else gap)
            for k, gap in enumerate(self._gaps)
        ]

    def _first_rise(self, row: Row, time: mp.mpf, after: Row) -> mp.mpf | None:
        """Return the part of a step after which a row of the state first rises through 0; None if it does not."""
        rate = _times(row, self._flow.matrix)
        start, slope = mp.fdot(row, self.z), mp.fdot(rate, self.z)
        size = mp.fsum(abs(a * b) for a, b in zip(row, self.z, strict=True))
        leaves = abs(start) <= mp.mpf(10) ** -(DIGITS - 12) * size and slope < 0
        peaks = slope > 0 > mp.fdot(rate, after)
        if mp.fdot(row, after) < 0 and not peaks and not leaves:
            return None
        series = [mp.fdot(row, term) for term in self._flow.series(self.z, time)]
        series = series[1:] if leaves else series  # divided by the time: without the root at its start
        return _rise_of(series[::-1])

    def _meet(self, k: int) -> ExactImpact:
        velocity, stop = mp.fdot(self._rates[k], self.z), self._stops[k]
        if stop.stiffness:
            self._pressed |= {k}
        else:
            kick = self._kick(k)
            mobility = -mp.fdot([mp.mpf(a) for a in stop.row], kick)
            impulse = (1 + mp.mpf(stop.restitution)) * velocity / mobility
            for i, each in enumerate(kick, start=self._n):
                self.z[i] += impulse * each
        return ExactImpact(self.time, velocity, k + 1)

    def at(self, time: Number) -> tuple[Row, Row]:
        """Go on to a time, without an impact in between; return displacements and velocities."""
        found = self.next_impact(time)
        assert found is None, found
        return self.z[: self._n], self.z[self._n : 2 * self._n]


def _times(row: Row, matrix: list[Row]) -> Row:
    return [mp.fdot(row, column) for column in zip(*matrix, strict=True)]


def _rise_of(series: list[mp.mpf]) -> mp.mpf | None:
    """Return the first rise through 0 of a polynomial between 0 and 1, highest power first, by Newton from floats."""
    rough = np.poly1d([float(a) for a in series])
    places = np.linspace(0.0, 1.0, PARTS + 1)
    values, slopes = rough(places), rough.deriv()(places)
    for k, (low, high) in enumerate(pairwise(places)):
        if values[k] >= 0.0:
            continue
        if values[k + 1] < 0.0 and slopes[k] > 0.0 > slopes[k + 1]:
            high = brentq(rough.deriv(), low, high)
        if rough(high) >= 0.0:
            return _newton(series, mp.mpf(brentq(rough, low, high, xtol=1e-16)))
    return None


def _newton(series: list[mp.mpf], root: mp.mpf) -> mp.mpf:
    for _ in range(MOST_ROUNDS):
        value, slope = mp.polyval(series, root, derivative=True)
        root -= value / slope
        if abs(value / slope) < mp.mpf(10) ** -(DIGITS - 20):
            return root
    raise AssertionError(f"no root near {root}")
