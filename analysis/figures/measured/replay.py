"""Figures of replays: a measured and a simulated signal over each other, and their difference."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.measured.recordings import short_name
from vibroimpact.analysis.figures.page import (
    COLOURS,
    LINE,
    MARK,
    STOP,
    Floats,
    canvas,
    legend_above,
    page_style,
    unit_symbol,
)
from vibroimpact.analysis.figures.window import ANY, Window
from vibroimpact.analysis.recording import Quality
from vibroimpact.fmus.errors import DatasetError

_HEIGHT_MM = 110
_HEIGHTS = (1.25, 1.25, 0.9)
_ZOOM_PERIODS = 12.0
"""Dominant periods from the onset in the first part; a sixth of this time is shown before the onset."""
_BEFORE = 1.0 / 6.0
_LONGEST_NAME = 14
_MEASURED = "#8FBBDB"
_WHOLE_SHARE = 0.6
"""Share of the record above which its first part has no panel of its own."""
# Range of the largest value outside which the label has a power of ten next to the unit.
_SMALL, _LARGE = 1e-2, 1e4


def draw_replay(dataset: xr.Dataset, recording: str | None = None, window: Window = ANY) -> Figure:
    """Draw a comparison: the whole record, its first part, and the residual with the scores of running windows.

    `recording` is the name of a comparison or the file of its recording; by default the first comparison is drawn. A
    window replaces the whole record and its first part. Clipped samples, which were not scored, are marked on the
    measured signal. The figure names the recording, and says whether the fit has used it.
    """
    name, words = comparison_of(dataset, recording)
    scores = dataset.isel(comparison=[str(one) for one in dataset["comparison"].values].index(name))
    measured = dataset[f"{name}_measured"]
    time = measured[str(measured.dims[0])].values
    scale, unit = (1e3, "ms") if float(time[-1] - time[0]) < 2.0 else (1.0, "s")
    parts = [np.array(window.part(time))] if window.given else _parts(scores, time)
    with page_style():
        figure = canvas(_HEIGHT_MM if len(parts) == 2 else 0.72 * _HEIGHT_MM)
        heights = _HEIGHTS[2 - len(parts) :]
        axes = figure.subplots(len(parts) + 1, 1, height_ratios=heights)
        size, prefix = _factor(measured.values)
        for axis, part in zip(axes, parts, strict=False):
            _draw_both(axis, dataset, name, (scale * time, scale * part), size)
            _draw_events(axis, dataset, name, scale, scale * part)
            axis.set_ylabel(f"{short_name(name, _LONGEST_NAME)} ({prefix}{unit_symbol(measured)})")
        _say_scores(axes[0], scores, words)
        legend_above(axes[0], "right", handletextpad=0.5)
        _draw_residual(axes[-1], dataset, name, (scale * time, scale * parts[0]), size)
        _draw_running(axes[-1], scores, scale)
        axes[-1].set(xlabel=f"time ({unit})", ylabel=f"residual\n({prefix}{unit_symbol(measured)})")
    return figure


def comparison_of(dataset: xr.Dataset, recording: str | None) -> tuple[str, str]:
    """Return the name of a comparison and the words about its recording; the first comparison if none is named.

    DatasetError: no comparison, or several, have this name.
    """
    names = _column(dataset, "comparison")
    if not names:
        raise DatasetError(
            "figure: comparison: expected one at least, got none. Replay a scene with compare."
        )
    files, uses = _column(dataset, "recording"), _column(dataset, "use")
    places = [0] if recording is None else [k for k, name in enumerate(names) if name == recording]
    places = places or [k for k, file in enumerate(files) if recording in (file, Path(file).stem)]
    if len(places) != 1:
        got = "several" if places else "none"
        raise DatasetError(
            f"figure: recording: expected one of {recordings_of(dataset)}, got {got} named {recording!r}."
        )
    (place,) = places
    role = {"fitted": "fitted on", "scored": "not fitted on"}.get(uses[place], "")
    return names[place], ", ".join(part for part in (short_name(files[place]), role) if part)


def recordings_of(dataset: xr.Dataset) -> str:
    """Return the comparisons of a replay, each with its recording and the use of this recording."""
    names, files, uses = (_column(dataset, name) for name in ("comparison", "recording", "use"))
    return ", ".join(
        f"{name} ({file}, {use})" if file else name
        for name, file, use in zip(names, files, uses, strict=True)
    )


def _column(dataset: xr.Dataset, name: str) -> list[str]:
    """Return one text for each comparison, empty where the dataset lacks the variable."""
    if name not in dataset:
        return [""] * dataset.sizes.get("comparison", 0)
    return [str(text) for text in dataset[name].values]


def _factor(values: Floats) -> tuple[float, str]:
    """Return the factor on the values, and its prefix in the label."""
    largest = float(np.nanmax(np.abs(values)))
    if _SMALL <= largest < _LARGE or largest <= 0.0:
        return 1.0, ""
    power = 3 * int(np.floor(np.log10(largest) / 3))
    return 10.0**-power, f"$10^{{{power}}}$ " if power else ""


def _parts(scores: xr.Dataset, time: Floats) -> list[Floats]:
    """Return the stretches to show (s): the whole, and the first part of the event."""
    whole = np.array([time[0], time[-1]])
    frequency, onset = float(scores["measured_frequency"]), float(scores["onset"])
    if not np.isfinite(frequency) or frequency <= 0.0:
        return [whole]
    length = _ZOOM_PERIODS / frequency
    first = np.array([max(time[0], onset - _BEFORE * length), min(time[-1], onset + length)])
    return [whole, first] if np.ptp(first) < _WHOLE_SHARE * np.ptp(whole) else [whole]


def _draw_both(axis: Axes, dataset: xr.Dataset, name: str, times: tuple[Floats, Floats], size: float) -> None:
    time, part = times
    rows = (time >= part[0]) & (time <= part[1])
    measured = size * dataset[f"{name}_measured"].values
    clipped = rows & ((dataset[f"{name}_quality"].values & int(Quality.clipped)) != 0)
    # wide and light below narrow and dark: both are visible where they agree
    simulated = size * dataset[f"{name}_simulated"].values
    axis.plot(time[rows], measured[rows], color=_MEASURED, linewidth=1.8, label="measured", rasterized=True)
    axis.plot(time[rows], simulated[rows], color=MARK, linewidth=0.5, label="simulated", rasterized=True)
    if np.any(clipped):
        axis.plot(
            time[clipped], measured[clipped], ".", color="k", markersize=2.5, label="clipped", rasterized=True
        )
    axis.set_xlim(part[0], part[1])


def _draw_events(axis: Axes, dataset: xr.Dataset, name: str, scale: float, part: Floats) -> None:
    """Mark events: measured events at the bottom of the panel, simulated events at its top."""
    if f"{name}_event_matched" not in dataset:
        return
    matched, missed, extra, delay = (
        dataset[f"{name}_event_{kind}"].values for kind in ("matched", "missed", "extra", "delay")
    )
    both = (
        (np.concatenate([matched, missed]), 0.0, 0.08, LINE),
        (np.concatenate([matched + delay, extra]), 0.92, 1.0, MARK),
    )
    for times, bottom, top, colour in both:
        shown = scale * times[(scale * times >= part[0]) & (scale * times <= part[1])]
        height = axis.get_xaxis_transform()
        axis.vlines(shown, bottom, top, transform=height, color=colour, linewidth=0.8)


def _say_scores(axis: Axes, scores: xr.Dataset, words: str) -> None:
    """Write the recording, the score and the alignment of the signals into a panel."""
    lag, error = 1e3 * float(scores["lag"]), 1e3 * float(scores["lag_error"])
    inverted = ", inverted" if float(scores["polarity"]) < 0.0 else ""
    # one digit more than the first digit of the error
    digits = 3 if error <= 0.0 or not np.isfinite(error) else max(0, 1 - int(np.floor(np.log10(error))))
    error_text, given = (f" ± {error:.{digits}f}", "") if error > 0.0 else ("", " (given)")
    score = f"VAF {float(scores['variance_accounted_for']):.2f} %"
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
    style: dict[str, Any] = {"transform": axis.transAxes, "ha": "right", "fontsize": 7, "bbox": box}
    axis.text(0.98, 0.05, words, va="bottom", **style)
    axis.text(0.98, 0.95, f"{score}\nlag {lag:.{digits}f}{error_text} ms{given}{inverted}", va="top", **style)


def _draw_residual(
    axis: Axes, dataset: xr.Dataset, name: str, times: tuple[Floats, Floats], size: float
) -> None:
    time, part = times
    residual = size * dataset[f"{name}_residual"].values
    # samples that were not scored are no part of the residual
    scored = dataset[f"{name}_quality"].values == 0
    axis.plot(time, np.where(scored, residual, np.nan), color=STOP, linewidth=0.5, rasterized=True)
    axis.set_xlim(part[0], part[1])


def _draw_running(axis: Axes, scores: xr.Dataset, scale: float) -> None:
    """Draw the score of each running window over the residual, on its own axis; an arrow if it is below 0."""
    if "running_window_start" not in scores:
        return
    onset = float(scores["onset"])
    variance = scores["running_window_variance"].values
    known = np.isfinite(variance)
    if not np.any(known):
        return
    variance = variance[known]
    start = scale * (scores["running_window_start"].values[known] + onset)
    stop = scale * (scores["running_window_stop"].values[known] + onset)
    shown = variance >= 0.0
    twin = axis.twinx()
    twin.hlines(variance[shown], start[shown], stop[shown], color=COLOURS[2], linewidth=1.2)
    # worse than the mean: the arrow points towards the score
    below = 0.5 * (start + stop)[~shown]
    twin.plot(below, np.full(len(below), 4.0), "v", color=COLOURS[2], markersize=3)
    twin.set_ylim(0.0, 105.0)
    twin.set_ylabel("VAF (%)", color=COLOURS[2])
    axis.tick_params(right=False)
