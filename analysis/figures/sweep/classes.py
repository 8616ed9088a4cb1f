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
from vibroimpact.analysis.figures.scene_text import contact_label, limiting_tables
from vibroimpact.analysis.figures.sweep.diagrams import (
    edges,
    in_order_of_the_scene,
    is_logarithmic,
    on_axes,
    varied,
    wrong_sweep,
)
from vibroimpact.analysis.figures.sweep.map_overview import block_classes, edges_of_blocks
from vibroimpact.fmus.errors import DatasetError

KIND = "class_kind"
_COLOURS = ("#0F4C81", "#56A5DC", "#3C7D3C", "#9BC46B", "#7A4B9A", "#C79BD6", "#8A6D00", "#E0B53A")
OWN_COLOURS = {
    "no impacts": "0.85",
    "chaos": "#B5410B",
    "rest": "0.55",
    "unknown": "0.35",
    "quasi-periodic": "#1FA39A",
}
_SHORT = 10
"""Letters of a name up to which four names of the legend fit side by side."""
OTHER_COLOUR = "#EFD9B4"
"""Light, and different from all class colours: rare classes must not look like chaos."""
_MOST_NAMED = 8
"""Number of classes with their own colour; rarer classes are `other`."""


def draw_classes(dataset: xr.Dataset) -> Figure:
    """Draw the class of each run over one or two swept parameters. DatasetError: the runs form no grid."""
    names = in_order_of_the_scene(dataset, varied(dataset))
    if len(names) == 2 and not ({"run", "point"} & set(dataset["run_id"].dims)):
        return _draw_map(dataset, names[0], names[1])
    if len(names) != 1:
        raise DatasetError(wrong_sweep("a grid of one or two swept parameters", dataset))
    return _draw_sweep(dataset, names[0])


def _names(dataset: xr.Dataset, impacts_of: xr.Dataset | None = None) -> Any:
    """Return the class of each run in words, in the shape of the runs; empty where there is no run.

    The impacts of the runs are in the same dataset, or in `impacts_of`.
    """

    source = dataset if impacts_of is None else impacts_of

    def named(kind: int, impacts: int, periods: int, stop: int) -> str:
        if kind < 0:
            return ""
        if OrbitClass(kind) in (OrbitClass.periodic, OrbitClass.sticking):
            where = f" at {contact_label(source, stop)}" if stop > 0 else ""
            return f"P({impacts if impacts >= 0 else 'inf'},{periods}){where}"
        return OrbitClass(kind).words

    columns = [dataset[name].values for name in (KIND, "class_impacts", "class_periods")]
    only = _only_stop(source)
    ids, padded = dataset["run_id"].values, np.append(only, 0)
    at = np.where((ids >= 0) & (ids < only.size), ids, only.size)
    return np.vectorize(named, otypes=[object])(*columns, padded[at])


def _only_stop(dataset: xr.Dataset) -> Any:
    """Return the only stop that a run hits, for each `run_id`, if its body has several; 0 for any other run."""
    if not _only_stop_counts(dataset):
        return np.zeros(0, dtype=int)
    owner, contact = dataset["impact_run"].values, dataset["impact_contact"].values.astype(int)
    lowest = np.full(int(owner.max()) + 1, np.iinfo(int).max)
    highest = np.zeros_like(lowest)
    np.minimum.at(lowest, owner, contact)
    np.maximum.at(highest, owner, contact)
    return np.where(lowest == highest, highest, 0)


def _only_stop_counts(dataset: xr.Dataset) -> bool:
    """Return whether names of classes say the only stop that a run hits: a body with several, and its impacts."""
    recorded = {"impact_run", "impact_contact"} <= set(dataset.variables) and dataset.sizes["impact"] > 0
    return len(limiting_tables(dataset)) > 1 and recorded


def _palette(names: Any) -> dict[str, str]:
    """Return the colour of each class; frequent classes have their own colour."""
    counts = Counter(str(name) for name in names.ravel() if name)
    own = [name for name, _ in counts.most_common() if name not in OWN_COLOURS][:_MOST_NAMED]
    palette = dict(zip(sorted(own), _COLOURS, strict=False))
    palette |= {name: colour for name, colour in OWN_COLOURS.items() if name in counts}
    return palette | ({"other": OTHER_COLOUR} if set(counts) - set(palette) else {})


def _legend(figure: Figure, palette: dict[str, str]) -> None:
    patches = [Patch(color=colour, label=name) for name, colour in palette.items()]
    figure.legend(
        handles=patches,
        loc="outside upper center",
        ncols=4 if max(map(len, palette)) <= _SHORT else 3,
        frameon=False,
        handlelength=1.0,
        columnspacing=1.2,
        fontsize=7,
    )


def _draw_map(dataset: xr.Dataset, along: str, across: str) -> Figure:
    blocks = None if _only_stop_counts(dataset) else block_classes(dataset)
    shown, starts = (dataset, {}) if blocks is None else blocks
    names = shown[KIND].copy(data=_names(shown))
    palette = _palette(names.values)
    places = {name: number for number, name in enumerate(palette)}
    directions = np.atleast_1d(dataset["direction"].values).tolist()
    figure = canvas(75 * len(directions))
    axes = np.atleast_1d(figure.subplots(len(directions), 1, sharex=True))
    for axis, place in zip(axes, range(len(directions)), strict=True):
        one = names.isel(direction=place) if "direction" in names.dims else names
        cells = on_axes(one.squeeze(), along, across)
        y, x = (dataset[axis] if axis in starts else cells[axis] for axis in cells.dims)
        numbers = np.vectorize(
            lambda name: places.get(name, places.get("other", np.nan)) if name else np.nan
        )(cells.values)
        axis.pcolormesh(
            edges_of_blocks(edges(x.values), starts.get(str(x.name))),
            edges_of_blocks(edges(y.values), starts.get(str(y.name))),
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


def _points(dataset: xr.Dataset, runs: xr.Dataset) -> tuple[str, Any, Any]:
    """Return the quantity that represents runs, and for each of its values the place of its run, and the value.

    If only impacts are recorded, a run without an impact has the speed 0.
    """
    quantity = next((q for q in ("displacement_max", "strobe_displacement") if q in runs), None)
    if quantity is not None:
        values = runs[quantity].values
        return quantity, np.repeat(np.arange(len(values)), values.shape[1]), values.ravel()
    if "impact_velocity" not in dataset:
        raise DatasetError("figure: expected extrema or strobe in the dataset, got neither.")
    table = dataset.vibroimpact.impacts_table()
    owner = np.searchsorted(runs["run_id"].values, table["run_id"].values)
    bare = np.setdiff1d(np.arange(runs.sizes["run"]), owner)
    values = np.concatenate([table["impact_velocity"].values, np.zeros(bare.size)])
    return "impact_velocity", np.concatenate([owner, bare]), values


def _draw_sweep(dataset: xr.Dataset, name: str) -> Figure:
    runs = dataset.vibroimpact.runs
    quantity, owner, values = _points(dataset, runs)
    names = _names(runs, dataset)
    palette = _palette(names)
    figure = canvas(70)
    axis = figure.subplots()
    shown = np.array([each if each in palette else "other" for each in names])
    for each, colour in palette.items():
        chosen = shown[owner] == each
        axis.plot(
            runs[name].values[owner[chosen]],
            values[chosen],
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
