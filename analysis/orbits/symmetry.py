"""Mirror symmetry of bodies between equal stops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Complexes, Contact, Floats, ImpactingBody

EQUAL = 1e-12
"""Difference, over the larger size, up to which numbers of a body and of its mirror image are equal."""


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
    if abs(one.restitution - other.restitution) > EQUAL:
        return False
    orders = {*one.motion, *other.motion}
    here = np.array([one.position, *(one.motion.get(n, 0j) for n in sorted(orders))])
    turned = np.array([other.position, *(other.motion.get(n, 0j) * (-1) ** n for n in sorted(orders))])
    return _equal(one.direction * here, other.direction * turned) and _equal(
        one.direction * one.shape, -other.direction * other.shape
    )


def _equal(one: Floats | Complexes, other: Floats | Complexes) -> bool:
    return bool(np.abs(one - other).max() <= EQUAL * max(np.abs(one).max(), np.abs(other).max()))
