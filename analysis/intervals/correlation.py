"""Correlation sums of delay vectors, and their slope against the radius (thesis 5.4.2).

C(eps) is the share of pairs of delay vectors (x_i, ..., x_{i+m-1}) nearer than eps in the max norm. Its logarithmic
slope is the correlation dimension if it is constant over a range of radii and stops growing with m. The C function
behind `fmus.core` counts the pairs exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.intervals.trains import Floats, Span
from vibroimpact.fmus.core import MOST_RADII, RADII_PER_OCTAVE, near_pairs, radius_ladder
from vibroimpact.fmus.errors import EstimationError

# Range of C in which a slope is fitted; smallest number of pairs at a radius, and of radii, for a slope.
WINDOW: Span = (1e-3, 1e-1)
FEWEST_PAIRS, FEWEST_RADII = 30, 3
# Number of radii on either side in a local slope: a quarter of an octave each way.
REACH = 2
_OCTAVES = (MOST_RADII - 6) // RADII_PER_OCTAVE


@dataclass(frozen=True, slots=True)
class CorrelationSums:
    """Near pairs of delay vectors.

    Attributes
    ----------
    radii : ndarray of float, shape (radius,)
        In the unit of the values, ascending.
    near : ndarray of int, shape (embedding, radius)
        Number of pairs nearer than the radius, for m = 1, 2, ...
    pairs : ndarray of int, shape (embedding,)
        Number of all pairs.
    """

    radii: Floats
    near: NDArray[np.int64]
    pairs: NDArray[np.int64]

    @property
    def sums(self) -> Floats:
        """C, shape (embedding, radius)."""
        return np.asarray(self.near / self.pairs[:, None])

    @property
    def local_slopes(self) -> Floats:
        """d ln C / d ln eps over half an octave about each radius, shape (embedding, radius).

        NaN where there is no pair, or where the ladder of radii ends.
        """
        slopes = np.full(self.near.shape, np.nan)
        wide, narrow = self.near[:, 2 * REACH :], self.near[:, : -2 * REACH]
        step = np.log(self.radii[2 * REACH :] / self.radii[: -2 * REACH])
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes[:, REACH:-REACH] = np.where(narrow > 0, np.log(wide / narrow) / step, np.nan)
        return slopes


def correlation_sums(
    values: Floats, embedding: int, *, theiler: int = 0, radii: Floats | None = None
) -> CorrelationSums:
    """Count the near pairs of the delay vectors of a sequence.

    Parameters
    ----------
    values : ndarray of float, shape (n,)
        x; no vector crosses a NaN.
    embedding : int
        Largest m, 1 to 16.
    theiler : int
        Pairs i < j with j - i <= `theiler` do not count; 0: all pairs of different vectors count. Use at least 1 for
        maps, and a few correlation times for samples of a flow.
    radii : ndarray of float, optional
        From `fmus.core.radius_ladder`; by default 15 octaves down from the range of the values.

    Raises
    ------
    EstimationError
        The values are all equal, or too few for a pair.

    Examples
    --------
    >>> sums = correlation_sums(np.random.default_rng(1).random(2000), 2)
    >>> bool(np.all(np.abs(fitted_slopes(sums) - [1.0, 2.0]) < 0.1))
    True
    """
    if radii is None:
        radii = _usual_radii(values)
    pairs = np.array([count_pairs(np.isfinite(values), m, theiler) for m in range(1, embedding + 1)])
    if pairs[-1] < 1:
        raise EstimationError(
            f"correlation sums: expected values for at least one pair of vectors of {embedding}, got {len(values)}."
        )
    return CorrelationSums(radii, near_pairs(values, radii, embedding, window=theiler), pairs)


def fitted_slopes(sums: CorrelationSums, *, above: float = 0.0, window: Span = WINDOW) -> Floats:
    """Return the slope of ln C against ln eps where C is in a window, for every embedding.

    The fit is by least squares over the radii whose C lies in the window, with at least 30 pairs each. Radii below
    `above`, for example below the grid of the values, do not count. The slope is 0 if C is constant over the lowest
    octave and not below the window, as for a finite number of points. It is NaN if fewer than three radii lie in the
    window; radii between the same steps of a grid count once.
    """
    return np.array([_fitted_slope(sums, place, above, window) for place in range(len(sums.pairs))])


def _fitted_slope(sums: CorrelationSums, place: int, above: float, window: Span) -> float:
    near, share = sums.near[place], sums.sums[place]
    usable = sums.radii >= above
    # a finite number of points: C stays at the share of equal pairs, however small the radius
    lowest = near[usable][: RADII_PER_OCTAVE + 1]
    if share[usable][0] >= window[0] and np.all(lowest == lowest[0]):
        return 0.0
    chosen = usable & (share >= window[0]) & (share <= window[1]) & (near >= FEWEST_PAIRS)
    # between two steps of a grid C is constant, and many radii count as one
    enough = len(np.unique(near[chosen])) if above > 0.0 else np.count_nonzero(chosen)
    if enough < FEWEST_RADII:
        return float("nan")
    return float(np.polyfit(np.log(sums.radii[chosen]), np.log(share[chosen]), 1)[0])


def _usual_radii(values: Floats) -> Floats:
    low, high = np.nanmin(values), np.nanmax(values)
    spread = float(high - low)
    if not spread > 0.0:
        raise EstimationError(
            f"correlation sums: expected values that differ, got all {low:g}. They are one point, of dimension 0."
        )
    return radius_ladder(spread * 2.0**-_OCTAVES, spread * (1.0 + 1e-12))


def count_pairs(known: NDArray[np.bool_], embedding: int, theiler: int) -> int:
    """Return the number of pairs of whole delay vectors more than `theiler` places apart."""
    if len(known) < embedding:
        return 0
    whole: NDArray[np.bool_] = np.all(np.lib.stride_tricks.sliding_window_view(known, embedding), axis=1)
    number = int(np.count_nonzero(whole))
    near = sum(int(np.count_nonzero(whole[lag:] & whole[:-lag])) for lag in range(1, theiler + 1))
    return number * (number - 1) // 2 - near
