"""Orbits that begin at the special points of a branch: equations.md 4.13."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.branch import Branch, BranchOrbit, SpecialPoint
from vibroimpact.analysis.orbits.branch_points import BRANCH_POINT, LEVEL, crossing_direction
from vibroimpact.analysis.orbits.corners import AT_YIELD_VELOCITY, split_orbit
from vibroimpact.analysis.orbits.following import Follower
from vibroimpact.analysis.orbits.periodic import TURN, OrbitError, PeriodicOrbit, evaluated, grazes, ordered
from vibroimpact.analysis.orbits.symmetry import are_alike, is_symmetric, mirror_image, mirrored_contacts
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.core.orbits import MOST_IMPACTS

BESIDE, BESIDE_SQUARE = 1e-4, 1e-2
"""Step away from a graze, over the longest, after which an orbit is judged; where the parameter changes with V^2.

It does so without a force, and on stops that yield. A maximum beyond its stop must exceed rounding.
"""
SAME_VALUE = 1e-7
"""Difference of two values, over the range, up to which they are one point."""
SAME_TOUCH = 1e-3
"""Difference of phases, rad, below which two touches of a stop are one; a phase at a graze has half the digits."""
MOST_TURNS = 3
"""Number of turns of a grazing orbit, some with and some without an impact, up to which orbits are named."""
MOST_TOUCHES = 4
"""Number of touches of a stop, over all turns, up to which all choices of them are tried."""

Impact = tuple[float, int, float]
"""Phase, rad, contact, from 0, and speed, m/s."""


@dataclass(frozen=True, slots=True)
class Departure:
    """A branch that begins at a special point of another one.

    Attributes
    ----------
    start : BranchOrbit
        First orbit, and the direction in which the branch leaves.
    cause : str
        `period doubling`, `pitchfork`, `transcritical branch point`, `graze`, or `impact at the yield velocity`.
    goes_both_ways : bool
        Whether the branch also leaves in the other direction, with orbits that are not those of the first one.
    is_stable : bool or None
        Whether the orbits next to a graze are stable; None for other points.
    beside : float or None
        Value of the parameter at an orbit next to a graze; None for other points.
    """

    start: BranchOrbit
    cause: str
    goes_both_ways: bool = False
    is_stable: bool | None = None
    beside: float | None = None

    @property
    def side(self) -> str:
        """`higher` or `lower`: the values of the parameter at which the orbits next to a graze are."""
        ahead = self.start.tangent[-1] if self.beside is None else self.beside - self.start.value
        return "higher" if ahead > 0.0 else "lower"


def departures(follower: Follower, point: SpecialPoint) -> list[Departure]:
    """Return the branches that begin at a special point, one of each pair of mirror images.

    A fold and a torus have none. Orbits of more than MOST_IMPACTS impacts are none, too.
    """
    is_doubled = point.kind in ("period doubling", AT_YIELD_VELOCITY)
    if is_doubled and 2 * point.at.orbit.phases.size > MOST_IMPACTS:
        return []
    if point.kind == "period doubling":
        return [_crossing(follower, _twice(point.at), "period doubling")]
    if point.kind == AT_YIELD_VELOCITY:
        return list(_split(follower, point.at))
    if point.kind == BRANCH_POINT:
        return [_crossing(follower, point.at)]
    return list(_grazing(follower, point.at)) if point.kind.startswith("graze") else []


def _split(follower: Follower, at: BranchOrbit) -> Iterator[Departure]:
    """Yield the branch of twice the period that begins at an impact at its yield velocity, if there is one."""
    start = split_orbit(follower, at, _twice(at))
    if start is not None:
        yield Departure(BranchOrbit(*start), AT_YIELD_VELOCITY)


def _twice(at: BranchOrbit) -> BranchOrbit:
    """Return an orbit that is counted twice, with the direction of its branch."""
    orbit = at.orbit.repeated(2)
    tangent = np.concatenate([at.tangent[:-1], at.tangent])
    if orbit.body.has_own_period:
        count = at.orbit.phases.size
        later, faster = 0.5 * np.append(0.0, at.tangent[1:count]), at.tangent[count:-1]
        tangent = np.concatenate([at.tangent[:1], np.tile(later, 2)[1:], np.tile(faster, 2), at.tangent[-1:]])
    return BranchOrbit(at.value, orbit, tangent / np.linalg.norm(tangent), 0.0)


def _crossing(follower: Follower, at: BranchOrbit, cause: str = "") -> Departure:
    """Return the branch that crosses another one at an orbit."""
    span, orbit = follower.settings.span, at.orbit

    def matrix_at(unknowns: Floats) -> Floats:
        return follower.matrix(orbit, unknowns[:-1], float(unknowns[-1]) * span)

    direction = crossing_direction(matrix_at, np.append(orbit.unknowns, at.value / span), at.tangent)
    is_level = abs(direction[-1]) < LEVEL
    cause = cause or (
        "pitchfork" if is_level or abs(at.tangent[-1]) < LEVEL else "transcritical branch point"
    )
    # orbits on both sides of a doubling, or of a symmetric orbit, are one orbit counted differently, or mirror images
    is_copy = is_level and (orbit.turns > 1 or is_symmetric(orbit))
    return Departure(BranchOrbit(at.value, orbit, direction, 0.0), cause, not is_copy)


def _grazing(follower: Follower, at: BranchOrbit) -> Iterator[Departure]:
    """Yield the branches of orbits with some of the impacts and maxima that touch a stop, others than the own one.

    Several turns of the orbit may each have others of them. Where all impacts touch, a turn is one period of the motion
    without impacts.
    """
    orbit = at.orbit
    slow = grazes(orbit)
    if orbit.body.has_own_period and slow.all():
        return  # the motion vanishes
    fast = _impacts(orbit, ~slow)
    touching = _impacts(orbit, slow) or touching_maxima(orbit)
    turn = orbit.periods
    if slow.all():
        turn, touching = 1, _in_one_period(orbit, touching)
    found = [orbit]
    for turns in range(1, MOST_TURNS + 1):
        if turns * (len(fast) + len(touching)) > MOST_IMPACTS or turns * len(touching) > MOST_TOUCHES:
            return
        later = [TURN * turn * count for count in range(turns)]
        always = [(phase + more, contact, speed) for more in later for phase, contact, speed in fast]
        sometimes = [(phase + more, contact, speed) for more in later for phase, contact, speed in touching]
        for chosen in _subsets(sometimes):
            if not always and not chosen:
                continue
            try:
                other = orbit_of_impacts(orbit, turns, turns * turn, always + chosen)
            except OrbitError:
                continue  # contacts of such an orbit overlap
            images = [other, mirror_image(other)]
            if other.turns > 1 or any(
                are_alike(each, image) for each in found for image in images if image is not None
            ):
                continue
            found.append(other)
            yield from _beside(follower, other, at.value)


def _subsets(touching: list[Impact]) -> Iterator[list[Impact]]:
    """Yield all choices of impacts, the smallest first."""
    for count in range(len(touching) + 1):
        yield from map(list, itertools.combinations(touching, count))


def _impacts(orbit: PeriodicOrbit, which: NDArray[np.bool_]) -> list[Impact]:
    return [
        (float(orbit.phases[k]), int(orbit.contacts[k]), float(orbit.velocities[k]))
        for k in np.flatnonzero(which)
    ]


def touching_maxima(orbit: PeriodicOrbit) -> list[Impact]:
    """Return phase and contact of the maximum that touches a stop, and of its mirror image on a symmetric orbit."""
    _, phase, contact = orbit.highest
    contacts = mirrored_contacts(orbit.body)
    if contacts is None or not is_symmetric(orbit):
        return [(phase, contact, 0.0)]
    return [(phase, contact, 0.0), (phase + 0.5 * TURN * orbit.periods, int(contacts[contact]), 0.0)]


def _in_one_period(orbit: PeriodicOrbit, touching: list[Impact]) -> list[Impact]:
    """Return the touches in one period of a motion without impacts, with those of its mirror image if it is its own."""
    contacts = mirrored_contacts(orbit.body)
    images = (
        [] if contacts is None else [(at + 0.5 * TURN, int(contacts[hit]), 0.0) for at, hit, _ in touching]
    )
    found: list[Impact] = []
    for phase, contact, _ in [*touching, *images]:
        apart = [abs((phase - at + 0.5 * TURN) % TURN - 0.5 * TURN) for at, hit, _ in found if hit == contact]
        if min(apart, default=TURN) > SAME_TOUCH:
            found.append((phase % TURN, contact, 0.0))
    return found


def orbit_of_impacts(like: PeriodicOrbit, turns: int, periods: int, impacts: list[Impact]) -> PeriodicOrbit:
    """Return the orbit of some turns of another one that has these impacts in its forcing periods."""
    phases, hit, speeds = (np.array(each) for each in zip(*impacts, strict=True))
    body, contacts = like.body, hit.astype(np.int32)
    if body.has_own_period:
        order = np.argsort(phases)
        phases = (phases[order] - phases[order][0]) / turns
        return PeriodicOrbit(body.with_period(turns * like.period), 1, phases, contacts[order], speeds[order])
    made = ordered(PeriodicOrbit(body, periods, phases, contacts, speeds))
    start = like.state_at(float(made.phases[0])) if body.yields else None
    found = evaluated(body, made.contacts, made.phases, periods, start)
    return PeriodicOrbit(body, periods, made.phases, made.contacts, found.velocities, found.start)


def _beside(follower: Follower, orbit: PeriodicOrbit, value: float) -> Iterator[Departure]:
    """Yield the branch of an orbit at a graze in the direction of its physical orbits, if there are any."""
    try:
        start = follower.on_branch(orbit, value, None)
    except OrbitError:
        return  # contacts overlap next to it
    is_square = orbit.body.has_own_period or orbit.body.yields
    away = (BESIDE_SQUARE if is_square else BESIDE) * follower.settings.longest
    for each in (start, start.turned):
        found = follower.step(each, away)
        if found is not None and found[0].orbit.is_physical:
            next_to = found[0]
            yield Departure(each, "graze", is_stable=next_to.orbit.is_stable, beside=next_to.value)
            return


def passes(branch: Branch, start: BranchOrbit, span: float) -> bool:
    """Tell whether a branch ends at an orbit, or has a special point there, or at its mirror image."""
    ends = [*branch.orbits[:1], *branch.orbits[-1:], *(point.at for point in branch.points)]
    near = [each for each in ends if abs(each.value - start.value) < SAME_VALUE * span]
    images = [each for each in (start.orbit, mirror_image(start.orbit)) if each is not None] if near else []
    return any(are_alike(each.orbit, image) for each in near for image in images)
