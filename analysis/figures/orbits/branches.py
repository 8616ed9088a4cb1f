"""Figure of branches of periodic orbits, stable and unstable, as in thesis figure 3.1; a sweep may lie below."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from vibroimpact.analysis.dataset.schema import CurvePoint, SpecialOrbit
from vibroimpact.analysis.figures.page import MARK, axes_of, canvas, label, legend_outside, unit_symbol
from vibroimpact.analysis.figures.sweep.classes import KIND as CLASS_KIND
from vibroimpact.analysis.figures.sweep.classes import draw_classes
from vibroimpact.analysis.figures.sweep.diagrams import (
    draw_map,
    edges,
    in_order_of_the_scene,
    refuse_variable,
    varied,
    wrong_sweep,
)
from vibroimpact.fmus.errors import DatasetError

BRANCH = "orbit_branch"
_LONG = 20
"""Letters of a legend entry above which three entries do not fit side by side."""
_ROW = 0.1
"""Height that the page gains for a row of the legend, in."""
_STABLE: dict[str, Any] = {"color": "#0F4C81", "linewidth": 0.9, "linestyle": "-"}
_UNSTABLE: dict[str, Any] = {"color": "#B5410B", "linewidth": 0.8, "linestyle": (0, (3, 1.5))}
_ALONE: dict[str, Any] = {"marker": "o", "markersize": 3.4}
_BELOW: dict[str, Any] = {
    "marker": "o",
    "markersize": 1.4,
    "markeredgewidth": 0.0,
    "linestyle": "none",
    "color": "0.75",
}
_LOCI: dict[SpecialOrbit, dict[str, Any]] = {
    SpecialOrbit.fold: {"color": "#0F4C81", "linestyle": "-"},
    SpecialOrbit.period_doubling: {"color": "#B5410B", "linestyle": (0, (4, 1.5))},
    SpecialOrbit.torus: {"color": "#A8327D", "linestyle": (0, (6, 1.2))},
    SpecialOrbit.pitchfork: {"color": "#B8860B", "linestyle": (0, (8, 1.2, 1.2, 1.2))},
    SpecialOrbit.graze: {"color": "#3C7D3C", "linestyle": (0, (1.2, 1.2))},
    SpecialOrbit.graze_between_impacts: {"color": "#6F4E9C", "linestyle": (0, (5, 1.2, 1.2, 1.2))},
}
_ON_CLASSES: dict[str, Any] = {
    "color": "black",
    "linewidth": 1.2,
    "path_effects": [withStroke(linewidth=2.6, foreground="white")],
}
"""Style of loci on a map of classes, whose colours leave none for lines."""
_MARKS = {
    SpecialOrbit.fold: "s",
    SpecialOrbit.period_doubling: "D",
    SpecialOrbit.torus: "^",
    SpecialOrbit.graze: "o",
    SpecialOrbit.graze_between_impacts: "v",
    SpecialOrbit.stability_change: "X",
    SpecialOrbit.branch_point: "P",
    SpecialOrbit.impact_at_the_yield_velocity: "<",
    SpecialOrbit.pitchfork: "P",
}
_EXTREMA = (CurvePoint.isola_centre, CurvePoint.crossing_of_branches, CurvePoint.cusp)
_POINTS_OF_CURVES: tuple[tuple[str, str, tuple[CurvePoint, ...]], ...] = (
    ("codimension 2", "o", tuple(each for each in CurvePoint if each not in _EXTREMA)),
    ("isola centre", "*", (CurvePoint.isola_centre,)),
    ("crossing of branches", "X", (CurvePoint.crossing_of_branches,)),
    ("cusp", "^", (CurvePoint.cusp,)),
)
"""Name, mark and kinds of the points of curves."""


def draw_branches(dataset: xr.Dataset, over: xr.Dataset | None = None, variable: str | None = None) -> Figure:
    """Draw displacement range and impact velocity of orbits over their parameter: stable solid, unstable dashed.

    A sweep of the same parameter is drawn below (`over`). A variable of `diagrams.drawable_variables` replaces both.
    A sweep of another parameter, or a variable that was not recorded, raises DatasetError.
    """
    names = varied(dataset)
    if variable is not None:
        refuse_variable(dataset, variable, "orbits")
        if over is not None:
            refuse_variable(over, variable, "the sweep")
    if len(names) == 2 and variable is None:
        return _draw_loci(dataset, names, over)
    if len(names) != 1:
        raise DatasetError(wrong_sweep("orbits at several values of one or two parameters", dataset))
    (name,) = names
    panels = ["displacement_range", "impact_velocity"] if variable is None else [variable]
    if over is not None:
        panels = [panel for panel in panels if panel in over.variables]
        if varied(over) != [name] or not panels:
            raise DatasetError(wrong_sweep(f"a sweep of {name} below", over))
    figure = canvas(20 + 45 * len(panels))
    axes = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    for axis, panel in zip(axes, panels, strict=True):
        if over is not None:
            draw_below(axis, over, name, panel)
        draw_orbits(axis, dataset, name, panel)
        axis.set_ylabel(_label(dataset, panel))
        axis.margins(x=0.02)
    axes[-1].set_xlabel(label(dataset[name]))
    words = axes[0].get_legend_handles_labels()[1]
    legend_outside(figure, axes[0], ncols=3 if max(map(len, words)) < _LONG else 2)
    return figure


def _shade_missing(axis: Axes, dataset: xr.Dataset) -> None:
    """Shade the ranges in which index sums show that orbits are missing."""
    for number, line in enumerate(str(dataset.attrs.get("missing_orbits", "")).splitlines()):
        low, high = map(float, line.split())
        axis.axvspan(low, high, color="0.92", zorder=0.0, label="" if number else "orbits missing")


def _label(dataset: xr.Dataset, panel: str) -> str:
    if panel in dataset.variables:
        return label(dataset[panel])
    # the orbits were not opened from a file
    return f"displacement range ({unit_symbol(dataset['displacement_max'])})"


def _draw_loci(dataset: xr.Dataset, names: list[str], over: xr.Dataset | None) -> Figure:
    """Draw bifurcations over two parameters, over a map if there is one."""
    runs = dataset.vibroimpact.runs
    order = np.argsort(runs["run_index"].values)
    if over is not None:
        if sorted(varied(over)) != sorted(names):
            raise DatasetError(wrong_sweep(f"a map of {' and '.join(names)} below", over))
        figure = draw_classes(over) if CLASS_KIND in over else draw_map(over)
        x, y = in_order_of_the_scene(over, varied(over))
        panels = [axis for axis in axes_of(figure) if axis.get_ylabel() == label(over[y])]
    else:
        figure = canvas(75)
        panels = [figure.subplots()]
        first = str(dataset.attrs.get("parameter", "")).split(".")[-1]
        x, y = sorted(names, key=lambda name: name != first)
        panels[0].set(xlabel=label(dataset[x]), ylabel=label(dataset[y]))
    branch, special = runs[BRANCH].values, runs["orbit_special"].values
    on_classes = _ON_CLASSES if over is not None and CLASS_KIND in over else {}
    labelled: set[str] = set()
    for number in np.unique(branch[branch > 0]):
        chosen = order[branch[order] == number]
        kind = SpecialOrbit(int(special[chosen[0]]))
        words = str(kind.name).replace("_", " ")
        style = {"linewidth": 1.0, **_LOCI.get(kind, {"color": "0.4"}), **on_classes}
        shown = None if words in labelled else words
        for axis in panels:
            axis.plot(runs[x].values[chosen], runs[y].values[chosen], label=shown, **style)
        labelled.add(words)
    _mark_curve_points(panels, dataset, (x, y), labelled)
    if over is None:
        panels[0].margins(x=0.02)
    else:  # curves may extend beyond the map
        panels[0].set(xlim=_ends(over[x].values), ylim=_ends(over[y].values))
    if on_classes:
        _name_loci_beside_classes(figure, panels[0])
    else:
        legend_outside(figure, panels[0], ncols=3 if max(map(len, labelled), default=0) < _LONG else 2)
    return figure


def _mark_curve_points(
    panels: Sequence[Axes], dataset: xr.Dataset, names: tuple[str, str], labelled: set[str]
) -> None:
    """Mark the points at which curves of bifurcations meet, and the extrema of folds over the second number."""
    if "curve_point_kind" not in dataset:
        return
    first = str(dataset.attrs.get("parameter", "")).split(".")[-1]
    values = [dataset[f"curve_point_{which}"].values for which in ("first", "second")]
    x, y = values if names[0] == first else values[::-1]
    kinds = dataset["curve_point_kind"].values
    for words, marker, members in _POINTS_OF_CURVES:
        chosen = np.isin(kinds, members)
        if not chosen.any():
            continue
        for axis in panels:
            axis.plot(
                x[chosen],
                y[chosen],
                linestyle="none",
                marker=marker,
                markersize=3.6,
                markerfacecolor="white",
                markeredgewidth=0.7,
                color=MARK,
                label=words,
                zorder=3,
            )
        labelled.add(words)


def _name_loci_beside_classes(figure: Figure, panel: Axes) -> None:
    """Name loci and classes in one legend, for which the page becomes longer."""
    legend = figure.legends[0] if figure.legends else panel.get_legend()  # of a figure, or of given axes
    assert legend is not None
    legend.remove()
    handles = [*legend.legend_handles, *panel.get_legend_handles_labels()[0]]
    rows = math.ceil(len(handles) / 3)
    figure.set_figheight(figure.get_figheight() + _ROW * rows)
    figure.legend(
        handles=handles,
        loc="outside upper center",
        ncols=3,
        frameon=False,
        fontsize=7,
        columnspacing=1.2,
    )


def _ends(values: Any) -> tuple[float, float]:
    cells = edges(np.unique(values))
    return float(cells[0]), float(cells[-1])


def _rows(dataset: xr.Dataset, panel: str) -> list[np.ndarray[Any, Any]]:
    """Return the values of a panel, an array for each run: its periods or its impacts."""
    runs = dataset.vibroimpact.runs
    if panel == "displacement_range":
        ranges = runs["displacement_max"].values - runs["displacement_min"].values
        return [row[np.isfinite(row)] for row in np.atleast_2d(ranges)]
    if dataset[panel].dims != ("impact",):
        values = np.asarray(runs[panel].values, dtype=np.float64)
        return [row[np.isfinite(row)] for row in values.reshape(len(values), -1)]
    counts = np.asarray(runs["impact_count"].values, dtype=int)
    return np.split(np.asarray(dataset[panel].values), np.cumsum(counts)[:-1])


def draw_below(axis: Axes, over: xr.Dataset, name: str, panel: str, words: str = "simulated") -> None:
    """Draw the values of a sweep in grey."""
    x, y = values_of_runs(over, name, panel)
    axis.plot(x, y, rasterized=True, label=words, **_BELOW)


def _continued(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the rows of a branch, each turned by the impacts or periods that lead on from the row before.

    An orbit counts from phase 0, which an impact passes between two orbits of a branch.
    """
    for k in range(1, len(values)):
        turned = [np.roll(values[k], -turn) for turn in range(values.shape[1])]
        values[k] = min(turned, key=lambda row: float(np.abs(row - values[k - 1]).sum()))
    return values


def values_of_runs(dataset: xr.Dataset, name: str, panel: str, direction: str = "") -> tuple[Any, Any]:
    """Return the values of a panel with those of the parameter; of the runs in one direction if it is named."""
    runs, rows = dataset.vibroimpact.runs, _rows(dataset, panel)
    # one direction alone is a scalar
    directions = np.broadcast_to(runs["direction"].values, len(rows))
    chosen = directions == direction if direction else np.full(len(rows), True)
    sizes = [row.size if one else 0 for row, one in zip(rows, chosen, strict=True)]
    values = [row for row, one in zip(rows, chosen, strict=True) if one]
    return np.repeat(runs[name].values, sizes), np.concatenate(values)


def draw_orbits(axis: Axes, dataset: xr.Dataset, name: str, panel: str) -> None:
    """Draw orbits over their parameter into a panel: branches as lines, special points as marks."""
    _shade_missing(axis, dataset)
    runs = dataset.vibroimpact.runs
    order = np.argsort(runs["run_index"].values)
    rows = _rows(dataset, panel)
    places, branch = runs[name].values, runs[BRANCH].values
    stable, special = runs["orbit_stable"].values > 0, runs["orbit_special"].values
    labelled: set[str] = set()
    for number in np.unique(branch[branch > 0]):
        chosen = order[branch[order] == number]
        columns = min(rows[each].size for each in chosen)
        values = _continued(np.array([rows[each][:columns] for each in chosen]))
        for which, style, words in ((stable, _STABLE, "stable"), (~stable, _UNSTABLE, "unstable")):
            # a piece extends to its neighbours on both sides, so that no gap is left where stability changes
            keep = which[chosen] | np.append(which[chosen][1:], False) & ~which[chosen]
            shown = np.where(keep[:, None], values, np.nan)
            # a single orbit, which was not followed, is a mark instead of a line
            lines = axis.plot(places[chosen], shown, **style, **({} if chosen.size > 1 else _ALONE))
            if words not in labelled and keep.any():
                lines[0].set_label(words)
                labelled.add(words)
        for each in chosen[special[chosen] > 0]:
            kind = SpecialOrbit(int(special[each]))
            words = str(kind.name).replace("impact_", "").replace("_", " ")
            axis.plot(
                np.full(rows[each].size, places[each]),
                rows[each],
                linestyle="none",
                marker=_MARKS[kind],
                markersize=3.4,
                markerfacecolor="white",
                markeredgewidth=0.7,
                color=MARK,
                label=None if words in labelled else words,
                zorder=3,
            )
            labelled.add(words)
