"""Figures for one journal column: bifurcation diagrams, maps over two parameters, and single runs.

The only module that imports matplotlib; it draws without a display.
"""

from __future__ import annotations

import io
import os
import tomllib
from pathlib import Path
from typing import Any, Literal, cast

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from vibroimpact.analysis.atomic import write_atomically
from vibroimpact.analysis.schema import swept_names
from vibroimpact.fmus.errors import DatasetError, UsageError

Kind = Literal["auto", "bifurcation", "run"]
Floats = npt.NDArray[np.float64]

_MM = 1 / 25.4
COLUMN_WIDTH = 85 * _MM
FORMATS = (".png", ".pdf", ".svg")
_DPI = 300
_STYLE: dict[str, Any] = {
    "font.size": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7.5,
    "axes.linewidth": 0.6,
    "lines.linewidth": 0.7,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "svg.hashsalt": "vibroimpact",
}
# Where both sweeps agree the small dark crosses lie inside the large light rings, and both stay visible.
_SWEEPS: dict[str, dict[str, Any]] = {
    "up": {"marker": "o", "color": "#56A5DC", "markersize": 2.6, "markeredgewidth": 0.5, "fillstyle": "none"},
    "down": {"marker": "x", "color": "#B5410B", "markersize": 1.5, "markeredgewidth": 0.5},
    "independent": {"marker": ".", "color": "#20567D", "markersize": 1.6, "markeredgewidth": 0.0},
}
_LINE = "#20567D"
_IMPACT = "#D55E00"
_STOP = "0.45"
_UNIT_SYMBOLS = {
    "1": "-",
    "m s-1": "m/s",
    "rad s-1": "rad/s",
    "m s-2": "m/s²",
    "N m-1": "N/m",
    "N s m-1": "N s/m",
}


def draw(dataset: xr.Dataset, kind: Kind = "auto", run: int | None = None) -> Figure:
    """Draw a dataset as `open_dataset` gives it.

    Parameters
    ----------
    dataset : xarray.Dataset
    kind : {"auto", "bifurcation", "run"}
        `auto` draws a single run where nothing is swept or a run is named, else a bifurcation diagram, or
        colour maps over two swept parameters.
    run : int, optional
        `run_index` of the run to draw.

    Returns
    -------
    matplotlib.figure.Figure
        One column (85 mm) wide.

    Raises
    ------
    DatasetError
        If the dataset does not hold what the figure shows.
    """
    swept = _varied(dataset)
    with mpl.rc_context(cast(Any, _STYLE)):
        if kind == "run" or (kind == "auto" and (run is not None or not swept)):
            return draw_run(dataset, run)
        if len(swept) == 1:
            return draw_bifurcation(dataset)
        if len(swept) == 2:
            return draw_map(dataset)
    raise DatasetError(
        f"figure: expected one or two swept parameters, got {len(swept)} ({', '.join(swept) or 'none'}). "
        "Select some in Python before drawing, or draw one run."
    )


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure, whole or not at all; the ending of the name chooses the format (png, pdf, svg).

    Raises
    ------
    UsageError
        If the ending is none of these.
    OSError
        If the file cannot be written.
    """
    ending = Path(path).suffix.lower()
    if ending not in FORMATS:
        raise UsageError(
            f"{os.fspath(path)}: expected a name ending in {', '.join(FORMATS)}, got {ending or 'none'!r}."
        )
    content = io.BytesIO()
    with mpl.rc_context(cast(Any, _STYLE)):
        figure.savefig(content, format=ending[1:], dpi=_DPI)
    write_atomically(path, content.getvalue())


def _varied(dataset: xr.Dataset) -> list[str]:
    """Return the swept parameters that take more than one value."""
    return [name for name in swept_names(dataset) if dataset[name].size > 1]


def label(variable: xr.DataArray) -> str:
    """Return the axis label of a variable: its name in words and its unit.

    >>> label(xr.DataArray(0.0, name="angular_frequency", attrs={"units": "rad s-1"}))
    'angular frequency (rad/s)'
    """
    unit = str(variable.attrs.get("units", "1"))
    return f"{str(variable.name).replace('_', ' ')} ({_UNIT_SYMBOLS.get(unit, unit)})"


def _canvas(height_mm: float, width: float = COLUMN_WIDTH) -> Figure:
    """Return an empty figure that needs no display."""
    figure = Figure(figsize=(width, height_mm * _MM), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def draw_bifurcation(dataset: xr.Dataset) -> Figure:
    """Draw displacement range and impact velocity against the swept parameter, up and down told apart."""
    (name,) = _varied(dataset)
    runs = dataset.vibroimpact.runs
    panels = [q for q in ("displacement_range", "impact_velocity") if q in dataset.variables]
    if not panels:
        raise DatasetError(
            "figure: expected extrema or impacts in the dataset, got neither. "
            "Set extrema = true or impacts = true in [record]."
        )
    figure = _canvas(15 + 45 * len(panels))
    axes = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    directions = [d for d in _SWEEPS if d in np.unique(runs["direction"].values)]
    for axis, quantity in zip(axes, panels, strict=True):
        for direction in directions:
            x, y = _points(dataset, runs, name, quantity, direction)
            axis.plot(
                x, y, linestyle="none", rasterized=True, label=f"{direction} sweep", **_SWEEPS[direction]
            )
        axis.set_ylabel(label(dataset[quantity]))
        axis.set_ylim(bottom=0)
    axes[-1].set_xlabel(label(dataset[name]))
    axes[-1].margins(x=0.02)
    if len(directions) > 1:
        handles, labels = axes[0].get_legend_handles_labels()
        # Above the panels, where it cannot cover a point.
        figure.legend(handles, labels, loc="outside upper center", ncols=2, markerscale=2.2, frameon=False)
    return figure


def _points(
    dataset: xr.Dataset, runs: xr.Dataset, name: str, quantity: str, direction: str
) -> tuple[Any, Any]:
    """Return the points of one branch: one for each run, or one for each impact of its runs."""
    chosen = runs["direction"].values == direction
    parameter = runs[name].values
    if quantity != "impact_velocity":
        return parameter[chosen], runs[quantity].values[chosen]
    # Positions of the runs in the file lead from each impact to the parameter of its run.
    at = np.full(int(dataset["impact_run"].values.max(initial=-1)) + 1, np.nan)
    ids = runs["run_id"].values
    inside = chosen & (ids < at.size)
    at[ids[inside]] = parameter[inside]
    x = at[dataset["impact_run"].values]
    kept = np.isfinite(x)
    return x[kept], dataset["impact_velocity"].values[kept]


def draw_map(dataset: xr.Dataset) -> Figure:
    """Draw displacement range and largest impact velocity as colours over two swept parameters."""
    quantities = []
    if "displacement_range" in dataset.variables:
        quantities.append((dataset["displacement_range"], label(dataset["displacement_range"])))
    if "impact_velocity" in dataset.variables:
        quantities.append((largest_impact_velocity(dataset), f"largest {label(dataset['impact_velocity'])}"))
    if not quantities or "run" in dataset["run_id"].dims:
        raise DatasetError(
            "figure: expected extrema or impacts on a grid of two parameters, got none or scattered runs. "
            "Set extrema = true in [record], and sweep each parameter over its own values."
        )
    directions = np.atleast_1d(dataset["direction"].values).tolist()
    figure = _canvas(5 + 60 * len(quantities), COLUMN_WIDTH * len(directions))
    axes = np.asarray(
        figure.subplots(len(quantities), len(directions), sharex=True, sharey=True, squeeze=False)
    )
    for row, (values, text) in zip(axes, quantities, strict=True):
        for axis, direction in zip(row, directions, strict=True):
            branch = values.sel(direction=direction) if "direction" in values.dims else values
            _colours(axis, branch.squeeze(), text, (float(values.min()), float(values.max())))
            if len(directions) > 1:
                axis.set_title(f"{direction} sweep", fontsize=8)
    return figure


def largest_impact_velocity(dataset: xr.Dataset) -> xr.DataArray:
    """Return the largest impact velocity of each run (m/s); NaN where a run has no impact."""
    largest = np.full(int(dataset["run_id"].values.max(initial=0)) + 1, -np.inf)
    owner = dataset["impact_run"].values
    inside = owner < largest.size
    np.maximum.at(largest, owner[inside], dataset["impact_velocity"].values[inside])
    values = np.where(dataset["run_id"].values >= 0, largest[dataset["run_id"].values], -np.inf)
    return dataset["run_id"].copy(data=np.where(np.isfinite(values), values, np.nan))


def _colours(axis: Axes, values: xr.DataArray, text: str, limits: tuple[float, float]) -> None:
    """Draw one colour map with its bar."""
    across, along = values.dims
    mesh = axis.pcolormesh(
        values[along].values,
        values[across].values,
        values.values,
        shading="nearest",
        cmap="viridis",
        vmin=limits[0],
        vmax=limits[1],
        rasterized=True,
    )
    # Long numbers of small distances would run into each other.
    axis.xaxis.set_major_locator(MaxNLocator(4))
    axis.set_xlabel(label(values[along]))
    axis.set_ylabel(label(values[across]))
    axis.label_outer()
    bar = axis.figure.colorbar(mesh, ax=axis)
    bar.set_label(text)


def draw_run(dataset: xr.Dataset, run: int | None = None) -> Figure:
    """Draw one run: time series with the stop and the impacts, and the phase portrait.

    Where no time series was recorded, the extremes of each period and the strobe points stand in for it.
    """
    selection = {} if run is None else {"run_index": run}
    if {"displacement", "velocity"} <= set(map(str, dataset.variables)):
        return _draw_samples(dataset, selection)
    if "displacement_max" in dataset.variables or "impact_velocity" in dataset.variables:
        return _draw_periods(dataset, selection)
    raise DatasetError(
        "figure: expected a time series, extrema or impacts of the run, got none recorded. "
        'Set time_series = { rate = ..., variables = ["displacement", "velocity"] } in [record].'
    )


def _draw_samples(dataset: xr.Dataset, selection: dict[str, int]) -> Figure:
    """Draw the sampled displacement and velocity of a run."""
    samples = dataset.vibroimpact.samples(**selection)
    hits = dataset.vibroimpact.impacts(**selection) if "impact" in dataset.dims else None
    stops = _stops(dataset)
    marks = _impact_points(hits, stops)
    time, displacement, velocity = _with_impacts(samples, marks)
    figure = _canvas(150)
    above, middle, below = figure.subplots(3, 1, height_ratios=[1, 1, 1.5])
    above.plot(time, displacement, color=_LINE, rasterized=True)
    middle.plot(time, velocity, color=_LINE, rasterized=True)
    below.plot(displacement, velocity, color=_LINE, rasterized=True)
    dots = {"linestyle": "none", "marker": "o", "markersize": 2.2, "color": _IMPACT, "zorder": 3}
    for axis, columns in ((above, (0, 1)), (middle, (0, 2)), (below, (1, 2))):
        axis.plot(marks[:, columns[0]], marks[:, columns[1]], label="just before impact", **dots)
    for position, _ in stops:
        above.axhline(position, color=_STOP, linestyle="--", linewidth=0.6, zorder=0)
        below.axvline(position, color=_STOP, linestyle="--", linewidth=0.6, zorder=0, label="stop")
    middle.sharex(above)
    above.tick_params(labelbottom=False)
    above.set_ylabel(label(samples["displacement"]))
    middle.set_ylabel(label(samples["velocity"]))
    middle.set_xlabel(label(samples["time"]))
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
    """Return position and side (+1 upper, -1 lower) of each stop of the scene; none where it is not known."""
    if any(name.endswith(("position", "side")) for name in swept_names(dataset)):
        return []
    try:
        stops = tomllib.loads(str(dataset.attrs.get("scene", ""))).get("stop", [])
        return [(float(s["position"]), -1.0 if s.get("side") == "lower" else 1.0) for s in stops]
    except (tomllib.TOMLDecodeError, KeyError, TypeError, ValueError, AttributeError):
        # The scene text is only provenance here: a figure without the line of the stop is still right.
        return []


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
    figure = _canvas(5 + 48 * len(drawers))
    for axis, draw_panel in zip(np.atleast_1d(figure.subplots(len(drawers), 1)), drawers, strict=True):
        draw_panel(axis, dataset, run, selection)
    return figure


def _extremes_panel(axis: Axes, dataset: xr.Dataset, run: xr.Dataset, selection: dict[str, int]) -> None:
    """Draw the largest and smallest displacement of each period, with the stops."""
    period = np.arange(1, run.sizes["period"] + 1)
    axis.plot(period, run["displacement_max"].values, "^", color=_IMPACT, markersize=2.5, label="largest")
    axis.plot(period, run["displacement_min"].values, "v", color=_LINE, markersize=2.5, label="smallest")
    for position, _ in _stops(dataset):
        axis.axhline(position, color=_STOP, linestyle="--", linewidth=0.6, zorder=0, label="stop")
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    axis.set_xlabel("recorded forcing period (-)")
    axis.set_ylabel(label(run["final_displacement"].rename("displacement")))
    axis.legend(frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.1)


def _impacts_panel(axis: Axes, dataset: xr.Dataset, run: xr.Dataset, selection: dict[str, int]) -> None:
    """Draw the velocity of each impact against time."""
    hits = dataset.vibroimpact.impacts(**selection)
    axis.plot(hits["impact_time"].values, hits["impact_velocity"].values, "o", color=_IMPACT, markersize=2)
    axis.set_xlabel(label(dataset["impact_time"].rename("time")))
    axis.set_ylabel(label(hits["impact_velocity"]))
    axis.set_ylim(bottom=0)


def _strobe_panel(axis: Axes, dataset: xr.Dataset, run: xr.Dataset, selection: dict[str, int]) -> None:
    """Draw displacement and velocity at forcing phase zero."""
    axis.plot(
        run["strobe_displacement"].values, run["strobe_velocity"].values, "o", color=_LINE, markersize=2
    )
    axis.set_xlabel(label(run["strobe_displacement"]))
    axis.set_ylabel(label(run["strobe_velocity"]))
