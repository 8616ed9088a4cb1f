"""The modes and contacts of a scene, which define its orbits, with the numbers that its FMU gets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies import ImpactingBody
from vibroimpact.orchestrator.run.limits import Seen, refuse_orbits, seen, seen_of_drag
from vibroimpact.orchestrator.run.parameters import body_points
from vibroimpact.orchestrator.scene import Scene

Floats = NDArray[np.float64]
TAKEN = ("law",)
"""Rows of the table of limits that orbits on stops that yield take."""


def impacting_body(scene: Scene, *, yields: bool = False) -> ImpactingBody:
    """Return the modes, the force and the contacts of a scene: an Oscillator, Chain, Beam or Structure on its stops.

    Parameters
    ----------
    scene : Scene
        In the short form; its sweep is ignored.
    yields : bool
        Whether stops that yield are taken, too.

    Raises
    ------
    UsageError
        The scene is not a body of modes between such stops under forces of one period.
    """
    refuse_orbits(scene, seen(scene), TAKEN if yields else ())
    body = body_points(scene)
    found = body.mass_normalised()
    if found.is_dragged:
        refuse_orbits(scene, [seen_of_drag(scene)])
    for key, contact in zip(scene.stop_keys, found.contacts, strict=True):
        if found.loose and contact.press is not None and not contact.press.is_linear:
            refuse_orbits(scene, [Seen("placed", f"{key}.law", f'"{contact.press.law}"')])
        if not contact.shape @ contact.shape > 0.0:
            refuse_orbits(scene, [Seen("held", key, "one that is held")])
    if any(key.startswith("contact") for key in scene.stop_keys):
        keys = (key.replace("[", " ").removesuffix("]") for key in scene.stop_keys)
        named = [replace(each, name=name) for each, name in zip(found.contacts, keys, strict=True)]
        return replace(found, contacts=tuple(named))
    return found


def modal_displacements(scene: Scene, displacements: Floats) -> Floats:
    """Return displacements of the masses of a chain, or of the modes of a beam, in mass-normalised modes.

    The given displacements have shape (state, mass or mode), m; an oscillator has one mass. The result has shape
    (state, mode), kg^(1/2) m.
    """
    return body_points(scene).normalised(displacements)
