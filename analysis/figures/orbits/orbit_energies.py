"""Figures of the energies that modes exchange: on one orbit, along a sweep; thesis figures 6.15 and 6.16."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import (
    COLOURS,
    LINE,
    MARK,
    STOP,
    canvas,
    label,
    legend_outside,
    page_style,
    unit_symbol,
)
from vibroimpact.fmus.errors import DatasetError

_PARTS = {
    "forcing_work": (1.0, "force"),
    "damping_loss": (-1.0, "damping"),
    "impact_change": (1.0, "impacts"),
}
_BAR = 0.26
_RAYS = (0.0, 0.3, 0.5, 0.7, 0.9, 1.0)
_MARKS = {"up": "^", "down": "v"}


def draw_orbit_energies(dataset: xr.Dataset) -> Figure:
    """Draw the energy gains and losses of an orbit's modes, or residual energies along a sweep; below, the restitution.

    A missing variable, or more than one swept key, raises DatasetError.
    """
    missing = [name for name in (*_PARTS, "residual_energy", "contact_energy") if name not in dataset]
    if missing:
        raise DatasetError(
            f"figure: expected what `vibroimpact energies` writes, got none of {', '.join(missing)}."
        )
    along = [str(dim) for dim in dataset["contact_energy"].dims if dim != "direction"]
    if len(along) > 1 or (not along and "direction" in dataset["contact_energy"].dims):
        raise DatasetError(
            f"figure: expected energies along one key at most, got {', '.join(along) or 'directions alone'}. "
            "Select values of the others in Python."
        )
    with page_style():
        figure = canvas(105)
        above, below = figure.subplots(2, 1)
        if along:
            _draw_sweep(above, dataset, along[0])
            _draw_plane(below, dataset)
        else:
            _draw_bars(above, dataset)
            _draw_curve(below, dataset)
        legend_outside(figure, above, ncols=3)
    return figure


def _draw_bars(axis: Axes, dataset: xr.Dataset) -> None:
    places = dataset["mode"].values.astype(np.float64)
    for number, (name, (sign, words)) in enumerate(_PARTS.items()):
        values = sign * dataset[name].values
        axis.bar(places + _BAR * (number - 1), values, _BAR, color=COLOURS[number], label=words)
    axis.axhline(0.0, color=STOP, linewidth=0.6)
    axis.set_xticks(places)
    axis.set_xlabel("mode")
    axis.set_ylabel(f"energy over the orbit ({unit_symbol(dataset['forcing_work'])})")


def _draw_curve(axis: Axes, dataset: xr.Dataset) -> None:
    """Draw restitution over residual energy for the energy that the impacts of the orbit meet: figure 6.16 (a)."""
    met, residual = float(dataset["contact_energy"]), float(dataset["residual_energy"].sum())
    # square root: points are closest where the curve is steep
    share = 1.0 - np.linspace(1.0, 0.0, 200) ** 2
    axis.plot(met * share, np.sqrt(1.0 - share), color=LINE)
    axis.plot(residual, float(dataset["residual_restitution"]), "o", color=MARK, markersize=4)
    unit = unit_symbol(dataset["residual_energy"])
    axis.set_xlabel(f"residual energy ({unit}); impacts meet {met:.4g}")
    axis.set(ylabel="restitution (-)", xlim=(0.0, 1.02 * met), ylim=(0.0, 1.05))


def _draw_sweep(axis: Axes, dataset: xr.Dataset, along: str) -> None:
    for number, mode in enumerate(dataset["mode"].values.tolist()):
        own = dataset["residual_energy"].sel(mode=mode) / dataset["periods"]
        for sweep in own["direction"].values.tolist() if "direction" in own.dims else [None]:
            line = own if sweep is None else own.sel(direction=sweep)
            colour = COLOURS[number % len(COLOURS)]
            axis.plot(line[along] if along in line.coords else np.arange(line.size), line, _MARKS.get(str(sweep), "."),
                      color=colour, markersize=1.5, label=f"mode {mode}", rasterized=True)  # fmt: skip
    axis.axhline(0.0, color=STOP, linewidth=0.6)
    axis.set_xlabel(label(dataset[along]) if along in dataset.coords else along)
    axis.set_ylabel(f"residual in a period ({unit_symbol(dataset['residual_energy'])})")


def _draw_plane(axis: Axes, dataset: xr.Dataset) -> None:
    """Draw residual energy over the energy that impacts meet, with lines of equal restitution: figure 6.16 (b)."""
    met, residual = (
        dataset["contact_energy"].values,
        dataset["residual_energy"].sum("mode", skipna=True).values,
    )
    known = np.isfinite(met)
    if not known.any():
        raise DatasetError("figure: expected a run with a periodic orbit, got none.")
    most = 1.05 * float(met[known].max())
    for restitution in _RAYS:
        height = (1.0 - restitution**2) * most
        axis.plot([0.0, most], [0.0, height], color=STOP, linewidth=0.5, zorder=0)
        axis.annotate(
            f"{restitution:g}",
            (most, height),
            xytext=(2, 0),
            textcoords="offset points",
            va="center",
            fontsize=6,
        )
    axis.plot(met[known], residual[known], ".", color=MARK, markersize=2, rasterized=True)
    unit = unit_symbol(dataset["contact_energy"])
    axis.set(xlim=(0.0, most), ylim=(0.0, most))
    axis.set_xlabel(f"energy that impacts meet ({unit})")
    axis.set_title("restitution", fontsize=6, loc="right", pad=2)
    axis.set_ylabel(f"residual energy ({unit})")


register_results("energies", "energies of orbits", draw_orbit_energies)
