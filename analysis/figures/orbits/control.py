"""Figure of an orbit kept by its forcing amplitude: thesis figure 3.15."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import Drawing, Family, register
from vibroimpact.analysis.figures.orbits.branches import draw_below
from vibroimpact.analysis.figures.page import canvas, label, legend_outside
from vibroimpact.analysis.figures.sweep.diagrams import varied, wrong_sweep
from vibroimpact.fmus.errors import DatasetError

_PERCENT = 100.0
_DOTS: dict[str, Any] = {"marker": ".", "linestyle": "none", "markersize": 1.6, "markeredgewidth": 0.0}


def draw_control(dataset: xr.Dataset, over: xr.Dataset | None = None) -> Figure:
    """Draw impact velocities over the angular frequency, and the corrections of the amplitude.

    A sweep of the same frequency (`over`) is drawn below: the motion without control. Another sweep raises
    DatasetError.
    """
    frequency, velocity = dataset["angular_frequency"].values, dataset["impact_velocity"].values
    figure = canvas(100)
    speeds, pushes = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    if over is not None:
        if varied(over) != ["angular_frequency"] or "impact_velocity" not in over.variables:
            raise DatasetError(wrong_sweep("a sweep of angular_frequency with impacts below", over))
        draw_below(speeds, over, "angular_frequency", "impact_velocity", "without control")
    orbit = dataset["orbit_angular_frequency"].values, dataset["orbit_velocity"].values
    unstable = np.where(dataset["orbit_multiplier"].values >= 1.0, orbit[1], np.nan)
    speeds.plot(orbit[0], unstable, color="#F4B9A0", linewidth=4.0, label="unstable orbit", zorder=1)
    speeds.plot(frequency, velocity, color="#0F4C81", label="kept", **_DOTS)
    if "branch_ends_at" in dataset.attrs:
        end = float(dataset.attrs["branch_ends_at"])
        speeds.plot([end], [0.0], "o", color="#3C7D3C", markersize=4, markerfacecolor="none", label="graze")
    speeds.set_ylabel(label(dataset["impact_velocity"]))
    pushes.plot(
        frequency,
        _PERCENT * dataset["correction"].values,
        ".",
        color="#0F4C81",
        markersize=1.6,
        markeredgewidth=0.0,
    )
    pushes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    pushes.set(xlabel=label(dataset["angular_frequency"]), ylabel="correction of the\namplitude (%)")
    low, high = float(orbit[0].min()), float(orbit[0].max())
    room = 0.03 * (high - low) or 0.01 * high
    pushes.set_xlim(low - room, high + room)
    legend_outside(figure, speeds, ncols=2)
    return figure


register(
    Family(
        "control",
        "an orbit that was kept",
        {"control": Drawing(lambda data, view: draw_control(data, view.over), takes=("over",))},
    )
)
