"""Edges between the basins of a scene: the saddles on them, found by edge tracking and refined into orbits."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import numpy as np

from vibroimpact.analysis.orbits.attractors.basins import Basins, Floats, Labels
from vibroimpact.analysis.orbits.attractors.edges import LOOKED_AT, EdgeTracking, Track, neighbouring_pairs
from vibroimpact.analysis.orbits.branches import multiplier_text
from vibroimpact.analysis.orbits.periodic import PeriodicOrbit
from vibroimpact.analysis.orbits.search import same_orbit
from vibroimpact.fmus.bodies.impacting_body import ImpactingBody
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.orbits.find import orbit_of_impacts

MOST_PAIRS, PAIRS_OF_STARTS, MOST_TRIED = 6, 2, 6
"""Most pairs of attractors whose edges are tracked, pairs of starts from which each edge is, and those tried."""
SHOWN = 2
"""Number of multipliers that are printed and kept."""
EDGE_ROWS = (
    ("edge_attractor", "edge side", "1", "attractors on both sides, from 0"),
    ("edge_orbit", "edge", "1", "orbit on the edge; empty where none was found", "text"),
    ("edge_seed", "edge", "1", "phases (rad) and stops of its impacts, for --seed", "text"),
    ("edge_multiplier", "edge multiplier", "1", "its largest multipliers in its period, by their real parts"),
    ("edge_exponent", "edge", "1", "largest Lyapunov exponent of the edge state in a forcing period"),
    ("edge_exponent_error", "edge", "1", "standard error of the exponent"),
    ("edge_displacement", "edge edge_period", "m", "displacement of the edge state at forcing phase 0"),
    ("edge_velocity", "edge edge_period", "m s-1", "velocity of the edge state at forcing phase 0"),
)


def edge_tracks(
    found: Basins, labels: Labels, body: ImpactingBody | None, flow: BodyFlow, *, block: int
) -> Generator[Track, None, None]:
    """Yield an edge state for each pair of neighbouring attractors; orbits that are known already do not count.

    `labels` has the shape (y, x), as the plane of starts. Without a body, as under forces that do not repeat, no
    orbit is found.
    """

    def refine(rows: Floats) -> PeriodicOrbit | None:
        if body is None:
            return None
        return orbit_of_impacts(body, rows, longest=LOOKED_AT - 1)

    tracking = EdgeTracking(found, flow, refine, block=block, period=flow.period)
    known: list[PeriodicOrbit] = []
    for between, places in neighbouring_pairs(labels)[:MOST_PAIRS]:
        tracked = 0
        for pair in places[:: max(1, len(places) // MOST_TRIED)][:MOST_TRIED]:
            track = tracking.track(between, pair) if tracked < PAIRS_OF_STARTS else None
            if track is None:
                continue
            tracked += 1
            if track.orbit is None or not any(same_orbit(track.orbit, other) for other in known):
                yield track
            if track.orbit is not None:
                known.append(track.orbit)


def seed_text(orbit: PeriodicOrbit) -> str:
    """Return the impacts of an orbit as `--seed` takes them."""
    impacts = zip(orbit.phases, orbit.contacts + 1, strict=True)
    return ",".join(f"{phase:.12g}:{stop}" for phase, stop in impacts)


def edge_values(tracks: list[Track], axes: tuple[int, int], unit: float) -> dict[str, Any]:
    """Return the variables of `EDGE_ROWS`; `axes` are the plane's displacement and velocity among the variables.

    `unit` is the displacement for a unit of these variables.
    """
    most = max([_periods(each) for each in tracks], default=1)
    points = np.full((len(tracks), most, 2), np.nan)
    for place, each in enumerate(tracks):
        points[place, : _periods(each)] = unit * each.states[-_periods(each) :, list(axes)]
    orbits = [each.orbit for each in tracks]
    none = np.full(SHOWN, np.nan)
    return {
        "edge_attractor": np.array([each.between for each in tracks], np.int16).reshape(-1, 2),
        "edge_orbit": np.array(["" if each is None else each.full_name for each in orbits], object),
        "edge_seed": np.array(["" if each is None else seed_text(each) for each in orbits], object),
        "edge_multiplier": np.array(
            [none if each is None else each.multipliers[:SHOWN].real for each in orbits]
        ).reshape(-1, SHOWN),
        "edge_exponent": np.array([each.parting.exponent for each in tracks]),
        "edge_exponent_error": np.array([each.parting.error for each in tracks]),
        "edge_displacement": points[..., 0],
        "edge_velocity": points[..., 1],
    }


def _periods(track: Track) -> int:
    """Return the number of last states that show an edge state: those of its orbit."""
    return LOOKED_AT if track.orbit is None else track.orbit.periods


def print_edges(tracks: list[Track], names: list[str]) -> None:
    """Print the orbit on each edge with its multipliers, and how `follow` takes it."""
    if not tracks:
        say("No edge was followed: no two starts side by side straddle one to within rounding.")
        return
    rows = table("Edges between basins", "<between", "<orbit on the edge", "<largest multipliers", "<seed")
    for each in tracks:
        orbit = each.orbit
        rows.add_row(
            " and ".join(names[number] for number in each.between),
            f"none found in {len(each.states)} periods" if orbit is None else orbit.full_name,
            each.parting.text
            if orbit is None
            else ", ".join(map(multiplier_text, orbit.multipliers[:SHOWN])),
            "" if orbit is None else f"--seed {seed_text(orbit)} --periods {orbit.periods}",
        )
    wide_terminal().print(rows)
