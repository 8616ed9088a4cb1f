"""Figures of the motion once per forcing period: sections of one run, diagrams of a sweep."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from vibroimpact.analysis.figures.page import LINE, STOP_LINE, canvas, label
from vibroimpact.analysis.figures.scene_text import fixed_positions, observed_stops
from vibroimpact.analysis.figures.sweep.diagrams import draw_diagram, one_value, varied
from vibroimpact.analysis.figures.window import View
from vibroimpact.analysis.orbits.rotation import rotation_of
from vibroimpact.fmus.errors import DatasetError

# Number of points of a section above which they are small, so that the layers of an attractor show.
_MANY_POINTS = 100


def draw_strobe(dataset: xr.Dataset, view: View) -> Figure:
    """Draw displacements at forcing phase 0 against the swept parameter, or the Poincare section of one run."""
    if "strobe_displacement" not in dataset.variables:
        raise DatasetError(
            "figure: expected a motion recorded once per period, got none. "
            "Set strobe = true in [record] of a forced scene."
        )
    if view.run is None and varied(dataset):
        return draw_diagram(dataset, ["strobe_displacement"])
    runs = dataset.vibroimpact.runs
    chosen = runs if view.run is None else runs.isel(run=runs["run_index"].values == view.run)
    figure = canvas(75)
    axis = figure.subplots()
    draw_section(axis, chosen.isel(run=0))
    axis.set_title(_rotation_in_words(chosen.isel(run=0)), fontsize=8)
    for position in fixed_positions(observed_stops(dataset)):
        low, high = axis.get_xlim()
        if low <= position <= high:
            axis.axvline(position, **STOP_LINE)
    return figure


def _rotation_in_words(run: xr.Dataset) -> str:
    """Return the rotation number of a run whose section is made of closed curves; empty for other runs."""
    states = np.column_stack([run["strobe_displacement"].values, run["strobe_velocity"].values])
    found = rotation_of(states) if np.isfinite(states).all() and len(states) else None
    return "" if found is None else f"quasi-periodic\n{found.text}"


def draw_section(axis: Axes, run: xr.Dataset) -> None:
    """Draw displacement and velocity of one run at forcing phase 0."""
    x, y = run["strobe_displacement"], run["strobe_velocity"]
    size = 2.5 if np.isfinite(x.values).sum() <= _MANY_POINTS else 1.0
    axis.plot(x.values, y.values, "o", markersize=size, markeredgewidth=0.0, color=LINE, rasterized=True)
    for values, limits in ((x, "xlim"), (y, "ylim")):
        same = one_value(values.values)
        if same is not None:
            # a single point: nine digits of axis numbers around it would be meaningless
            room = 0.5 * abs(same) or 1.0
            axis.set(**{limits: (same - room, same + room)})
    axis.xaxis.set_major_locator(MaxNLocator(5))
    axis.set(xlabel=label(x), ylabel=label(y))
