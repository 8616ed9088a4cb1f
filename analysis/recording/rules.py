"""The rules of a recording, checked before writing and after reading: names, shapes, clocks, sizes of numbers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import isfinite

import numpy as np

from vibroimpact.analysis.dataset.naming import file_name_of
from vibroimpact.analysis.recording.channels import Channel, EventTrain, Recording, TimeAxis

QUALITY_ENDING, EVENT_ENDING = "_quality", "_event"
#: Magnitudes beyond those of any sensor; squares of numbers between them neither overflow nor vanish.
LARGEST, SMALLEST = 1e100, 1e-100
#: Relative difference of an interval and its instants up to which they agree, plus the axis's own uncertainty.
AGREEMENT = 0.01


def problems_of(recording: Recording) -> Iterable[str]:
    """Yield the contradictions of the schema, a line each, `NAME: what: expected ..., got ....`"""
    yield from _names(recording)
    axes: set[int] = set()
    for name, channel in recording.channels.items():
        yield from (f"{name}: {problem}" for problem in _of_channel(channel))
        if id(channel.axis) not in axes:  # channels that share an axis share its problems
            yield from (f"{name}: time: {problem}" for problem in _of_axis(channel.axis))
        axes.add(id(channel.axis))
    for name, train in recording.events.items():
        yield from (f"{name}: {problem}" for problem in _of_train(train))


def _names(recording: Recording) -> Iterator[str]:
    names = [*recording.channels, *recording.events, *recording.scalars]
    if not names:
        yield "expected a channel, an event train or a single value, got none."
    for name in sorted({name for name in names if names.count(name) > 1}):
        yield f"{name}: expected each name once, got it again."
    for name in names:
        if file_name_of(name) != name or not name[0].isalpha() or name.startswith("time"):
            yield f"{name}: expected letters, digits and underscores, a letter first, and not `time`."
        if name.endswith((QUALITY_ENDING, EVENT_ENDING)):
            yield (
                f"{name}: expected a name that does not end in {QUALITY_ENDING} or {EVENT_ENDING}, "
                "as flags and dimensions do."
            )


def _of_channel(channel: Channel) -> Iterator[str]:
    length = len(channel.axis.time)
    for what, got in (("values", channel.values.shape), ("quality", channel.quality.shape)):
        if got != (length,):
            yield f"{what}: expected the shape ({length},) of its time axis, got {got}."
    most = float(np.max(np.abs(channel.values), initial=0.0, where=np.isfinite(channel.values)))
    if most > LARGEST or 0.0 < most < SMALLEST:
        yield (
            f"values: expected a largest magnitude from {SMALLEST:g} to {LARGEST:g}, or all 0, got {most:g}. "
            "Give the unit or the scale in which it was measured."
        )


def _of_axis(axis: TimeAxis) -> Iterator[str]:
    if not np.all(np.isfinite(axis.time)) or not np.all(np.diff(axis.time) > 0.0):
        yield "expected finite instants that ascend strictly, got others."
        return
    if not (isfinite(axis.interval_uncertainty) and axis.interval_uncertainty >= 0.0):
        yield f"interval_uncertainty: expected a number >= 0, got {axis.interval_uncertainty:g}."
        return
    if axis.interval is None:
        return
    if not (isfinite(axis.interval) and axis.interval > 0.0):
        yield f"sampling_interval: expected a number > 0, got {axis.interval:g}."
    elif len(axis.time) > 1:
        mean = float(axis.time[-1] - axis.time[0]) / (len(axis.time) - 1)
        if abs(mean / axis.interval - 1.0) > AGREEMENT + axis.interval_uncertainty:
            yield (
                f"sampling_interval: expected about the mean distance of the instants, {mean:g} s, "
                f"got {axis.interval:g}."
            )


def _of_train(train: EventTrain) -> Iterator[str]:
    if train.times.ndim != 1:
        yield f"times: expected one dimension, got {train.times.ndim}."
    elif not np.all(np.isfinite(train.times)) or not np.all(np.diff(train.times) >= 0.0):
        yield "times: expected finite instants that ascend, got others."
    if not (isfinite(train.resolution) and train.resolution >= 0.0):
        yield f"resolution: expected a number >= 0, got {train.resolution:g}."
    if train.window is not None:
        start, end = train.window
        if not (isfinite(start) and isfinite(end) and start < end):
            yield f"window: expected a start before an end, got {start:g} to {end:g} s."
    try:
        masked = masked_spans(train)
    except ValueError:
        yield f"masked: expected start, end, start, end, ... in s, got {str(train.attrs['masked'])[:60]!r}."
    else:
        for start, end in masked:
            if not (isfinite(start) and isfinite(end) and start < end):
                yield f"masked: expected spans with a start before an end, got {start:g} to {end:g} s."


def masked_spans(train: EventTrain) -> tuple[tuple[float, float], ...]:
    """Return the spans (s) of a train's window in which no event could be seen.

    Raises
    ------
    ValueError
        The spans are no numbers, or the last start has no end.
    """
    ends = np.atleast_1d(np.asarray(train.attrs.get("masked", ()), dtype=np.float64)).ravel().tolist()
    return tuple(zip(ends[::2], ends[1::2], strict=True))
