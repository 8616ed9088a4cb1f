"""Equations of symmetric orbits, split for equal and opposite changes of an impact and its image: equations.md 4.20."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.orbits.periodic import TURN, PeriodicOrbit, tried
from vibroimpact.analysis.orbits.symmetry import is_symmetric, mirrored_contacts
from vibroimpact.fmus.bodies.impacting_body import Floats


@dataclass(frozen=True, eq=False)
class Halves:
    """Split of the n unknowns and n errors of orbits next to a symmetric one, h = n / 2.

    Attributes
    ----------
    equal, opposite : array, shape (n, h)
        Changes of the unknowns that keep the symmetry, and changes that the mirror image turns round.
    mean, difference : array, shape (h, n)
        Rows that take the mean of the errors of an impact and its image, and half their difference.
    apart, offset : array, shapes (h, n) and (h,)
        Rows whose product with the unknowns is `offset` on symmetric orbits alone.
    """

    equal: Floats
    opposite: Floats
    mean: Floats
    difference: Floats
    apart: Floats
    offset: Floats

    def errors(self, errors: Floats, unknowns: Floats) -> Floats:
        """Return n errors that are 0 on symmetric orbits alone: means of errors, then distances from the symmetry."""
        return np.concatenate([self.mean @ errors, self.apart @ unknowns - self.offset])

    def equal_slopes(self, slopes: Floats) -> Floats:
        """Return the slopes of the errors for changes that keep the symmetry, shape (h, h)."""
        return np.asarray(self.mean @ slopes @ self.equal)

    def opposite_slopes(self, slopes: Floats) -> Floats:
        """Return the slopes of the errors for changes that break the symmetry, shape (h, h)."""
        return np.asarray(self.difference @ slopes @ self.opposite)

    def folding(self, orbit: PeriodicOrbit) -> float:
        """Return a function that is 0 where symmetric orbits have a fold."""
        return float(np.linalg.det(self.equal_slopes(slopes_of(orbit))))

    def breaking(self, orbit: PeriodicOrbit) -> float:
        """Return a function that is 0 where symmetric orbits have a pitchfork."""
        return float(np.linalg.det(self.opposite_slopes(slopes_of(orbit))))

    def symmetric(self, unknowns: Floats) -> Floats:
        """Return the unknowns of the nearest symmetric orbit."""
        return np.asarray(unknowns - np.linalg.pinv(self.apart) @ (self.apart @ unknowns - self.offset))


def slopes_of(orbit: PeriodicOrbit) -> Floats:
    """Return the derivatives of the errors of an orbit over its size, shape (n, n)."""
    return tried(orbit.body, orbit, orbit.unknowns).slopes / orbit.body.scale


def halves_of(orbit: PeriodicOrbit) -> Halves | None:
    """Return the split of the equations of a symmetric orbit; None for another one."""
    if orbit.phases.size % 2 or not is_symmetric(orbit):
        return None
    return halves_like(orbit)


def halves_like(orbit: PeriodicOrbit) -> Halves | None:
    """Return the split of the equations of an orbit next to a symmetric one; None if its impacts have no such order."""
    contacts, count = mirrored_contacts(orbit.body), orbit.phases.size
    half = count // 2
    if contacts is None or count % 2 or (contacts[orbit.contacts] != np.roll(orbit.contacts, -half)).any():
        return None
    one = np.eye(half)
    equal, opposite = np.vstack([one, one]), np.vstack([one, -one])
    mean, difference, apart = 0.5 * equal.T, 0.5 * opposite.T, -opposite.T
    offset = np.full(half, 0.5 * TURN * orbit.periods)
    if not orbit.body.has_own_period:
        return Halves(equal, opposite, mean, difference, apart, offset)
    # the unknowns are the period, the phases less that of the first impact, and the speeds
    none, period = np.zeros((count, half)), np.eye(2 * count)[:, :1]
    kept, broken = equal - equal[0], opposite - opposite[0]
    rows, means, differences = (
        np.kron(np.eye(2), each).astype(np.float64) for each in (apart, mean, difference)
    )
    rows[:, 0] = 0.0  # the phase of the first impact is 0
    return Halves(
        np.hstack([period, np.vstack([kept, none])[:, 1:], np.vstack([none, equal])]),
        np.block([[broken, none], [none, opposite]]),
        means,
        differences,
        rows,
        np.concatenate([offset, np.zeros(half)]),
    )
