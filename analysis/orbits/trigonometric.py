"""All zeros of a sum of sines in a turn, by certified subdivision: equations.md 4.3."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats

TURN = 2.0 * np.pi
SPLITS = 30
"""Largest number of halvings of a part; rounding is reached before."""
MOST_PARTS = 1_000_000
"""Number of undecided parts above which they are not halved: zeros of so high a multiplicity hardly have a place."""
BISECTIONS = 54
EXTREMUM_STEPS = 4
ROUNDING = 8.0 * np.finfo(float).eps
"""Rounding of a sum, over the sum of its amplitudes times one plus their phase's size."""


@dataclass(frozen=True, eq=False)
class SumOfSines:
    """level + cosine cos(order phase) + sine sin(order phase), summed over the orders.

    Attributes
    ----------
    level : float
    order, cosine, sine : array, shape (harmonics,)
        Whole numbers from 1; coefficients in the unit of the level.
    """

    level: float
    order: Floats
    cosine: Floats
    sine: Floats

    def at(self, phase: Floats) -> tuple[Floats, Floats]:
        """Return the sum and its derivative at phases, rad."""
        value, slope = np.full_like(phase, self.level), np.zeros_like(phase)
        for order, cosine, sine in zip(self.order, self.cosine, self.sine, strict=True):
            c, s = np.cos(order * phase), np.sin(order * phase)
            value += cosine * c + sine * s
            slope += order * (sine * c - cosine * s)
        return value, slope

    def zeros(self) -> list[float]:
        """Return all zeros in [0, 2 pi), rad, ascending; none where the sum is zero throughout.

        A part of the turn has no zero if its middle is farther from zero than the derivatives allow. It has at most one
        if the derivative keeps its sign. Other parts are halved. Two zeros that rounding cannot separate count once.

        Examples
        --------
        >>> one, none = np.array([1.0, 2.0]), np.zeros(2)
        >>> [round(float(zero), 6) for zero in SumOfSines(0.0, one, np.array([0.0, 1.0]), none).zeros()]
        [0.785398, 2.356194, 3.926991, 5.497787]
        """
        size = np.hypot(self.cosine, self.sine)
        if not np.abs(self.level) <= size.sum():
            return []
        bend = float((self.order**2 * size).sum())
        rounding = ROUNDING * (abs(self.level) + float((size * (1.0 + TURN * self.order)).sum()))
        steep = rounding * float(self.order.max())
        first = 4.0 * float(self.order.max())
        parts, place, found = first, np.arange(first), []
        for _ in range(SPLITS):
            half = 0.5 * TURN / parts
            value, slope = self.at((place + 0.5) * (TURN / parts))
            maybe = np.abs(value) <= half * np.abs(slope) + 0.5 * half**2 * bend + rounding
            monotonic = np.abs(slope) > half * bend + steep
            found += self._crossings(place[maybe & monotonic], parts)
            place = place[maybe & ~monotonic]
            if not place.size:
                return sorted(found)
            if 0.5 * half**2 * bend <= rounding:
                break
            place = np.concatenate([2.0 * place, 2.0 * place + 1.0])
            parts *= 2.0
            if place.size > MOST_PARTS:
                break
        if place.size == parts:
            return []
        return sorted([*found, *self._touching(np.sort(place), parts)])

    def _crossings(self, place: Floats, parts: float) -> list[float]:
        """Return the zeros in parts where the sum is monotonic: those whose ends have different signs."""
        low, high = place * (TURN / parts), (place + 1.0) * (TURN / parts)
        rising = self.at(low)[0] < 0.0
        # the end of the turn has the value of its start, so that a zero between two parts counts once
        crosses = rising != (self.at(np.mod(place + 1.0, parts) * (TURN / parts))[0] < 0.0)
        if not crosses.any():
            return []
        low, high, rising = low[crosses], high[crosses], rising[crosses]
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            before = (self.at(middle)[0] < 0.0) == rising
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return [float(np.mod(each, TURN)) for each in 0.5 * (low + high)]

    def _touching(self, place: Floats, parts: float) -> list[float]:
        """Return one zero for each row of neighbouring parts where the sum is zero to rounding, and hardly changes."""
        rows: list[NDArray[np.float64]] = np.split(place, np.flatnonzero(np.diff(place) > 1.0) + 1)
        if len(rows) > 1 and rows[0][0] == 0.0 and rows[-1][-1] == parts - 1.0:  # a row across phase 0
            rows = [np.concatenate([rows[-1] - parts, rows[0]]), *rows[1:-1]]
        zeros = []
        for row in rows:
            if row.size:
                low, high = row[0] * (TURN / parts), (row[-1] + 1.0) * (TURN / parts)
                zeros.append(float(np.mod(self._extremum(0.5 * (low + high), low, high), TURN)))
        return zeros

    def _extremum(self, phase: float, low: float, high: float) -> float:
        """Return the extremum near a phase, within bounds, by Newton's method for the derivative."""
        for _ in range(EXTREMUM_STEPS):
            c, s = np.cos(self.order * phase), np.sin(self.order * phase)
            slope = float((self.order * (self.sine * c - self.cosine * s)).sum())
            bend = -float((self.order**2 * (self.cosine * c + self.sine * s)).sum())
            if bend == 0.0:
                break
            phase = min(max(phase - slope / bend, low), high)
        return phase
