"""From a scene to the modes and contacts that its orbits follow from: the numbers that its FMU gets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies import BodyPoints, ImpactingBody
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.body import body_points
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.models import RestitutionStop

Floats = NDArray[np.float64]
VARIATIONAL = "variational"
_LOOSE = {
    "oscillator": ("body.stiffness", "a spring where orbits are followed", "none"),
    "chain": ("body.stiffnesses", "a chain tied to the ground", "one that is loose"),
}


def impacting_body(scene: Scene) -> ImpactingBody:
    """Return the modes, the force and the contacts of a scene: of an Oscillator, a Chain or a Beam on rigid stops.

    Parameters
    ----------
    scene : Scene
        Of the short form; its sweep is not looked at.

    Raises
    ------
    UsageError
        Its orbits are not those of modes that fly between restitution stops under one harmonic force.
    """
    _refuse(scene)
    body = body_points(scene)
    _refuse_body(scene, body)
    found = body.mass_normalised()
    for number, contact in enumerate(found.contacts, start=1):
        if not contact.shape @ contact.shape > 0.0:
            raise _refused(scene, f"stop[{number}]", "a point that moves", "one that is held")
    return found


def _refused(scene: Scene, where: str, expected: str, got: str) -> UsageError:
    return UsageError(f"{scene.source}: {where}: expected {expected}, got {got}.")


def _refuse(scene: Scene) -> None:
    if scene.body_given is None or scene.replay is not None:
        kind = "a replay" if scene.replay is not None else "a scene of components"
        raise _refused(scene, "body", "an oscillator, a chain or a beam whose orbits are followed", kind)
    if scene.forcing is None or scene.period is None:
        raise _refused(scene, "forcing", "a harmonic force, which orbits are periodic with", "none")
    if not scene.stops:
        raise _refused(scene, "stop", "a restitution stop", "none")
    for number, stop in enumerate(scene.stops, start=1):
        if not isinstance(stop, RestitutionStop):
            raise _refused(
                scene, f"stop[{number}].law", '"restitution": impacts without duration', f'"{stop.law}"'
            )
        if stop.yield_velocity > 0.0:
            raise _refused(
                scene,
                f"stop[{number}].yield_velocity",
                "0 where orbits are followed",
                f"{stop.yield_velocity:g}",
            )
    if scene.falling_force:
        raise _refused(
            scene, "exciter.distance", "0 where orbits are followed", "a force that falls with the distance"
        )


def _refuse_body(scene: Scene, body: BodyPoints) -> None:
    """Refuse a body whose flights are not those of modes."""
    if not body.is_classical():
        got = "one that does. Dampings in proportion to the stiffnesses do not"
        raise _refused(
            scene, "body.dampings", "damping that does not couple the modes where orbits are followed", got
        )
    if not body.is_tied():
        raise _refused(scene, *_LOOSE[scene.body.kind])
    projection = getattr(scene.body, "impact_projection", VARIATIONAL)
    if projection != VARIATIONAL:
        expected = f'"{VARIATIONAL}" where orbits are followed'
        raise _refused(scene, "body.impact_projection", expected, f'"{projection}"')


def modal_displacements(scene: Scene, displacements: Floats) -> Floats:
    """Return displacements of the masses of a chain, or of the modes of a beam, in mass-normalised modes.

    Parameters
    ----------
    scene : Scene
    displacements : array, shape (state, mass or mode)
        m; of an oscillator that of its mass.

    Returns
    -------
    array, shape (state, mode)
        kg^(1/2) m.
    """
    return body_points(scene).normalised(displacements)
