"""Recordings: measured or simulated signals, as importers write them and analyses read them.

A recording holds channels (sampled on one of its time axes), event trains (instants only) and single values. It is one
NetCDF file (CF-1.11) with its own schema, apart from the schema of runs; `docs/recordings.md` describes it in words.

`open_signals` returns the same type for a recording, for the time series of a simulated run, and for a replay. One
analysis therefore serves all three.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntFlag
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import lines_of

RECORDING_SCHEMA = "1"

Floats = NDArray[np.float64]
T = TypeVar("T")
#: Relative difference of intervals below which they count as even.
_EVEN = 1e-6
PAUSE = 1.5
"""Step, in median intervals, above which uneven instants have a pause."""


class Quality(IntFlag):
    """Faults of a sample; 0 means a good sample."""

    clipped = 1
    """At the limit of the measuring chain: the true value lies beyond the limit."""
    missing = 2
    """No sample was taken here, or it is NaN in the file; its value is NaN."""
    overrange = 4
    """The file has a marker of overrange or of an open input; its value is NaN."""
    suspect = 8
    """The value is kept, but its time was repeated or out of order."""


QUALITY_FLAGS = {
    "flag_masks": np.array([int(flag) for flag in Quality], dtype=np.uint8),
    "flag_meanings": " ".join(str(flag.name) for flag in Quality),
}
"""Attributes of a variable of `Quality`, as CF writes them."""


@dataclass(frozen=True, slots=True)
class TimeAxis:
    """Instants that some channels share.

    Attributes
    ----------
    time : ndarray of float, shape (sample,)
        s, ascending strictly.
    interval : float or None
        Sampling interval, s; None where the samples are not evenly spaced.
    interval_uncertainty : float
        Relative uncertainty of the interval, and so of every frequency. It is 0 where the file is consistent, and half
        the relative spread or more where the file contradicts itself.
    source : str
        Source of the instants, in words, with any contradictions.
    trigger : str
        Trigger that started the axis: axes of different triggers are shifted by an unknown lag.
    """

    time: Floats
    interval: float | None
    interval_uncertainty: float = 0.0
    source: str = ""
    trigger: str = ""

    @classmethod
    def through(cls, time: Floats, source: str = "") -> TimeAxis:
        """Return the axis of instants (s); it is even if the intervals differ only by rounding."""
        steps = np.diff(time)
        even = len(steps) > 0 and float(np.ptp(steps)) <= _EVEN * float(np.mean(steps))
        return cls(time, float(np.mean(steps)) if even else None, source=source)

    @property
    def pace(self) -> float:
        """Interval of samples, s; for uneven samples the mean, without the pauses between pieces of a record."""
        if self.interval is not None:
            return self.interval
        steps = np.diff(self.time)
        return float(np.mean(steps[steps <= PAUSE * np.median(steps)]))

    @property
    def rate(self) -> float:
        """Samples per second; the mean rate where they are not evenly spaced."""
        if self.interval is not None:
            return 1.0 / self.interval
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])


@dataclass(frozen=True, slots=True)
class Channel:
    """A sampled signal.

    Attributes
    ----------
    name : str
        Its name here and in the file of the recording: letters, digits, underscores.
    values : ndarray of float, shape (sample,)
        In `unit`; NaN where there is no value.
    unit : str
        CF unit, see `units.MeasuredUnit.cf`.
    axis : TimeAxis
    quality : ndarray of uint8, shape (sample,)
        Sums of `Quality`.
    label : str
        Name in the source.
    attrs : dict
        Further facts: `role` (measured, simulated, residual), `sensitivity`, `scale`, `offset`, ...
    """

    name: str
    values: Floats
    unit: str
    axis: TimeAxis
    quality: NDArray[np.uint8]
    label: str = ""
    attrs: dict[str, Any] = field(default_factory=dict)

    @property
    def time(self) -> Floats:
        """Instants of the samples, s."""
        return self.axis.time

    @property
    def good(self) -> NDArray[np.bool_]:
        """Mask of the samples that are plain measurements: finite, not clipped, not missing."""
        chosen: NDArray[np.bool_] = np.isfinite(self.values) & (
            (self.quality & ~np.uint8(Quality.suspect)) == 0
        )
        return chosen

    def between(self, start: float, stop: float) -> Channel:
        """Return the samples from start to stop (s), both included; the clock is unchanged."""
        rows = (self.time >= start) & (self.time <= stop)
        axis = replace(self.axis, time=self.time[rows])
        return replace(self, values=self.values[rows], quality=self.quality[rows], axis=axis)

    def si(self) -> Floats:
        """Return the values in the SI unit of their kind (`g` becomes m/s^2)."""
        return self.values * measured_unit(self.unit).factor


@dataclass(frozen=True, slots=True)
class EventTrain:
    """Instants at which something happened: spikes of a neuron, bounces, impacts of a simulation.

    Attributes
    ----------
    name : str
    times : ndarray of float, shape (event,)
        s, ascending; two may coincide.
    window : tuple of float or None
        Start and end of the observation, s; None: unknown, and the first and the last event take their place.
    resolution : float
        Grid on which the instants were written, s; 0 where no grid shows.
    label : str
        Name in the source.
    attrs : dict
        Further facts.
    """

    name: str
    times: Floats
    window: tuple[float, float] | None = None
    resolution: float = 0.0
    label: str = ""
    attrs: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SingleValue:
    """A number of a recording outside its channels: value and CF unit; NaN where it was beyond the range."""

    value: float
    unit: str = "1"
    label: str = ""
    overrange: bool = False


@dataclass(frozen=True, slots=True)
class Recording:
    """Channels, event trains and single values of one measurement, by name.

    Attributes
    ----------
    channels, events, scalars : mapping
    attrs : dict
        Provenance (`source_file`, `source_sha256`, `source_format`, ...) and `remarks`: one line for each fact that a
        reader must know (gaps, clipping, conflicting axes).
    """

    channels: Mapping[str, Channel]
    events: Mapping[str, EventTrain] = field(default_factory=dict)
    scalars: Mapping[str, SingleValue] = field(default_factory=dict)
    attrs: dict[str, Any] = field(default_factory=dict)

    @property
    def remarks(self) -> tuple[str, ...]:
        """The remarks of the recording, one string for each line."""
        found = self.attrs.get("remarks", "")
        return tuple(line for line in lines_of(found if isinstance(found, str) else str(found)) if line)

    @property
    def remarks_counted(self) -> tuple[str, ...]:
        """The number of import remarks and where to read them, in one line; empty without remarks."""
        if not self.remarks:
            return ()
        name, many = os.path.basename(self.title), len(self.remarks)
        counted = "1 remark of its import is" if many == 1 else f"{many} remarks of its import are"
        return (
            f"{name}: {counted} in its attribute `remarks` (`vibroimpact import {name} -o COPY.nc` shows them)",
        )

    @property
    def title(self) -> str:
        """Name of the recording in messages: its file."""
        return str(self.attrs.get("opened_from", "") or self.attrs.get("source_file", "") or "recording")

    def channel(self, name: str | None = None) -> Channel:
        """Return a channel by name, or the only one.

        Raises
        ------
        DatasetError
            No channel has that name, or there are several and no name is given; the message lists the names.
        """
        return _chosen(self.channels, name, "channel", self.title)

    def event_train(self, name: str | None = None) -> EventTrain:
        """Return an event train by name, or the only one; errors as for `channel`."""
        return _chosen(self.events, name, "event train", self.title)


def _chosen(found: Mapping[str, T], name: str | None, what: str, title: str) -> T:
    if not found:
        expected = "one" if name is None else f'"{name}"'
        raise DatasetError(f"{title}: {what}: expected {expected}, got a file without any.")
    names = ", ".join(found)
    if name is None:
        if len(found) == 1:
            return next(iter(found.values()))
        raise DatasetError(f"{title}: {what}: expected one to be named, got {len(found)}: {names}.")
    if name not in found:
        near = difflib.get_close_matches(name, list(found), 1)
        hint = f' Did you mean "{near[0]}"?' if near else ""
        raise DatasetError(f'{title}: {what}: expected one of {names}, got "{name}".{hint}')
    return found[name]
