"""Points of bodies by name: `"ball"`, `"chain.2"`, `"beam.tip"`, `"bracket.corner"`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from vibroimpact.orchestrator.scene.body_models.base import NoPoint
from vibroimpact.orchestrator.scene.body_models.beam import BeamBody
from vibroimpact.orchestrator.scene.body_models.chain import ChainBody
from vibroimpact.orchestrator.scene.body_models.modes import ModesBody
from vibroimpact.orchestrator.scene.body_models.oscillator import OscillatorBody

GROUND = "ground"
"""Name of the point that does not move, for links."""
ALL = "all"
"""Name of all masses together, for forces, unless a body has this name."""
BODY_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}")

OneBody = OscillatorBody | ChainBody | BeamBody | ModesBody


class PointOfBody(NamedTuple):
    """A point: the body, from 0, and its mass (from 1) or its place along a beam."""

    body: int
    place: float


def find_point(text: str, names: Sequence[str], bodies: Sequence[OneBody]) -> PointOfBody | NoPoint:
    """Return the point that a text names.

    Parameters
    ----------
    text : str
        The name of a body, and behind a dot its mass, its fraction of the length, or `tip`.
    names : sequence of str
    bodies : sequence of OscillatorBody, ChainBody or BeamBody

    Examples
    --------
    >>> ball = OscillatorBody(mass=1.0, stiffness=0.0)
    >>> find_point("ball", ["frame", "ball"], [ball, ball])
    PointOfBody(body=1, place=1)
    >>> find_point("ball.2", ["ball"], [ball]).expected
    '"ball" or "ball.mass"'
    """
    name, _, rest = text.partition(".")
    if name not in names:
        return NoPoint("a point of a body of this scene", f"Bodies: {', '.join(names)}.")
    number = names.index(name)
    place = bodies[number].place_named(rest, name)
    return place if isinstance(place, NoPoint) else PointOfBody(number, place)
