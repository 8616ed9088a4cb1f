"""Corners of branches: an impact at the yield velocity, above which its restitution falls with speed.

The restitution is continuous there and its slope jumps: equations.md 4.7. So do the direction of the branch and the
multipliers. A step ends at the corner, and the next one begins in the direction of the other side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.branch_points import bordered_determinant
from vibroimpact.analysis.orbits.periodic import OrbitError, PeriodicOrbit, Trial
from vibroimpact.fmus.bodies.impacting_body import Floats

AT_YIELD_VELOCITY = "impact at the yield velocity"
"""Kind of a point where an impact passes its yield velocity."""
MOST_NEWTON = 20
BESIDE = 1e-4
"""Distance from a corner at which one side of it is judged."""
SLOPE_STEP = 1e-7
"""Change of the unknowns for slopes of the velocities by differences."""
SOLVED = 1e-12
"""Distances over the size of the motion, and velocity over the yield velocity, up to which a corner is found."""
SAME_SPEED = 1e-9
"""Difference from its yield velocity, over it, below which an impact of a corner counts as at it."""
REACH = 2.0
"""Distance of a corner, over the step that found no orbit, up to which it is searched."""


class _Span(Protocol):
    @property
    def span(self) -> float:
        """Range of the parameter."""


class BranchEquations(Protocol):
    """Equations of the orbits of a branch over their unknowns: those of an orbit, and the parameter over its range."""

    @property
    def settings(self) -> _Span:
        """The range of the parameter."""

    def residual(self, orbit: PeriodicOrbit, unknowns: Floats, value: float) -> Trial:
        """Return errors, their slopes by the unknowns of an orbit, and the orbit."""

    def matrix(self, orbit: PeriodicOrbit, unknowns: Floats, value: float) -> Floats:
        """Return the derivatives of the errors by all unknowns."""


class BranchPlace(Protocol):
    """An orbit of a branch with its direction."""

    @property
    def value(self) -> float:
        """Value of the parameter."""

    @property
    def orbit(self) -> PeriodicOrbit:
        """The orbit."""

    @property
    def tangent(self) -> Floats:
        """Direction of the branch."""


class CornerSide(NamedTuple):
    """The orbit at a corner with direction, determinant and multipliers of one side."""

    value: float
    orbit: PeriodicOrbit
    tangent: Floats
    border: float


@dataclass(frozen=True, slots=True)
class Corner:
    """A corner of a branch.

    Attributes
    ----------
    place : float
        Distance along the branch.
    before, beyond : CornerSide
        The orbit, with direction and multipliers of either side.
    """

    place: float
    before: CornerSide
    beyond: CornerSide


def crosses(one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    """Tell whether an impact passes its yield velocity between two orbits of a branch."""
    return bool((one.falling != other.falling).any())


def next_corner(
    follower: BranchEquations, now: BranchPlace, step: float, taken: PeriodicOrbit | None
) -> Corner | None:
    """Return the first corner within a step to `taken`, or near one that found no orbit; None without a corner."""
    excess = _excess(now.orbit)
    if (excess == -1.0).all() or (taken is not None and not crosses(now.orbit, taken)):
        return None
    unknowns = _unknowns(follower, now)
    try:
        if taken is None:
            rates = _rates(follower, now.orbit, unknowns, now.tangent)
            reach = REACH * step
        else:
            rates, reach = (_excess(taken) - excess) / step, step
        with np.errstate(divide="ignore", invalid="ignore"):
            places = -excess / rates
        for place in sorted(each for each in places if SAME_SPEED * step < each <= reach):
            impact = int(np.flatnonzero(places == place)[0])
            found = _solved(follower, now.orbit, unknowns + place * now.tangent, impact)
            corner = None if found is None else _both_sides(follower, now, *found)
            if corner is not None and 0.0 < corner.place <= reach:
                return corner
    except (OrbitError, np.linalg.LinAlgError):
        return None
    return None


def split_orbit(follower: BranchEquations, at: BranchPlace, twice: BranchPlace) -> CornerSide | None:
    """Return the orbit at a corner, counted twice, with the direction of orbits with an impact on either side.

    They begin there where a multiplier jumps across -1. None if there are none, or several impacts are at the corner.
    `twice` is the orbit of the corner counted twice.
    """
    here = np.flatnonzero(np.abs(_excess(at.orbit)) <= 2.0 * SAME_SPEED)
    if here.size != 1:
        return None
    pair = np.array([here[0], here[0] + at.orbit.phases.size])
    unknowns = _unknowns(follower, twice)
    axes = np.eye(unknowns.size)[:-1]
    slopes = np.array([_rates(follower, twice.orbit, unknowns, axis)[pair] for axis in axes]).T
    apart = np.append(np.linalg.lstsq(slopes, np.array([1.0, -1.0]), rcond=None)[0], 0.0)
    beside = unknowns + BESIDE * apart / np.linalg.norm(apart)
    falling = _residual(follower, twice.orbit, beside)[2].falling[pair]
    if not (falling[0] and not falling[1]):
        return None
    matrix = follower.matrix(twice.orbit, beside[:-1], twice.value)
    tangent: Floats = np.linalg.svd(matrix)[2][-1]
    above, below = _rates(follower, twice.orbit, beside, tangent)[pair]
    if not above * below < 0.0:
        return None
    return CornerSide(twice.value, twice.orbit, tangent if above > 0.0 else -tangent, 0.0)


def _excess(orbit: PeriodicOrbit) -> Floats:
    """Return velocities less their yield velocities, over these, shape (p,); -1 for a stop without one."""
    levels = np.array([each.yield_velocity or np.inf for each in orbit.body.contacts])
    return np.asarray(orbit.velocities / levels[orbit.contacts] - 1.0)


def _unknowns(follower: BranchEquations, at: BranchPlace) -> Floats:
    return np.append(at.orbit.unknowns, at.value / follower.settings.span)


def _residual(follower: BranchEquations, like: PeriodicOrbit, unknowns: Floats) -> Trial:
    """Return errors, their slopes by the unknowns of an orbit, and the orbit."""
    return follower.residual(like, unknowns[:-1], float(unknowns[-1]) * follower.settings.span)


def _rates(follower: BranchEquations, like: PeriodicOrbit, unknowns: Floats, direction: Floats) -> Floats:
    """Return the slopes of all excesses in a direction, shape (p,)."""
    ends = [
        _excess(_residual(follower, like, unknowns + side * SLOPE_STEP * direction)[2])
        for side in (1.0, -1.0)
    ]
    return np.asarray(ends[0] - ends[1]) / (2.0 * SLOPE_STEP)


def _solved(
    follower: BranchEquations, like: PeriodicOrbit, unknowns: Floats, impact: int
) -> tuple[Floats, PeriodicOrbit] | None:
    """Return unknowns and orbit near a start where an impact has its yield velocity, by Newton's method."""
    least = np.inf
    for _ in range(MOST_NEWTON):
        distances, _, orbit = _residual(follower, like, unknowns)
        errors = np.append(distances / orbit.body.scale, _excess(orbit)[impact])
        error = float(np.abs(errors).max())
        if error <= SOLVED and error >= 0.5 * least:
            return unknowns, orbit
        least = min(least, error)
        matrix = follower.matrix(like, unknowns[:-1], float(unknowns[-1]) * follower.settings.span)
        rates = [_rates(follower, like, unknowns, axis)[impact] for axis in np.eye(unknowns.size)]
        change = np.linalg.solve(np.vstack([matrix / orbit.body.scale, rates]), -errors)
        if not np.abs(change).max() < 1.0:
            return None
        unknowns = unknowns + change
    return None


def _both_sides(
    follower: BranchEquations, now: BranchPlace, unknowns: Floats, orbit: PeriodicOrbit
) -> Corner | None:
    """Return the corner at an orbit; None if the branch only touches the yield velocity there."""
    at = np.abs(_excess(orbit)) < SAME_SPEED
    before = _one_side(follower, now, unknowns, orbit, at, now.orbit.falling, -now.tangent)
    beyond = _one_side(follower, now, unknowns, orbit, at, now.orbit.falling ^ at, now.tangent)
    if before is None or beyond is None:
        return None
    # beyond the corner the velocities go on in the sense in which they reached it
    rates = _rates(follower, orbit, unknowns + BESIDE * now.tangent, beyond.tangent)
    onwards = -rates[at] * np.sign(_excess(now.orbit))[at]
    if not ((onwards > 0.0).all() or (onwards < 0.0).all()):
        return None
    turned = beyond._replace(tangent=-beyond.tangent, border=-beyond.border)
    place = float(now.tangent @ (unknowns - _unknowns(follower, now)))
    return Corner(place, before, beyond if onwards[0] > 0.0 else turned)


def _one_side(
    follower: BranchEquations,
    now: BranchPlace,
    unknowns: Floats,
    orbit: PeriodicOrbit,
    at: NDArray[np.bool_],
    falling: NDArray[np.bool_],
    direction: Floats,
) -> CornerSide | None:
    """Return the orbit at a corner with direction and multipliers of one side; None if that side is not there."""
    beside = unknowns + BESIDE * direction
    if (_residual(follower, orbit, beside)[2].falling != falling).any():
        return None
    value = float(unknowns[-1]) * follower.settings.span
    matrix = follower.matrix(orbit, beside[:-1], float(beside[-1]) * follower.settings.span)
    tangent: Floats = np.linalg.svd(matrix)[2][-1]
    tangent = tangent if tangent @ now.tangent >= 0.0 else -tangent
    shares = np.where(at, np.where(falling, 1.0 + SAME_SPEED, 1.0 - SAME_SPEED), 1.0)
    velocities = orbit.velocities * shares
    return CornerSide(
        value, replace(orbit, velocities=velocities), tangent, bordered_determinant(matrix, tangent)
    )
