"""Figure of the classes of runs: a map over two parameters, or a sweep whose points have the colour of their class."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.figures.page import canvas, label
from vibroimpact.analysis.figures.sweep.diagrams import (
    edges,
    in_order_of_the_scene,
    is_logarithmic,
    on_axes,
    varied,
    wrong_sweep,
)
from vibroimpact.fmus.errors import DatasetError

KIND = "class_kind"
_COLOURS = ("#0F4C81", "#56A5DC", "#3C7D3C", "#9BC46B", "#7A4B9A", "#C79BD6", "#8A6D00", "#E0B53A")
_OWN = {"no impacts": "0.85", "chaos": "#B5410B", "rest": "0.55", "unknown": "0.35"}
_MOST_NAMED = 8
"""Classes with a colour of their own; those of fewer runs are `other`."""


def draw_classes(dataset: xr.Dataset) -> Figure:
    """Draw the class of each run over one or two swept parameters.

    Raises
    ------
    DatasetError
        The runs are not those of one or two parameters on a grid.
    """
    names = in_order_of_the_scene(dataset, varied(dataset))
    if len(names) == 2 and not ({"run", "point"} & set(dataset["run_id"].dims)):
        return _draw_map(dataset, names[0], names[1])
    if len(names) != 1:
        raise DatasetError(wrong_sweep("a grid of one or two swept parameters", dataset))
    return _draw_sweep(dataset, names[0])


def _names(dataset: xr.Dataset) -> Any:
    """Return the class of each run in words, in the shape of the runs; empty where there is no run."""

    def named(kind: int, impacts: int, periods: int) -> str:
        if kind < 0:
            return ""
        if OrbitClass(kind) in (OrbitClass.periodic, OrbitClass.sticking):
            return f"P({impacts if impacts >= 0 else 'inf'},{periods})"
        return str(OrbitClass(kind).name).replace("_", " ")

    columns = [dataset[name].values for name in (KIND, "class_impacts", "class_periods")]
    return np.vectorize(named, otypes=[object])(*columns)


def _palette(names: Any) -> dict[str, str]:
    """Return the colour of each class: the frequent ones have one of their own."""
    counts = Counter(str(name) for name in names.ravel() if name)
    own = [name for name, _ in counts.most_common() if name not in _OWN][:_MOST_NAMED]
    palette = dict(zip(sorted(own), _COLOURS, strict=False))
    palette |= {name: colour for name, colour in _OWN.items() if name in counts}
    return palette | ({"other": "#000000"} if set(counts) - set(palette) else {})


def _legend(figure: Figure, palette: dict[str, str]) -> None:
    patches = [Patch(color=colour, label=name) for name, colour in palette.items()]
    figure.legend(
        handles=patches,
        loc="outside upper center",
        ncols=4,
        frameon=False,
        handlelength=1.0,
        columnspacing=1.2,
        fontsize=7,
    )


def _draw_map(dataset: xr.Dataset, along: str, across: str) -> Figure:
    names = dataset[KIND].copy(data=_names(dataset))
    palette = _palette(names.values)
    places = {name: number for number, name in enumerate(palette)}
    directions = np.atleast_1d(dataset["direction"].values).tolist()
    figure = canvas(75 * len(directions))
    axes = np.atleast_1d(figure.subplots(len(directions), 1, sharex=True))
    for axis, place in zip(axes, range(len(directions)), strict=True):
        one = names.isel(direction=place) if "direction" in names.dims else names
        cells = on_axes(one.squeeze(), along, across)
        y, x = (cells[axis] for axis in cells.dims)
        numbers = np.vectorize(
            lambda name: places.get(name, places.get("other", np.nan)) if name else np.nan
        )(cells.values)
        axis.pcolormesh(
            edges(x.values),
            edges(y.values),
            numbers.astype(float),
            cmap=ListedColormap(list(palette.values())),
            vmin=-0.5,
            vmax=len(palette) - 0.5,
            rasterized=True,
        )
        axis.set_ylabel(label(y))
        if len(directions) > 1:
            axis.set_title(f"{directions[place]} sweep", fontsize=8)
    axes[-1].set_xlabel(label(x))
    _legend(figure, palette)
    return figure


def _draw_sweep(dataset: xr.Dataset, name: str) -> Figure:
    runs = dataset.vibroimpact.runs
    quantity = next((q for q in ("displacement_max", "strobe_displacement") if q in runs), None)
    if quantity is None:
        raise DatasetError("figure: expected extrema or strobe in the dataset, got neither.")
    names = _names(runs)
    palette = _palette(names)
    figure = canvas(70)
    axis = figure.subplots()
    shown = np.array([each if each in palette else "other" for each in names])
    values = runs[quantity].values
    for each, colour in palette.items():
        chosen = shown == each
        x = np.repeat(runs[name].values[chosen], values.shape[1])
        axis.plot(
            x,
            values[chosen].ravel(),
            linestyle="none",
            marker=".",
            markersize=2,
            color=colour,
            rasterized=True,
        )
    axis.set(xlabel=label(dataset[name]), ylabel=label(dataset[quantity]))
    if is_logarithmic(dataset[name].values):
        axis.set_xscale("log")
    _legend(figure, palette)
    return figure
