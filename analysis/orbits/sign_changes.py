"""Functions of an orbit whose sign changes where a branch changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.periodic import TURN, PeriodicOrbit
from vibroimpact.fmus.bodies.impacting_body import Floats

OPPOSITE = 0.9
"""Cosine of the angle between differences of the halves; below its negative the differences are opposite."""


def determinant(matrix: Floats) -> float:
    """Return the determinant of a matrix; NaN for a graze."""
    return float(np.linalg.det(matrix)) if np.isfinite(matrix).all() else float(np.nan)


def turning(multipliers: NDArray[np.complex128]) -> float:
    """Return a product over all pairs of multipliers that is 0 if two are on the unit circle."""
    i, j = np.triu_indices(multipliers.size, 1)
    with np.errstate(over="ignore", invalid="ignore"):  # next to a graze
        off = 1.0 - multipliers[i] * multipliers[j]
    if not np.isfinite(off).all():
        return float(np.nan)
    return float(np.prod(off / (1.0 + np.abs(off))).real)


def turns_round(multipliers: NDArray[np.complex128]) -> bool:
    """Tell whether two complex multipliers are on the unit circle, not two real ones with the product 1."""
    nearest = multipliers[np.argmin(np.abs(np.abs(multipliers) - 1.0))]
    return bool(abs(nearest.imag) > 1e-6 and abs(abs(nearest) - 1.0) < 1e-6)


def passes_doubling(before: PeriodicOrbit, after: PeriodicOrbit) -> bool:
    """Tell whether a branch passes an orbit of half the period between two orbits: both halves change places there."""
    one, other = _half_difference(before), _half_difference(after)
    return bool(one @ other < -OPPOSITE * np.linalg.norm(one) * np.linalg.norm(other))


def _half_difference(orbit: PeriodicOrbit) -> Floats:
    """Return the difference of an orbit's second half from its first, rad of each impact; empty if stops differ."""
    half, odd = divmod(orbit.phases.size, 2)
    if odd or orbit.periods % 2 or (orbit.contacts[:half] != orbit.contacts[half:]).any():
        return np.empty(0)
    return np.asarray(orbit.phases[half:] - orbit.phases[:half] - 0.5 * TURN * orbit.periods)
