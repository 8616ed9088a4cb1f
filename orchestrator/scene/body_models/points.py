"""Points of bodies by name: `"ball"`, `"chain.2"`, `"beam.tip"`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from vibroimpact.orchestrator.scene.body_models.beam import TIP, BeamBody
from vibroimpact.orchestrator.scene.body_models.chain import ChainBody
from vibroimpact.orchestrator.scene.body_models.oscillator import OscillatorBody

GROUND = "ground"
"""Name of the point that does not move, for links."""
BODY_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}")
_MASS = re.compile(r"(?:mass\[)?([1-9][0-9]?)(\])?")

OneBody = OscillatorBody | ChainBody | BeamBody


class PointOfBody(NamedTuple):
    """A point: the body, from 0, and its mass (from 1) or its place along a beam."""

    body: int
    place: float


class NoPoint(NamedTuple):
    """The reason why a text names no point, in the words of a message."""

    expected: str
    hint: str = ""


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
    place = _place(rest, name, bodies[number])
    return place if isinstance(place, NoPoint) else PointOfBody(number, place)


def _place(rest: str, name: str, body: OneBody) -> float | NoPoint:
    if isinstance(body, BeamBody):
        return _place_on_beam(rest, name, body)
    if rest == "" or (rest == "mass" and not isinstance(body, ChainBody)):
        return body.size
    if not isinstance(body, ChainBody):
        return NoPoint(f'"{name}" or "{name}.mass"')
    mass = _MASS.fullmatch(rest)
    is_whole = mass is not None and rest.startswith("mass[") == (mass[2] is not None)
    if mass is None or not is_whole or int(mass[1]) > body.size:
        return NoPoint(
            f'"{name}" for the last mass, or "{name}.1" to "{name}.{body.size}"', "Masses count from 1."
        )
    return int(mass[1])


def _place_on_beam(rest: str, name: str, body: BeamBody) -> float | NoPoint:
    expected = f'"{name}.tip", or a fraction of the length such as "{name}.0.5"'
    if rest in ("", "tip"):
        location = TIP
    else:
        try:
            location = float(rest) if re.fullmatch(r"[0-9.]+", rest) else -1.0
        except ValueError:
            location = -1.0
        if not 0.0 <= location <= 1.0:
            return NoPoint(expected)
    fixed = body.fixed_point(location)
    return location if fixed is None else NoPoint(fixed[0], f'"{name}.{rest or "tip"}" is the {fixed[1]}.')
