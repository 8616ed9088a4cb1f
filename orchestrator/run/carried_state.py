"""The state of a structure that a sweep carries to its next point, where a stop may have moved into the body.

A rigid stop that has moved beyond the body pushes it back by the smallest motion in the metric of its masses:
along the mobility of the contact, which is the way an impulse at the stop would move it, and the contact points
then rest on their stops. All other motion is kept. A compliant stop is just pressed in.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core import beam_modes
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import BeamBody, ChainBody
from vibroimpact.orchestrator.scene.models import RestitutionStop, Stop
from vibroimpact.orchestrator.scene.places import stop_location, stop_mass

Floats = NDArray[np.float64]

#: Distance beyond a stop, relative to the sum of what the modes contribute, above which the stop has moved.
MOVED = 1e-12
#: Relative distance below which a contact is on its stop, as in its FMU.
ROUNDING = 2.0 * float(np.finfo(np.float64).eps)
#: Relative distance in front of its stop at which a contact is put, lest rounding has it beyond in its FMU.
MARGIN = 1e-14


def on_free_side(scene: Scene, body: ChainBody | BeamBody, state: tuple[float, ...]) -> tuple[float, ...]:
    """Return a state that passes no rigid stop.

    Parameters
    ----------
    scene : Scene
    body : ChainBody or BeamBody
        The body of the scene.
    state : tuple of float
        N displacements (m), then N velocities (m/s), of masses or modes.
    """
    q, p = np.array(state).reshape(2, body.size)
    rigid = [stop for stop in scene.stops if isinstance(stop, RestitutionStop)]
    if not rigid:
        return state
    signs = np.array([1.0 if stop.side == "upper" else -1.0 for stop in rigid])
    positions = np.array([stop.position for stop in rigid])
    shapes = contact_shapes(body, rigid)
    motions = shapes / np.array(body.masses) if isinstance(body, ChainBody) else shapes
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


def contact_shapes(body: ChainBody | BeamBody, stops: Sequence[Stop]) -> Floats:
    """Return the displacement of each contact for 1 m of each mass or mode, shape (stop, N)."""
    if isinstance(body, ChainBody):
        return np.eye(body.size)[[stop_mass(body, stop) - 1 for stop in stops]]
    locations = np.array([stop_location(stop) for stop in stops])
    boundary: Any = body.boundary.replace("-", "_")
    return np.asarray(beam_modes(boundary, body.size).shapes(locations))
