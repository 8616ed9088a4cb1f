"""Points at which two branches of orbits cross: equations.md 4.13.

The matrix of 4.7 over all unknowns loses a rank there, and Newton's method its digits. So the point is interpolated
between orbits of the branch on both sides of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.polynomial import chebyshev

from vibroimpact.analysis.orbits.periodic import PeriodicOrbit
from vibroimpact.analysis.orbits.symmetry import is_symmetric
from vibroimpact.fmus.bodies.impacting_body import Floats

BRANCH_POINT = "branch point"
"""Kind of a point where another branch of orbits with the same impacts crosses."""
NODES = 8
"""Number of orbits between which a branch point is interpolated."""
WIDTH = 0.25
"""Half the length, over the step, along which orbits are interpolated."""
CURVATURE_STEP = 1e-4
"""Change of the unknowns for second derivatives by differences."""
LEVEL = 1e-5
"""Share of the parameter in a direction up to which a branch leaves across the parameter: a pitchfork."""
NEAR = 0.05
"""Share of the determinant left after a step below which the step ends too near to a branch point: it is halved."""
HALVINGS = 7
"""Number of halvings of a step around a branch point, and then of the piece that is interpolated."""

OrbitAt = Callable[[float], tuple[Floats, float] | None]


def end_of(kind: str, now: PeriodicOrbit, at: PeriodicOrbit) -> str:
    """Return the kind of a point, or the end of a branch that would go on as a copy of itself.

    Beyond an orbit of half the period both halves change places. Beyond a symmetric orbit its mirror image follows.
    """
    if kind == BRANCH_POINT and at.turns > 1:
        return f"period doubling of {at.once.name}"
    if kind == BRANCH_POINT and is_symmetric(at) and not is_symmetric(now):
        return f"{BRANCH_POINT} of the symmetric {at.name}"
    return kind


def bordered_determinant(matrix: Floats, tangent: Floats) -> float:
    """Return the determinant of the equations over all unknowns, shape (p, p + 1), and the tangent; rows count as 1."""
    rows = matrix / np.maximum(np.linalg.norm(matrix, axis=1), np.finfo(np.float64).tiny)[:, None]
    return float(np.linalg.det(np.vstack([rows, tangent])))


def interpolated_zeros(orbit_at: OrbitAt, step: float) -> Iterator[tuple[float, Floats, Floats]]:
    """Yield ever better guesses of a place along a step where a function is 0, the unknowns there, and their slopes.

    Parameters
    ----------
    orbit_at : callable
        Unknowns, shape (p + 1,), and the function, at a place along the branch; None without an orbit.
    step : float
        Length of the step; the function has opposite signs at its ends.

    Yields
    ------
    tuple of float, array, array
        Each is interpolated on half the length of the one before. Where an orbit is missing there is no guess.
    """
    first = orbit_at(0.0)
    same, changed = 0.0, step
    for _ in range(HALVINGS):
        middle = orbit_at(0.5 * (same + changed))
        if first is None or middle is None:
            break
        has_changed = middle[1] * first[1] < 0.0
        half = 0.5 * (same + changed)
        same, changed = (same, half) if has_changed else (half, changed)
    for halvings in range(HALVINGS):
        found = _zero_next_to(orbit_at, 0.5 * (same + changed), WIDTH * step * 0.5**halvings)
        if found is not None:
            yield found


def _zero_next_to(orbit_at: OrbitAt, middle: float, half: float) -> tuple[float, Floats, Floats] | None:
    """Return place, unknowns and slopes at a zero of the polynomials through orbits around a place."""
    nodes = np.cos((2.0 * np.arange(NODES) + 1.0) * np.pi / (2.0 * NODES))
    found = [orbit_at(middle + half * node) for node in nodes]
    rows = np.array([np.append(*each) for each in found if each is not None])
    if len(rows) < NODES:
        return None
    series = chebyshev.chebfit(nodes, rows, NODES - 1)
    zeros = chebyshev.chebroots(series[:, -1])
    real = zeros.real[(np.abs(zeros.imag) < 1e-9) & (np.abs(zeros.real) < 1.0)]
    if not real.size:
        return None
    zero = float(real[np.argmin(np.abs(real))])
    unknowns, slopes = (chebyshev.chebval(zero, each) for each in (series, chebyshev.chebder(series)))
    return middle + half * zero, np.asarray(unknowns)[:-1], np.asarray(slopes)[:-1]


def crossing_direction(matrix_at: Callable[[Floats], Floats], unknowns: Floats, tangent: Floats) -> Floats:
    """Return the direction of the branch that crosses another one: the other root of the bifurcation equation, 4.13.

    Parameters
    ----------
    matrix_at : callable
        Derivatives of the p equations by all unknowns, shape (p, p + 1).
    unknowns, tangent : array, shape (p + 1,)
        The branch point, and the direction of the known branch there.
    """
    left, _, right = np.linalg.svd(matrix_at(unknowns))
    lost = left[:, -1]
    plane = right[-2:]
    across = plane[0] * (plane[1] @ tangent) - plane[1] * (plane[0] @ tangent)
    across = across / np.linalg.norm(across)

    def curvature(along: Floats) -> float:
        ends = [matrix_at(unknowns + side * CURVATURE_STEP * along) for side in (1.0, -1.0)]
        return float(lost @ (ends[0] - ends[1]) @ across) / (2.0 * CURVATURE_STEP)

    own, mixed = curvature(across), curvature(tangent)
    direction = 2.0 * mixed * across - own * tangent
    direction = direction / np.linalg.norm(direction)
    return np.asarray(direction if direction @ across > 0.0 else -direction)
