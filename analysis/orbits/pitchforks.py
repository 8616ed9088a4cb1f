"""Pitchforks over two parameters, and the degenerate ones at which folds of broken orbits begin: equations.md 4.20."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vibroimpact.analysis.orbits.mirrored_halves import Halves, halves_like, halves_of, slopes_of
from vibroimpact.analysis.orbits.periodic import OrbitError, PeriodicOrbit
from vibroimpact.fmus.bodies.impacting_body import Floats

PITCHFORK = "pitchfork"
DEGENERATE = "degenerate pitchfork"
"""Kind of the point where a pitchfork turns from broken orbits on one side of it to broken orbits on the other side."""
AMPLITUDE = 4e-3
"""Breaking of the symmetry, rad, for the cubic coefficient; twice of it removes the next order."""
BROKEN = (0.05, 0.02, 0.1, 0.01)
"""Breakings of the symmetry, rad, tried for the first fold of broken orbits next to a degenerate pitchfork."""
MOST_STEPS = 20
"""Number of Newton steps to a degenerate pitchfork, or to a fold next to it."""
SLOPE_STEP = 1e-4
"""Change of an unknown for the slopes of the cubic coefficient, which has 9 digits."""
FOUND = 1e-9
"""Newton step of the unknowns below which a degenerate pitchfork counts as found: errors of the cubic coefficient."""
SOLVED = 1e-11
"""Newton step of the unknowns below which a fold next to it counts as found."""
NEAR = 0.3
"""Change of an unknown up to which a point that Newton's method finds is next to the first guess."""

Made = Callable[[PeriodicOrbit, Floats], tuple[PeriodicOrbit, Floats]]
"""Orbit and errors over the size of the motion, for unknowns with both parameters over their ranges."""


class Breaking(NamedTuple):
    """Broken orbits x + s `across` + s^2/2 `bend` next to a pitchfork x, and the cubic term of their equation."""

    across: Floats
    bend: Floats
    cubic: float


def is_pitchfork(orbit: PeriodicOrbit) -> bool:
    """Tell whether a branch point of an orbit is a pitchfork of symmetric orbits."""
    halves = halves_of(orbit)
    if halves is None:
        return False
    slopes = slopes_of(orbit)
    smallest = [
        np.linalg.svd(each, compute_uv=False)[-1]
        for each in (halves.opposite_slopes(slopes), halves.equal_slopes(slopes))
    ]
    return bool(smallest[0] < smallest[1])


def breaking_of(halves: Halves, orbit: PeriodicOrbit, slopes_at: Callable[[Floats], Floats]) -> Breaking:
    """Return the directions of broken orbits next to a pitchfork; `cubic` is continuous along a locus.

    `slopes_at` has the slopes for other unknowns of the orbit, those of its body.
    """
    begin = orbit.unknowns
    slopes = slopes_at(begin)
    matrix = halves.opposite_slopes(slopes)
    left, _, right = np.linalg.svd(matrix)
    lost, across = left[:, -1], halves.opposite @ right[-1]

    def curved(size: float) -> Floats:
        ends = [slopes_at(begin + side * size * across) for side in (1.0, -1.0)]
        return np.asarray(halves.mean @ ((ends[0] - ends[1]) @ across) / (2.0 * size))

    second = (4.0 * curved(AMPLITUDE) - curved(2.0 * AMPLITUDE)) / 3.0
    kept = halves.equal_slopes(slopes)
    bend = -halves.equal @ np.linalg.solve(kept, second)

    def departing(size: float) -> float:
        there = slopes_at(begin + size * across + 0.5 * size**2 * bend)
        return float(lost @ halves.difference @ there @ (across + size * bend))

    first = departing(0.0)
    own, twice = (departing(size) - first for size in (AMPLITUDE, 2.0 * AMPLITUDE))
    border = np.block([[matrix, lost[:, None]], [right[-1], np.zeros(1)]])
    signed = float(np.linalg.det(border) * np.linalg.det(kept))  # no pole where symmetric orbits have a fold
    return Breaking(across, bend, (16.0 * own - twice) / (6.0 * AMPLITUDE**2) * signed)


def cubic_of(halves: Halves, orbit: PeriodicOrbit, made: Made, parameters: Floats) -> float:
    """Return the cubic coefficient of a pitchfork; NaN where orbits next to it have no motion."""
    try:
        return breaking_of(halves, orbit, _slopes_with(orbit, made, parameters)).cubic
    except (OrbitError, np.linalg.LinAlgError):
        return float("nan")


def _slopes_with(orbit: PeriodicOrbit, made: Made, parameters: Floats) -> Callable[[Floats], Floats]:
    return lambda unknowns: slopes_of(made(orbit, np.append(unknowns, parameters))[0])


def degenerate_near(
    orbit: PeriodicOrbit, parameters: Floats, made: Made
) -> tuple[PeriodicOrbit, Floats] | None:
    """Return the degenerate pitchfork next to a broken orbit, with its parameters; None if there is none."""
    halves = halves_like(orbit)
    if halves is None:
        return None

    def errors(unknowns: Floats) -> Floats:
        there, off = made(orbit, unknowns)
        cubic = breaking_of(halves, there, _slopes_with(there, made, unknowns[-2:])).cubic
        return np.concatenate([halves.errors(off, unknowns[:-2]), [halves.breaking(there), cubic]])

    found = _newton(errors, np.append(halves.symmetric(orbit.unknowns), parameters), SLOPE_STEP, FOUND)
    return None if found is None else (made(orbit, found)[0], found[-2:])


def fold_beside(
    orbit: PeriodicOrbit, parameters: Floats, made: Made, slope_step: float
) -> tuple[PeriodicOrbit, Floats] | None:
    """Return a fold of broken orbits next to a degenerate pitchfork, with its parameters; None if none is found."""
    halves = halves_of(orbit)
    if halves is None:
        return None
    for size in BROKEN:
        try:
            way = breaking_of(halves, orbit, _slopes_with(orbit, made, parameters))
        except (OrbitError, np.linalg.LinAlgError):
            return None
        begin = orbit.unknowns + size * way.across + 0.5 * size**2 * way.bend

        def errors(unknowns: Floats, begin: Floats = begin, across: Floats = way.across) -> Floats:
            there, off = made(orbit, unknowns)
            fold = float(np.linalg.det(slopes_of(there)))
            return np.concatenate([off, [fold, float(across @ (unknowns[:-2] - begin))]])

        found = _newton(errors, np.append(begin, parameters), slope_step, SOLVED)
        if found is not None:
            return made(orbit, found)[0], found[-2:]
    return None


def _newton(
    errors: Callable[[Floats], Floats], begin: Floats, slope_step: float, close: float
) -> Floats | None:
    """Return the zero of some errors next to a guess, with slopes by differences; None if there is none."""
    unknowns = begin
    try:
        for _ in range(MOST_STEPS):
            axes = slope_step * np.eye(unknowns.size)
            slopes = [
                (errors(unknowns + each) - errors(unknowns - each)) / (2.0 * slope_step) for each in axes
            ]
            change = np.linalg.solve(np.column_stack(slopes), -errors(unknowns))
            unknowns = unknowns + change
            if not np.abs(unknowns - begin).max() < NEAR:
                return None
            if np.abs(change).max() < close:
                return unknowns
    except (OrbitError, np.linalg.LinAlgError):
        return None
    return None
