"""Mirror symmetry of bodies between equal stops, and orbits that are compared, also with mirror images: 4.13."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.periodic import TURN, PeriodicOrbit, ordered
from vibroimpact.fmus.bodies.impacting_body import Complexes, Contact, Floats, ImpactingBody

EQUAL = 1e-12
"""Difference, over the larger size, up to which numbers of a body and of its mirror image are equal."""
ALIKE = 1e-6
"""Difference of the unknowns (phases, rad) up to which two orbits at one value of the parameter are the same."""


def mirrored_contacts(body: ImpactingBody) -> NDArray[np.int32] | None:
    """Return the contact that takes the place of each one in the mirror image half a period later; None without one.

    The mirror image of a motion is -x(t + T/2). Force and stops are their own mirror image without constant forces and
    without even harmonics of the force.
    """
    even = [force for order, force in body.further.items() if order % 2 == 0]
    if body.held.any() or any(force.any() for force in even):
        return None
    images = []
    for contact in body.contacts:
        found = [k for k, other in enumerate(body.contacts) if _is_image(contact, other)]
        if not found:
            return None
        images.append(found[0])
    return np.array(images, dtype=np.int32)


def _is_image(one: Contact, other: Contact) -> bool:
    """Tell whether the mirror image of a stop, half a period later, is another one."""
    if abs(one.restitution - other.restitution) > EQUAL or one.yield_velocity != other.yield_velocity:
        return False
    if one.press != other.press:
        return False
    orders = {*one.motion, *other.motion}
    here = np.array([one.position, *(one.motion.get(n, 0j) for n in sorted(orders))])
    turned = np.array([other.position, *(other.motion.get(n, 0j) * (-1) ** n for n in sorted(orders))])
    return _equal(one.direction * here, other.direction * turned) and _equal(
        one.direction * one.shape, -other.direction * other.shape
    )


def _equal(one: Floats | Complexes, other: Floats | Complexes) -> bool:
    return bool(np.abs(one - other).max() <= EQUAL * max(np.abs(one).max(), np.abs(other).max()))


def mirror_image(orbit: PeriodicOrbit) -> PeriodicOrbit | None:
    """Return the mirror image of an orbit, half a period later; None if its body has no mirror symmetry.

    Without a force the image need not be later.
    """
    contacts = mirrored_contacts(orbit.body)
    if contacts is None:
        return None
    later = orbit.phases if orbit.body.has_own_period else orbit.phases + 0.5 * TURN
    start = None if orbit.start is None else -orbit.start
    return ordered(
        PeriodicOrbit(orbit.body, orbit.periods, later, contacts[orbit.contacts], orbit.velocities, start)
    )


def is_symmetric(orbit: PeriodicOrbit) -> bool:
    """Tell whether an orbit is its own mirror image."""
    image = None if orbit.periods % 2 == 0 else mirror_image(orbit)
    return image is not None and are_alike(orbit, image)


def differences(one: PeriodicOrbit, other: PeriodicOrbit) -> Floats | None:
    """Return the unknowns of another orbit less those of one, counted from the impact and period that fit best.

    None if their stops are hit in another order.
    """
    if one.contacts.size != other.contacts.size or one.periods != other.periods:
        return None
    shifts = [k for k in range(one.contacts.size) if (np.roll(other.contacts, -k) == one.contacts).all()]
    apart = [other.counted_from(k).unknowns - one.unknowns for k in shifts]
    if not one.body.has_own_period:
        apart = [each - TURN * np.round(each.mean() / TURN) for each in apart]
    return min(apart, key=lambda each: float(np.abs(each).max()), default=None)


def are_alike(one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    """Tell whether two orbits of one body are the same, from whichever impact and period they are counted."""
    apart = differences(one, other)
    return apart is not None and bool(np.abs(apart).max() < ALIKE)
