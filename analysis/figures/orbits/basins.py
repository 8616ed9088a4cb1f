"""Figure of basins of attraction over the start states."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, hsv_to_rgb, rgb_to_hsv, to_rgb
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import canvas, label, legend_outside
from vibroimpact.analysis.figures.sweep.diagrams import edges

COLOURS = ("#9CC9EA", "#F4B9A0", "#B9DDB0", "#D9C2E9", "#F6E3A1", "#A7DAD5", "#E3C3B1", "#C9CBD6")
_MARKS = "osD^vPX*"
STRONG = (1.0, 0.55)
"""Saturation and brightness of the states of an attractor; the hue is that of its basin."""
WIDE = 22
"""Characters of a legend's entry up to which two entries fit side by side."""
_UNDECIDED, _BEYOND = "#FFFFFF", "#5A5A5A"


def draw_basins(dataset: xr.Dataset) -> Figure:
    """Draw the attractor of each start state, and the attractors at forcing phase 0."""
    labels = dataset["basin"].values
    names = [str(name) for name in dataset["attractor_name"].values]
    colours = [COLOURS[place % len(COLOURS)] for place in range(len(names))]
    figure = canvas(95)
    axis = figure.subplots()
    axis.pcolormesh(
        edges(dataset["displacement_start"].values),
        edges(dataset["velocity_start"].values),
        labels,
        cmap=ListedColormap([_BEYOND, _UNDECIDED, *colours]),
        vmin=-2.5,
        vmax=len(names) - 0.5,
        rasterized=True,
    )
    ends = axis.get_xlim(), axis.get_ylim()
    for place, colour in enumerate(colours):
        x = dataset["attractor_displacement"].values[place]
        y = dataset["attractor_velocity"].values[place]
        axis.plot(
            x[np.isfinite(x)],
            y[np.isfinite(y)],
            _MARKS[place % len(_MARKS)],
            color=colour,
            markeredgecolor="black",
            markersize=4.5,
            label=_label(names[place], _share(dataset, place)),
        )
    _draw_sections(axis, dataset, colours)
    if "edge_orbit" in dataset:
        _draw_edges(axis, dataset)
    for value, colour, words in ((-1, _UNDECIDED, "undecided"), (-2, _BEYOND, "beyond a stop")):
        if (labels == value).any():
            axis.plot([], [], "s", color=colour, markeredgecolor="black", markersize=4.5, label=words)
    axis.set(
        xlim=ends[0],
        ylim=ends[1],
        xlabel=label(dataset["displacement_start"]),
        ylabel=label(dataset["velocity_start"]),
    )
    longest = max(map(len, axis.get_legend_handles_labels()[1]), default=0)
    legend_outside(figure, axis, ncols=2 if longest <= WIDE else 1)
    return figure


def _draw_sections(axis: Axes, dataset: xr.Dataset, colours: list[str]) -> None:
    """Draw the states at forcing phase 0 of attractors without a period, in a strong tone of its colour."""
    if "section_displacement" not in dataset:
        return
    sections = (dataset[f"section_{what}"].values for what in ("displacement", "velocity"))
    for colour, x, y in zip(colours, *sections, strict=True):
        hue, _, _ = rgb_to_hsv(to_rgb(colour))
        axis.plot(x, y, ".", color=hsv_to_rgb((hue, *STRONG)), markersize=1.0, markeredgewidth=0.0)


def _draw_edges(axis: Axes, dataset: xr.Dataset) -> None:
    """Draw the states at forcing phase 0 of the orbits on edges."""
    for place, name in enumerate(map(str, dataset["edge_orbit"].values)):
        x, y = (dataset[f"edge_{what}"].values[place] for what in ("displacement", "velocity"))
        there = np.isfinite(x)
        words = f"on an edge: {name.partition(')')[0]})" if name else "edge state without a known orbit"
        axis.plot(x[there], y[there], "x" if name else "+", color="black", markersize=5.5, label=words)


def _label(name: str, share: str) -> str:
    """Return a name and its share for the legend, in lines if the name has a rotation number."""
    return f"{name}: {share}" if ", " not in name else f"{name.replace(', ', f',{chr(10)}')}:{chr(10)}{share}"


def _share(dataset: xr.Dataset, place: int) -> str:
    """Return the share of an attractor with its confidence interval in words."""
    names = ("basin_fraction", "basin_fraction_low", "basin_fraction_high")
    share, *ends = (f"{100.0 * float(dataset[name].values[place]):.3g}" for name in names if name in dataset)
    return f"{share} % ({' to '.join(ends)} %)" if ends else f"{share} %"


register_results("basins", "basins of attraction", draw_basins)
