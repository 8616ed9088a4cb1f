"""Columns of instants of events instead of samples: spikes of a neuron, bounces of a ball."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroimpact.analysis.recording import EventTrain
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.hardware.formats.labels import is_time_name, seconds_in
from vibroimpact.hardware.formats.table import Column, Floats, Table
from vibroimpact.hardware.recordings.printed_grid import common_step, decimal_step
from vibroimpact.hardware.recordings.time_axis import Placement

_FEWEST = 3
_FEW_ONES = 0.2
"""Largest share of ones for which a column of 0 and 1 has events."""
_UNEVEN = 0.01
"""Standard deviation of the steps, in mean steps, above which ascending numbers are no clock."""


def looks_like_events(column: Column) -> bool:
    """Whether a column clearly has instants of events: ascending from row to row, unevenly, and in no other unit."""
    values = column.values
    if len(values) < _FEWEST or column.interval is not None or column.overrange is not None:
        return False
    if column.unit and seconds_in(column.unit) is None:
        return False
    steps = np.diff(values)
    if not np.all(np.isfinite(values)) or not np.all(steps > 0.0):
        return False
    # whole numbers in a row are counts, unless their heading says time
    if np.all(values == np.rint(values)) and not is_time_name(column.label) and not column.unit:
        return False
    return float(steps.std()) > max(_UNEVEN * float(steps.mean()), decimal_step(values))


def is_raster(table: Table, choice: bool | None = None) -> bool:
    """Whether the columns of a table hold only 0 and 1, as trials of a raster do, so that each 1 is an event.

    `choice` is the user's choice: all columns are events, or none is. Without a choice the ones must be few and
    isolated: a column that stays at 1 is the level of a switch.
    """
    if choice is False or not table.columns:
        return False
    ones = [column.values == 1.0 for column in table.columns]
    known = all(
        bool(np.all(one | (column.values == 0.0))) for one, column in zip(ones, table.columns, strict=True)
    )
    if not known or not any(one.any() for one in ones):
        return False
    return bool(choice) or all(
        float(np.mean(one)) <= _FEW_ONES and not np.any(one[1:] & one[:-1]) for one in ones if len(one)
    )


def raster_train(
    name: str,
    column: Column,
    placement: Placement,
    window: tuple[float, float] | None,
    masked: tuple[tuple[float, float], ...],
) -> EventTrain | None:
    """Return the instants at which a column of 0 and 1 becomes 1; None if it never does.

    The observation is the window (from, to, s), else its axis, without the masked parts, s.
    """
    axis = placement.axis
    on = (placement.row >= 0) & (column.values[placement.row] == 1.0)
    times = axis.time[on & ~np.append(False, on[:-1])]
    if not len(times):
        return None
    observed = window or (float(axis.time[0]), float(axis.time[-1]))
    _check_window(name, times, observed)
    attrs = {"masked": np.array(masked, dtype=np.float64).ravel()} if masked else {}
    return EventTrain(name, times, observed, axis.interval or 0.0, column.label, attrs)


def _check_window(name: str, times: Floats, window: tuple[float, float]) -> None:
    if times[0] < window[0] or times[-1] > window[1]:
        raise DatasetError(
            f"{name}: expected events from {window[0]:g} to {window[1]:g} s (the window), got some from "
            f"{times[0]:g} to {times[-1]:g} s."
        )


def event_train(
    name: str,
    column: Column,
    window: tuple[float, float] | None = None,
    masked: tuple[tuple[float, float], ...] = (),
) -> tuple[EventTrain, list[str]]:
    """Return an event train from a column of instants, s, and remarks.

    The observation is the window (from, to, s), without the masked parts, s. DatasetError: there are no instants, or
    some lie outside the window.
    """
    times, remarks = _ascending(name, column)
    if window is not None:
        _check_window(name, times, window)
    digits = decimal_step(times)
    intervals = np.diff(times)
    resolution = common_step(intervals[intervals > 0.0], digits) or digits
    if resolution:
        distinct = len(np.unique(np.rint(intervals / digits)))
        how = "printed to" if resolution == digits else f"printed to {digits:g} s, on a grid of about"
        remarks.append(
            f"{name}: {len(times)} instants {how} {resolution:.4g} s; {distinct} distinct intervals"
        )
    attrs: dict[str, Any] = {}
    if masked:
        attrs["masked"] = np.array(masked, dtype=np.float64).ravel()
        remarks.append(f"{name}: {len(masked)} parts of the observation are masked")
    if window is None:
        remarks.append(
            message(
                *(f"{name}: when the observation began and ended is not known (", Argument("window")),
                f"); the first and the last event are at {times[0]:.6g} and {times[-1]:.6g} s",
            )
        )
    return EventTrain(name, times, window, resolution, column.label, attrs), remarks


def _ascending(name: str, column: Column) -> tuple[Floats, list[str]]:
    """Return the instants in order, and remarks."""
    known = column.values[np.isfinite(column.values)]
    if not len(known):
        raise DatasetError(f"{name}: expected instants of events, got none.")
    remarks = []
    if len(known) < len(column.values):
        remarks.append(f"{name}: {len(column.values) - len(known)} cells hold no instant and are left out")
    if np.any(np.diff(known) < 0.0):
        back = int(np.sum(np.diff(known) < 0.0))
        remarks.append(f"{name}: the instants go back {back} times; they are put in order")
        known = np.sort(known)
    again = int(np.sum(np.diff(known) == 0.0))
    if again:
        remarks.append(f"{name}: {again} events have the instant of the one before")
    return known, remarks
