"""The figure of chosen communication steps: their sizes and their estimated errors over time."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.motion.series import selected
from vibroimpact.analysis.figures.page import LINE, MARK, STOP, STOP_LINE, canvas, legend_above, unit_symbol
from vibroimpact.analysis.figures.window import View

#: Smallest error over the tolerance that is drawn: a contact needs its steps, and has no error.
_SMALLEST = 1e-3


def draw_steps(dataset: xr.Dataset, view: View) -> Figure:
    """Draw the size of each communication step, and its estimated error over the coupling tolerance.

    Steps up to an event end at a vertical line. A window of time restricts the figure.
    """
    steps = dataset.vibroimpact.chosen_steps(**selected(view.run))
    time, size = steps["chosen_step_end"].values, steps["chosen_step_size"].values
    error = np.maximum(steps["chosen_step_error"].values, _SMALLEST)
    part = view.window.part(time, None) if len(time) else (0.0, 0.0)
    figure = canvas(90)
    above, below = figure.subplots(2, 1, sharex=True)
    above.plot(time, size, color=LINE, drawstyle="steps-pre", linewidth=0.7, rasterized=True)
    above.set_ylabel(f"communication step ({unit_symbol(steps['chosen_step_size'])})")
    below.plot(time, error, ".", color=MARK, markersize=2.0, rasterized=True)
    below.axhline(1.0, **STOP_LINE, label="coupling_tolerance")
    below.set(
        ylabel="error / coupling_tolerance (-)", xlabel=f"time ({unit_symbol(steps['chosen_step_end'])})"
    )
    events = dataset["event_time"].values if "event_time" in dataset.variables and view.run is None else ()
    for axis in (above, below):
        axis.set_yscale("log")
        axis.margins(x=0.0)
        for instant in events:
            axis.axvline(instant, color=STOP, linewidth=0.4, zorder=0)
        if view.window.given:
            axis.set_xlim(*part)
    legend_above(below, "right")
    return figure
