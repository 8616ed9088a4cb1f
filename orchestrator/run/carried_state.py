"""The state of a structure that a sweep carries to its next point, where a stop may have moved into the body.

A rigid stop that has moved beyond the body pushes the body back by the smallest motion in the metric of its masses.
This motion follows the mobility of the contact, as an impulse at the stop would. The contact points then rest on
their stops, and all other motion is kept. A compliant stop is only pressed in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies import BodyPoints
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.models import Stop, StopTable

Floats = NDArray[np.float64]
State = tuple[float, ...]

#: Distance beyond a stop over the sum of all modal contributions, above which the stop has moved.
MOVED = 1e-12
#: Relative distance beyond a stop, up to which a contact is on its stop, as in its FMU.
ROUNDING = 2.0 * float(np.finfo(np.float64).eps)
#: Relative distance in front of its stop at which a contact is put, so that rounding in its FMU keeps it in front.
MARGIN = 1e-14


def on_free_side(body: BodyPoints, stops: Sequence[Stop], state: State, phases: Sequence[float]) -> State:
    """Return the state of a structure, pushed back where it is beyond a rigid stop.

    Parameters
    ----------
    body : BodyPoints
    stops : sequence of stops
    state : tuple of float
        Displacements, then velocities.
    phases : sequence of float
        Phase of the motion of each stop, rad; 0 for a stop that stands still.
    """
    rigid = [number for number, stop in enumerate(stops) if LAWS[stop.law].is_rigid]
    if not rigid:
        return state
    q, p = np.array(state).reshape(2, -1)
    signs = np.array([1.0 if stops[number].side == "upper" else -1.0 for number in rigid])
    places = [_place(stops[number], phases[number]) for number in rigid]
    positions, speeds = np.array(places).T
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
        p = p - _smallest(shapes[moved], motions[moved], shapes[moved] @ p - speeds[moved])
    return (*q.tolist(), *p.tolist())


def _place(stop: Stop, phase: float) -> tuple[float, float]:
    """Return the position (m) and the speed (m/s) of a stop whose motion is a sine at this phase."""
    if not isinstance(stop, StopTable):
        return stop.position, 0.0
    amplitude = stop.motion_amplitude
    speed = -stop.motion_angular_frequency * amplitude * math.sin(phase)
    return stop.position + amplitude * math.cos(phase) if amplitude else stop.position, speed


def _smallest(shapes: Floats, motions: Floats, distances: Floats) -> Floats:
    """Return the motion with the smallest kinetic energy that moves the contacts by the given distances."""
    forces = np.linalg.lstsq(shapes @ motions.T, distances, rcond=None)[0]
    return np.asarray(motions.T @ forces, dtype=np.float64)
