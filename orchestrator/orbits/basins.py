"""The study `basins`: basins of attraction of a scene over a plane of start states."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.attractors.basin_search import find_basins
from vibroimpact.analysis.orbits.attractors.basins import (
    BEYOND_A_STOP,
    MOST_PERIODS,
    UNDECIDED,
    Attractor,
    Basins,
    Floats,
    partners,
)
from vibroimpact.analysis.orbits.attractors.borders import border_dimension, border_share
from vibroimpact.analysis.orbits.attractors.edges import Track
from vibroimpact.analysis.orbits.attractors.separation import Separation
from vibroimpact.analysis.orbits.symmetry import mirrored_contacts
from vibroimpact.analysis.study import Study
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.operations.basins import Basins as Options
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.orbits.edges import EDGE_ROWS, edge_tracks, edge_values, print_edges
from vibroimpact.orchestrator.orbits.further_sines import FurtherSines, strobed_body
from vibroimpact.orchestrator.orbits.planes import (
    Plane,
    axes_of,
    beyond_stops,
    element_of,
    mass_displacement,
    plane_of,
    spans_of,
    start_states,
)
from vibroimpact.orchestrator.run.provenance import scene_attributes
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene

HISTORY = "basins of attraction found by vibroimpact"
ATTRACTOR_ROWS = (
    ("attractor_name", "attractor", "1", "what it is", "text"),
    ("attractor_rotation_number", "attractor", "1", "rotation number of a quasi-periodic motion"),
    ("attractor_rotation_error", "attractor", "1", "error of the rotation number"),
    (
        "attractor_exponent",
        "attractor",
        "1",
        "largest Lyapunov exponent in a forcing period, without a period",
    ),
    ("attractor_exponent_error", "attractor", "1", "standard error of the exponent"),
    ("basin_fraction", "attractor", "1", "share of the starts that end on it"),
    ("basin_fraction_low", "attractor", "1", "lower end of the 95 % confidence interval of the share"),
    ("basin_fraction_high", "attractor", "1", "upper end of the 95 % confidence interval of the share"),
    (
        "attractor_impacts",
        "attractor stop",
        "1",
        "mean number of impacts in a forcing period at each stop, but for the slow ones of a chatter",
    ),
    ("attractor_speed", "attractor stop", "m s-1", "mean impact velocity at each stop"),
    ("attractor_phase_spread", "attractor stop", "rad", "circular standard deviation of the impact phases"),
    ("attractor_lowest", "attractor", "m", "smallest observed displacement"),
    ("attractor_highest", "attractor", "m", "largest observed displacement"),
    ("attractor_dimension", "attractor", "1", "correlation dimension of its states at forcing phase 0"),
    ("attractor_multiplier", "attractor", "1", "modulus of its slowest multiplier in a forcing period"),
    ("attractor_partner", "attractor", "1", "number of its mirror image, from 0; -1 without one"),
)
"""Variables of attractors that have no state of the plane."""
TABLE = ResultTable(
    "basins",
    ("displacement_start", "displacement_start", "m", "displacement{of} at the start"),
    ("velocity_start", "velocity_start", "m s-1", "velocity{of} at the start"),
    ("basin", "velocity_start displacement_start", "1", "attractor, from 0; -1 undecided, -2 beyond a stop"),
    *ATTRACTOR_ROWS,
    (
        "section_displacement",
        "attractor section_period",
        "m",
        "displacement at forcing phase 0 of a motion without a period",
    ),
    ("section_velocity", "attractor section_period", "m s-1", "velocity of this motion"),
    ("attractor_displacement", "attractor period", "m", "displacement at forcing phase 0"),
    ("attractor_velocity", "attractor period", "m s-1", "velocity at forcing phase 0"),
    (
        "attractor_radius",
        "attractor",
        "1",
        "distance from which starts were seen to come back, over the size of the motion",
    ),
    ("border_fraction", "", "1", "share of the starts next to one that ends elsewhere"),
    ("border_dimension", "", "1", "dimension of the border between basins"),
    ("border_dimension_error", "", "1", "standard error of it"),
    *EDGE_ROWS,
)
BLOCK = 16_384
"""Starts followed in one call; Ctrl-C takes effect between calls."""


def attractor_values(found: Basins, images: Any, stops: int) -> dict[str, Any]:
    """Return the variables of `ATTRACTOR_ROWS`; `images` are the mirrored contacts, or None."""
    each_one = [each.features for each in found.attractors]
    ends = found.intervals
    rotations = [each.kind.rotation for each in found.attractors]

    def of_stops(values: list[Floats]) -> Floats:
        return np.array(values).reshape(-1, stops)

    return {
        "attractor_name": found.full_names,
        "attractor_rotation_number": np.array([np.nan if one is None else one.number for one in rotations]),
        "attractor_rotation_error": np.array([np.nan if one is None else one.error for one in rotations]),
        "attractor_exponent": np.array([each.exponent for each in found.attractors]),
        "attractor_exponent_error": np.array([each.exponent_error for each in found.attractors]),
        "basin_fraction": found.fractions,
        "basin_fraction_low": ends[:, 0],
        "basin_fraction_high": ends[:, 1],
        "attractor_impacts": of_stops([each.impacts for each in each_one]),
        "attractor_speed": of_stops([each.speed for each in each_one]),
        "attractor_phase_spread": of_stops([each.phase_spread for each in each_one]),
        "attractor_lowest": np.array([each.extremes[0] for each in each_one]),
        "attractor_highest": np.array([each.extremes[1] for each in each_one]),
        "attractor_dimension": np.array([each.dimension for each in each_one]),
        "attractor_multiplier": np.array([each.multiplier for each in found.attractors]),
        "attractor_partner": partners(found.attractors, images),
    }


def search_attributes(found: Basins) -> dict[str, Any]:
    """Return the attributes that say how complete a search is."""
    counts = found.separation
    separated = (
        {}
        if counts is None
        else {
            "separated_by_features": counts.by_features,
            "separated_by_recurrence": counts.by_recurrence,
            "separations_agree": int(counts.agree),
        }
    )
    return {
        "decided": found.decided,
        "chaotic_by_sample": found.told_by_sample,
        "undetected_share_below": found.undetected_share_below,
        "missed_share_below": found.missed_share_below,
        "most_periods": found.most_periods,
        "followed_periods": found.followed_periods,
        "needed_periods": found.needed_periods,
        **separated,
    }


def basins_dataset(
    scene: Scene, plane: Plane, x: Floats, y: Floats, found: Basins, edges: list[Track] | None = None
) -> xr.Dataset:
    """Return the dataset of a plane: ends of the starts, attractors, borders, and edges that were tracked."""
    labels = found.labels.reshape(y.size, x.size)
    across, along = axes_of(scene, plane.number)
    most = max([len(each.states) for each in found.attractors], default=0)
    points = np.full((len(found.attractors), most, 2), np.nan)
    for place, attractor in enumerate(found.attractors):
        points[place, : len(attractor.states)] = attractor.states[:, [across, along]]
    drawn = max([len(each.section) for each in found.attractors], default=0)
    section = np.full((len(found.attractors), drawn, 2), np.nan)
    for place, attractor in enumerate(found.attractors):
        if len(attractor.section):
            section[place, : len(attractor.section)] = attractor.section[:, [across, along]]
    body = strobed_body(scene)
    unit = mass_displacement(scene, body)
    names = ("section_displacement", "section_velocity") if drawn else ()
    sections = dict(zip(names, np.moveaxis(unit * section, -1, 0), strict=False))
    dimension = border_dimension(labels)
    values = {
        "displacement_start": x,
        "velocity_start": y,
        "basin": labels,
        **attractor_values(found, mirrored_contacts(body), len(scene.stops)),
        **sections,
        "attractor_displacement": unit * points[..., 0],
        "attractor_velocity": unit * points[..., 1],
        "attractor_radius": np.array([each.radius for each in found.attractors]),
        "border_fraction": border_share(labels),
        "border_dimension": np.nan if dimension is None else dimension.value,
        "border_dimension_error": np.nan if dimension is None else dimension.error,
        **({} if edges is None else edge_values(edges, (across, along), unit)),
    }
    attributes = scene_attributes(scene, HISTORY) | {"units_system": scene.units} | search_attributes(found)
    return TABLE.dataset(values, attributes, units=scene.units, of=element_of(scene, plane.number))


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
    periods: int = MOST_PERIODS
    edges: bool = False

    def __post_init__(self) -> None:
        self.plane.refuse()
        if self.periods < 1:
            raise UsageError(f"basins: periods: expected 1 at least, got {self.periods}.")
        self.scene = self.scene.unswept()
        body = strobed_body(self.scene)
        axes_of(self.scene, self.plane.number)
        spans, scale = spans_of(self.scene, body, self.plane)
        unit = mass_displacement(self.scene, body)
        self.x, self.y, states = start_states(self.scene, self.plane, spans, unit)
        phases = len(FurtherSines.of(self.scene))
        beyond = beyond_stops(self.scene, body, states[:, : states.shape[1] - phases])
        if beyond.all():
            raise UsageError("basins: x: expected starts on the free side of the stops, got none.")
        half = (states.shape[1] - phases) // 2
        sizes = np.repeat(
            [max(size, np.abs(ends).max() / abs(unit)) for size, ends in zip(scale, spans, strict=True)],
            half,
        )
        sizes = np.append(sizes, np.zeros(phases))  # neighbours share the phases of forces
        labels = np.where(beyond, BEYOND_A_STOP, UNDECIDED).astype(np.int16)
        self.tracks: list[Track] = []
        self._body = body
        self.known = Basins(states, labels, sizes, most_periods=self.periods)

    @classmethod
    def prepare(cls, options: Options, stack: ExitStack) -> Self:
        """Open the scene, and place the starts."""
        scene = opened_scene(options.scene, options.changes or ())
        return cls(scene, plane_of(options), options.periods, options.edges)

    def rows(self) -> Generator[Basins, None, None]:
        """Follow the starts block by block."""
        flow = BodyFlow(self.scene)
        try:
            for now in find_basins(self.known, flow, block=BLOCK):
                names = ", ".join(now.names) or "none yet"
                self.status(f"{100.0 * now.decided:.1f} % of {now.possible} starts; {names}")
                if now.attractors:
                    yield now
            if self.edges:
                yield from self._track(flow)
        finally:
            flow.close()

    def _track(self, flow: BodyFlow) -> Generator[Basins, None, None]:
        """Follow the edges between the basins."""
        labels = self.known.labels.reshape(self.y.size, self.x.size)
        body = self._body if flow.turns is None else None
        for track in edge_tracks(self.known, labels, body, flow, block=BLOCK):
            self.tracks.append(track)
            self.status(f"edges: {len(self.tracks)}")
            yield self.known

    def made(self) -> xr.Dataset:
        """Return the dataset of the plane as far as it is known."""
        edges = self.tracks if self.edges else None
        return basins_dataset(self.scene, self.plane, self.x, self.y, self.known, edges)

    def print_results(self) -> None:
        """Print each attractor with its share, and the undecided starts."""
        found, data = self.known, self.dataset
        rows = table(
            f"Basins of attraction: {self.scene.title or self.scene.source}",
            *("<attractor", ">share of the starts", ">95 % confidence", ">multiplier a period"),
            "<displacement, velocity at forcing phase 0",
        )
        ends = found.intervals
        for place, (name, each) in enumerate(zip(found.full_names, found.attractors, strict=True)):
            states = np.column_stack(
                [data[f"attractor_{what}"].values[place] for what in ("displacement", "velocity")]
            )
            shown = "; ".join(f"{a:.6g}, {b:.6g}" for a, b in states[:4] if np.isfinite(a))
            rows.add_row(
                name,
                f"{100.0 * found.fractions[place]:.2f} %",
                f"{100.0 * ends[place, 0]:.2f} to {100.0 * ends[place, 1]:.2f} %",
                f"{each.multiplier:.5g}" if each.has_period else "",
                shown + (" ..." if len(each.states) > 4 else ""),
            )
        wide_terminal().print(rows)
        say_search(found)
        _say_partners(found, data["attractor_partner"].values.tolist())
        _say_aperiodic(found)
        _say_border(data)
        if self.edges:
            print_edges(self.tracks, found.names)


def say_search(found: Basins) -> None:
    """Print how many starts are undecided, and the shares that may have been missed."""
    undecided = 1.0 - found.decided
    if undecided > 0.0:
        say(
            f"{100.0 * undecided:.3g} % of the starts came near to no attractor that is known in "
            f"{found.followed_periods} periods."
        )
    if found.needed_periods > found.most_periods:
        say(
            f"The slowest motion needs {found.needed_periods} periods, more than the budget of "
            f"{found.most_periods}. Raise --periods."
        )
    if found.told_by_sample:
        say(
            f"{found.told_by_sample} starts count as ending where a sample of starts like them ends, as all of it is "
            "chaotic, quasi-periodic, or of a long period."
        )
    if found.attractors:
        say(
            f"An attractor that was missed has less than {100.0 * found.missed_share_below:.2g} % of the plane "
            "(95 % confidence)."
        )


def _say_partners(found: Basins, partner: list[int]) -> None:
    """Print the attractors that are mirror images of each other, or of themselves."""
    for place, other in enumerate(partner):
        if other > place:
            say(f"{found.names[place]} and {found.names[other]} are mirror images of each other.")
        elif other == place:
            say(f"{found.names[place]} is its own mirror image.")


def _say_aperiodic(found: Basins) -> None:
    """Print the features of attractors without a period, and whether recurrence separates them, too."""
    aperiodic = [
        (name, each)
        for name, each in zip(found.names, found.attractors, strict=True)
        if not (each.has_period or each.kind.kind is OrbitClass.no_impacts)
    ]
    for name, each in aperiodic:
        if not each.is_one:
            say(
                "Chaotic runs differ by more than their own scatter: there may be several chaotic attractors."
            )
        else:
            say(f"{name}: {_features_in_words(each)}.")
    counts = found.separation
    if counts is None:
        return
    if not counts.agree:
        say(
            f"Features of impacts separate {counts.by_features} of these attractors, recurrence in the strobe "
            f"section {counts.by_recurrence}: they disagree."
        )
    elif counts.by_features > 1:
        say("Features of impacts and recurrence in the strobe section separate the same attractors.")


def _features_in_words(each: Attractor) -> str:
    """Return impact rates, spreads of impact phases and the dimension of an attractor in words."""
    features = each.features
    rates = ", ".join(f"{rate:.3g} at stop {stop}" for stop, rate in enumerate(features.impacts, start=1))
    spreads = ", ".join(f"{spread:.3g}" for spread in features.phase_spread)
    dimension = f"dimension {features.dimension:.2f}" if features.dimension else "no dimension: a long period"
    parting = Separation(each.exponent, each.exponent_error).text
    return (
        f"impacts in a forcing period: {rates}; spread of impact phases {spreads} rad; {dimension}; {parting}"
    )


def _say_border(data: xr.Dataset) -> None:
    share, dimension = float(data["border_fraction"]), float(data["border_dimension"])
    if np.isfinite(dimension):
        error = float(data["border_dimension_error"])
        say(f"{100.0 * share:.3g} % lie on a border, whose dimension is {dimension:.3f} +- {error:.3f}.")
    elif share > 0.0:
        say(f"{100.0 * share:.3g} % lie on a border.")
