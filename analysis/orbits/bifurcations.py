"""Bifurcations of periodic orbits, the functions that are 0 there, and their loci over two parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.branch import CLOSED, SpecialPoint
from vibroimpact.analysis.orbits.branch_points import BRANCH_POINT
from vibroimpact.analysis.orbits.mirrored_halves import Halves, slopes_of
from vibroimpact.analysis.orbits.own_period import alternating_slopes
from vibroimpact.analysis.orbits.periodic import TOUCHES, TURN, PeriodicOrbit, evaluated
from vibroimpact.analysis.orbits.pitchforks import PITCHFORK, is_pitchfork
from vibroimpact.analysis.orbits.sign_changes import turning
from vibroimpact.analysis.orbits.symmetry import differences, is_symmetric, mirror_image, mirrored_contacts
from vibroimpact.fmus.bodies.impacting_body import Floats

GRAZE, BETWEEN = "graze", "graze between impacts"
FOLLOWED_KINDS = ("fold", "period doubling", "torus", PITCHFORK, GRAZE, BETWEEN)
JUMP = 0.5
"""Change of the phase of the highest maximum, rad, above which it is another maximum."""
NEARLY_SYMMETRIC = 0.1
"""Distance of an orbit from its mirror image, rad, below which it is next to a symmetric orbit."""
DOUBLE = 1e-4
"""Distance from 1 or -1 below which a multiplier is that double one: rounding moves double multipliers by its root."""


def folding(orbit: PeriodicOrbit) -> float:
    """Return a function that is 0 at a fold, and smooth through a graze: the determinant of the errors' slopes."""
    return float(np.linalg.det(slopes_of(orbit)))


def alternating(orbit: PeriodicOrbit) -> float:
    """Return a function that is 0 at a period doubling, and smooth through a graze: equations.md 4.7.

    It is the determinant of the errors' slopes for changes that alternate from round to round.
    """
    body = orbit.body
    if body.has_own_period:
        own = alternating_slopes(body, orbit.contacts, orbit.phases, orbit.velocities)
        return float(np.linalg.det(own / body.scale))
    count = orbit.phases.size
    phases = np.concatenate([orbit.phases, orbit.phases + TURN * orbit.periods])
    twice = np.tile(orbit.contacts, 2)
    slopes = evaluated(body, twice, phases, 2 * orbit.periods, orbit.start).distance_slopes
    return float(np.linalg.det((slopes[:count, :count] - slopes[:count, count:]) / body.scale))


def beyond_stop(orbit: PeriodicOrbit) -> float:
    """Return the distance of the highest maximum beyond its stop, over the size of the motion; at least -1."""
    return max(orbit.highest[0] / orbit.body.scale, -1.0) - TOUCHES


def is_other_maximum(one: PeriodicOrbit, other: PeriodicOrbit, first: int = 0) -> bool:
    """Tell whether the highest maxima of two orbits differ; the other orbit is counted from one of its impacts.

    On a symmetric orbit a maximum and its mirror image are as high as each other, and count as one.
    """
    (_, at, contact), (_, at_other, contact_other) = one.highest, other.highest
    whole = TURN * one.periods
    moved = (at_other - other.phases[first]) - (at - one.phases[0])
    apart = abs(np.mod(moved + 0.5 * whole, whole) - 0.5 * whole)
    if contact == contact_other and apart <= JUMP:
        return False
    contacts = mirrored_contacts(one.body) if abs(apart - 0.5 * whole) <= JUMP else None
    is_image = contacts is not None and contact >= 0 and contact_other == contacts[contact]
    return not (is_image and is_symmetric(one))


def partner(orbit: PeriodicOrbit, impact: int) -> int | None:
    """Return the impact that is the mirror image of one of a symmetric orbit; None on another orbit."""
    contacts = mirrored_contacts(orbit.body) if is_symmetric(orbit) else None
    if contacts is None:
        return None
    turn = TURN * orbit.periods
    apart = np.mod(orbit.phases - orbit.phases[impact], turn) - 0.5 * turn
    apart[orbit.contacts != contacts[orbit.contacts[impact]]] = np.inf
    return int(np.abs(apart).argmin())


def meets_torus(multipliers: NDArray[np.complex128]) -> bool:
    """Tell whether two multipliers with the product 1 are complex, or both 1 or both -1: a torus begins there."""
    i, j = np.triu_indices(multipliers.size, 1)
    pair = int(np.argmin(np.abs(1.0 - multipliers[i] * multipliers[j])))
    one = multipliers[i[pair]]
    return bool(abs(one.imag) > DOUBLE or abs(abs(one.real) - 1.0) < DOUBLE)


SMOOTH: dict[str, Callable[[PeriodicOrbit], float]] = {
    "fold": folding,
    "period doubling": alternating,
    "torus": lambda orbit: turning(orbit.multipliers),
}
"""Functions with a zero at the bifurcations that a locus of another kind passes without an end."""


def kind_of(point: SpecialPoint) -> str:
    """Return the kind of the locus that passes a special point: a branch point of symmetric orbits is a pitchfork."""
    is_breaking = point.kind == BRANCH_POINT and is_pitchfork(point.at.orbit)
    return PITCHFORK if is_breaking else point.kind


@dataclass(frozen=True, eq=False)
class Bifurcation:
    """An orbit at a bifurcation, at which a locus can begin.

    Attributes
    ----------
    kind : str
        One of `FOLLOWED_KINDS`.
    orbit : PeriodicOrbit
    values : tuple of float
        Values of both parameters.
    impact : int
        Index of the impact without speed; -1 unless the kind is a graze.
    halves : Halves or None
        Split of the equations, on a locus of symmetric orbits alone.
    """

    kind: str
    orbit: PeriodicOrbit
    values: tuple[float, float]
    impact: int = -1
    halves: Halves | None = None

    @classmethod
    def of(cls, point: SpecialPoint, values: tuple[float, float]) -> Bifurcation:
        """Return the bifurcation at a special point of a branch, with the values of both parameters."""
        orbit = point.at.orbit
        return cls(
            kind_of(point), orbit, values, int(orbit.velocities.argmin()) if point.kind == GRAZE else -1
        )

    def test(self, orbit: PeriodicOrbit) -> float:
        """Return the function that is 0 along the locus, for an orbit next to it."""
        if self.kind == GRAZE:
            return float(orbit.velocities[self.impact])
        if self.kind == BETWEEN:
            beyond, _, contact = orbit.highest
            return beyond / orbit.body.scale if contact >= 0 else float(np.nan)
        return self.smooth[self.kind](orbit)

    @property
    def smooth(self) -> dict[str, Callable[[PeriodicOrbit], float]]:
        """Functions of the smooth bifurcations of orbits of the locus: `SMOOTH`, or those that keep the symmetry.

        Symmetric orbits double their period in no generic way: the multipliers of half an orbit are squared (4.20).
        """
        if self.halves is None:
            return SMOOTH
        return {"fold": self.halves.folding, PITCHFORK: self.halves.breaking, "torus": SMOOTH["torus"]}

    @cached_property
    def _image(self) -> int | None:
        return partner(self.orbit, self.impact)

    def other_speeds(self, orbit: PeriodicOrbit) -> Floats:
        """Return the speeds of the impacts of an orbit next to it; unbounded for the impact without speed.

        The mirror image of this impact, on a symmetric orbit, has no speed either.
        """
        speeds = orbit.velocities.copy()
        if self.kind == GRAZE:
            speeds[self.impact] = np.inf
            if self._image is not None:
                speeds[self._image] = np.inf
        return speeds


@dataclass(frozen=True, eq=False)
class LocusPoint:
    """An orbit at its bifurcation."""

    values: tuple[float, float]
    """Values of both parameters."""
    orbit: PeriodicOrbit
    tangent: Floats
    """Direction of the locus, shape (p + 2,)."""


def within(place: int, lowest: float, highest: float) -> Callable[[LocusPoint], bool]:
    """Return a function that tells whether a point lies in the range of its first (0) or second (1) parameter."""
    return lambda point: lowest <= point.values[place] <= highest


def beyond(place: int, bound: float) -> Callable[[LocusPoint], float]:
    """Return a function that is 0 where the first (0) or second (1) parameter has a value."""
    return lambda point: point.values[place] - bound


def nearly_symmetric(orbit: PeriodicOrbit) -> bool:
    """Tell whether an orbit is next to its mirror image."""
    image = mirror_image(orbit)
    apart = None if image is None else differences(orbit, image)
    return apart is not None and bool(np.abs(apart).max() < NEARLY_SYMMETRIC)


@dataclass(slots=True)
class Locus:
    """Locus of a bifurcation over two parameters.

    Attributes
    ----------
    kind : str
        One of `FOLLOWED_KINDS`.
    points : list of LocusPoint
    special : list of tuple of (str, LocusPoint)
        Points of codimension 2, each with the kind of the other bifurcation; `another`: a second graze between impacts.
        Extrema of folds over the second parameter are `isola centre`, `crossing of branches` or `cusp`.
    starts : list of Bifurcation
        Bifurcations at which the loci begin that leave these points.
    beyond : list of Bifurcation
        Grazes of orbits with another number of impacts, whose loci leave its corners.
    ends : list of str
    origin : str
        Branch or locus, and its point, from which it starts.
    """

    kind: str
    points: list[LocusPoint] = field(default_factory=list)
    special: list[tuple[str, LocusPoint]] = field(default_factory=list)
    starts: list[Bifurcation] = field(default_factory=list)
    beyond: list[Bifurcation] = field(default_factory=list)
    ends: list[str] = field(default_factory=list)
    origin: str = ""

    @property
    def is_closed(self) -> bool:
        """Whether its last point is its first again."""
        return CLOSED in self.ends


def joined_loci(backward: Locus, forward: Locus) -> Locus:
    """Return both ways from one point as one locus."""
    return Locus(
        backward.kind,
        backward.points[::-1] + forward.points[1:],
        backward.special[::-1] + forward.special,
        backward.starts[::-1] + forward.starts,
        backward.beyond[::-1] + forward.beyond,
        backward.ends + forward.ends,
        backward.origin,
    )
