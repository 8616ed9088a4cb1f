"""Figure of transients: distance of other starts from a scene's own motion, period by period."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import canvas

_MOST_LABELLED = 6
"""Number of ends named in the legend."""
_COLOURS = ("#20567D", "#B5410B", "#7A7A7A", "#56A5DC", "#8C6BB1", "#41AB5D")


def draw_transients(dataset: xr.Dataset) -> Figure:
    """Draw the distance of each start over the periods, the tolerance, and the decay of the body without impacts."""
    figure = canvas(70)
    axis = figure.subplots()
    period, distances = dataset["period"].values, dataset["distance"].values
    ends = [str(each) for each in dataset["end"].values]
    kinds = list(dict.fromkeys(ends))
    for place, end in enumerate(ends):
        number = kinds.index(end)
        first = ends.index(end) == place and number < _MOST_LABELLED
        seen = np.where(distances[place] > 0.0, distances[place], np.nan)
        colour = _COLOURS[min(number, _MOST_LABELLED - 1)]
        axis.plot(period, seen, color=colour, linewidth=0.8, label=end if first else None)
    linear = float(dataset.attrs["linear_contraction"]) ** period * float(np.nanmax(distances[:, 0]))
    axis.plot(period, linear, color="0.4", linewidth=0.8, linestyle=":", label="body without impacts")
    axis.axhline(float(dataset.attrs["tolerance"]), color="0.6", linewidth=0.6, linestyle="--", zorder=0)
    lowest = float(np.nanmin(np.where(distances > 0.0, distances, np.nan)))
    axis.set(yscale="log", xlabel=f"periods of {dataset.attrs['period_of']}", ylabel="distance (-)")
    axis.set_ylim(bottom=0.5 * lowest)
    axis.legend(fontsize=7, frameon=False)
    return figure


register_results("transients", "transients", draw_transients)
