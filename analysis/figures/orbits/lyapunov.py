"""Figures of Lyapunov exponents: of a run, over one swept parameter, over two."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import canvas, label
from vibroimpact.analysis.figures.sweep.diagrams import edges, in_order_of_the_scene
from vibroimpact.fmus.errors import DatasetError

_COLOURS = {"up": "#56A5DC", "down": "#B5410B"}


def draw_lyapunov(dataset: xr.Dataset) -> Figure:
    """Draw the largest exponent of each run over one or two swept parameters, or all exponents of a single run.

    More swept parameters, or runs without a grid, raise DatasetError.
    """
    names = [str(dim) for dim in dataset["reason"].dims if dim != "direction"]
    if not names and "direction" not in dataset["reason"].dims:
        return _draw_run(dataset)
    if len(names) not in (1, 2) or not set(names) <= set(dataset.coords):
        raise DatasetError(
            f"figure: expected exponents over one or two swept parameters, got {', '.join(names) or 'none'}. "
            "Select values of the others in Python."
        )
    return _draw_sweep(dataset, names[0]) if len(names) == 1 else _draw_map(dataset, names)


def _draw_run(dataset: xr.Dataset) -> Figure:
    figure = canvas(60)
    axis = figure.subplots()
    errors = dataset["standard_error"].values
    axis.errorbar(
        dataset["exponent"].values,
        dataset["lyapunov_exponent"].values,
        np.where(np.isfinite(errors), errors, 0.0),
        linestyle="none",
        marker="o",
        markersize=4,
        color="#20567D",
    )
    axis.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axis.set_xticks(dataset["exponent"].values)
    axis.set(xlabel="exponent, the largest first", ylabel="exponent per impact (-)")
    return figure


def _draw_map(dataset: xr.Dataset, names: list[str]) -> Figure:
    """Draw the largest exponent as colours, with different colours above and below 0."""
    along, across = in_order_of_the_scene(dataset, names)
    largest = dataset["lyapunov_exponent"].isel(exponent=0)
    directions = dataset["direction"].values.tolist() if "direction" in largest.dims else [None]
    most = float(np.nanmax(np.abs(largest.values), initial=0.0)) or 1.0
    figure = canvas(5 + 60 * len(directions))
    axes = np.atleast_1d(figure.subplots(len(directions), 1, sharex=True))
    for axis, direction in zip(axes, directions, strict=True):
        one = largest if direction is None else largest.sel(direction=direction)
        x, y = one[along].values, one[across].values
        mesh = axis.pcolormesh(
            edges(x),
            edges(y),
            one.transpose(across, along).values,
            cmap="RdBu_r",
            vmin=-most,
            vmax=most,
            rasterized=True,
        )
        axis.set_facecolor("0.85")
        axis.set_ylabel(label(dataset[across]))
        axis.locator_params(axis="x", nbins=5)
        axis.set_title("gray: none" if direction is None else f"{direction} sweep, gray: none", fontsize=8)
        figure.colorbar(mesh, ax=axis, label="largest exponent per impact (-)")
    axes[-1].set_xlabel(label(dataset[along]))
    return figure


def _draw_sweep(dataset: xr.Dataset, name: str) -> Figure:
    figure = canvas(60)
    axis = figure.subplots()
    draw_exponents(axis, dataset, name)
    axis.set_xlabel(label(dataset[name]))
    if len(axis.get_legend_handles_labels()[1]) > 1:
        axis.legend(frameon=False, fontsize=7)
    return figure


def draw_exponents(axis: Axes, dataset: xr.Dataset, name: str, colours: Mapping[str, str] = _COLOURS) -> None:
    """Draw the largest exponent of each run over a swept parameter into a panel; directions have their colours."""
    directions = dataset["direction"].values.tolist() if "direction" in dataset["reason"].dims else [None]
    for direction in directions:
        one = dataset if direction is None else dataset.sel(direction=direction)
        values, errors = one["lyapunov_exponent"].values[:, 0], one["standard_error"].values[:, 0]
        axis.errorbar(
            one[name].values,
            values,
            np.where(np.isfinite(errors), errors, 0.0),
            linestyle="none",
            marker=".",
            markersize=2.5,
            elinewidth=0.5,
            color=colours.get(str(direction), "#20567D"),
            label=None if direction is None else f"{direction} sweep",
        )
    axis.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axis.set_ylabel("largest exponent per impact (-)")


register_results("lyapunov", "Lyapunov exponents", draw_lyapunov)
