"""Columns that are instants of events, not samples: spikes of a neuron, bounces of a ball."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroimpact.analysis.recording import EventTrain
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.importers.labels import is_time_name, seconds_in
from vibroimpact.hardware.importers.table import Column, Floats
from vibroimpact.hardware.printed_grid import common_step, decimal_step

_FEWEST = 3
_UNEVEN = 0.01
"""Of the mean interval: the spread from which on ascending numbers are no clock."""


def looks_like_events(column: Column) -> bool:
    """Whether a column is clearly one of instants: ascending from row to row, unevenly, and of no other unit."""
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


def event_train(
    name: str,
    column: Column,
    window: tuple[float, float] | None = None,
    masked: tuple[tuple[float, float], ...] = (),
) -> tuple[EventTrain, list[str]]:
    """Make an event train of a column, and say what was noticed.

    Parameters
    ----------
    name : str
    column : Column
        Instants, s.
    window : tuple of float or None
        Observed from, to, s.
    masked : tuple of tuple of float
        Parts of the window in which nothing could be seen, s.

    Raises
    ------
    DatasetError
        There are no instants, or they lie outside the window.
    """
    times, remarks = _ascending(name, column)
    if window is not None and (times[0] < window[0] or times[-1] > window[1]):
        raise DatasetError(
            f"{name}: expected events from {window[0]:g} to {window[1]:g} s (the window), got some from "
            f"{times[0]:g} to {times[-1]:g} s."
        )
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
            f"{name}: when the observation began and ended is not known (--window); the first and the last event "
            f"are at {times[0]:.6g} and {times[-1]:.6g} s"
        )
    return EventTrain(name, times, window, resolution, column.label, attrs), remarks


def _ascending(name: str, column: Column) -> tuple[Floats, list[str]]:
    """Return the instants in order."""
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
