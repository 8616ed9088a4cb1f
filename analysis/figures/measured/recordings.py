"""Figures of recordings: every channel over time, with clipped and missing samples, and trains of events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vibroimpact.analysis.figures.page import COLUMN_WIDTH, LINE, MARK, STOP, Floats, canvas, page_style
from vibroimpact.analysis.figures.window import ANY, Window
from vibroimpact.analysis.recording import Channel, EventTrain, Quality, Recording
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.units import written_unit

_QUANTITIES = {
    "m": "displacement",
    "m s-1": "velocity",
    "m s-2": "acceleration",
    "N": "force",
    "N m": "moment",
    "Pa": "pressure",
    "V": "voltage",
    "A": "current",
    "rad": "angle",
    "rad s-1": "angular velocity",
}
_PANEL_MM = 22
_TRAIN_MM = 20
#: Largest number of channels, and of event trains, in a figure.
MOST_PANELS = 12
_MOST_POINTS = 4000
_LONGEST_NAME = 34
_MOST_BANDS = 200
_LOG_RATIO = 30.0


def draw_recording(recording: Recording, window: Window = ANY) -> Figure:
    """Draw the first twelve channels of a recording, a panel for each on its own time axis, then its event trains.

    Clipped samples are marked; a band runs through the panel where samples are missing or overrange. Event trains
    show the interval after each event against its time. Long channels are drawn by the smallest and largest value of
    each of some thousand spans, so that no peak is lost.
    """
    channels = list(recording.channels.values())[:MOST_PANELS]
    trains = list(recording.events.values())[:MOST_PANELS]
    if not channels and not trains:
        raise DatasetError(f"{recording.title}: expected channels or events to draw, got none.")
    shown = channels
    if window.given:
        shown = [channel.between(*window.part(channel.time)) for channel in channels]
        trains = [_train_part(train, window) for train in trains]
    with page_style():
        heights = [_PANEL_MM] * len(channels) + [_TRAIN_MM] * len(trains)
        figure = canvas(10 + sum(heights) + 4 * len(heights), COLUMN_WIDTH)
        axes = list(figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0])
        for axis, channel in zip(axes, shown, strict=False):
            _draw_channel(axis, channel)
        for axis, train in zip(axes[len(channels) :], trains, strict=True):
            _draw_train(axis, train)
        _share_time(axes[: len(channels)], channels, shown)
        figure.align_ylabels(axes)
    return figure


def _share_time(axes: Sequence[Axes], channels: Sequence[Channel], shown: Sequence[Channel]) -> None:
    """Label the time once below each group of panels with a common axis."""
    for place, (axis, channel, part) in enumerate(zip(axes, channels, shown, strict=True)):
        if len(part.time) > 1:
            axis.set_xlim(part.time[0], part.time[-1])
        last = place + 1 == len(channels) or channels[place + 1].axis is not channel.axis
        axis.tick_params(labelbottom=last)
        if last:
            axis.set_xlabel("time (s)")


def _train_part(train: EventTrain, window: Window) -> EventTrain:
    """Return the events of a train in a window."""
    start, stop = window.part(train.times)
    inside = (train.times >= start) & (train.times <= stop)
    return replace(train, times=train.times[inside], window=(start, stop))


def _draw_channel(axis: Axes, channel: Channel) -> None:
    """Draw one channel with its marks."""
    line = channel.time, channel.values
    if len(channel.time) > _MOST_POINTS:
        line = outline(*line, -(-2 * len(channel.time) // _MOST_POINTS))
    axis.plot(*line, color=LINE, linewidth=0.6, rasterized=True)
    entries = []
    absent = channel.quality & np.uint8(Quality.missing | Quality.overrange) != 0
    if np.any(absent):
        _draw_spans(axis, channel.time, absent)
        entries.append(f"{int(absent.sum())} missing or overrange")
    clipped = channel.quality & np.uint8(Quality.clipped) != 0
    if np.any(clipped):
        axis.plot(
            channel.time[clipped],
            channel.values[clipped],
            "o",
            markersize=2.2,
            color=MARK,
            rasterized=True,
        )
        entries.append(f"{int(clipped.sum())} clipped")
    axis.set_title(_titled(channel.name, entries), fontsize=7.5, loc="left", pad=2)
    axis.set_ylabel(f"{_quantity(channel.unit)}\n({written_unit(channel.unit)})".lstrip())


def _quantity(unit: str) -> str:
    """Return the quantity of a channel by its unit, for any multiple of the unit; empty if unknown.

    >>> _quantity("9.80665 m s-2"), _quantity("V"), _quantity("1")
    ('acceleration', 'voltage', '')
    """
    number, _, rest = unit.partition(" ")
    return _QUANTITIES.get(rest if number[0].isdigit() and rest else unit, "")


def _titled(name: str, entries: Sequence[str]) -> str:
    return short_name(name) + (f": {', '.join(entries)}" if entries else "")


def short_name(name: str, longest: int = _LONGEST_NAME) -> str:
    """Return a name short enough for a place above a panel, or next to one."""
    return name if len(name) <= longest else name[: longest - 1] + "…"


def outline(time: Floats, values: Floats, per_span: int) -> tuple[Floats, Floats]:
    """Return a line through the smallest and largest value of each span of `per_span` samples; it looks the same."""
    known = np.where(np.isfinite(values), values, np.nan)
    starts = np.arange(0, len(time), per_span)
    ends = [extreme.reduceat(known, starts) for extreme in (np.fmin, np.fmax)]
    return np.repeat(time[starts], 2), np.stack(ends, axis=1).ravel()


def spans_of(marked: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the first place of each run of marked samples and the place after its last, shape (run, 2)."""
    return np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]))).reshape(-1, 2)


def _draw_spans(axis: Axes, time: Floats, marked: NDArray[np.bool_]) -> None:
    """Draw a band over each run of marked samples."""
    half = float(np.median(np.diff(time))) / 2
    for begin, end in spans_of(marked)[:_MOST_BANDS]:
        axis.axvspan(time[begin] - half, time[end - 1] + half, color=MARK, alpha=0.25, linewidth=0.3)


def _draw_train(axis: Axes, train: EventTrain) -> None:
    """Draw the interval after each event against its time."""
    intervals = np.diff(train.times)
    if len(intervals):
        size = 1.5 if len(intervals) > _MOST_POINTS else 2.0
        axis.plot(
            train.times[:-1],
            intervals,
            ".",
            markersize=size,
            markeredgewidth=0.0,
            color=LINE,
            rasterized=True,
        )
        if intervals.min() > 0.0 and intervals.max() > _LOG_RATIO * intervals.min():
            axis.set_yscale("log")
    for begin, end in np.reshape(train.attrs.get("masked", ()), (-1, 2)):
        axis.axvspan(begin, end, color=STOP, alpha=0.3, linewidth=0.3)
    if train.window is not None:
        axis.set_xlim(*train.window)
    axis.set_title(_titled(train.name, [f"{len(train.times)} events"]), fontsize=7.5, loc="left", pad=2)
    axis.set(xlabel="time (s)", ylabel="interval (s)")
