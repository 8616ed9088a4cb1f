"""All zeros of a sum of sines in a turn, by certified subdivision: equations.md 4.3."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats

TURN = 2.0 * np.pi
SPLITS = 30
"""Halvings of a turn over the highest order after which a part with an undecided zero is left as it is."""
MOST_PARTS = 1_000_000
"""Number of parts of a turn above which the sum counts as zero throughout."""
BISECTIONS = 54
ROUNDING = 8.0 * np.finfo(float).eps
"""Rounding of a sum, over the sum of its amplitudes times one plus their phase's size."""


class ZeroThroughoutError(ArithmeticError):
    """A sum of sines is zero to rounding over a part of the turn."""


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
        """Return all zeros in [0, 2 pi), rad, ascending; two that rounding cannot separate count once.

        A part of the turn has no zero if its middle is farther from zero than the derivatives allow. It has at most one
        if the derivative keeps its sign. Other parts are halved.

        Raises
        ------
        ZeroThroughoutError
            The sum is zero to rounding over a part of the turn.

        Examples
        --------
        >>> one, none = np.array([1.0, 2.0]), np.zeros(2)
        >>> print(np.round(SumOfSines(0.0, one, np.array([0.0, 1.0]), none).zeros(), 9))
        [0.785398163 2.35619449  3.926990817 5.497787144]
        """
        size = np.hypot(self.cosine, self.sine)
        if not np.abs(self.level) <= size.sum():
            return []
        bend = float((self.order**2 * size).sum())
        rounding = ROUNDING * (abs(self.level) + float((size * (1.0 + TURN * self.order)).sum()))
        steep = rounding * float(self.order.max())
        first = 4.0 * float(self.order.max())
        parts, place, found = first, np.arange(first), []
        touching: list[Floats] = []
        for split in range(SPLITS + 1):
            half = 0.5 * TURN / parts
            value, slope = self.at((place + 0.5) * (TURN / parts))
            maybe = np.abs(value) <= half * np.abs(slope) + 0.5 * half**2 * bend + rounding
            monotonic = np.abs(slope) > half * bend + steep
            found += self._crossings(place[maybe & monotonic], parts)
            place = place[maybe & ~monotonic]
            if split == SPLITS or 0.5 * half**2 * bend <= rounding:
                touching.append(place)
                break
            place = np.concatenate([2.0 * place, 2.0 * place + 1.0])
            parts *= 2.0
            if place.size > MOST_PARTS:
                raise ZeroThroughoutError("orbit: expected isolated zeros of a sum of sines, got a zero sum.")
        found += self._touching(np.sort(np.concatenate(touching)), parts)
        return sorted(found)

    def _crossings(self, place: Floats, parts: float) -> list[float]:
        """Return the zeros in parts where the sum is monotonic: those whose ends have different signs."""
        low, high = place * (TURN / parts), (place + 1.0) * (TURN / parts)
        rising = self.at(low)[0] < 0.0
        crosses = rising != (self.at(high)[0] < 0.0)
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
                middle = (row + 0.5) * (TURN / parts)
                zeros.append(float(np.mod(middle[np.argmin(np.abs(self.at(middle)[0]))], TURN)))
        return zeros
