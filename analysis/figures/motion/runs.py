"""Figures of one run: its time series and phase portrait, or other recorded groups in their place."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from vibroimpact.analysis.dataset.columns import OF_ALL_PERIODS
from vibroimpact.analysis.figures.motion.layers import draw_turns
from vibroimpact.analysis.figures.motion.series import (
    count_time,
    draw_series,
    left_out,
    sampled_variables,
    selected,
    time_part,
)
from vibroimpact.analysis.figures.motion.strobe import draw_section
from vibroimpact.analysis.figures.page import (
    COLOURS,
    LINE,
    MARK,
    STOP_LINE,
    Floats,
    canvas,
    label,
    legend_above,
    legend_outside,
)
from vibroimpact.analysis.figures.scene_text import (
    ShownStop,
    contact_label,
    fixed_positions,
    observed_stops,
    stops,
)
from vibroimpact.analysis.figures.window import View
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.messages import Argument, message

#: Number of impacts above which their marks are small.
_MOST_LARGE_MARKS = 100
#: Instants at which the motion of a stop is drawn.
_INSTANTS_OF_A_STOP = 1000


def draw_run(dataset: xr.Dataset, view: View) -> Figure:
    """Draw one run: time series with the stop and the impacts, and the phase portrait.

    Variables of components are drawn as time series with the events or impacts. So is a body with more sampled
    variables than displacement and velocity. Without a time series, the extremes of each period and the strobe points
    are drawn. A long record shows its first forcing periods, unless a window is given; the phase portrait then shows
    all of it.
    """
    sampled = sampled_variables(dataset)
    if set(sampled) == {"displacement", "velocity"}:
        return _draw_samples(dataset, view)
    if sampled:
        return draw_series(dataset, view)
    if view.window.given:
        raise UsageError("figure: window: expected a run with a time series, got none recorded.")
    if "displacement_max" in dataset.variables or "impact_velocity" in dataset.variables:
        return _draw_periods(dataset, view.run)
    raise DatasetError(
        f"figure: expected a time series of single numbers, extrema or impacts of the run, got none recorded"
        f"{left_out(dataset)}. "
        'Set time_series = { rate = ..., variables = ["displacement", "velocity"] } in [record], '
        "or rate and variables in a scene of components."
    )


def _draw_samples(dataset: xr.Dataset, view: View) -> Figure:
    """Draw the sampled displacement and velocity of a run."""
    samples = dataset.vibroimpact.samples(**selected(view.run))
    marks = _impact_points(dataset, view.run)
    words_of_marks = "just before impact" if len(marks) else None
    part, words = time_part(dataset, samples, view.window)
    figure = canvas(150)
    above, middle, below = figure.subplots(3, 1, height_ratios=[1, 1, 1.5])
    dots = {"linestyle": "none", "marker": "o", "color": MARK, "zorder": 3}
    for axis, columns in ((above, (0, 1)), (middle, (0, 2)), (below, (1, 2))):
        shown = part if axis is not below or view.window.given else (-math.inf, math.inf)
        rows, inside = _with_impacts(samples, marks, shown)
        drawn = draw_turns if axis is below else Axes.plot
        drawn(axis, rows[:, columns[0]], rows[:, columns[1]], color=LINE, rasterized=True)
        size = 2.2 if len(inside) <= _MOST_LARGE_MARKS else 0.8
        axis.plot(inside[:, columns[0]], inside[:, columns[1]], markersize=size, label=words_of_marks, **dots)
    for moving in (stop for stop in observed_stops(dataset) if stop.motion):
        first, last = np.clip(part, *samples["time"].values[[0, -1]]).tolist()
        instants = np.linspace(first, last, _INSTANTS_OF_A_STOP)
        above.plot(instants, moving.course(instants)[0], **STOP_LINE)
    for position in fixed_positions(observed_stops(dataset)):
        above.axhline(position, **STOP_LINE)
        below.axvline(position, **STOP_LINE, label="stop")
    middle.sharex(above)
    above.tick_params(labelbottom=False)
    above.set_ylabel(label(samples["displacement"]))
    middle.set_ylabel(label(samples["velocity"]))
    count_time(middle, samples["time"], view.window, words)
    below.xaxis.set_major_locator(MaxNLocator(5))
    below.set(xlabel=label(samples["displacement"]), ylabel=label(samples["velocity"]))
    legend_outside(figure, below, ncols=2)
    return figure


def _impact_points(dataset: xr.Dataset, run: int | None) -> Floats:
    """Return time, displacement and velocity of the observed point just before its impacts, shape (impact, 3)."""
    hits = dataset.vibroimpact.impacts(**selected(run)) if "impact" in dataset.dims else None
    known, seen = stops(dataset), observed_stops(dataset)
    if hits is None or hits.sizes["impact"] == 0 or int(hits["impact_contact"].max()) > len(known):
        return np.empty((0, 3))
    hits = hits.isel(impact=[known[contact - 1] in seen for contact in hits["impact_contact"].values])
    time, contact = hits["impact_time"].values, hits["impact_contact"].values
    place, velocity = np.empty_like(time), np.empty_like(time)
    for number, stop in enumerate(known, start=1):
        own = contact == number
        place[own], of_stop = stop.course(time[own])
        velocity[own] = stop.side * hits["impact_velocity"].values[own] + of_stop
    return np.column_stack([time, place, velocity])


def _with_impacts(samples: xr.Dataset, marks: Floats, part: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return time, displacement and velocity of a part with its impacts inserted, and the impacts alone.

    The velocity has a gap where it jumps.
    """
    rows = np.column_stack([samples[name].values for name in ("time", "displacement", "velocity")])
    rows = rows[(rows[:, 0] >= part[0]) & (rows[:, 0] <= part[1])]
    ends = rows[:, 0].min(initial=np.inf), rows[:, 0].max(initial=-np.inf)
    inside = marks[(marks[:, 0] >= ends[0]) & (marks[:, 0] <= ends[1])]
    gaps = inside.copy()
    gaps[:, 2] = np.nan
    merged = np.concatenate([rows, inside, gaps])
    return merged[np.argsort(merged[:, 0], kind="stable")], inside


def _draw_periods(dataset: xr.Dataset, run: int | None) -> Figure:
    """Draw the substitutes of a time series: extremes, impact velocities, strobe points."""
    runs = dataset.vibroimpact.runs
    chosen = runs if run is None else runs.isel(run=runs["run_index"].values == run)
    if chosen.sizes["run"] != 1:
        raise DatasetError(
            message(
                f"figure: expected one run, got {chosen.sizes['run']}. "
                f"Name one of {runs.sizes['run']} by its run_index (",
                *(Argument("run"), ")."),
            )
        )
    one = chosen.isel(run=0)
    panels: dict[str, Callable[[Axes], None]] = {
        "displacement_max": lambda axis: _draw_extremes(axis, one, observed_stops(dataset)),
        "impact_velocity": lambda axis: _draw_impacts(axis, dataset, run),
        "strobe_velocity": lambda axis: draw_section(axis, one),
    }
    drawers = [draw_panel for name, draw_panel in panels.items() if name in dataset.variables]
    figure = canvas(5 + 48 * len(drawers))
    for axis, draw_panel in zip(np.atleast_1d(figure.subplots(len(drawers), 1)), drawers, strict=True):
        draw_panel(axis)
    return figure


def _draw_extremes(axis: Axes, run: xr.Dataset, observed: list[ShownStop]) -> None:
    """Draw the largest and smallest displacement of each period, with the stops."""
    period = np.arange(1, run.sizes["period"] + 1)
    axis.plot(period, run["displacement_max"].values, "^", color=MARK, markersize=2.5, label="largest")
    axis.plot(period, run["displacement_min"].values, "v", color=LINE, markersize=2.5, label="smallest")
    for place, position in enumerate(fixed_positions(observed)):
        axis.axhline(position, **STOP_LINE, label="_" if place else "stop")
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    axis.set_xlabel("recorded forcing period (-)")
    if str(run["displacement_max"].attrs.get("long_name")) == OF_ALL_PERIODS["displacement_max"]:
        axis.set(xlabel="all recorded forcing periods together", xticks=[])
    axis.set_ylabel(label(run["final_displacement"].rename("displacement")))
    legend_above(axis, "center", columnspacing=2.0, handlelength=2.0)


def _draw_impacts(axis: Axes, dataset: xr.Dataset, run: int | None) -> None:
    """Draw the velocity of each impact against time."""
    hits = dataset.vibroimpact.impacts(**selected(run))
    owner = hits["impact_contact"].values
    hit = np.unique(owner)
    for place, stop in enumerate(hit):
        one = hits.isel(impact=owner == stop)
        colour = COLOURS[place % len(COLOURS)] if hit.size > 1 else MARK
        dots = one["impact_time"].values, one["impact_velocity"].values
        axis.plot(*dots, "o", color=colour, markersize=2, label=contact_label(dataset, int(stop)))
    if hit.size > 1:
        legend_above(axis, "center")
    axis.set(xlabel=label(hits["impact_time"].rename("time")), ylabel=label(hits["impact_velocity"]))
    axis.set_ylim(0.0, 1.05 * float(hits["impact_velocity"].max()) if hits.sizes["impact"] else 1.0)
