"""Cut a displacement into parabolas: the flights of a body under a constant force.

A flight is a parabola from end to end, so all its samples determine its start and end. A kink has only the samples
around it. With few samples in a flight, or in strong noise, parabolas are clear where kinks are not.

The best cut has the least cost: the sum of squared residuals of one parabola for each piece, plus a price for each
piece. Dynamic programming finds it (optimal partitioning, Jackson et al. 2005). Long records are cut on means of
neighbouring samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.estimation.physics import Floats

# Number of points on which a record is cut; the cost grows with its square (0.05 s at this number).
_MOST_POINTS = 500
# Smallest number of points in a piece: one more than the coefficients of a parabola.
FEWEST_IN_PIECE = 4
# Price of a piece, in variances of the noise: by chance, a second parabola saves more in 1 of 10,000 cases.
_PIECE_PENALTY = 24.0
# Factors of the noise for repeated cuts: coloured noise and contacts of some length look like more pieces.
_FACTORS = (1.0, 2.0, 4.0, 8.0)
# Smallest noise for a cut, relative to the range; below it sums of squares are rounded.
_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Points:
    """Means of neighbouring samples, on which a record is cut."""

    time: Floats
    values: Floats
    """Values in the unit of the displacement; both arrays have shape (point,), time in s."""
    size: int
    """Samples in a mean; with several samples, a mean may contain both sides of an impact."""

    @property
    def skipped(self) -> int:
        """Points at the start of a piece that may belong to the piece before it."""
        return 0 if self.size == 1 else 1


@dataclass(frozen=True, slots=True)
class Piece:
    """Neighbouring points, `end` excluded, that one parabola follows."""

    first: int
    end: int
    coefficients: Floats
    """Coefficients of 1, t - middle, (t - middle)^2; the middle is in s."""
    middle: float
    square: float
    """Sum of squared residuals."""

    @property
    def count(self) -> int:
        """Number of points."""
        return self.end - self.first

    @property
    def bend(self) -> float:
        """Second derivative, unit of the displacement per s^2."""
        return 2.0 * float(self.coefficients[2])

    def at(self, time: float) -> tuple[float, float]:
        """Return displacement and velocity at an instant."""
        level, slope, half = map(float, self.coefficients)
        since = time - self.middle
        return level + (slope + half * since) * since, slope + 2.0 * half * since


def points_of(time: Floats, values: Floats) -> Points:
    """Return means of neighbouring samples, at most 500 of them."""
    size = -(-len(time) // _MOST_POINTS)
    whole = len(time) // size * size
    means = [np.mean(one[:whole].reshape(-1, size), axis=1) for one in (time, values)]
    return Points(means[0], means[1], size)


def cuts(points: Points, noise: float) -> list[list[Piece]]:
    """Return the pieces of a record for each factor that multiplies its noise (standard deviation of a sample)."""
    if len(points.time) < FEWEST_IN_PIECE:
        return []
    least = _ROUNDING * float(np.ptp(points.values))
    variance = noise**2 / points.size + least**2
    penalties = _PIECE_PENALTY * variance * np.square(_FACTORS)
    ends = [_traced(row, points.skipped) for row in _cheapest(points, penalties)]
    different = [one for k, one in enumerate(ends) if one not in ends[:k]]
    return [[piece_of(points, first, end) for first, end in one] for one in different]


def piece_of(points: Points, first: int, end: int) -> Piece:
    """Return the parabola through points first to end - 1."""
    time, values = points.time[first:end], points.values[first:end]
    middle = 0.5 * float(time[0] + time[-1])
    vander = np.vander(time - middle, 3, increasing=True)
    coefficients = np.asarray(np.linalg.lstsq(vander, values, rcond=None)[0], dtype=np.float64)
    residual = values - vander @ coefficients
    return Piece(first, end, coefficients, middle, float(residual @ residual))


def _traced(before: NDArray[np.intp], skipped: int) -> list[tuple[int, int]]:
    """Return the start and end of each piece of a cut, followed backwards from the last end."""
    ends, end = [], len(before) - 1
    while end > 0:
        start = int(before[end])
        ends.append((start + (skipped if start else 0), end))
        end = start
    return ends[::-1]


def _cheapest(points: Points, penalties: Floats) -> NDArray[np.intp]:
    """Return the start of the last piece in the cheapest cut up to each end, for each price."""
    count = len(points.time)
    cost = np.full((len(penalties), count + 1), np.inf)
    cost[:, 0] = 0.0
    before = np.zeros(cost.shape, dtype=np.intp)
    for start in range(count - FEWEST_IN_PIECE + 1):
        first = start + (points.skipped if start else 0)
        squares = _squares(points.time[first:], points.values[first:])
        ends = slice(first + FEWEST_IN_PIECE, count + 1)
        trial = cost[:, start, None] + squares + penalties[:, None]
        cheaper = trial < cost[:, ends]
        cost[:, ends] = np.where(cheaper, trial, cost[:, ends])
        before[:, ends] = np.where(cheaper, start, before[:, ends])
    return before


def _squares(time: Floats, values: Floats) -> Floats:
    """Return the sums of squared residuals of parabolas through the first 4, 5, ... points.

    Moments of time are scaled to the length of each piece; the parabola is eliminated term by term.
    """
    last = slice(FEWEST_IN_PIECE - 1, None)
    since, level = time - time[0], values - values[0]
    length = since[last]
    count = np.arange(float(FEWEST_IN_PIECE), len(time) + 1.0)
    powers = [since, since**2, since**3, since**4]
    m1, m2, m3, m4 = (np.cumsum(one)[last] / length**k for k, one in enumerate(powers, 1))
    b0, b1, b2 = (np.cumsum(level * one)[last] / length**k for k, one in enumerate((1.0, since, powers[1])))
    # 1 is eliminated from t and t^2, then t from t^2
    v11, v12, v22 = m2 - m1 * m1 / count, m3 - m1 * m2 / count, m4 - m2 * m2 / count
    c1, c2 = b1 - m1 * b0 / count, b2 - m2 * b0 / count
    v22, c2 = v22 - v12 * v12 / v11, c2 - v12 * c1 / v11
    left = np.cumsum(level**2)[last] - b0 * b0 / count - c1 * c1 / v11 - c2 * c2 / v22
    found: Floats = np.maximum(left, 0.0)
    return found
