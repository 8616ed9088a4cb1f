"""The cost of accuracy: errors of all methods of simulating a scene over their processor time."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import COLOURS, MARK, canvas, page_style
from vibroimpact.analysis.figures.study.needed import missing_from, refuse_missing

_MARKERS = "osD^vP<"
"""Markers: one more than colours, so that many combinations of both look different."""
_NEEDED = ("cost", "error", "name", "failure", "on_front", "is_model")
_ROUNDING = 1e-16
"""Error below which values are equal; an error of 0 is drawn there."""
_ROWS = 12
"""Height of two rows of names below the panel, mm."""
_SIGNS = 3
"""Rows of names for other entries: crosses, rings, the error of the reference."""


def draw_accuracy(dataset: xr.Dataset) -> Figure:
    """Draw the error of each method over its cost, a line for each method and a mark for each setting.

    A line behind the methods joins the settings that no other method beats. A failed setting is a cross at the top, at
    its time; another model of the same scene is hollow. A setting that simulated a part of the time has a ring: its
    cost is extrapolated, and its error belongs to that part. The figure is one column (85 mm) wide. A missing variable
    raises DatasetError.
    """
    refuse_missing(missing_from(dataset, _NEEDED), "what `vibroimpact accuracy` writes")
    names = list(dict.fromkeys(str(name) for name in dataset["name"].values))
    with page_style():
        figure = canvas(80 + _ROWS * (len(names) + _SIGNS) / 2)
        axis = figure.subplots()
        errors = np.maximum(dataset["error"].values, _ROUNDING)
        good = np.isfinite(errors) & (dataset["failure"].values == "")
        top = 10.0 * max(float(errors[good].max(initial=_ROUNDING)), 1.0)
        _draw_front(axis, dataset, errors)
        for place, name in enumerate(names):
            _draw_way(axis, dataset, errors, good, name, place, top)
        _explain_failures(axis, dataset)
        _ring_parts(axis, dataset, errors, good)
        if dataset.attrs.get("reference_error", 0.0) > 0.0:
            known = float(dataset.attrs["reference_error"])
            label = "below what the reference is known to"
            axis.axhspan(0.1 * _ROUNDING, known, color="0.9", zorder=-2, label=label)
        tolerance = float(dataset.attrs.get("tolerance", np.nan))
        if tolerance > 0.0:
            axis.axhline(tolerance, color=MARK, linewidth=0.6, linestyle=":", label="tolerance asked for")
        axis.set(xscale="log", yscale="log", xlabel="processor time of a run (s)", ylabel=_label(dataset))
        _show_whole_decades(axis, dataset["cost"].values)
        _write_scores(axis, dataset, errors)
        axis.set_ylim(0.3 * _ROUNDING, 10.0 * top)
        figure.legend(
            *axis.get_legend_handles_labels(), loc="outside lower center", ncols=1, frameon=False, fontsize=6
        )
        figure.suptitle(str(dataset.attrs.get("title", "")), fontsize=8, wrap=True)
    return figure


def _show_whole_decades(axis: Axes, costs: np.ndarray) -> None:
    """Let the axis of times begin and end at powers of ten; only these are labelled."""
    known = costs[np.isfinite(costs) & (costs > 0.0)]
    if known.size:
        axis.set_xlim(
            10.0 ** np.floor(np.log10(0.9 * known.min())), 10.0 ** np.ceil(np.log10(1.1 * known.max()))
        )
        axis.xaxis.set_minor_formatter(NullFormatter())


def _write_scores(axis: Axes, dataset: xr.Dataset, errors: np.ndarray) -> None:
    """Write the variance of the recording that a replay accounts for next to each setting, other models excepted."""
    if "variance_accounted_for" not in dataset:
        return
    scores, costs = dataset["variance_accounted_for"].values, dataset["cost"].values
    for place in np.flatnonzero(np.isfinite(scores) & ~dataset["is_model"].values.astype(bool)):
        axis.annotate(
            f"{scores[place]:.1f} %",
            (costs[place], errors[place]),
            xytext=(0, 5),
            textcoords="offset points",
            ha="center",
            fontsize=5,
        )


def _ring_parts(axis: Axes, dataset: xr.Dataset, errors: np.ndarray, good: np.ndarray) -> None:
    """Draw a ring around each setting that simulated a part of the time."""
    if "part" not in dataset:
        return
    its = good & (dataset["part"].values < 1.0)
    if its.any():
        axis.plot(
            *(dataset["cost"].values[its], errors[its]),
            linestyle="none",
            marker="o",
            markersize=7.0,
            markerfacecolor="none",
            color="0.4",
            markeredgewidth=0.6,
            label="extrapolated from a part of the time",
        )


def _label(dataset: xr.Dataset) -> str:
    quantity = str(dataset.attrs.get("quantity", "all"))
    return (
        "largest relative error (-)"
        if quantity == "all"
        else f"relative error of {quantity.replace('_', ' ')} (-)"
    )


def _draw_front(axis: Axes, dataset: xr.Dataset, errors: np.ndarray) -> None:
    on = dataset["on_front"].values.astype(bool)
    order = np.argsort(dataset["cost"].values[on])
    axis.plot(
        dataset["cost"].values[on][order],
        errors[on][order],
        color="0.75",
        linewidth=4.0,
        solid_capstyle="round",
        marker="o",
        markersize=8.0,
        zorder=-1,
        label="not beaten by another way",
    )


def _draw_way(
    axis: Axes,
    dataset: xr.Dataset,
    errors: np.ndarray,
    good: np.ndarray,
    name: str,
    place: int,
    top: float,
) -> None:
    its = dataset["name"].values == name
    cost, colour = dataset["cost"].values, COLOURS[place % len(COLOURS)]
    hollow = bool(dataset["is_model"].values[its].any())
    style: dict[str, Any] = {
        "color": colour,
        "marker": _MARKERS[place % len(_MARKERS)],
        "markersize": 3.5,
        "linewidth": 0.8,
    }
    shown = its & good
    if "part" in dataset:  # errors over a part of the time are not joined with others
        parts = shown & (dataset["part"].values < 1.0)
        shown = shown & ~parts
        axis.plot(
            cost[parts],
            errors[parts],
            linestyle="none",
            markerfacecolor="white" if hollow else colour,
            **style,
        )
    axis.plot(
        cost[shown],
        errors[shown],
        linestyle="--" if hollow else "-",
        markerfacecolor="white" if hollow else colour,
        label=f"{name} (another model)" if hollow else name,
        **style,
    )
    failed = its & ~good & np.isfinite(cost)
    axis.plot(cost[failed], np.full(failed.sum(), top), "x", color=colour, markersize=5.0)


def _explain_failures(axis: Axes, dataset: xr.Dataset) -> None:
    """Explain the crosses in the legend, if there are any."""
    if (dataset["failure"].values != "").any():
        label = "no error: impacts missed, or no end"
        axis.plot([], [], "x", color="0.4", markersize=5.0, linestyle="none", label=label)


register_results("accuracy", "a study of accuracy", draw_accuracy)
