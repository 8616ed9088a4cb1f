"""Planes of start states of a scene: their axes, their starts, and the part beyond the stops."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibroimpact.analysis.orbits.attractors.basins import Floats
from vibroimpact.fmus.bodies.impacting_body import ImpactingBody
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.operations.basins import Basins as Options
from vibroimpact.orchestrator.orbits.bodies import modal_displacements
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.orbits.further_sines import FurtherSines
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters, state_variables
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.scene.body_models.structure import BodyAlone

POINTS = 200
"""Default number of starts along each axis."""
MOST_STARTS = 16_000_000
ROUNDING = 1e-13
"""Part of a span by which its ends stay away from the contacts that cut it off."""
REACH = 2.0
"""Default half width of the plane, over the size of the scene's own motion."""

Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Plane:
    """The plane of start states.

    Attributes
    ----------
    x, y : tuple of float, or None
        Ends of the axes of displacement (m) and velocity (m/s); None: from the scene's own motion.
    points : tuple of int
        Starts along both axes.
    number : int or None
        Mass of a chain, or mode of a beam, whose start is varied; the others start as in the scene. None: the mass
        that the first stop hits, or mode 1.
    """

    x: Span | None = None
    y: Span | None = None
    points: tuple[int, int] = (POINTS, POINTS)
    number: int | None = None

    def refuse(self) -> None:
        """Raise UsageError unless the plane has finite spans in order and 2 to MOST_STARTS starts."""
        for name, span in (("x", self.x), ("y", self.y)):
            if span is not None and not (
                math.isfinite(span[0]) and math.isfinite(span[1]) and span[0] < span[1]
            ):
                got = f"{span[0]:g} to {span[1]:g}"
                raise UsageError(
                    f"basins: {name}: expected two finite numbers, the smaller one first, got {got}."
                )
        if min(self.points) < 2 or math.prod(self.points) > MOST_STARTS:
            raise UsageError(
                f"basins: points: expected 2 at least along each axis and {MOST_STARTS} in all, "
                f"got {self.points[0]} x {self.points[1]}."
            )


def axes_of(scene: Scene, number: int | None) -> tuple[int, int]:
    """Return the indices of the plane's displacement and velocity among the start values."""
    if not scene.body.IS_STRUCTURE or _is_lone_mass(scene):
        if number not in (None, 1):
            raise UsageError(f"basins: number: expected 1, an oscillator's only mass, got {number}.")
        return 0, 1
    size = len(state_variables(scene)) // 2
    chosen = number if number is not None else _first_hit(scene)
    if not 1 <= chosen <= size:
        raise UsageError(f"basins: number: expected a {scene.body.ELEMENT} from 1 to {size}, got {chosen}.")
    return chosen - 1, size + chosen - 1


def _is_lone_mass(scene: Scene) -> bool:
    """Tell whether the body is an oscillator that starts in its mode, as one under several forces does."""
    alone = scene.body
    return isinstance(alone, BodyAlone) and alone.body.ELEMENT == "mass" and alone.body.size == 1


def mass_displacement(scene: Scene, body: ImpactingBody) -> float:
    """Return the displacement of the plane's mass for a unit of its start value; 1 unless an oscillator has modes."""
    if not _is_lone_mass(scene):
        return 1.0
    return float(modal_displacements(scene, np.ones((1, 1)))[0, 0] * body.contacts[0].shape[0])


def _first_hit(scene: Scene) -> int:
    """Return the mass that a chain's first stop hits; for a beam 1, its first mode."""
    return integer_parameters(scene).get("contact[1].mass_number", 1)


def start_states(
    scene: Scene, plane: Plane, spans: tuple[Span, Span], unit: float
) -> tuple[Floats, Floats, Floats]:
    """Return displacements, velocities and the start states of a plane, shape (y * x, variable).

    `unit` is that of `mass_displacement`. Phases of sines without a common period are the last variables.
    """
    numbers, sines = float_parameters(scene, None), FurtherSines.of(scene)
    own = np.array([numbers.get(name, 0.0) for name in (*scene.body.start_names, *sines.names)])
    across, along = axes_of(scene, plane.number)
    x, y = (np.linspace(*span, count) for span, count in zip(spans, plane.points, strict=True))
    states = np.repeat(own[None], x.size * y.size, axis=0)
    states[:, across], states[:, along] = np.tile(x, y.size) / unit, np.repeat(y, x.size) / unit
    return x, y, states


def beyond_stops(scene: Scene, body: ImpactingBody, states: Floats) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return a mask of the states at time 0 beyond a rigid stop, shape (state,); stops that yield let the body in."""
    modal = modal_displacements(scene, states[:, : states.shape[1] // 2])
    beyond = np.zeros(len(states), np.bool_)
    for contact in (each for each in body.contacts if each.press is None):
        at = modal @ contact.shape
        beyond |= contact.direction * (at - contact.stop_at(body.phase)) > 0.0
    return beyond


def spans_of(
    scene: Scene, body: ImpactingBody, plane: Plane
) -> tuple[tuple[Span, Span], tuple[float, float]]:
    """Return the ends of both axes, and displacement and velocity of the scene's own motion as start values."""
    flow = BodyFlow(scene, workers=1)
    try:
        numbers = float_parameters(scene, None)
        own = np.array([[numbers.get(name, 0.0) for name in (*flow.names, *FurtherSines.of(scene).names)]])
        seen = [flow.follow(own, 1, first=True).states[0]]
        for periods in (1, 2, 3, 5, 7, 11, 50, 100):
            seen.append(flow.follow(seen[-1][None], periods).states[0])
    finally:
        flow.close()
    half = len(flow.names) // 2
    table = np.nan_to_num(np.abs(np.array([own[0], *seen])))
    size = max(float(table[:, :half].max()), body.scale / float(np.abs(body.contacts[0].shape).max()) * 1e-3)
    speed = max(float(table[:, half : 2 * half].max()), size * body.angular_frequency)
    unit = abs(mass_displacement(scene, body))
    x = plane.x or (-REACH * size * unit, REACH * size * unit)
    y = plane.y or (-REACH * speed * unit, REACH * speed * unit)
    if plane.x is None and (_is_lone_mass(scene) or not scene.body.IS_STRUCTURE):
        # a plane beyond the stops has no starts
        for contact in body.contacts:
            stop = contact.stop_at(body.phase)
            x = (x[0], min(x[1], stop)) if contact.direction > 0 else (max(x[0], stop), x[1])
    elif plane.x is None and isinstance(scene.body, StructureBody):
        x = _free_span(scene, body, own[:, :half], axes_of(scene, plane.number)[0], x)
    return (x, y), (size, speed)


def _free_span(scene: Scene, body: ImpactingBody, own: Floats, across: int, span: Span) -> Span:
    """Return the part of a span of one displacement that no stop or contact cuts off; all of it without such a part.

    The other displacements are those of the scene's start, `own`, shape (1, displacement).
    """
    ends = np.repeat(own, 2, axis=0)
    ends[:, across] = 0.0, 1.0
    at_0, at_1 = modal_displacements(scene, ends)
    low, high = span
    for contact in body.contacts:
        slope = contact.direction * float((at_1 - at_0) @ contact.shape)
        room = contact.direction * (contact.stop_at(body.phase) - float(at_0 @ contact.shape))
        if slope > 0.0:
            high = min(high, room / slope)
        elif slope < 0.0:
            low = max(low, room / slope)
    inner = ROUNDING * (high - low)  # an end on a contact stays on its free side
    return (low + inner, high - inner) if low < high else span


def element_of(scene: Scene, number: int | None) -> str:
    """Return ` of mass 2` and the like, for names of variables; empty for an oscillator."""
    if not scene.body.IS_STRUCTURE or _is_lone_mass(scene):
        return ""
    place = axes_of(scene, number)[0] + 1
    return f" of {scene.body.ELEMENT} {place}"


def span_of(text: str | None, name: str) -> Span | None:
    """Return `LOW:HIGH` as two numbers; another text raises UsageError.

    >>> span_of("-1:0.5", "x")
    (-1.0, 0.5)
    """
    if text is None:
        return None
    parts = text.split(":")
    try:
        low, high = map(float, parts)
    except ValueError:
        raise UsageError(f"--{name}: expected LOW:HIGH, two numbers, got {text!r}.") from None
    return low, high


def points_of(text: str) -> tuple[int, int]:
    """Return `N` or `NxM` as the starts along both axes; another text raises UsageError.

    >>> points_of("200"), points_of("300x200")
    ((200, 200), (300, 200))
    """
    parts = text.lower().split("x")
    if len(parts) > 2 or not all(part.isascii() and part.isdigit() for part in parts):
        raise UsageError(f"--points: expected a number of starts, or two as 300x200, got {text!r}.")
    return int(parts[0]), int(parts[-1])


def plane_of(options: Options) -> Plane:
    """Return the plane that the arguments of the operation describe."""
    return Plane(span_of(options.x, "x"), span_of(options.y, "y"), points_of(options.points), options.number)
