"""A body that knows nothing of its stops: what its FMU shows where they are, and what pushes it there."""

from __future__ import annotations

from dataclasses import dataclass

from vibroimpact.orchestrator.run.parameters import body_points, float_parameters, integer_parameters
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.study.observation import Floats


@dataclass(frozen=True, slots=True)
class Stranger:
    """The parameters of a body without stops, and the names of its variables at each of them."""

    floats: dict[str, float]
    """Parameters, by variable name, SI."""
    integers: dict[str, int]
    """Likewise."""
    displacements: tuple[str, ...]
    """Displacement of the point in front of each stop."""
    velocities: tuple[str, ...]
    """And its velocity."""
    forces: tuple[str, ...]
    """Input that acts there; empty where the body has none at a stop."""


def stranger_of(scene: Scene) -> Stranger:
    """Return the body of a scene without its stops."""
    floats = {n: v for n, v in float_parameters(scene, None).items() if not n.startswith("contact[")}
    integers = {n: v for n, v in integer_parameters(scene).items() if not n.startswith("contact[")}
    body = body_points(scene)
    seen = (body.variables_at_contacts(what) for what in ("displacement", "velocity", "force"))
    return Stranger(floats | body.floats_of_contacts(), integers, *seen)


def thrown_back(scene: Scene) -> tuple[tuple[str, ...], Floats]:
    """Return the start velocities of a body, and their changes by an impulse at each rigid stop, for 1 m/s there.

    They are the names of the velocities, N of them, and the changes, shape (stop, N).
    """
    body, rigid = body_points(scene), [LAWS[stop.law].is_rigid for stop in scene.stops]
    shapes = body.contact_shapes()[rigid]
    motions = body.contact_mobilities(shapes)
    return scene.body.start_names[scene.body.size :], motions / (shapes * motions).sum(axis=1)[:, None]
