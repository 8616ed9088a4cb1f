"""Corners of loci of grazes, where a second impact or maximum touches a stop: equations.md 4.19.

Both touches may be impacts of an orbit, or maxima. Each touch is thus 0 along two curves, with and without the other
touch as an impact: four curves meet.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vibroimpact.analysis.orbits.bifurcations import GRAZE, Bifurcation, partner
from vibroimpact.analysis.orbits.departures import Impact, orbit_of_impacts, touching_maxima
from vibroimpact.analysis.orbits.periodic import TURN, OrbitError, PeriodicOrbit
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.core.orbits import MOST_IMPACTS

CORNER = "corner with another graze"
"""End of a locus of grazes where a second touch of a stop begins."""
MOST_NEWTON = 12
SOLVED = 1e-11
"""Errors of an orbit, over the size of the motion, and speeds, over its fastest, up to which a corner is found."""
MOST_MOVED = 0.3
"""Change of the unknowns, in ranges and radians, above which another corner was found."""

Residual = Callable[[PeriodicOrbit, Floats], tuple[PeriodicOrbit, Floats]]
"""Function that returns an orbit with the impacts of another one, and its errors, for unknowns and both parameters."""


class TwoTouches(NamedTuple):
    """A locus of grazes, its orbit at a corner, and the touch that begins there.

    Attributes
    ----------
    start : Bifurcation
        Beginning of the locus.
    at : PeriodicOrbit
        Orbit at the corner, or near to it.
    other : int or PeriodicOrbit
        Index of the impact that loses its speed, or an orbit next to the corner whose highest maximum is the touch.
    near : PeriodicOrbit
        Orbit of the locus before the corner: at the corner a slow impact may hide the maximum that touches.
    """

    start: Bifurcation
    at: PeriodicOrbit
    other: int | PeriodicOrbit
    near: PeriodicOrbit


class Corner(NamedTuple):
    """Both parameters at a corner, over their ranges, the locus's orbit, and the grazes of other orbits there."""

    parameters: Floats
    at: PeriodicOrbit
    beyond: list[tuple[PeriodicOrbit, int]]


def corner_of(
    touches: TwoTouches, parameters: Floats, residual: Residual, slope_step: float
) -> Corner | None:
    """Return the corner near an orbit; None if Newton's method finds none.

    `parameters` are those near the corner, over their ranges. `slope_step` is the change of the unknowns for slopes.
    """
    start, at, other, near = touches
    own = _touches(at, start.impact) if start.kind == GRAZE else touching_maxima(near)
    second = _touches(at, other) if isinstance(other, int) else touching_maxima(other)
    phases = {each[0] for each in (*own, *second)}
    always = [each for each in _every(at) if each[0] not in phases]
    if len(always) + len(own) + len(second) > MOST_IMPACTS:
        return None
    try:
        like = orbit_of_impacts(at, 1, at.periods, [*always, *own, *second])
        here = [[_place(like, each) for each in group] for group in (own, second)]
        found = _solved(like, parameters, [group[0] for group in here], residual, slope_step)
        if found is None:
            return None
        orbit, unknowns = found
        rest = [k for k in range(orbit.phases.size) if k not in (*here[0], *here[1])]
        # the locus itself and the locus that already begins at the corner are two of the four curves
        wanted = [
            (here[0], here[0] if isinstance(other, int) else [*here[0], *here[1]]),
            (here[1], here[1] if start.kind == GRAZE else [*here[0], *here[1]]),
        ]
        beyond = [_graze_of(orbit, graze[0], [*rest, *impacts]) for graze, impacts in wanted]
        impacts = [
            *rest,
            *(here[0] if start.kind == GRAZE else []),
            *(here[1] if isinstance(other, int) else []),
        ]
        same = _with_impacts(orbit, impacts)
    except (OrbitError, np.linalg.LinAlgError):
        return None  # contacts of such an orbit overlap
    return Corner(unknowns[-2:], same, beyond)


def _solved(
    like: PeriodicOrbit, parameters: Floats, silent: list[int], residual: Residual, slope_step: float
) -> tuple[PeriodicOrbit, Floats] | None:
    """Return the orbit whose two touches have no speed, and the unknowns, by Newton's method."""
    begin = unknowns = np.append(like.unknowns, parameters)

    def errors(unknowns: Floats) -> tuple[PeriodicOrbit, Floats]:
        orbit, distances = residual(like, unknowns)
        return orbit, np.append(distances, orbit.velocities[silent])

    for _ in range(MOST_NEWTON):
        orbit, off = errors(unknowns)
        size = np.append(np.ones(off.size - 2), np.full(2, max(float(orbit.velocities.max()), 1.0)))
        if np.abs(off / size).max() <= SOLVED:
            return (orbit, unknowns) if np.abs(unknowns - begin).max() < MOST_MOVED else None
        axes = slope_step * np.eye(unknowns.size)
        slopes = [
            (errors(unknowns + axis)[1] - errors(unknowns - axis)[1]) / (2.0 * slope_step) for axis in axes
        ]
        # a symmetric orbit has more touches than unknowns need
        unknowns = unknowns - np.linalg.lstsq(np.column_stack(slopes), off, rcond=1e-9)[0]
    return None


def _touches(orbit: PeriodicOrbit, impact: int) -> list[Impact]:
    """Return phase, contact and speed of an impact, and of its mirror image on a symmetric orbit."""
    image = partner(orbit, impact)
    every = _every(orbit)
    return [every[k] for k in (impact, image) if k is not None]


def _place(orbit: PeriodicOrbit, touch: Impact) -> int:
    """Return the index of the impact that is a touch."""
    turn = TURN * orbit.periods
    apart = np.abs(np.mod(orbit.phases - touch[0] + 0.5 * turn, turn) - 0.5 * turn)
    apart[orbit.contacts != touch[1]] = np.inf
    return int(apart.argmin())


def _graze_of(orbit: PeriodicOrbit, graze: int, impacts: list[int]) -> tuple[PeriodicOrbit, int]:
    """Return the orbit with some impacts of another one, and the index of its graze."""
    made = _with_impacts(orbit, impacts)
    return made, _place(made, _every(orbit)[graze])


def _with_impacts(orbit: PeriodicOrbit, impacts: list[int]) -> PeriodicOrbit:
    """Return the orbit with some impacts of another one."""
    every = _every(orbit)
    return orbit_of_impacts(orbit, 1, orbit.periods, [every[k] for k in impacts])


def _every(orbit: PeriodicOrbit) -> list[Impact]:
    """Return phase, contact and speed of all impacts."""
    return [
        (float(phase), int(contact), float(speed))
        for phase, contact, speed in zip(orbit.phases, orbit.contacts, orbit.velocities, strict=True)
    ]
