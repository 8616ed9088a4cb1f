"""A body without stops in its FMU: the motion and the force input of its FMU at each stop of the scene."""

from __future__ import annotations

from dataclasses import dataclass

from vibroimpact.orchestrator.run.parameters import body_points, float_parameters, integer_parameters
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.study.observation import Floats


@dataclass(frozen=True, slots=True)
class Stranger:
    """The parameters of a body without stops, and the names of its variables at each stop."""

    floats: dict[str, float]
    """Real parameters by variable name, SI."""
    integers: dict[str, int]
    """Integer parameters by variable name."""
    displacements: tuple[str, ...]
    """Variable of the displacement in front of each stop."""
    velocities: tuple[str, ...]
    """Variable of the velocity in front of each stop."""
    forces: tuple[str, ...]
    """Force input in front of each stop; empty where the body has none at a stop."""


def stranger_of(scene: Scene) -> Stranger:
    """Return the body of a scene without its stops."""
    floats = {n: v for n, v in float_parameters(scene, None).items() if not n.startswith("contact[")}
    integers = {n: v for n, v in integer_parameters(scene).items() if not n.startswith("contact[")}
    body = body_points(scene)
    seen = (body.variables_at_contacts(what) for what in ("displacement", "velocity", "force"))
    return Stranger(floats | body.floats_of_contacts(), integers, *seen)


def thrown_back(scene: Scene) -> tuple[tuple[str, ...], Floats]:
    """Return the names of the start velocities of a body, and their changes by an impulse at each rigid stop.

    There are N names; the changes have shape (stop, N). Each impulse changes the velocity at its stop by 1 m/s.
    """
    body, rigid = body_points(scene), [LAWS[stop.law].is_rigid for stop in scene.stops]
    shapes = body.contact_shapes()[rigid]
    motions = body.contact_mobilities(shapes)
    return scene.body.start_names[scene.body.size :], motions / (shapes * motions).sum(axis=1)[:, None]
