"""The state of a structure that a sweep carries to its next point, where a stop may have moved into the body.

A rigid stop that has moved beyond the body pushes it back by the smallest motion in the metric of its masses:
along the mobility of the contact, which is the way an impulse at the stop would move it, and the contact points
then rest on their stops. All other motion is kept. A compliant stop is just pressed in.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies import BodyPoints
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.models import Stop

Floats = NDArray[np.float64]
State = tuple[float, ...]

#: Distance beyond a stop, relative to the sum of what the modes contribute, above which the stop has moved.
MOVED = 1e-12
#: Relative distance below which a contact is on its stop, as in its FMU.
ROUNDING = 2.0 * float(np.finfo(np.float64).eps)
#: Relative distance in front of its stop at which a contact is put, lest rounding has it beyond in its FMU.
MARGIN = 1e-14


def on_free_side(body: BodyPoints, stops: Sequence[Stop], state: State) -> State:
    """Return a state of a structure that passes no rigid stop."""
    rigid = [number for number, stop in enumerate(stops) if LAWS[stop.law].is_rigid]
    if not rigid:
        return state
    q, p = np.array(state).reshape(2, -1)
    signs = np.array([1.0 if stops[number].side == "upper" else -1.0 for number in rigid])
    positions = np.array([stops[number].position for number in rigid])
    shapes = body.contact_shapes()[rigid]
    motions = body.contact_mobilities(shapes)
    active = np.zeros(len(rigid), dtype=bool)
    moved = active.copy()
    for _ in rigid:  # pushing back from one stop may push into another
        size = np.abs(positions) + np.abs(shapes * q).sum(axis=1)
        beyond = signs * (shapes @ q - positions)
        if not (beyond > ROUNDING * size).any():
            break
        active |= beyond > ROUNDING * size
        moved |= beyond > MOVED * size
        target = positions[active] - signs[active] * MARGIN * size[active]
        q = q + _smallest(shapes[active], motions[active], target - shapes[active] @ q)
    if moved.any():
        p = p - _smallest(shapes[moved], motions[moved], shapes[moved] @ p)
    return (*q.tolist(), *p.tolist())


def _smallest(shapes: Floats, motions: Floats, wanted: Floats) -> Floats:
    """Return the smallest motion, by its kinetic energy, that moves the contacts by so much."""
    forces = np.linalg.lstsq(shapes @ motions.T, wanted, rcond=None)[0]
    return np.asarray(motions.T @ forces, dtype=np.float64)
