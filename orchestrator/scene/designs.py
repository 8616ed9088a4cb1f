"""Points drawn from distributions: random, Sobol and Saltelli designs, the same for a seed on every machine.

More points keep the old ones: a design of 2 n points begins with the design of n points.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import Literal

import numpy as np
from numpy.typing import NDArray

DesignName = Literal["random", "sobol", "saltelli"]
BALANCED: tuple[DesignName, ...] = ("sobol", "saltelli")
"""Designs that are balanced only if the number of points is a power of 2."""

_DIGITS = 12
"""Digits of a drawn value, few enough that another machine's logarithm (last of 16 digits) does not change them."""
_OUTERMOST = 2.0**-33
"""Least probability of a drawn value: a Sobol sequence may have 0, for which a normal distribution has no value."""

Quantile = Callable[[float], float]
"""Quantile function: the value below which a distribution has a given share of its probability."""


def unit_design(design: DesignName, points: int, keys: int, seed: int) -> NDArray[np.float64]:
    """Return a design in the unit cube.

    Parameters
    ----------
    design : {"random", "sobol", "saltelli"}
        Each base point of `saltelli` gives keys + 2 rows: one of A, one of B, and A with each column from B.
    points, keys, seed : int

    Returns
    -------
    ndarray of float, shape (row, keys)

    Examples
    --------
    >>> bool((unit_design("sobol", 8, 2, 1) == unit_design("sobol", 16, 2, 1)[:8]).all())
    True
    >>> unit_design("saltelli", 4, 3, 1).shape
    (20, 3)
    """
    source = np.random.default_rng(seed)
    if design == "random":
        return source.random((points, keys))
    # the import takes a third of a second, and other scenes do not need it
    from scipy.stats import qmc

    columns = 2 * keys if design == "saltelli" else keys
    rows: NDArray[np.float64] = qmc.Sobol(columns, scramble=True, seed=source).random(points)
    return rows if design == "sobol" else _saltelli_rows(rows[:, :keys], rows[:, keys:])


def _saltelli_rows(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    points, keys = a.shape
    rows = np.repeat(a[:, None, :], keys + 2, axis=1)
    rows[:, 1] = b
    for place in range(keys):
        rows[:, place + 2, place] = b[:, place]
    return rows.reshape(points * (keys + 2), keys)


def uniform(low: float, high: float) -> Quantile:
    """Return the quantile function of a uniform distribution."""
    return lambda share: low + share * (high - low)


def log_uniform(low: float, high: float) -> Quantile:
    """Return the quantile function of a distribution with a uniform logarithm; both ends are > 0."""
    return lambda share: low * (high / low) ** share


def normal(mean: float, deviation: float, low: float | None = None, high: float | None = None) -> Quantile:
    """Return the quantile function of a normal distribution, cut off below `low` and above `high` if given.

    Examples
    --------
    >>> normal(3.0, 2.0)(0.5), round(normal(0.0, 1.0, low=0.0)(0.5), 6)
    (3.0, 0.67449)
    """
    whole = NormalDist(mean, deviation)
    first = 0.0 if low is None else whole.cdf(low)
    last = 1.0 if high is None else whole.cdf(high)

    def quantile(share: float) -> float:
        inner = first + share * (last - first)
        return whole.inv_cdf(min(max(inner, _OUTERMOST), 1.0 - _OUTERMOST))

    return quantile


def drawn(shares: NDArray[np.float64], quantile: Quantile, low: float, high: float) -> tuple[float, ...]:
    """Return the drawn values of one key, rounded, within `low` to `high`.

    Examples
    --------
    >>> drawn(np.array([0.0, 0.25]), uniform(2.0, 3.0), 2.0, 3.0)
    (2.0, 2.25)
    """
    rounded = (float(f"{quantile(share):.{_DIGITS}g}") for share in shares.tolist())
    return tuple(min(max(value, low), high) for value in rounded)


def has_probability(mean: float, deviation: float, low: float, high: float) -> bool:
    """Return whether a normal distribution has more than a probability of 1e-6 between two values."""
    whole = NormalDist(mean, deviation)
    inside = [whole.cdf(end) if math.isfinite(end) else float(end > 0.0) for end in (low, high)]
    return inside[1] - inside[0] > 1e-6
