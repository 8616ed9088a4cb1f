"""Sobol indices and their bootstrap intervals, from the values of a quantity at the points of a Saltelli design.

A block of the design is a point of A, a point of B, and A's point with each coordinate of B in turn. f is the
quantity minus its mean; V is its variance over A and B. The estimators are those of A. Saltelli et al., Computer
Physics Communications 181, 259-270, 2010, table 2 b and f:

    first order  S_i = mean(f_B (f_AB,i - f_A)) / V
    total order  T_i = mean((f_A - f_AB,i)^2) / 2 V
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import UsageError

Floats = NDArray[np.float64]

FEWEST_BLOCKS = 8
"""Number of blocks below which a variance and its bootstrap interval mean nothing."""
_CONSTANT = 1e-9
"""Spread, over the largest value, below which a quantity is constant: rounding, and remains of transients."""
_BATCH = 10**6
"""Numbers drawn at a time for the bootstrap."""


@dataclass(frozen=True, slots=True)
class Indices:
    """Sobol indices of quantities.

    Attributes
    ----------
    first_order, total_order : ndarray of float, shape (quantity, key)
        NaN for a quantity that is constant, or has too few whole blocks.
    first_interval, total_interval : ndarray of float, shape (quantity, key, 2)
        Ends of the bootstrap intervals; NaN where resamples are constant: the quantity depends on a few blocks.
    blocks : ndarray of int, shape (quantity,)
        Number of blocks behind the estimates: blocks whose values are all finite.
    """

    first_order: Floats
    total_order: Floats
    first_interval: Floats
    total_interval: Floats
    blocks: NDArray[np.int64]


def sobol_indices(
    a: Floats, b: Floats, mixed: Floats, *, level: float = 0.95, resamples: int = 1000, seed: int = 0
) -> Indices:
    """Estimate first-order and total Sobol indices of quantities at the points of a Saltelli design.

    Blocks with a value that is not finite are left out of their quantity. Blocks are resampled with replacement; the
    intervals are quantiles over the resamples. Sobol points are more even than random points, so the intervals are
    wider than the errors.

    Parameters
    ----------
    a, b : ndarray of float, shape (block, quantity)
        Values at the points of A and B.
    mixed : ndarray of float, shape (block, key, quantity)
        Values at the points of A with one coordinate of B.
    level : float
        Confidence of the intervals.
    resamples : int
        Number of bootstrap resamples.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    Indices

    Raises
    ------
    UsageError
        The level, the number of resamples or the seed makes no sense.

    Examples
    --------
    >>> a, b = np.random.default_rng(1).random((2, 4096, 2))
    >>> swapped = [np.where([[0, 1]] == np.array(key), b, a) for key in (0, 1)]
    >>> f = lambda x: (2.0 * x[:, 0] + x[:, 1])[:, None]
    >>> found = sobol_indices(f(a), f(b), np.stack([f(x) for x in swapped], axis=1))
    >>> found.total_order.round(1).tolist()
    [[0.8, 0.2]]
    """
    estimation = SobolEstimation(a, b, mixed, level=level, resamples=resamples, seed=seed)
    for _ in estimation.batches():
        pass
    return estimation.indices()


class SobolEstimation:
    """Sobol indices whose intervals improve with each batch of resamples; see `sobol_indices` for the parameters."""

    def __init__(
        self, a: Floats, b: Floats, mixed: Floats, *, level: float, resamples: int, seed: int
    ) -> None:
        _refuse(level, resamples, seed)
        self._points, self._shape = (a, b, mixed), (a.shape[1], mixed.shape[1])
        self._level, self._resamples, self._seed = level, resamples, seed
        self._whole = np.isfinite(a) & np.isfinite(b) & np.isfinite(mixed).all(axis=1)
        self._groups: list[_Group] = []

    def batches(self) -> Generator[int, None, None]:
        """Estimate quantities with equal whole blocks together; yield the number of resamples of each batch."""
        a, b, mixed = self._points
        patterns, which = np.unique(self._whole, axis=1, return_inverse=True)
        for number, rows in enumerate(patterns.T):
            if rows.sum() < FEWEST_BLOCKS:
                continue
            chosen = np.flatnonzero(which.reshape(-1) == number)
            moments = _Moments(a[np.ix_(rows, chosen)], b[np.ix_(rows, chosen)], mixed[rows][:, :, chosen])
            group = _Group(chosen, moments.indices(np.ones((1, rows.sum())))[:, 0], [])
            self._groups.append(group)
            for weights in _weights(int(rows.sum()), self._resamples, self._seed):
                group.draws.append(moments.indices(weights))
                yield len(weights)

    def indices(self) -> Indices:
        """Return the indices with the intervals of the resamples so far."""
        found = np.full((2, *self._shape, 3), np.nan)
        for group in self._groups:
            found[:, group.quantities, :, :1] = group.indices[..., None]
            if group.draws:
                draws = np.concatenate(group.draws, axis=1)
                ends = np.quantile(draws, [0.5 - 0.5 * self._level, 0.5 + 0.5 * self._level], axis=1)
                found[:, group.quantities, :, 1:] = np.moveaxis(ends, 0, -1)
        (first, total), blocks = found, self._whole.sum(axis=0)
        return Indices(first[..., 0], total[..., 0], first[..., 1:], total[..., 1:], blocks)


def _refuse(level: Any, resamples: Any, seed: Any) -> None:
    if not (isinstance(level, Real) and 0.0 < float(level) < 1.0):
        raise UsageError(f"level: expected a number between 0 and 1, got {level!r}.")
    if not (isinstance(resamples, Integral) and 2 <= int(resamples) <= 10**6):
        raise UsageError(f"resamples: expected a whole number from 2 to 1000000, got {resamples!r}.")
    if not (isinstance(seed, Integral) and int(seed) >= 0):
        raise UsageError(f"seed: expected a whole number >= 0, got {seed!r}.")


class _Group(NamedTuple):
    """Quantities with the same whole blocks: their places, their indices, and the indices of each batch."""

    quantities: NDArray[np.intp]
    indices: Floats
    draws: list[Floats]


def _weights(blocks: int, resamples: int, seed: int) -> Iterator[Floats]:
    """Yield the number of occurrences of each block in each resample, in batches of shape (resample, block)."""
    source = np.random.default_rng(seed)
    batch = max(1, _BATCH // blocks)
    for start in range(0, resamples, batch):
        drawn = source.integers(blocks, size=(min(batch, resamples - start), blocks))
        yield np.stack([np.bincount(row, minlength=blocks) for row in drawn]).astype(np.float64)


class _Moments:
    """The products of each block whose means give the indices of quantities."""

    def __init__(self, a: Floats, b: Floats, mixed: Floats) -> None:
        both = np.concatenate([a, b])
        centre, size = both.mean(axis=0), np.abs(both).max(axis=0)
        # scaled, so that squares of quantities of any size stay finite
        scale = np.where(size > 0.0, size, 1.0)
        spread = np.ptp(np.concatenate([both, mixed.reshape(-1, a.shape[1])]) / scale, axis=0)
        self._is_constant = spread <= _CONSTANT
        a, b, mixed = (a - centre) / scale, (b - centre) / scale, (mixed - centre) / scale
        self._sums, self._squares = a + b, a * a + b * b
        self._first = b[:, None] * (mixed - a[:, None])
        self._total = (a[:, None] - mixed) ** 2

    def indices(self, weights: Floats) -> Floats:
        """Return first-order and total indices, shape (2, resample, quantity, key), for weights (resample, block)."""
        shares = weights / weights.sum(axis=1, keepdims=True)
        variance = 0.5 * shares @ self._squares - (0.5 * shares @ self._sums) ** 2
        variance[:, self._is_constant] = np.nan
        variance[variance <= 0.0] = np.nan  # a resample of equal values
        first, total = (np.tensordot(shares, each, axes=(1, 0)) for each in (self._first, 0.5 * self._total))
        shared: Floats = np.stack([first, total]).swapaxes(2, 3) / variance[None, :, :, None]
        return shared
