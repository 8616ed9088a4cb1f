"""Figure of the shares of basins over a parameter."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.orbits.basins import COLOURS
from vibroimpact.analysis.figures.page import canvas, legend_outside


def draw_basin_shares(dataset: xr.Dataset) -> Figure:
    """Draw the shares of attractors as stacked fractions over the parameter, with their confidence intervals."""
    figure = canvas(75)
    axis = figure.subplots()
    draw_shares(axis, dataset)
    x, names = dataset["parameter"].values, dataset["attractor_name"].values
    axis.set(xlim=(x.min(), x.max()), xlabel=_name(dataset["parameter"]))
    legend_outside(figure, axis, ncols=1 if max(map(len, names), default=0) > 22 else 2)
    return figure


def draw_shares(axis: Axes, dataset: xr.Dataset) -> None:
    """Draw stacked shares into a panel."""
    x, shares = dataset["parameter"].values, dataset["basin_fraction"].values
    low, high = (dataset[f"basin_fraction_{end}"].values for end in ("low", "high"))
    names = [str(name) for name in dataset["attractor_name"].values]
    below = np.zeros(x.size)
    for place, name in enumerate(names):
        colour = COLOURS[place % len(COLOURS)]
        above = below + shares[:, place]
        axis.fill_between(
            x, 100.0 * below, 100.0 * above, color=colour, linewidth=0.0, step="mid", label=name
        )
        there = (shares[:, place] > 0.0) & (shares[:, place] < 1.0)
        off = 100.0 * np.array(
            [shares[there, place] - low[there, place], high[there, place] - shares[there, place]]
        )
        middle = below[there] + 0.5 * shares[there, place]
        axis.errorbar(x[there], 100.0 * middle, yerr=off, fmt="none", ecolor="black", elinewidth=0.5)
        below = above
    if (below < 1.0).any():
        axis.fill_between(
            x, 100.0 * below, 100.0, color="white", linewidth=0.0, step="mid", label="undecided"
        )
    axis.set(ylim=(0.0, 100.0), ylabel="share of starts (%)")


def _name(parameter: xr.DataArray) -> str:
    """Return the key of the parameter with its unit."""
    unit = parameter.attrs["units"]
    return f"{parameter.attrs['long_name']} ({'-' if unit == '1' else unit})"


register_results("basin_shares", "shares of basins over a parameter", draw_basin_shares)
