"""Hard cases: the measured values of each case, with its bound."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import COLUMN_WIDTH, LINE, MARK, canvas, page_style
from vibroimpact.analysis.figures.study.needed import missing_from, refuse_missing

_NEEDED = (
    "figure",
    "bound",
    "is_met",
    "x",
    "y",
    "x_label",
    "y_label",
    "x_log",
    "y_log",
    "is_bounded",
    "name",
)
_COLUMNS = 3
_PANEL_MM, _PANEL_WIDTH = 40, 60 / 25.4
_SMALLEST = 1e-17
"""Place of an error of 0 on a logarithmic axis."""


def draw_hard_cases(dataset: xr.Dataset) -> Figure:
    """Draw the measured values of each case over its difficulty, with its bound; three panels side by side.

    A missing variable, or no case, raises DatasetError.
    """
    missing = missing_from(dataset, _NEEDED) or ([] if dataset["figure"].size else ["case"])
    refuse_missing(missing, "what `vibroimpact hard-cases` writes")
    count = dataset["figure"].size
    columns = min(_COLUMNS, count)
    rows = -(-count // columns)
    with page_style():
        figure = canvas(_PANEL_MM * rows, max(COLUMN_WIDTH, columns * _PANEL_WIDTH))
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for place, axis in enumerate(panels):
            if place < count:
                _draw_case(axis, dataset.isel(case=place))
            else:
                axis.remove()
    return figure


def _draw_case(axis: Axes, case: xr.Dataset) -> None:
    x, y = (case[name].values[np.isfinite(case[name].values)] for name in ("x", "y"))
    size = min(len(x), len(y))
    x, y = x[:size], y[:size]
    met = bool(case["is_met"])
    axis.set_title(
        f"{case['name'].item()}{'' if met else ': missed'}", fontsize=7, color="black" if met else MARK
    )
    bound = float(case["bound"])
    if bool(case["y_log"]):
        axis.set_yscale("log")
        y = np.maximum(y, _SMALLEST)
    axis.plot(x, y, ".-" if size <= 20 else "-", color=LINE, markersize=4, linewidth=0.8, clip_on=False)
    if bound > 0.0 and bool(case["is_bounded"]) and bool(case["y_log"]):
        axis.axhline(bound, color=MARK, linewidth=0.8, linestyle="--")
        axis.set_ylim(min(_SMALLEST, bound / 10.0), 10.0 * max(bound, float(y.max(initial=bound))))
    if bool(case["x_log"]):
        axis.set_xscale("log")
        axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xlabel(str(case["x_label"].item()), fontsize=6)
    axis.set_ylabel(str(case["y_label"].item()), fontsize=5)
    axis.tick_params(labelsize=5)


register_results("hard_cases", "hard cases", draw_hard_cases, "hard-cases")
