"""A body that knows nothing of its stops: what its FMU shows where they are, and what pushes it there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.orchestrator.run.carried_state import contact_shapes
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters, numbered
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import BeamBody, ChainBody
from vibroimpact.orchestrator.scene.models import RestitutionStop
from vibroimpact.orchestrator.scene.places import forcing_location, stop_location, stop_mass
from vibroimpact.orchestrator.study.observation import Floats

MOST_SENSORS = 4
"""Of the FMU of a beam."""


@dataclass(frozen=True, slots=True)
class Stranger:
    """The parameters of a body without stops, and the names of its variables at each of them.

    Attributes
    ----------
    floats, integers : dict
        Parameters, by variable name, SI.
    displacements, velocities : tuple of str
        Motion of the point in front of each stop.
    forces : tuple of str
        Input that acts there; empty where the body has none at a stop.
    """

    floats: dict[str, float]
    integers: dict[str, int]
    displacements: tuple[str, ...]
    velocities: tuple[str, ...]
    forces: tuple[str, ...]


def stranger_of(scene: Scene) -> Stranger:
    """Return the body of a scene without its stops."""
    floats = {n: v for n, v in float_parameters(scene, None).items() if not n.startswith("contact[")}
    integers = {n: v for n, v in integer_parameters(scene).items() if not n.startswith("contact[")}
    body, stops = scene.body, scene.stops
    if isinstance(body, ChainBody):
        at = [f"[{stop_mass(body, stop)}]" for stop in stops]
        x, v, f = (tuple(f"{name}{place}" for place in at) for name in ("displacement", "velocity", "force"))
        return Stranger(floats, integers, x, v, f)
    if isinstance(body, BeamBody):
        locations = [stop_location(stop) for stop in stops]
        where = list(dict.fromkeys(locations))
        sensors = [f"sensor[{where.index(location) + 1}]" for location in locations]
        floats |= {f"sensor[{k}].location": location for k, location in enumerate(where, start=1)}
        if _is_pushed(scene, body):
            floats["forcing_location"] = where[0]
        x, v = (tuple(f"{sensor}.{name}" for sensor in sensors) for name in ("displacement", "velocity"))
        return Stranger(floats, integers, x, v, ("force",) * len(stops) if _is_pushed(scene, body) else ())
    count = len(stops)
    return Stranger(floats, integers, ("displacement",) * count, ("velocity",) * count, ("force",) * count)


def why_not_pushed(scene: Scene) -> str:
    """Return why no force can act on a body where its stops are; empty where one can."""
    if isinstance(scene.body, BeamBody) and not _is_pushed(scene, scene.body):
        return "a Beam takes one force, where it is forced, and its stops are not all there"
    return ""


def why_not_thrown_back(scene: Scene) -> str:
    """Return why the state of a body after an impact on a rigid stop cannot be told by its modes or masses alone."""
    body = scene.body
    if isinstance(body, ChainBody) and body.modes not in (None, body.size):
        return "a Chain with fewer modes than masses does not move one mass alone"
    if isinstance(body, BeamBody):
        if body.impact_projection != "variational":
            return "the impacts of a Beam with another projection than the variational one do not follow from its state"
        if len({stop_location(stop) for stop in scene.stops}) > MOST_SENSORS:
            return f"a Beam shows its motion at {MOST_SENSORS} places, and its stops are at more"
    return ""


def thrown_back(scene: Scene) -> tuple[tuple[str, ...], Floats]:
    """Return the start velocities of a body, and their changes by an impulse at each rigid stop, for 1 m/s there.

    Returns
    -------
    names : tuple of str
    changes : ndarray, shape (stop, N)
    """
    body = scene.body
    if not isinstance(body, ChainBody | BeamBody):
        return ("velocity_start",), np.ones((len(scene.stops), 1))
    prefix = "" if isinstance(body, ChainBody) else "modal_"
    shapes = contact_shapes(body, [stop for stop in scene.stops if isinstance(stop, RestitutionStop)])
    motions = shapes / np.array(body.masses) if isinstance(body, ChainBody) else shapes
    names = tuple(numbered(f"{prefix}velocity_start", [0.0] * body.size))
    return names, motions / (shapes * motions).sum(axis=1)[:, None]


def contact_masses(scene: Scene) -> Floats:
    """Return the mass that each stop feels when it is hit, kg: of a beam that of its modes.

    Returns
    -------
    ndarray, shape (stop,)
    """
    body = scene.body
    if not isinstance(body, BeamBody):
        return np.array([body.mass_at(stop.mass) for stop in scene.stops])
    line = body.mass_per_length
    if line is None:
        assert body.width is not None
        assert body.thickness is not None
        assert body.density is not None
        line = body.width * body.thickness * body.density
    shapes = contact_shapes(body, scene.stops)
    return np.asarray(line * body.length / (shapes**2).sum(axis=1))


def _is_pushed(scene: Scene, body: BeamBody) -> bool:
    """Whether the one force input of a beam can act at all of its stops."""
    where = {stop_location(stop) for stop in scene.stops}
    if len(where) != 1:
        return False
    forced_there = scene.forcing is not None and scene.forcing.kind == "force"
    return not forced_there or where == {forcing_location(body, scene.forcing)}
