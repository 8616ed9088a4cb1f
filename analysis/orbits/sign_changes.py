"""Functions of an orbit whose sign changes where a branch changes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.periodic import PeriodicOrbit, grazes
from vibroimpact.fmus.bodies.impacting_body import Floats

SLOWEST = 1e-6
"""Speed of an impact, over the size of the motion, below which a fold without a force is the graze of this impact."""
SLOW = 1e-7
"""Speed of a contact, over that of the force's motion, below which its orbit counts as the one at a graze."""
MULTIPLIERS_OF = {"fold": 1, "period doubling": 1, "torus": 2, "branch point": 1}
"""Number of multipliers that pass the unit circle at a point of each kind."""


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


def is_of_graze(kind: str, at: PeriodicOrbit) -> bool:
    """Tell whether a zero without a force is that of a speed: the parameter is even in the speed of an impact there."""
    return at.body.has_own_period and not kind.startswith("graze") and bool(grazes(at, SLOWEST).any())


def turns_at_graze(orbit: PeriodicOrbit) -> bool:
    """Tell whether a branch turns because a contact with a stop that yields has no speed: the branch ends there."""
    speeds = np.abs(orbit.velocities[~orbit.is_rigid])
    return bool(speeds.min(initial=np.inf) < SLOW * orbit.body.scale * orbit.body.angular_frequency)


def is_explained(before: PeriodicOrbit, after: PeriodicOrbit, kinds: Sequence[str]) -> bool:
    """Tell whether two orbits have the same stability, or points of these kinds between them explain the change.

    Each point moves the number of multipliers of its kind across the unit circle, outwards or inwards. A graze explains
    any change: multipliers are unbounded next to it.
    """
    if before.is_stable == after.is_stable or "graze" in kinds:
        return True
    moved = [MULTIPLIERS_OF[kind] for kind in kinds if kind in MULTIPLIERS_OF]
    outside = [int((np.abs(each.multipliers) >= 1.0).sum()) for each in (before, after)]
    change = outside[1] - outside[0]
    return any(
        change == sum(way * count for way, count in zip(ways, moved, strict=True))
        for ways in itertools.product((-1, 1), repeat=len(moved))
    )
