"""Figure of a measured sweep: each period is a point, as in thesis figure 3.7; a simulated sweep may lie below."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.dataset.schema import MeasurementFlag
from vibroimpact.analysis.figures.page import MARK, canvas, label, legend_outside
from vibroimpact.analysis.figures.sweep.diagrams import is_logarithmic, varied, wrong_sweep
from vibroimpact.fmus.errors import DatasetError

_FLAGS = "measurement_flags"
_TURN = 2.0 * np.pi
_OTHER_FREQUENCY = {
    ("frequency", "angular_frequency"): 1.0 / _TURN,
    ("angular_frequency", "frequency"): _TURN,
}
"""Factor that converts the second coordinate to the first one."""

# Upper marks are dark and small, lower marks light and large: both stay visible where they agree.
_ABOVE: dict[str, dict[str, Any]] = {
    "up": {"marker": "o", "color": "#0F4C81", "markersize": 2.4, "markeredgewidth": 0.5, "fillstyle": "none"},
    "down": {"marker": "x", "color": "#B5410B", "markersize": 2.2, "markeredgewidth": 0.6},
    "independent": {"marker": ".", "color": "#20567D", "markersize": 2.0, "markeredgewidth": 0.0},
}
_BELOW: dict[str, dict[str, Any]] = {
    "up": {"marker": "o", "color": "#A9D3F0", "markersize": 4.0, "markeredgewidth": 0.0},
    "down": {"marker": "s", "color": "#F6C7A3", "markersize": 3.2, "markeredgewidth": 0.0},
    "independent": {"marker": "o", "color": "0.8", "markersize": 3.2, "markeredgewidth": 0.0},
}
_RING: dict[str, Any] = {
    "marker": "o",
    "color": MARK,
    "markersize": 6.5,
    "markeredgewidth": 0.6,
    "fillstyle": "none",
}
_TOP = 0.965
"""Height of the marks of clipped steps in the panel."""


def draw_measured_sweep(dataset: xr.Dataset, over: xr.Dataset | None = None) -> Figure:
    """Draw the range of each recorded period over the swept parameter, with separate marks for up and down.

    A clipped step has no points, since its range is the range of the input; a mark at the top shows its place. Steps
    with other flags have a ring. Another sweep of the same parameter, for example a simulated one, is drawn below
    (`over`). DatasetError: `over` sweeps another parameter, or has no extrema.
    """
    name = _swept(dataset)
    figure = canvas(65 if over is None else 72)
    axis = figure.subplots()
    names = _names(dataset, over)
    if over is not None:
        _draw(axis, over, name, _BELOW, names[1])
    _draw(axis, dataset, name, _ABOVE, names[0])
    for drawn in (dataset,) if over is None else (dataset, over):
        _mark(axis, drawn, name)
    axis.set_ylim(bottom=0.0)
    axis.set(xlabel=label(dataset[name]), ylabel=label(dataset["displacement_range"]))
    if is_logarithmic(dataset[name].values):
        axis.set_xscale("log")
    axis.margins(x=0.02)
    legend_outside(figure, axis, ncols=2, markerscale=1.5)
    return figure


def _swept(dataset: xr.Dataset) -> str:
    """Return the only swept parameter."""
    names = varied(dataset)
    if len(names) != 1:
        raise DatasetError(wrong_sweep("one swept parameter", dataset))
    if "displacement_max" not in dataset.variables:
        raise DatasetError(
            "figure: expected extrema in the dataset, got none. Set extrema = true in [record]."
        )
    return names[0]


def _names(dataset: xr.Dataset, over: xr.Dataset | None) -> tuple[str, str]:
    """Return the names of both sweeps: measured or simulated, or their titles if both are of one kind."""
    kinds = ["measured" if _FLAGS in each else "simulated" for each in (dataset, over) if each is not None]
    if over is None:
        return "", ""
    if kinds[0] != kinds[1]:
        return kinds[0], kinds[1]
    return str(dataset.attrs.get("title", "this"))[:24], str(over.attrs.get("title", "below"))[:24]


def _places(dataset: xr.Dataset, name: str) -> Any:
    """Return the values of the swept parameter of each run, converted to the parameter of this name."""
    own = _swept(dataset)
    if own != name and (name, own) not in _OTHER_FREQUENCY:
        raise DatasetError(f"figure: over: expected a sweep of {name}, got one of {own}.")
    values = dataset.vibroimpact.runs[own].values
    return values if own == name else _OTHER_FREQUENCY[name, own] * values


def _flagged(dataset: xr.Dataset) -> tuple[Any, Any]:
    """Return masks of the clipped runs, and of the runs with other flags."""
    runs = dataset.vibroimpact.runs
    flags = runs[_FLAGS].values if _FLAGS in runs else np.zeros(runs.sizes["run"], dtype=np.int8)
    # -1 marks a point that no run covers
    flags = np.where(flags < 0, 0, flags)
    clipped = (flags & MeasurementFlag.clipped) != 0
    return clipped, (flags != 0) & ~clipped


def _ranges(dataset: xr.Dataset) -> Any:
    """Return the range of each recorded period, shape (run, period)."""
    runs = dataset.vibroimpact.runs
    return runs["displacement_max"].values - runs["displacement_min"].values


def _draw(axis: Axes, dataset: xr.Dataset, name: str, styles: dict[str, dict[str, Any]], called: str) -> None:
    """Draw the points of each direction."""
    places, ranges, clipped = _places(dataset, name), _ranges(dataset), _flagged(dataset)[0]
    directions = np.broadcast_to(dataset.vibroimpact.runs["direction"].values, places.shape)
    for direction, style in styles.items():
        chosen = (directions == direction) & ~clipped
        if (directions == direction).any():
            x, y = np.repeat(places[chosen], ranges.shape[1]), ranges[chosen].ravel()
            words = "sweep" if direction == "independent" else f"{direction} sweep"
            axis.plot(
                x, y, linestyle="none", rasterized=True, label=f"{words}{called and ', '}{called}", **style
            )


def _mark(axis: Axes, dataset: xr.Dataset, name: str) -> None:
    """Mark the flagged steps."""
    places, ranges = _places(dataset, name), _ranges(dataset)
    clipped, others = _flagged(dataset)
    if clipped.any():
        at = np.unique(places[clipped])
        axis.plot(
            at,
            np.full(at.size, _TOP),
            transform=axis.get_xaxis_transform(),
            linestyle="none",
            marker="v",
            color=MARK,
            markersize=3.0,
            markeredgewidth=0.0,
            label="clipped, not drawn",
        )
    if others.any():
        middle = np.nanmean(ranges[others], axis=1)
        axis.plot(places[others], middle, linestyle="none", label="flagged", **_RING)
