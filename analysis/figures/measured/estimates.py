"""Figures of estimates: a free decay and its laws, a frequency response, or methods side by side."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.measured.impact_estimate import draw_impact_estimate, limit
from vibroimpact.analysis.figures.page import LINE, MARK, STOP, canvas, legend_above, page_style, unit_symbol
from vibroimpact.fmus.errors import DatasetError

_PANEL_MM = 32


def draw_estimates(dataset: xr.Dataset) -> Figure:
    """Draw the dataset of `vibroimpact estimate`; the kind of estimation decides the figure."""
    drawers = {
        "decay": _draw_decay,
        "response": _draw_response,
        "impacts": draw_impact_estimate,
        "bounces": draw_impact_estimate,
    }
    kind = str(dataset.attrs.get("estimates", ""))
    if kind not in drawers:
        raise DatasetError(
            f"figure: expected estimates of a decay, a response, impacts or bounces, got {kind or 'none'!r}. "
            "Make them with `vibroimpact estimate`."
        )
    with page_style():
        return drawers[kind](dataset)


def _draw_decay(dataset: xr.Dataset) -> Figure:
    """Draw motion, residuals and peaks over time, then frequency and damping over amplitude."""
    panels = [_draw_motion, _draw_residuals]
    panels += [_draw_peaks] * ("peak_height" in dataset)
    windows = [_draw_frequency, _draw_damping] if "window" in dataset.dims else []
    figure = canvas(14 + _PANEL_MM * (len(panels) + len(windows)))
    axes = figure.subplots(len(panels) + len(windows), 1)
    for axis, draw in zip(axes, panels + windows, strict=True):
        draw(axis, dataset)
    over_time, over_amplitude = axes[: len(panels)], axes[len(panels) :]
    for axis in over_time:
        axis.set_xlim(float(dataset.time[0]), float(dataset.time[-1]))
        axis.set_xlabel("time (s)" if axis is over_time[-1] else "")
        axis.tick_params(labelbottom=axis is over_time[-1])
    for axis in over_amplitude:
        axis.set_xlim(left=0.0)
        axis.tick_params(labelbottom=axis is axes[-1])
    if windows:
        axes[-1].set_xlabel(f"amplitude ({unit_symbol(dataset.window_amplitude)})")
    return figure


def _draw_motion(axis: Axes, dataset: xr.Dataset) -> None:
    axis.plot(dataset.time, dataset.measured, color=LINE, linewidth=0.5, rasterized=True, label="measured")
    best = dataset["law_fit" if "law_fit" in dataset else "exponential_fit"]
    axis.plot(dataset.time, best, color=MARK, linewidth=0.4, linestyle="--", rasterized=True, label="fitted")
    axis.set_ylabel(f"{dataset.attrs['channel'].replace('_', ' ')} ({unit_symbol(dataset.measured)})")
    # the power of ten of the axis stands on the left
    legend_above(axis, "right")


def _draw_residuals(axis: Axes, dataset: xr.Dataset) -> None:
    """Draw the residuals: noise shows as a band, a wrong law as a pattern."""
    residual = dataset.measured - dataset.exponential_fit
    axis.plot(dataset.time, residual, color=STOP, linewidth=0.4, rasterized=True, label="cosine")
    if "law_fit" in dataset:
        residual = dataset.measured - dataset.law_fit
        axis.plot(dataset.time, residual, color=MARK, linewidth=0.4, rasterized=True, label="best law")
    axis.axhline(0.0, color="k", linewidth=0.3)
    axis.set_ylabel(f"residual ({unit_symbol(dataset.measured)})")
    legend_above(axis, "right")


def _draw_peaks(axis: Axes, dataset: xr.Dataset) -> None:
    height, number = dataset.peak_height.values, dataset.peak_number.values
    axis.errorbar(
        dataset.peak_time,
        height,
        yerr=dataset.peak_height_error,
        fmt=".",
        markersize=2,
        color=LINE,
        elinewidth=0.4,
        label="turning points",
    )
    decrement = float(dataset.estimate.sel(estimator="decrement", quantity="logarithmic_decrement"))
    # The line of the fit; its level is the weighted mean of the logarithms about it.
    line = -0.5 * decrement * (number - number[0])
    level = np.average(np.log(height) - line, weights=height**2)
    axis.plot(dataset.peak_time, np.exp(level + line), color=MARK, linewidth=0.6, label="one decrement")
    axis.set(yscale="log", ylabel=f"peaks ({unit_symbol(dataset.measured)})")
    axis.legend(frameon=False, loc="lower left", borderaxespad=0.1)


def _draw_frequency(axis: Axes, dataset: xr.Dataset) -> None:
    _draw_backbone(axis, dataset, "window_frequency", 2.0 * np.pi, "frequency (Hz)")


def _draw_damping(axis: Axes, dataset: xr.Dataset) -> None:
    _draw_backbone(axis, dataset, "window_damping", 1.0, "damping ratio (-)")


def _draw_backbone(axis: Axes, dataset: xr.Dataset, name: str, unit: float, words: str) -> None:
    """Draw a variable of the windows over their amplitude, with its intervals."""
    x, y, error = (dataset[n].values for n in ("window_amplitude", name, f"{name}_error"))
    y, error = y / unit, error / unit
    axis.set_ylabel(words)
    axis.ticklabel_format(axis="y", useOffset=False)
    axis.errorbar(x, y, yerr=1.96 * error, fmt="o", markersize=2, color=LINE, elinewidth=0.6, capsize=1.5)
    # One bad window must not compress all others.
    middle = np.median(y)
    reach = 1.3 * float(np.percentile(np.abs(y - middle) + error, 85)) or 1.0
    low, high = float(np.min(y - 2 * error)), float(np.max(y + 2 * error))
    low, high = max(middle - 2 * reach, low), min(middle + 2 * reach, high)
    limit(axis.set_ylim, low, high)
    _mark_beyond(axis, x, y)


def _mark_beyond(axis: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Draw an arrow at the frame for each point beyond it, and write the farthest value."""
    low, high = axis.get_ylim()
    height = axis.get_xaxis_transform()
    for marker, place, beyond, farthest in (
        ("^", 0.95, y > high, np.argmax(y)),
        ("v", 0.05, y < low, np.argmin(y)),
    ):
        if not beyond.any():
            continue
        arrows = np.full(int(beyond.sum()), place)
        axis.plot(x[beyond], arrows, marker, color=MARK, markersize=3, linestyle="none", transform=height)
        axis.annotate(
            f"{y[farthest]:.3g}",
            (float(x[beyond].max()), place),
            xycoords=height,
            xytext=(4, 0),
            textcoords="offset points",
            fontsize=7,
            va="center",
        )


def _draw_response(dataset: xr.Dataset) -> Figure:
    """Draw |H| with its fit near the resonance, and the coherence of a measured response."""
    # A single segment has the coherence 1 by construction.
    measured = "h1_magnitude" in dataset
    coherent = measured and bool(np.any(dataset.coherence < 1.0 - 1e-9))
    figure = canvas(8 + (1.6 + coherent) * _PANEL_MM)
    axes = figure.subplots(1 + coherent, 1, squeeze=False, sharex=True)[:, 0]
    hertz = dataset.angular_frequency / (2.0 * np.pi)
    error = dataset.response_error.values
    axes[0].errorbar(
        hertz,
        dataset.response,
        yerr=np.minimum(1.96 * error, 0.9 * dataset.response.values) if np.any(error > 0) else None,
        fmt=".",
        markersize=2.5,
        color=LINE,
        elinewidth=0.4,
        label="measured" if measured else "simulated",
    )
    axes[0].plot(hertz, dataset.fitted_response, color=MARK, label="fitted resonance", zorder=3)
    axes[0].set(yscale="log", ylabel=f"response ({unit_symbol(dataset.response)})")
    axes[0].legend(frameon=False, loc="best", borderaxespad=0.3)
    if coherent:
        near = (dataset.frequency >= hertz[0]) & (dataset.frequency <= hertz[-1])
        axes[1].plot(dataset.frequency[near], dataset.coherence[near], color=LINE)
        axes[1].set(ylim=(0.0, 1.05), ylabel="coherence (-)")
    axes[-1].set(xlim=(float(hertz[0]), float(hertz[-1])), xlabel="frequency (Hz)")
    return figure


register_results("estimates", "estimates", draw_estimates)
