"""Figures of resonances: responses over the forcing frequency, their peaks, and shifted natural frequencies."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import (
    COLOURS,
    MARK,
    STOP,
    canvas,
    legend_outside,
    page_style,
    unit_symbol,
)
from vibroimpact.fmus.errors import DatasetError

_PANEL_MM = 38
_NEEDED = ("quantity", "peak_frequency", "peak_height", "shifted_frequency", "natural_frequency", "forcing")


def draw_resonances(dataset: xr.Dataset) -> Figure:
    """Draw panels for displacement range, impact velocity and kinetic energies of the modes over the frequency.

    A missing variable raises DatasetError.
    """
    missing = [name for name in _NEEDED if name not in dataset.variables]
    if missing:
        raise DatasetError(
            f"figure: expected what `vibroimpact resonances` writes, got none of {', '.join(missing)}."
        )
    modes = [f"mean_kinetic_energy_{mode}" for mode in dataset["mode"].values.tolist()]
    panels = [[name] for name in ("displacement_range", "impact_velocity") if name in dataset]
    panels.append([name for name in modes if name in dataset])
    frequency = dataset["forcing"].values
    with page_style():
        figure = canvas(14 + _PANEL_MM * len(panels))
        axes = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
        for axis, names in zip(axes, panels, strict=True):
            for number, name in enumerate(names):
                words = f"mode {number + 1}" if name.startswith("mean_kinetic") else None
                for branch in range(dataset.sizes["branch"]):
                    values = dataset[name].values[branch]
                    axis.plot(frequency, values, "-" if branch == 0 else ":", color=COLOURS[number % len(COLOURS)],
                              label=words if branch == 0 else None, linewidth=0.7, rasterized=True)  # fmt: skip
                own = dataset["quantity"].values == name
                axis.plot(dataset["peak_frequency"].values[own], dataset["peak_height"].values[own], "v", color=MARK,
                          markersize=3, label="peaks")  # fmt: skip
            _draw_natural(axis, dataset)
            kinetic = names and names[0].startswith("mean_kinetic")
            quantity = "kinetic energy" if kinetic else names[0].replace("_", " ")
            axis.set_ylabel(f"{quantity} ({unit_symbol(dataset[names[0]])})")
            axis.set_ylim(bottom=0.0)
        axes[-1].set_xlim(float(frequency.min()), float(frequency.max()))
        axes[-1].set_xlabel(f"angular frequency ({unit_symbol(dataset['forcing'])})")
        legend_outside(figure, axes[-1], ncols=3)
        figure.align_ylabels(axes)
    return figure


def _draw_natural(axis: Axes, dataset: xr.Dataset) -> None:
    """Mark natural frequencies, and those shifted by the stop at the highest peak of the first panel."""
    first = dataset["quantity"].values == dataset["quantity"].values[0]
    heights = np.where(first, dataset["peak_height"].values, -np.inf)
    shifted = dataset["shifted_frequency"].values[int(np.argmax(heights))]
    for number, (natural, moved) in enumerate(zip(dataset["natural_frequency"].values, shifted, strict=True)):
        axis.axvline(natural, color=STOP, linestyle=":", linewidth=0.6, zorder=0, label="natural")
        if moved <= dataset["forcing"].values.max():
            axis.axvline(moved, color=COLOURS[number % len(COLOURS)], linestyle="--", linewidth=0.6, zorder=0,
                         label="shifted")  # fmt: skip


register_results("resonances", "resonances", draw_resonances)
