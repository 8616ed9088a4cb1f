"""Figures of one motion in other planes than time: phase portraits and impact maps."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from vibroimpact.analysis.dataset.schema import scene_of
from vibroimpact.analysis.figures.motion.layers import FEW_TURNS, draw_turns, turn_begins
from vibroimpact.analysis.figures.motion.series import (
    first_after_impacts,
    impacts_within,
    samples_within,
    with_gaps,
)
from vibroimpact.analysis.figures.page import (
    COLOURS,
    LINE,
    MARK,
    STOP,
    STOP_LINE,
    Floats,
    canvas,
    label,
    legend_above,
    legend_outside,
    title,
    unit_symbol,
)
from vibroimpact.analysis.figures.scene_text import contact_label, fixed_positions, limits, swept_keys, table
from vibroimpact.analysis.figures.window import View
from vibroimpact.fmus.errors import DatasetError

_PANEL_MM = 62
# Marker size, points: small enough that ten thousand impacts do not merge.
_DOT = 1.1
# Impacts on one stop above which their marks have this size.
_MANY_IMPACTS = 200
_QUARTERS = ("0", "π/2", "π", "3π/2", "2π")


class _Orbit(NamedTuple):
    """The orbit of one line in a portrait."""

    name: str
    words: str
    displacement: Floats
    velocity: Floats


def draw_portrait(dataset: xr.Dataset, view: View) -> Figure:
    """Draw velocity against displacement for each sampled pair; a whole chain also shows its modes.

    Lines end at an impact and begin again after it; dots join both ends. In a long motion the ends are not joined: the
    dots of many jumps would be a solid band.
    """
    samples = samples_within(dataset, view)
    orbits = _sampled_orbits(samples)
    if not orbits:
        raise DatasetError(
            "figure: expected a displacement and its velocity in the time series, got no such pair. "
            'Set variables = ["displacement", "velocity"] in time_series.'
        )
    jumps = first_after_impacts(dataset, view.run, samples["time"].values)
    nondimensional = dataset.attrs.get("units_system") == "nondimensional"
    modal = _modal_orbits(dataset, orbits)
    panels = [(orbits, ("-", "-") if nondimensional else ("m", "m/s"))]
    if modal:
        panels.append((modal, ("-", "-") if nondimensional else ("√kg m", "√kg m/s")))
    figure = canvas(6 + _PANEL_MM * len(panels))
    axes = np.atleast_1d(figure.subplots(len(panels), 1))
    for axis, (lines, (length, speed)) in zip(axes, panels, strict=True):
        for place, orbit in enumerate(lines):
            _draw_orbit(axis, orbit, jumps, COLOURS[place % len(COLOURS)] if len(lines) > 1 else LINE)
        words = "modal displacement" if lines is modal else "displacement"
        axis.xaxis.set_major_locator(MaxNLocator(5))
        axis.set_xlabel(f"{words} ({length})")
        axis.set_ylabel(f"{words.replace('displacement', 'velocity')} ({speed})")
        if len(lines) > 1:
            legend_above(axis, "center", columnspacing=2.0, handlelength=2.0)
    for position in fixed_positions([stop for orbit in orbits for stop in limits(dataset, orbit.name)]):
        axes[0].axvline(position, **STOP_LINE)
    return figure


def _draw_orbit(axis: Any, orbit: _Orbit, jumps: Any, colour: str) -> None:
    """Draw one line, broken where the velocity jumps; the turns of a long line are layers."""
    x, y = (with_gaps(values, jumps) for values in (orbit.displacement, orbit.velocity))
    draw_turns(axis, x, y, color=colour, label=orbit.words, rasterized=True)
    if not jumps.size or turn_begins(orbit.velocity).size > FEW_TURNS:
        return
    both = [np.stack([values[jumps - 1], values[jumps]], axis=1) for values in orbit[2:]]
    pairs = np.stack(both, axis=2)
    gaps = np.full((jumps.size, 1, 2), np.nan)
    joined = np.concatenate([pairs, gaps], axis=1).reshape(-1, 2)
    axis.plot(joined[:, 0], joined[:, 1], linewidth=0.6, color=colour, linestyle=":", rasterized=True)


def _sampled_orbits(samples: xr.Dataset) -> list[_Orbit]:
    """Return each sampled displacement with the velocity of the same name."""
    named = {str(name): variable for name, variable in samples.data_vars.items()}
    return [
        _Orbit(name, title(variable), variable.values, named[partner].values)
        for name, variable in named.items()
        if "displacement" in name and (partner := name.replace("displacement", "velocity")) in named
    ]


def _modal_orbits(dataset: xr.Dataset, orbits: list[_Orbit]) -> list[_Orbit]:
    """Return the modal coordinates q = Psi' M y of a chain if all of its masses were sampled (equations.md 5.2)."""
    scene = scene_of(dataset.attrs)
    body = {} if any(key.startswith("body.") for key in swept_keys(scene)) else table(scene, "body")
    masses = np.atleast_1d(np.asarray(body.get("masses", []), dtype=float))
    by_name = {orbit.name: orbit for orbit in orbits}
    chosen = [by_name.get(f"displacement_{i}") for i in range(1, masses.size + 1)]
    rows = [orbit for orbit in chosen if orbit is not None]
    if body.get("kind") != "chain" or len(rows) < masses.size or masses.size < 2:
        return []
    springs = np.append(np.broadcast_to(body["stiffnesses"], masses.shape), body.get("far_stiffness", 0.0))
    matrix = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    roots = np.sqrt(masses)
    _, vectors = np.linalg.eigh(matrix / np.outer(roots, roots))
    vectors *= np.where(vectors[0] < 0, -1.0, 1.0)
    weights = (vectors * roots[:, None]).T
    q = weights @ np.stack([orbit.displacement for orbit in rows])
    p = weights @ np.stack([orbit.velocity for orbit in rows])
    return [_Orbit(f"mode_{j + 1}", f"mode {j + 1}", q[j], p[j]) for j in range(masses.size)]


def draw_impact_map(dataset: xr.Dataset, view: View) -> Figure:
    """Draw the impacts of one run in the plane of the impact map: forcing phase and velocity before impact."""
    hits = impacts_within(dataset, view)
    phase, velocity = hits["impact_phase"].values, hits["impact_velocity"].values
    if not np.isfinite(phase).any():
        raise DatasetError(
            "figure: expected impacts with a forcing phase, got none. "
            "Record a forced scene that meets its stop, with impacts = true."
        )
    figure = canvas(75)
    axis = figure.subplots()
    owner = hits["impact_contact"].values
    hit = {int(stop): (phase[owner == stop], velocity[owner == stop]) for stop in np.unique(owner)}
    _draw_dots(figure, axis, _named(dataset, hit))
    axis.set_xlim(0.0, 2.0 * math.pi)
    axis.set_xticks(np.linspace(0.0, 2.0 * math.pi, 5), _QUARTERS)
    axis.set_ylim(0.0, max(axis.get_ylim()[1], 1.05 * float(np.max(velocity))))
    axis.set(xlabel=label(hits["impact_phase"]), ylabel=label(hits["impact_velocity"]))
    return figure


def _named(
    dataset: xr.Dataset, points: dict[int, tuple[Floats, Floats]]
) -> list[tuple[str, tuple[Floats, Floats]]]:
    """Return points of the impacts on each contact with the name of the contact."""
    return [(contact_label(dataset, number), pair) for number, pair in points.items()]


def _draw_dots(
    figure: Figure, axis: Axes, points: list[tuple[str, tuple[Floats, Floats]]], many: int = _MANY_IMPACTS
) -> None:
    """Draw points of the impacts on each stop, small where they are many; several stops are named."""
    for place, (name, (x, y)) in enumerate(points):
        axis.plot(
            x,
            y,
            linestyle="none",
            marker="o",
            markersize=_DOT if len(x) > many else 3.0,
            markeredgewidth=0.0,
            color=COLOURS[place % len(COLOURS)] if len(points) > 1 else MARK,
            label=name,
            rasterized=True,
        )
    if len(points) > 1:
        legend_outside(figure, axis, ncols=4, markerscale=2.0)


def draw_return_map(dataset: xr.Dataset, view: View) -> Figure:
    """Draw the velocity of each impact over the velocity of the impact before it on the same stop.

    Points on the diagonal repeat; a motion of period n has n points, chaos a line or a thin set.
    """
    hits = impacts_within(dataset, view)
    velocity, contact = hits["impact_velocity"].values, hits["impact_contact"].values
    chains = {int(number): velocity[contact == number] for number in np.unique(contact)}
    chains = {number: values for number, values in chains.items() if values.size > 1}
    if not chains:
        raise DatasetError(
            f"figure: expected two impacts on one stop at least, got {velocity.size} impacts. "
            "Record a longer motion with impacts = true."
        )
    figure = canvas(82)
    axis = figure.subplots()
    pairs = {stop: (values[:-1], values[1:]) for stop, values in chains.items()}
    _draw_dots(figure, axis, _named(dataset, pairs), _MANY_IMPACTS - 1)  # there is one pair less than impacts
    limit = 1.05 * max(float(values.max()) for values in chains.values())
    axis.plot([0.0, limit], [0.0, limit], color=STOP, linewidth=0.4, zorder=0)
    unit = unit_symbol(hits["impact_velocity"])
    axis.set(xlim=(0.0, limit), ylim=(0.0, limit), xlabel=f"impact velocity $v_n$ ({unit})")
    axis.set_ylabel(f"next impact velocity $v_{{n+1}}$ ({unit})")
    axis.set_box_aspect(1.0)
    return figure
