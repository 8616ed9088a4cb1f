"""The body of a scene as one object: modes, contacts, forcing and what is observed, as arrays over points."""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.bodies import POINTS_OF_FMU, BodyPoints, Columns
from vibroimpact.orchestrator.run.parameters import FMU_NAMES, float_parameters, integer_parameters
from vibroimpact.orchestrator.scene import Scene


def body_points(scene: Scene, columns: Columns | None = None) -> BodyPoints:
    """Return the body of a scene of the short form with restitution stops.

    Parameters
    ----------
    scene : Scene
    columns : mapping of str to ndarray, shape (point,), or None
        Real parameters of the body's FMU at the points of the sweep; None: one point, the scene as it is.
    """
    if columns is None:
        columns = {name: np.array([value]) for name, value in float_parameters(scene, None).items()}
    return POINTS_OF_FMU[FMU_NAMES[scene.body.kind]](columns, integer_parameters(scene))
