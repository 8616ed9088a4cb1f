"""A branch of periodic orbits over a parameter, and its special points: equations.md 4.4 to 4.13."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from vibroimpact.analysis.orbits.branch_points import BRANCH_POINT
from vibroimpact.analysis.orbits.periodic import TOUCHES, PeriodicOrbit
from vibroimpact.analysis.orbits.sign_changes import determinant, turning
from vibroimpact.analysis.orbits.symmetry import is_symmetric
from vibroimpact.fmus.bodies.impacting_body import Floats

CLOSED = "closed"
"""End of a branch that returns to its first orbit."""


@dataclass(frozen=True, eq=False)
class BranchOrbit:
    """An orbit on a branch.

    Attributes
    ----------
    value : float
        Value of the parameter.
    orbit : PeriodicOrbit
        Its phases need not lie in the first period: they continue from orbit to orbit.
    tangent : array, shape (p + 1,)
        Direction of the branch: unknowns of the orbit, then the parameter over its range.
    border : float
        Determinant of the equations and the tangent, which changes its sign at a branch point: equations.md 4.13.
    """

    value: float
    orbit: PeriodicOrbit
    tangent: Floats
    border: float

    @property
    def turned(self) -> BranchOrbit:
        """The orbit on the branch in the other direction."""
        return BranchOrbit(self.value, self.orbit, -self.tangent, -self.border)

    @cached_property
    def tests(self) -> dict[str, float]:
        """Functions whose sign changes at a special point, by kind."""
        orbit = self.orbit
        size = orbit.monodromy.shape[0]
        fast = float(np.prod(np.minimum(orbit.velocities[orbit.is_rigid], 1.0)))
        scale = orbit.body.scale
        tests = {
            BRANCH_POINT: self.border,
            "fold": float(self.tangent[-1]),
            "period doubling": determinant(orbit.monodromy + np.eye(size)) * fast,
            "graze": float(orbit.velocities.min()),
            "graze between impacts": TOUCHES - max(orbit.highest[0] / scale, -1.0),
        }
        if size > 2:
            tests["torus"] = turning(orbit.multipliers)
        return tests


@dataclass(frozen=True, slots=True)
class SpecialPoint:
    """A point of a branch where its orbits change.

    Attributes
    ----------
    kind : str
        `fold`, `period doubling`, `torus`, `branch point` (another branch crosses), `graze` (an impact without speed),
        `graze between impacts` (a maximum touches a stop), or `stability change` (no known cause).
    at : BranchOrbit
    place : int
        Index of the next orbit of the branch.
    """

    kind: str
    at: BranchOrbit
    place: int


@dataclass(slots=True)
class Branch:
    """Orbits that are continuously connected, in the order of the branch.

    Attributes
    ----------
    orbits : list of BranchOrbit
    points : list of SpecialPoint
        Special points in their order.
    ends : list of str
        Reasons of both ends, at its first and at its last orbit.
    origin : str
        Description of its starting point.
    """

    origin: str
    orbits: list[BranchOrbit] = field(default_factory=list)
    points: list[SpecialPoint] = field(default_factory=list)
    ends: list[str] = field(default_factory=list)

    @property
    def name(self) -> str:
        """P(p,q)."""
        return self.orbits[0].orbit.name

    @property
    def full_name(self) -> str:
        """P(p,q), with the stops of its impacts if the body has several."""
        return self.orbits[0].orbit.full_name

    @property
    def is_symmetric(self) -> bool:
        """Whether its orbits are their own mirror images; single ones of another branch may be, too."""
        count = len(self.orbits)
        return all(is_symmetric(self.orbits[k].orbit) for k in {count // 3, count // 2})

    @property
    def is_closed(self) -> bool:
        """Whether its last orbit is its first again."""
        return CLOSED in self.ends

    @property
    def values(self) -> Floats:
        """The parameter of each orbit."""
        return np.array([each.value for each in self.orbits])


def joined(backward: Branch, forward: Branch) -> Branch:
    """Return both ways from one orbit as one branch, from the end of the first to the end of the second."""
    count = len(backward.orbits)
    turned = [each.turned for each in reversed(backward.orbits)]
    points = [
        SpecialPoint(point.kind, point.at.turned, count - 1 - point.place)
        for point in reversed(backward.points)
    ]
    points += [SpecialPoint(point.kind, point.at, point.place + count - 1) for point in forward.points]
    return Branch(forward.origin, turned + forward.orbits[1:], points, backward.ends + forward.ends)
