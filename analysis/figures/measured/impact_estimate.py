"""Figure of estimates from impacting motion: signal, impacts and fitted motion, residual, then all intervals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.page import (
    COLOURS,
    COLUMN_WIDTH,
    LINE,
    MARK,
    STOP,
    canvas,
    legend_above,
    unit_symbol,
)
from vibroimpact.fmus.units import written_unit

_SIGNAL_MM, _RESIDUAL_MM = 42, 26
_COLUMNS = 2
_WIDTH = 174 / 85 * COLUMN_WIDTH
"""Width of two columns."""
_MOST_FLIGHTS = 10
"""Largest number of flights drawn: more cannot be distinguished."""
_NARROWEST = 1e-4
"""Smallest range of a panel, over the values themselves; smaller differences are not resolved."""


def draw_impact_estimate(dataset: xr.Dataset) -> Figure:
    """Draw the data behind the estimates over some flights, then each quantity with the intervals of all methods.

    Two journal columns (174 mm) wide. Datasets without the signal (version 0.1) have the intervals alone.
    """
    panels = []
    for name in dataset["quantity"].values:
        chosen = dataset.sel(quantity=name)
        panels.append(chosen.isel(estimator=np.flatnonzero(np.isfinite(chosen.estimate.values))))
    panels = [chosen for chosen in panels if chosen.sizes["estimator"]]
    rows = [panels[k : k + _COLUMNS] for k in range(0, len(panels), _COLUMNS)]
    heights = [10 + 3.4 * (1 + max(chosen.sizes["estimator"] for chosen in row)) for row in rows]
    signal = [_SIGNAL_MM, _RESIDUAL_MM] if "measured" in dataset else []
    figure = canvas(6 + sum(signal) + sum(heights), _WIDTH)
    parts = figure.subfigures(
        1 + bool(signal),
        1,
        squeeze=False,
        height_ratios=[*([sum(signal)] if signal else []), max(sum(heights), 1)],
    )
    if signal:
        _draw_motion(parts[0, 0].subplots(2, 1, sharex=True, height_ratios=signal), dataset)
    methods = [str(name) for name in dataset["estimator"].values]
    axes = parts[-1, 0].subplots(max(len(rows), 1), _COLUMNS, squeeze=False, height_ratios=heights or [1])
    for axis in axes.ravel()[len(panels) :]:
        axis.set_axis_off()
    for axis, chosen in zip(axes.ravel(), panels, strict=False):
        _draw_intervals(axis, chosen, methods)
    return figure


def _draw_motion(axes: np.ndarray, dataset: xr.Dataset) -> None:
    """Draw signal, impacts and fitted motion over some flights, and the residual there."""
    low, high, title = _window(dataset)
    part = dataset.sel(time=slice(low, high))
    upper, lower = axes
    impacts = dataset.impact_time.values
    impacts = impacts[(impacts >= low) & (impacts <= high)]
    upper.plot(part.time, part.measured, ".", color=LINE, markersize=1.5, rasterized=True, label="measured")
    upper.plot(part.time, part.fitted, color=MARK, linewidth=0.7, label="fitted motion")
    for k, time in enumerate(impacts):
        for axis in axes:
            axis.axvline(
                time, color=STOP, linewidth=0.4, linestyle=":", zorder=0, label="impacts" if k == 0 else None
            )
    name = str(dataset.attrs.get("channel", "displacement")).replace("_", " ")
    upper.set_ylabel(f"{name} ({unit_symbol(dataset.measured)})")
    legend_above(upper, "right", columnspacing=2.0)
    upper.set_title(title, loc="left", fontsize=7.5)
    lower.plot(part.time, part.measured - part.fitted, ".", color=LINE, markersize=1.2, rasterized=True)
    noise = float(dataset.attrs.get("noise", np.nan))
    if np.isfinite(noise):
        lower.axhspan(-2.0 * noise, 2.0 * noise, color=STOP, alpha=0.25, linewidth=0.0, zorder=0)
    lower.axhline(0.0, color="k", linewidth=0.3)
    lower.set_ylabel(f"residual ({unit_symbol(dataset.measured)})")
    lower.set(xlim=(low, high), xlabel="time (s)")


def _window(dataset: xr.Dataset) -> tuple[float, float, str]:
    """Return the drawn span (some flights of the fitted motion) and its description."""
    time, impacts = dataset.time.values, dataset.impact_time.values
    if len(impacts) <= _MOST_FLIGHTS + 1:
        return float(time[0]), float(time[-1]), f"{len(impacts)} impacts"
    fitted = time[np.isfinite(dataset.fitted.values)]
    first = int(np.searchsorted(impacts, fitted[0])) if fitted.size else 0
    first = min(first, len(impacts) - _MOST_FLIGHTS - 1)
    margin = 0.3 * float(np.median(np.diff(impacts)))
    low, high = impacts[first] - margin, impacts[first + _MOST_FLIGHTS] + margin
    title = f"impacts {first + 1} to {first + 1 + _MOST_FLIGHTS} of {len(impacts)}; gray: twice the noise"
    return float(low), float(high), title


def _draw_intervals(axis: Axes, chosen: xr.Dataset, methods: list[str]) -> None:
    """Draw values as points and their intervals as bars; a value without an interval is an open point."""
    names = [str(name) for name in chosen["estimator"].values]
    ends = []
    for place, name in enumerate(names):
        value = float(chosen.estimate[place])
        low, high = float(chosen.interval_low[place]), float(chosen.interval_high[place])
        bounded = np.isfinite(low) and np.isfinite(high)
        colour = COLOURS[methods.index(name) % len(COLOURS)]
        if bounded:
            axis.plot([low, high], [place, place], color=colour, linewidth=1.0)
        axis.plot([value], [place], "o", markersize=3, color=colour, fillstyle="full" if bounded else "none")
        ends += [low, value, high]
    axis.set_yticks(np.arange(len(names)), [name.replace("_", " ") for name in names])
    axis.set_ylim(len(names) - 0.4, -0.6)
    limit(axis.set_xlim, float(np.nanmin(ends)), float(np.nanmax(ends)))
    axis.ticklabel_format(axis="x", useOffset=False)
    axis.locator_params(axis="x", nbins=5)
    unit = str(chosen["unit"].values)
    axis.set_xlabel(f"{str(chosen['quantity'].values).replace('_', ' ')} ({written_unit(unit)})")


def limit(setter: Callable[[float, float], object], low: float, high: float) -> None:
    """Set limits with a margin, far enough apart that rounding does not fill the panel."""
    margin = max(0.08 * (high - low), _NARROWEST * max(abs(low), abs(high)), 1e-300)
    setter(low - margin, high + margin)
