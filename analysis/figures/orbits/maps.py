"""Figures of maps: impacts, states at phase 0, the sets S and W, and the diagrams of maps near a graze."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import canvas, label, legend_outside, unit_symbol

_DOTS: dict[str, Any] = {"marker": "o", "linestyle": "none", "markeredgewidth": 0.0, "color": "#0F4C81"}
_SMALLEST, _LARGEST, _ONE, _TENFOLD = 0.9, 4.0, 5.0, 1.05
"""Diameters of dots, points: smallest, largest, diameter of a single dot, and decrease for ten times as many."""
_MARKS = "osD^v"


def draw_maps(dataset: xr.Dataset) -> Figure:
    """Draw the dataset of `maps`."""
    figure = canvas(80)
    axis = figure.subplots()
    if dataset.attrs["map"] in ("nordmark", "square-root"):
        _draw_diagram(axis, dataset)
    else:
        names = ("displacement", "velocity") if dataset.attrs["map"] == "strobe" else ("phase", "velocity")
        axis.plot(
            *(dataset[name].values for name in names),
            rasterized=True,
            label="long run",
            markersize=dot_size(dataset[names[0]].size),
            **_DOTS,
        )
        if "before_phase" in dataset:
            for which, colour, words in (("before", "#0F4C81", "S"), ("after", "#B5410B", "W")):
                _draw_curve(
                    axis, dataset[f"{which}_phase"].values, dataset[f"{which}_velocity"].values, colour, words
                )
        for place, name in enumerate(dataset["orbit_name"].values):
            axis.plot(
                dataset[f"orbit_{names[0]}"].values[place],
                dataset[f"orbit_{names[1]}"].values[place],
                _MARKS[place % len(_MARKS)],
                color="white",
                markeredgecolor="black",
                markersize=4.5,
                label=str(name),
            )
        axis.set(xlabel=label(dataset[names[0]]), ylabel=label(dataset[names[1]]))
        if names[0] == "phase":
            axis.set(
                xlim=(0.0, 2.0 * np.pi),
                xlabel=f"forcing phase of an impact ({unit_symbol(dataset['phase'])})",
            )
    if axis.get_legend_handles_labels()[1]:
        legend_outside(figure, axis, ncols=2)
    return figure


def dot_size(count: int) -> float:
    """Return the diameter of `count` dots, points: few dots are visible, and many do not cover each other.

    >>> [round(dot_size(count), 1) for count in (2, 100, 2752, 200_000)]
    [4.0, 2.9, 1.4, 0.9]
    """
    return float(np.clip(_ONE - _TENFOLD * np.log10(max(count, 1)), _SMALLEST, _LARGEST))


def _draw_curve(
    axis: Axes, phase: np.ndarray[Any, Any], speed: np.ndarray[Any, Any], colour: str, words: str
) -> None:
    """Draw a curve, interrupted where its phase passes 0."""
    wraps = np.abs(np.diff(phase, prepend=phase[:1])) > np.pi
    axis.plot(phase, np.where(wraps, np.nan, speed), color=colour, linewidth=0.9, label=words)


def _draw_diagram(axis: Axes, dataset: xr.Dataset) -> None:
    name = "rho" if dataset.attrs["map"] == "nordmark" else "d"
    values, states = dataset[name].values, dataset["x"].values
    axis.plot(
        np.repeat(values, states.shape[1]),
        states.ravel(),
        rasterized=True,
        markersize=dot_size(states.size),
        **_DOTS,
    )
    axis.margins(x=0.0)
    if name == "d":
        axis.set(xlabel="d (-)", ylabel="x (-)")
        axis.set_title(f"lambda {dataset.attrs['slope']:g}", fontsize=8)
        return
    numbers = (f"{key} {dataset.attrs[key]:.4g}" for key in ("alpha", "gamma", "restitution"))
    axis.set(xlabel="rho (-)", ylabel="X (-)")
    axis.set_title(", ".join(numbers), fontsize=8)
    if "forcing_amplitude" in dataset:
        graze, slope = float(dataset.attrs["grazing_amplitude"]), float(dataset.attrs["rho_slope"])
        below = axis.secondary_xaxis(
            -0.2,
            functions=(
                lambda rho: graze * (1.0 + np.asarray(rho) / slope),
                lambda force: slope * (np.asarray(force) / graze - 1.0),
            ),
        )
        below.set_xlabel(label(dataset["forcing_amplitude"]))


register_results("maps", "a map", draw_maps)
