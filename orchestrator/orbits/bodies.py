"""The modes and contacts of a scene, which define its orbits, with the numbers that its FMU gets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies import BodyPoints, ImpactingBody
from vibroimpact.fmus.bodies.adrift import loose_first, without_drift
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.limits import OF_OWN_PERIOD, Seen, refuse_orbits, seen, seen_of_drag
from vibroimpact.orchestrator.run.parameters import body_points, float_parameters
from vibroimpact.orchestrator.scene import Scene

Floats = NDArray[np.float64]
SLIGHT = 1e-12
"""Negative damping, over the largest, below which it is rounding."""
YIELDING = frozenset({"law"})
"""Rows of the table of limits that orbits on stops that yield take."""


def impacting_body(scene: Scene, *, all_kinds: bool = False, yielding: bool = False) -> ImpactingBody:
    """Return the modes, the force and the contacts of a scene: an Oscillator, Chain, Beam or Structure on its stops.

    Parameters
    ----------
    scene : Scene
        In the short form; its sweep is ignored.
    all_kinds : bool
        Whether stops that yield are taken, too. Whether the scene may be without a force: negative dashpots then keep
        the body moving (equations.md 4.16). And whether nothing need tie the body to the ground: its drift is then
        told apart.
    yielding : bool
        Whether stops that yield are taken, alone among these kinds.

    Raises
    ------
    UsageError
        The scene is not a body of modes between such stops under forces of one period.
    """
    own = all_kinds and scene.period is None
    refuse_orbits(scene, seen(scene), OF_OWN_PERIOD if own else YIELDING if all_kinds or yielding else ())
    found = (_without_force(scene) if own else body_points(scene)).mass_normalised()
    order = np.argsort(found.frequencies != 0.0, kind="stable")
    found = replace(loose_first(found, order), has_own_period=own)
    if all_kinds and found.loose and not found.is_dragged:
        found = without_drift(found, _velocities(scene)[order])
    if found.is_dragged:
        refuse_orbits(scene, [seen_of_drag(scene)])
    stop_keys = scene.stop_keys
    for key, contact in zip(stop_keys, found.contacts, strict=True):
        if found.loose and contact.press is not None and not contact.press.is_linear:
            refuse_orbits(scene, [Seen("placed", f"{key}.law", f'"{contact.press.law}"')])
        if not contact.shape @ contact.shape > 0.0:
            refuse_orbits(scene, [Seen("held", key, "one that is held")])
    if any(key.startswith("contact") for key in stop_keys):
        keys = (key.replace("[", " ").removesuffix("]") for key in stop_keys)
        named = [replace(each, name=name) for each, name in zip(found.contacts, keys, strict=True)]
        return replace(found, contacts=tuple(named))
    return found


def _velocities(scene: Scene) -> Floats:
    """Return the modal velocities at the start of a scene, kg^(1/2) m/s."""
    names = scene.body.start_names
    floats = float_parameters(scene, None)
    velocities = [floats[name] for name in names[len(names) // 2 :]]
    return np.asarray(modal_displacements(scene, np.array([velocities]))[0])


def _without_force(scene: Scene) -> BodyPoints:
    """Return the body of a scene without a force; its clock has any period until an orbit sets it."""
    clock = {"forcing.angular_frequency": 1.0, "forcing.amplitude": 0.0, "forcing.phase": 0.0}
    return body_points(scene, clock | float_parameters(scene, None))


def refuse_without_energy(scene: Scene, body: ImpactingBody) -> None:
    """Raise UsageError for a body without a force that no dashpot gives energy: no orbit of it is isolated."""
    if not body.has_own_period:
        return
    damping = np.diag(body.damping_ratios) if body.coupling is None else body.coupling
    if not (np.linalg.eigvalsh(damping) < -SLIGHT * np.abs(damping).max()).any():
        raise UsageError(
            f"{scene.source}: forcing: expected a force, or a negative dashpot that gives energy, got neither: the "
            "motion dies away, or keeps any energy that it has."
        )


def modal_displacements(scene: Scene, displacements: Floats) -> Floats:
    """Return displacements of the masses of a chain, or of the modes of a beam, in mass-normalised modes.

    The given displacements have shape (state, mass or mode), m; an oscillator has one mass. The result has shape
    (state, mode), kg^(1/2) m.
    """
    return body_points(scene).normalised(displacements)
