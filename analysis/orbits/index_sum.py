"""The sum of the indices of a body's periodic orbits, which shows whether any are missing: equations.md 4.14.

The strobe map takes the state at one phase of the force to the state q periods later. The index of a fixed point is
the sign of det(I - M). All indices of a damped body add up to 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.orbits.periodic import PeriodicOrbit
from vibroimpact.analysis.orbits.search import same_orbit
from vibroimpact.analysis.orbits.trigonometric import SumOfSines
from vibroimpact.fmus.bodies.impacting_body import Contact, ImpactingBody

NOTHING = "no impacts"
"""Name of the motion without impacts: the steady answer of the modes to the forces."""
PARALLEL = 1e-9
"""Second singular value of the shapes of all contacts, over the first, below which all contacts are at one point."""


@dataclass(frozen=True, slots=True)
class IndexTerm:
    """An orbit in an index sum.

    Attributes
    ----------
    name : str
        P(p,q), or `no impacts`.
    index : int
        Sign of det(I - M), with M over the periods of the sum.
    points : int
        Number of its fixed points: the periods of its shortest orbit.
    """

    name: str
    index: int
    points: int


@dataclass(frozen=True, slots=True)
class IndexSum:
    """The indices of the known fixed points of the strobe map over some periods.

    Attributes
    ----------
    periods : int
        q.
    terms : tuple of IndexTerm
    """

    periods: int
    terms: tuple[IndexTerm, ...]

    @property
    def total(self) -> int:
        """Sum over all fixed points."""
        return sum(each.index * each.points for each in self.terms)

    @property
    def is_complete(self) -> bool:
        """Whether the sum is 1: no orbit is missing, or the missing ones cancel each other."""
        return self.total == 1

    def __str__(self) -> str:
        """Terms of one name and sign together, then the sum: `P(2,1) -1, P(1,1) +2, sum 1`."""
        together: dict[tuple[str, int], int] = {}
        for each in self.terms:
            key = each.name, each.index
            together[key] = together.get(key, 0) + each.points
        rows = ", ".join(f"{name} {index * points:+d}" for (name, index), points in together.items())
        return f"{rows or 'no orbit'}, sum {self.total}"


def index(orbit: PeriodicOrbit, periods: int) -> int:
    """Return the sign of det(I - M) of an orbit, with M over a multiple of its periods; 0 at a fold or graze.

    Complex multipliers come in pairs, and their factors are positive. Each real multiplier above 1 changes the sign.
    """
    multipliers = orbit.multipliers
    if not np.isfinite(multipliers).all():
        return 0
    real = multipliers.real[multipliers.imag == 0.0]
    return int(np.prod(np.sign(1.0 - real ** (periods // orbit.periods))))


def index_sum(
    body: ImpactingBody,
    orbits: Iterable[PeriodicOrbit],
    periods: int,
    resting: Sequence[int] = (),
    located: Sequence[IndexTerm] = (),
) -> IndexSum:
    """Return the index sum of the known orbits of a body, and of its motion without impacts.

    Parameters
    ----------
    body : ImpactingBody
    orbits : iterable of PeriodicOrbit
        Known physical orbits at the body's numbers; equal ones count once, those of no divisor of q not at all.
    periods : int
        q, the forcing periods of the strobe map.
    resting : sequence of int
        Forcing periods of each known orbit that rests on a stop. Such an orbit attracts, so that its index is 1.
    located : sequence of IndexTerm
        Further fixed points, located by the strobe map itself.

    """
    terms = [IndexTerm(NOTHING, 1, 1)] if clears_stops(body) else []
    known = distinct(orbits, periods)
    terms += [IndexTerm(each.name, index(each, periods), each.periods) for each in known]
    terms += [IndexTerm(f"P(inf,{own})", 1, own) for own in resting if periods % own == 0]
    return IndexSum(periods, (*terms, *located))


def distinct(orbits: Iterable[PeriodicOrbit], periods: int) -> list[PeriodicOrbit]:
    """Return the shortest orbits whose number of periods divides q, each once."""
    known: list[PeriodicOrbit] = []
    for each in orbits:
        orbit = each.once
        if periods % orbit.periods == 0 and not any(same_orbit(orbit, other) for other in known):
            known.append(orbit)
    return known


def clears_stops(body: ImpactingBody) -> bool:
    """Return whether the motion without impacts stays clear of all stops; every maximum is found."""
    for contact in body.contacts:
        motion = _beyond(body, contact)
        if motion.at(np.zeros(1))[0][0] > 0.0 or motion.zeros():
            return False
    return True


def _beyond(body: ImpactingBody, contact: Contact) -> SumOfSines:
    """Return the distance of a contact beyond its stop in the motion without impacts, m, over the phase."""
    shape, direction = contact.shape, contact.direction
    amplitudes = np.array(
        [
            body.steady(order * body.angular_frequency, force) @ shape
            for order, force in body.harmonics.items()
        ]
    )
    return SumOfSines(
        direction * (float(body.levels @ shape) - contact.position),
        np.array(list(body.harmonics), dtype=float),
        direction * amplitudes.real,
        -direction * amplitudes.imag,
    )


def why_without_sum(body: ImpactingBody) -> str:
    """Return the reason that the indices of a body need not add up to 1; empty if they do."""
    if body.loose or not body.slowest_decay > 0.0:
        return "a mode without damping, so that the motion may grow"
    if any(contact.motion for contact in body.contacts):
        return "a stop that moves, so that impacts may bring energy"
    if body.frequencies.size > 1 and len(body.contacts) > 1:
        shapes = np.array([contact.shape for contact in body.contacts])
        sizes = np.linalg.svd(shapes, compute_uv=False)
        if sizes[1] > PARALLEL * sizes[0]:
            return "several modes and contacts, of which two can be met at once: the strobe map jumps there"
    return ""
