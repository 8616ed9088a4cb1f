"""Figure of Lyapunov exponents over a swept parameter."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.page import canvas, label
from vibroimpact.fmus.errors import DatasetError

_COLOURS = {"up": "#56A5DC", "down": "#B5410B"}


def draw_lyapunov(dataset: xr.Dataset) -> Figure:
    """Draw the largest exponent of each run, with its standard error, over the swept parameter.

    Raises
    ------
    DatasetError
        Not one parameter is swept.
    """
    names = [str(dim) for dim in dataset["reason"].dims if dim != "direction"]
    if len(names) != 1 or names[0] not in dataset.coords:
        raise DatasetError(
            f"figure: expected exponents over one swept parameter, got {', '.join(names) or 'one run'}."
        )
    figure = canvas(60)
    axis = figure.subplots()
    directions = dataset["direction"].values.tolist() if "direction" in dataset["reason"].dims else [None]
    for direction in directions:
        one = dataset if direction is None else dataset.sel(direction=direction)
        values, errors = one["lyapunov_exponent"].values[:, 0], one["standard_error"].values[:, 0]
        axis.errorbar(
            one[names[0]].values,
            values,
            np.where(np.isfinite(errors), errors, 0.0),
            linestyle="none",
            marker=".",
            markersize=2.5,
            elinewidth=0.5,
            color=_COLOURS.get(str(direction), "#20567D"),
            label=None if direction is None else f"{direction} sweep",
        )
    axis.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axis.set(xlabel=label(dataset[names[0]]), ylabel="largest exponent per impact (-)")
    if len(directions) > 1:
        axis.legend(frameon=False, fontsize=7)
    return figure
