"""The study `basins`: basins of attraction of a scene over a plane of start states."""

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.orbits.basins import (
    BEYOND_A_STOP,
    UNDECIDED,
    Basins,
    Floats,
    border_dimension,
    border_share,
    find_basins,
)
from vibroimpact.analysis.study import Study
from vibroimpact.fmus.bodies.impacting_body import ImpactingBody
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.operations.basins import Basins as Options
from vibroimpact.orchestrator.orbits.bodies import impacting_body, modal_displacements
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters, state_variables
from vibroimpact.orchestrator.run.provenance import scene_attributes
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.ssp import opened_scene

HISTORY = "basins of attraction found by vibroimpact"
TABLE = ResultTable(
    "basins",
    ("displacement_start", "displacement_start", "m", "displacement{of} at the start"),
    ("velocity_start", "velocity_start", "m s-1", "velocity{of} at the start"),
    ("basin", "velocity_start displacement_start", "1", "attractor, from 0; -1 undecided, -2 beyond a stop"),
    ("attractor_name", "attractor", "1", "what it is", "text"),
    ("basin_fraction", "attractor", "1", "share of the starts that end on it"),
    ("attractor_displacement", "attractor period", "m", "displacement at forcing phase 0"),
    ("attractor_velocity", "attractor period", "m s-1", "velocity at forcing phase 0"),
    (
        "attractor_radius",
        "attractor",
        "1",
        "distance from which starts were seen to come back, over the size of the motion",
    ),
    (
        "attractor_impacts",
        "attractor stop",
        "1",
        "mean number of impacts in a forcing period at each stop, but for the slow ones of a chatter",
    ),
    ("border_fraction", "", "1", "share of the starts next to one that ends elsewhere"),
    ("border_dimension", "", "1", "dimension of the border between basins"),
    ("border_dimension_error", "", "1", "standard error of it"),
)
POINTS = 200
"""Default number of starts along each axis."""
MOST_STARTS = 16_000_000
BLOCK = 16_384
"""Starts followed in one call; Ctrl-C takes effect between calls."""
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


def _axes(scene: Scene, number: int | None) -> tuple[int, int]:
    """Return the indices of the plane's displacement and velocity among the start values."""
    if not scene.body.IS_STRUCTURE:
        if number not in (None, 1):
            raise UsageError(f"basins: number: expected 1, an oscillator's only mass, got {number}.")
        return 0, 1
    size = len(state_variables(scene)) // 2
    chosen = number if number is not None else _first_hit(scene)
    if not 1 <= chosen <= size:
        raise UsageError(f"basins: number: expected a {scene.body.ELEMENT} from 1 to {size}, got {chosen}.")
    return chosen - 1, size + chosen - 1


def _first_hit(scene: Scene) -> int:
    """Return the mass that a chain's first stop hits; for a beam 1, its first mode."""
    return integer_parameters(scene).get("contact[1].mass_number", 1)


def start_states(scene: Scene, plane: Plane, spans: tuple[Span, Span]) -> tuple[Floats, Floats, Floats]:
    """Return displacements, velocities and the start states of a plane, shape (y * x, variable)."""
    numbers = float_parameters(scene, None)
    own = np.array([numbers.get(name, 0.0) for name in scene.body.start_names])
    across, along = _axes(scene, plane.number)
    x, y = (np.linspace(*span, count) for span, count in zip(spans, plane.points, strict=True))
    states = np.repeat(own[None], x.size * y.size, axis=0)
    states[:, across], states[:, along] = np.tile(x, y.size), np.repeat(y, x.size)
    return x, y, states


def beyond_stops(scene: Scene, body: ImpactingBody, states: Floats) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return a mask of the states at time 0 beyond a stop, shape (state,)."""
    modal = modal_displacements(scene, states[:, : states.shape[1] // 2])
    beyond = np.zeros(len(states), np.bool_)
    for contact in body.contacts:
        at = modal @ contact.shape
        beyond |= contact.direction * (at - contact.stop_at(body.phase)) > 0.0
    return beyond


def _spans(scene: Scene, body: ImpactingBody, plane: Plane) -> tuple[tuple[Span, Span], tuple[float, float]]:
    """Return the ends of both axes, and the size of the scene's own motion."""
    flow = BodyFlow(scene, workers=1)
    try:
        numbers = float_parameters(scene, None)
        own = np.array([[numbers.get(name, 0.0) for name in flow.names]])
        seen = [flow.follow(own, 1, first=True).states[0]]
        for periods in (1, 2, 3, 5, 7, 11, 50, 100):
            seen.append(flow.follow(seen[-1][None], periods).states[0])
    finally:
        flow.close()
    half = own.shape[1] // 2
    table = np.nan_to_num(np.abs(np.array([own[0], *seen])))
    size = max(float(table[:, :half].max()), body.scale / float(np.abs(body.contacts[0].shape).max()) * 1e-3)
    speed = max(float(table[:, half:].max()), size * body.angular_frequency)
    x = plane.x or (-REACH * size, REACH * size)
    y = plane.y or (-REACH * speed, REACH * speed)
    if plane.x is None and not scene.body.IS_STRUCTURE:
        # a plane beyond the stops has no starts
        for contact in body.contacts:
            stop = contact.stop_at(body.phase)
            x = (x[0], min(x[1], stop)) if contact.direction > 0 else (max(x[0], stop), x[1])
    elif plane.x is None and isinstance(scene.body, StructureBody):
        x = _free_span(scene, body, own[:, :half], _axes(scene, plane.number)[0], x)
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


def basins_dataset(scene: Scene, plane: Plane, x: Floats, y: Floats, found: Basins) -> xr.Dataset:
    """Return the dataset of a plane: ends of the starts, attractors, borders."""
    labels = found.labels.reshape(y.size, x.size)
    across, along = _axes(scene, plane.number)
    most = max([len(each.states) for each in found.attractors], default=0)
    points = np.full((len(found.attractors), most, 2), np.nan)
    for place, attractor in enumerate(found.attractors):
        points[place, : len(attractor.states)] = attractor.states[:, [across, along]]
    dimension = border_dimension(labels)
    values = {
        "displacement_start": x,
        "velocity_start": y,
        "basin": labels,
        "attractor_name": found.names,
        "basin_fraction": found.fractions,
        "attractor_displacement": points[..., 0],
        "attractor_velocity": points[..., 1],
        "attractor_radius": np.array([each.radius for each in found.attractors]),
        "attractor_impacts": np.array([each.impacts for each in found.attractors]).reshape(
            -1, len(scene.stops)
        ),
        "border_fraction": border_share(labels),
        "border_dimension": np.nan if dimension is None else dimension.value,
        "border_dimension_error": np.nan if dimension is None else dimension.error,
    }
    attributes = scene_attributes(scene, HISTORY) | {
        "units_system": scene.units,
        "decided": found.decided,
        "chaotic_by_sample": found.told_by_sample,
        "undetected_share_below": found.undetected_share_below,
    }
    return TABLE.dataset(values, attributes, units=scene.units, of=_element(scene, plane.number))


def _element(scene: Scene, number: int | None) -> str:
    if not scene.body.IS_STRUCTURE:
        return ""
    place = _axes(scene, number)[0] + 1
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


@dataclass(eq=False)
class BasinsOfScene(Study[Basins]):
    """The ends of the starts of a plane: see `vibroimpact.basins`. A row is the search after a block of starts."""

    name = "basins"
    nothing = "an attractor"
    begins = "Looking for attractors"
    history = HISTORY
    interruption = "Interrupted: the above is what is known so far."

    scene: Scene
    plane: Plane

    def __post_init__(self) -> None:
        self.plane.refuse()
        self.scene = self.scene.unswept()
        body = impacting_body(self.scene)
        _axes(self.scene, self.plane.number)
        spans, scale = _spans(self.scene, body, self.plane)
        self.x, self.y, states = start_states(self.scene, self.plane, spans)
        beyond = beyond_stops(self.scene, body, states)
        if beyond.all():
            raise UsageError("basins: x: expected starts on the free side of the stops, got none.")
        half = states.shape[1] // 2
        sizes = np.repeat(
            [max(size, np.abs(ends).max()) for size, ends in zip(scale, spans, strict=True)], half
        )
        labels = np.where(beyond, BEYOND_A_STOP, UNDECIDED).astype(np.int16)
        self.known = Basins(states, labels, sizes)

    @classmethod
    def prepare(cls, options: Options, stack: ExitStack) -> Self:
        """Open the scene, and place the starts."""
        spans = span_of(options.x, "x"), span_of(options.y, "y")
        plane = Plane(*spans, points_of(options.points), options.number)
        return cls(opened_scene(options.scene, options.changes or ()), plane)

    def rows(self) -> Generator[Basins, None, None]:
        """Follow the starts block by block."""
        flow = BodyFlow(self.scene)
        try:
            for now in find_basins(self.known, flow, block=BLOCK):
                names = ", ".join(now.names) or "none yet"
                self.status(f"{100.0 * now.decided:.1f} % of {now.possible} starts; {names}")
                if now.attractors:
                    yield now
        finally:
            flow.close()

    def made(self) -> xr.Dataset:
        """Return the dataset of the plane as far as it is known."""
        return basins_dataset(self.scene, self.plane, self.x, self.y, self.known)

    def print_results(self) -> None:
        """Print each attractor with its share, and the undecided starts."""
        found, data = self.known, self.dataset
        rows = table(
            f"Basins of attraction: {self.scene.title or self.scene.source}",
            *("<attractor", ">share of the starts", "<displacement, velocity at forcing phase 0"),
        )
        for place, name in enumerate(found.names):
            states = np.column_stack(
                [data[f"attractor_{what}"].values[place] for what in ("displacement", "velocity")]
            )
            told_states = "; ".join(f"{a:.6g}, {b:.6g}" for a, b in states[:4] if np.isfinite(a))
            rows.add_row(
                name,
                f"{100.0 * found.fractions[place]:.2f} %",
                told_states + (" ..." if len(states) > 4 else ""),
            )
        wide_terminal().print(rows)
        _say_rest(found, data)


def _say_rest(found: Basins, data: xr.Dataset) -> None:
    undecided = 1.0 - found.decided
    if undecided > 0.0:
        say(f"{100.0 * undecided:.3g} % of the starts came near to no attractor that is known.")
    if found.told_by_sample:
        say(
            f"{found.told_by_sample} starts count as chaotic because all of a sample of those like them were. Such a "
            f"sample may miss an attractor with up to {100.0 * found.undetected_share_below:.2g} % of the starts "
            "(95 % confidence)."
        )
    _say_chaotic(found)
    share, dimension = float(data["border_fraction"]), float(data["border_dimension"])
    if np.isfinite(dimension):
        error = float(data["border_dimension_error"])
        say(f"{100.0 * share:.3g} % lie on a border, whose dimension is {dimension:.3f} +- {error:.3f}.")
    elif share > 0.0:
        say(f"{100.0 * share:.3g} % lie on a border.")


def _say_chaotic(found: Basins) -> None:
    """Print the impact rates that distinguish chaotic attractors, or that there may be several."""
    chaotic = [
        (name, each) for name, each in zip(found.names, found.attractors, strict=True) if each.is_chaotic
    ]
    for name, each in chaotic:
        if not each.is_one:
            say(
                "Chaotic runs differ by more than their own scatter: there may be several chaotic attractors."
            )
        elif len(chaotic) > 1:
            rates = ", ".join(f"{rate:.3g} at stop {stop}" for stop, rate in enumerate(each.impacts, start=1))
            say(f"{name}: impacts in a forcing period: {rates}.")
