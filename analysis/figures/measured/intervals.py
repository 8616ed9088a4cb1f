"""The figure of interspike intervals: delay plot, density, and correlation slopes against the radius."""

from __future__ import annotations

import textwrap

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import COLUMN_WIDTH, LINE, MARK, STOP, canvas, legend_above, page_style

_HEIGHT_MM, _WIDE = 120, 2 * COLUMN_WIDTH
# Quantile of the intervals at the end of the delay plot (longer ones lie at its edge); largest number of its points.
_SHOWN, _MOST_POINTS = 0.999, 20_000
# Shades of the embeddings, from light to dark.
_LIGHTEST, _DARKEST = 0.75, 0.0
# Letters in a line of the text in an empty panel.
_LINE_LETTERS = 44
_KINDS = {"raw": "intervals", "log": "log intervals"}


def draw_intervals(report: xr.Dataset) -> Figure:
    """Draw the dataset of `interval_report`, two columns (170 mm) wide.

    Delay plot and density above. Below, the local slopes of the correlation sums of the intervals and of their
    logarithms, for every embedding m, with shuffled surrogates dashed.
    """
    with page_style():
        figure = canvas(_HEIGHT_MM, _WIDE)
        axes = figure.subplots(2, 2)
        _draw_delay_plot(axes[0, 0], report)
        _draw_density(axes[0, 1], report)
        for axis, scale in zip(axes[1], _KINDS, strict=True):
            _draw_slopes(axis, report, scale)
        return figure


def _draw_delay_plot(axis: Axes, report: xr.Dataset) -> None:
    """Draw each interval against the interval before it."""
    intervals = report["interval"].values
    known = intervals[np.isfinite(intervals)]
    limit = 1.05 * float(np.quantile(known, _SHOWN)) if known.size else 1.0
    pairs = np.column_stack([intervals[:-1], intervals[1:]])[:_MOST_POINTS]
    pairs = np.minimum(pairs[np.isfinite(pairs).all(axis=1)], limit)
    size = 2.0 if len(pairs) < 3000 else 0.8
    axis.plot(pairs[:, 0], pairs[:, 1], ".", color=LINE, markersize=size, rasterized=True)
    low = 0.95 * float(known.min()) if known.size and known.min() > 0.5 * limit else 0.0
    axis.set(xlim=(low, limit), ylim=(low, limit), xlabel="interval $I_k$ (s)", ylabel="next $I_{k+1}$ (s)")
    axis.set_box_aspect(1.0)


def _draw_density(axis: Axes, report: xr.Dataset) -> None:
    """Draw histogram, kernel estimate and distinct peaks."""
    width = float(report["histogram_bin_width"])
    axis.bar(
        report["histogram_start"].values,
        report["histogram"].values,
        width,
        align="edge",
        color="0.8",
        label=f"bins of {width:.3g} s",
    )
    bandwidth = float(report["density_bandwidth"])
    at, density = report["density_at"].values, report["density"].values
    axis.plot(at, density, color=LINE, label=f"kernel, {bandwidth:.3g} s")
    peaks = report["density_peak"].values
    axis.plot(
        peaks, np.interp(peaks, at, density), "v", color=MARK, markersize=3, label=f"peaks: {len(peaks)}"
    )
    known = report["interval"].values
    known = known[np.isfinite(known)]
    axis.set_xlim(at[0], max(1.05 * float(np.quantile(known, _SHOWN)), float(at[0]) + 4.0 * bandwidth))
    axis.set_ylim(bottom=0.0)
    axis.set(xlabel="interval (s)", ylabel="density (1/s)")
    axis.legend(frameon=False)


def _draw_slopes(axis: Axes, report: xr.Dataset, scale: str) -> None:
    """Draw local slopes against the radius, solid where C lies in the window of the fit, and the surrogates dashed."""
    radii = report[f"radius_{scale}"].values
    unit = "s" if scale == "raw" else "-"
    axis.set_xlabel(f"radius ({unit}), {_KINDS[scale]}")
    if not radii.size:
        words = textwrap.fill(str(report.attrs[f"dimension_{scale}"]), _LINE_LETTERS)
        axis.text(0.5, 0.5, words, ha="center", va="center", transform=axis.transAxes, fontsize=7)
        axis.set(xticks=[], yticks=[])
        return
    axis.set_ylabel(r"slope d ln C / d ln $\varepsilon$")
    low, high = report.attrs["slope_window"]
    shades = np.linspace(_LIGHTEST, _DARKEST, report.sizes["embedding"])
    # below the grid on which the instants were written, slopes only show the grid
    grid = float(report.attrs.get("resolution", 0.0))
    above = radii >= (grid if scale == "raw" else grid / float(np.nanmedian(report["interval"].values)))
    seen, ends = np.zeros(len(radii), dtype=np.bool_), []
    for place, shade in enumerate(shades):
        sums = report[f"correlation_sum_{scale}"].values[place]
        inside = above & (sums >= low) & (sums <= high)
        seen |= inside
        slopes = report[f"local_slope_{scale}"].values[place]
        shuffled = report[f"surrogate_sum_{scale}"].values[place]
        surrogate = report[f"surrogate_local_slope_{scale}"].values[place]
        surrogate = np.where(above & (shuffled >= low) & (shuffled <= high), surrogate, np.nan)
        drawn = np.where(above & (sums > low / 3.0), slopes, np.nan)
        colour = str(shade)
        axis.plot(radii, drawn, color=colour, linewidth=0.4)
        axis.plot(radii, np.where(inside, slopes, np.nan), color=colour, linewidth=1.2)
        axis.plot(radii, surrogate, "--", color=MARK, linewidth=0.7)
        ends.append(drawn)
    axis.set_xscale("log")
    first = float(radii[seen].min()) if seen.any() else 0.0
    if seen.any():
        axis.set_xlim(first / 3.0, radii[-1])
    for place, drawn in enumerate(ends):
        _name_embedding(axis, radii, np.where(radii >= first / 1.8, drawn, np.nan), place + 1)
    axis.set_ylim(0.0, report.sizes["embedding"] + 0.5)
    entries = [
        Line2D([], [], color="0.0", linewidth=1.2, label=f"C from {low:g} to {high:g}"),
        Line2D([], [], color=MARK, linestyle="--", linewidth=0.7, label="shuffled"),
        Line2D([], [], color=STOP, linewidth=0.4, label="other C"),
    ]
    legend_above(axis, handles=entries, fontsize=7)


def _name_embedding(axis: Axes, radii: np.ndarray, slopes: np.ndarray, embedding: int) -> None:
    """Write m next to the small end of a line, where there is space."""
    known = np.flatnonzero(np.isfinite(slopes))
    if known.size:
        axis.annotate(
            str(embedding),
            (radii[known[0]], slopes[known[0]]),
            xytext=(-5, 0),
            textcoords="offset points",
            fontsize=6,
            ha="center",
            va="center",
        )


register_results("spikes", "spikes", draw_intervals, "intervals")
