"""Sobol indices: bars with intervals, or lines along another key of the sweep."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import Drawing, Family, register
from vibroimpact.analysis.figures.page import COLOURS, LINE, MARK, canvas, label, legend_outside, page_style
from vibroimpact.analysis.figures.sweep.diagrams import is_logarithmic
from vibroimpact.fmus.errors import DatasetError

_NEEDED = ("first_order", "total_order", "first_order_interval", "total_order_interval", "blocks")
_BAR_MM, _PANEL_MM = 8, 38
_WIDTH = 0.36
_ORDERS = {"first_order": (LINE, "alone (first order)"), "total_order": (MARK, "with others (total)")}
_STYLES = {"up": "-", "down": "--"}


def draw_sensitivity(dataset: xr.Dataset) -> Figure:
    """Draw the indices of each quantity in its own panel: bars, or total indices along one further key.

    A missing variable, or more than one further key, raises DatasetError.
    """
    missing = [name for name in _NEEDED if name not in dataset]
    if missing:
        raise DatasetError(
            f"figure: expected what `vibroimpact sensitivity` writes, got none of {', '.join(missing)}."
        )
    along = [str(dim) for dim in dataset["blocks"].dims if dim not in ("quantity", "direction")]
    if len(along) > 1 or (not along and "direction" in dataset["blocks"].dims):
        got = ", ".join(map(str, dataset["blocks"].dims[1:]))
        raise DatasetError(
            f"figure: expected indices along one other key at most, got {got}. Select values of the others in Python."
        )
    known = dataset["total_order"].notnull()
    names = [n for n in dataset["quantity"].values.tolist() if bool(known.sel(quantity=n).any())]
    with page_style():
        height = _PANEL_MM if along else 8 + _BAR_MM * dataset.sizes["parameter"]
        figure = canvas(20 + height * len(names))
        axes = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
        for axis, name in zip(axes, names, strict=True):
            if along:
                _draw_lines(axis, dataset.sel(quantity=name), along[0])
            else:
                _draw_bars(axis, dataset.sel(quantity=name))
            axis.set_title(name.replace("_", " "), fontsize=7.5)
        axes[-1].set_xlabel(label(dataset[along[0]]) if along else "share of the variance (-)")
        legend_outside(figure, axes[0], ncols=2)
    return figure


def _draw_bars(axis: Axes, own: xr.Dataset) -> None:
    places = np.arange(own.sizes["parameter"])[::-1].astype(np.float64)
    for shift, (order, (colour, words)) in zip((0.5, -0.5), _ORDERS.items(), strict=True):
        values, ends = own[order].values, own[f"{order}_interval"].values
        # a quantile of resamples may lie on the other side of the estimate
        errors = np.maximum([values - ends[:, 0], ends[:, 1] - values], 0.0)
        style = {"elinewidth": 0.7, "capsize": 1.5}
        axis.barh(
            places + shift * _WIDTH, values, _WIDTH, xerr=errors, color=colour, label=words, error_kw=style
        )
    axis.axvline(0.0, color="0.5", linewidth=0.6)
    axis.set_yticks(places, [name.replace("_", " ") for name in own["parameter"].values.tolist()])
    axis.tick_params(axis="y", right=False, length=0)
    axis.set_xlim(min(0.0, float(axis.get_xlim()[0])), max(1.0, float(axis.get_xlim()[1])))


def _draw_lines(axis: Axes, own: xr.Dataset, along: str) -> None:
    """Draw total indices with their intervals, one line for each direction of the sweep."""
    values = own[along].values
    for number, parameter in enumerate(own["parameter"].values.tolist()):
        colour = COLOURS[number % len(COLOURS)]
        one = own.sel(parameter=parameter)
        for way in one["direction"].values.tolist() if "direction" in one.dims else [None]:
            line = one if way is None else one.sel(direction=way)
            words = parameter.replace("_", " ") + (f", {way}" if way else "")
            axis.plot(values, line.total_order.values, _STYLES.get(way or "", "-"), color=colour, label=words)
            low, high = line.total_order_interval.values.T
            axis.fill_between(values, low, high, color=colour, alpha=0.2, linewidth=0)
    if is_logarithmic(values):
        axis.set_xscale("log")
    axis.set_ylabel("total index (-)")
    axis.set_ylim(bottom=0.0)


register(
    Family(
        "sensitivity",
        "a study of sensitivity",
        {"sensitivity": Drawing(lambda data, view: draw_sensitivity(data))},
    )
)
