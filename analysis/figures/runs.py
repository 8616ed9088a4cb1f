"""Figures of one run: its time series and phase portrait, or what was recorded in their place."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from vibroimpact.analysis.figures.page import LINE, MARK, STOP, Floats, canvas, label
from vibroimpact.analysis.figures.series import draw_series, sampled_names
from vibroimpact.analysis.schema import swept_names
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.safe_toml import parse_toml


def draw_run(dataset: xr.Dataset, run: int | None = None) -> Figure:
    """Draw one run: time series with the stop and the impacts, and the phase portrait.

    Variables of components, and of a body where more than displacement and velocity was sampled, are drawn as
    time series with the events or impacts. Where no time series was recorded, the extremes of each period and
    the strobe points stand in for it.
    """
    selection = {} if run is None else {"run_index": run}
    sampled = sampled_names(dataset)
    if set(sampled) == {"displacement", "velocity"}:
        return _draw_samples(dataset, selection)
    if sampled:
        return draw_series(dataset, selection)
    if "displacement_max" in dataset.variables or "impact_velocity" in dataset.variables:
        return _draw_periods(dataset, selection)
    raise DatasetError(
        "figure: expected a time series, extrema or impacts of the run, got none recorded. "
        'Set time_series = { rate = ..., variables = ["displacement", "velocity"] } in [record], '
        "or rate and variables in a scene of components."
    )


def _draw_samples(dataset: xr.Dataset, selection: dict[str, int]) -> Figure:
    """Draw the sampled displacement and velocity of a run."""
    samples = dataset.vibroimpact.samples(**selection)
    hits = dataset.vibroimpact.impacts(**selection) if "impact" in dataset.dims else None
    stops = _stops(dataset)
    marks = _impact_points(hits, stops)
    time, displacement, velocity = _with_impacts(samples, marks)
    figure = canvas(150)
    above, middle, below = figure.subplots(3, 1, height_ratios=[1, 1, 1.5])
    above.plot(time, displacement, color=LINE, rasterized=True)
    middle.plot(time, velocity, color=LINE, rasterized=True)
    below.plot(displacement, velocity, color=LINE, rasterized=True)
    dots = {"linestyle": "none", "marker": "o", "markersize": 2.2, "color": MARK, "zorder": 3}
    for axis, columns in ((above, (0, 1)), (middle, (0, 2)), (below, (1, 2))):
        axis.plot(marks[:, columns[0]], marks[:, columns[1]], label="just before impact", **dots)
    for position, _ in stops:
        above.axhline(position, color=STOP, linestyle="--", linewidth=0.6, zorder=0)
        below.axvline(position, color=STOP, linestyle="--", linewidth=0.6, zorder=0, label="stop")
    middle.sharex(above)
    above.tick_params(labelbottom=False)
    above.set_ylabel(label(samples["displacement"]))
    middle.set_ylabel(label(samples["velocity"]))
    middle.set_xlabel(label(samples["time"]))
    below.xaxis.set_major_locator(MaxNLocator(5))  # long numbers of small displacements would run together
    below.set_xlabel(label(samples["displacement"]))
    below.set_ylabel(label(samples["velocity"]))
    _legend_above(figure, below, has_marks=len(marks) > 0)
    return figure


def _legend_above(figure: Figure, axis: Axes, *, has_marks: bool) -> None:
    """Put a legend above all panels, each entry once."""
    handles, labels = axis.get_legend_handles_labels()
    entries = {
        text: handle for handle, text in zip(handles, labels, strict=True) if has_marks or text == "stop"
    }
    if entries:
        figure.legend(entries.values(), entries.keys(), loc="outside upper center", ncols=2, frameon=False)


def _stops(dataset: xr.Dataset) -> list[tuple[float, float]]:
    """Return position and side (+1 upper, -1 lower) of each stop of the scene; none where it is not known.

    Nor where one is at another point than the observed one: there its position says nothing.
    """
    if any(name.endswith(("position", "side", "location")) for name in swept_names(dataset)):
        return []
    try:
        scene = parse_toml(str(dataset.attrs.get("scene", "")))
        stops = scene.get("stop", [])
        if not _at_observed_point(scene, stops):
            return []
        return [(float(s["position"]), -1.0 if s.get("side") == "lower" else 1.0) for s in stops]
    except (KeyError, TypeError, ValueError, AttributeError):
        # The scene text is only provenance here: a figure without the line of the stop is still right.
        return []


def _at_observed_point(scene: dict[str, Any], stops: list[dict[str, Any]]) -> bool:
    """Whether all stops limit the motion of the point whose displacement is recorded."""
    body = scene.get("body", {})
    if body.get("kind") == "chain":
        masses = [stop.get("mass", len(body["masses"])) for stop in stops]
        return set(masses) <= {body.get("observed_mass", masses[0] if masses else 0)}
    if body.get("kind") == "beam":
        tip = body.get("boundary", "clamped-free") == "clamped-free"
        places = [stop.get("location", 1.0) for stop in stops]
        default = 1.0 if tip or not places else places[0]
        return set(places) <= {scene.get("sensor", {}).get("location", default)}
    return True


def _impact_points(hits: xr.Dataset | None, stops: list[tuple[float, float]]) -> Floats:
    """Return time, displacement and velocity just before each impact, shape (impact, 3)."""
    if hits is None or hits.sizes["impact"] == 0 or int(hits["impact_contact"].max()) > len(stops):
        return np.empty((0, 3))
    place = np.array(stops)[hits["impact_contact"].values - 1]
    return np.column_stack(
        [hits["impact_time"].values, place[:, 0], place[:, 1] * hits["impact_velocity"].values]
    )


def _with_impacts(samples: xr.Dataset, marks: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the time series with the impacts in it, and a gap in the velocity where it jumps."""
    names = ("time", "displacement", "velocity")
    rows = np.column_stack([samples[name].values for name in names])
    inside = marks[
        (marks[:, 0] >= rows[:, 0].min(initial=np.inf)) & (marks[:, 0] <= rows[:, 0].max(initial=-np.inf))
    ]
    gaps = inside.copy()
    gaps[:, 2] = np.nan
    merged = np.concatenate([rows, inside, gaps])
    merged = merged[np.argsort(merged[:, 0], kind="stable")]
    return merged[:, 0], merged[:, 1], merged[:, 2]


def _draw_periods(dataset: xr.Dataset, selection: dict[str, int]) -> Figure:
    """Draw what stands in for a time series: extremes, impact velocities, strobe points."""
    runs = dataset.vibroimpact.runs
    chosen = runs if not selection else runs.isel(run=runs["run_index"].values == selection["run_index"])
    if chosen.sizes["run"] != 1:
        raise DatasetError(
            f"figure: expected one run, got {chosen.sizes['run']}. "
            f"Name one of {runs.sizes['run']} by its run_index (--run)."
        )
    run = chosen.isel(run=0)
    has = set(map(str, dataset.variables))
    drawers = [
        draw_panel
        for name, draw_panel in (
            ("displacement_max", _extremes_panel),
            ("impact_velocity", _impacts_panel),
            ("strobe_velocity", _strobe_panel),
        )
        if name in has
    ]
    figure = canvas(5 + 48 * len(drawers))
    for axis, draw_panel in zip(np.atleast_1d(figure.subplots(len(drawers), 1)), drawers, strict=True):
        draw_panel(axis, dataset, run, selection)
    return figure


def _extremes_panel(axis: Axes, dataset: xr.Dataset, run: xr.Dataset, selection: dict[str, int]) -> None:
    """Draw the largest and smallest displacement of each period, with the stops."""
    period = np.arange(1, run.sizes["period"] + 1)
    axis.plot(period, run["displacement_max"].values, "^", color=MARK, markersize=2.5, label="largest")
    axis.plot(period, run["displacement_min"].values, "v", color=LINE, markersize=2.5, label="smallest")
    for position, _ in _stops(dataset):
        axis.axhline(position, color=STOP, linestyle="--", linewidth=0.6, zorder=0, label="stop")
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    axis.set_xlabel("recorded forcing period (-)")
    axis.set_ylabel(label(run["final_displacement"].rename("displacement")))
    axis.legend(frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.1)


def _impacts_panel(axis: Axes, dataset: xr.Dataset, run: xr.Dataset, selection: dict[str, int]) -> None:
    """Draw the velocity of each impact against time."""
    hits = dataset.vibroimpact.impacts(**selection)
    axis.plot(hits["impact_time"].values, hits["impact_velocity"].values, "o", color=MARK, markersize=2)
    axis.set_xlabel(label(dataset["impact_time"].rename("time")))
    axis.set_ylabel(label(hits["impact_velocity"]))
    axis.set_ylim(bottom=0)


def _strobe_panel(axis: Axes, dataset: xr.Dataset, run: xr.Dataset, selection: dict[str, int]) -> None:
    """Draw displacement and velocity at forcing phase zero."""
    axis.plot(run["strobe_displacement"].values, run["strobe_velocity"].values, "o", color=LINE, markersize=2)
    axis.set_xlabel(label(run["strobe_displacement"]))
    axis.set_ylabel(label(run["strobe_velocity"]))
