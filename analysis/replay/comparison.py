"""Comparison of a simulated response with the measured one: alignment, residual, all scores, and a baseline score.

The measured samples stay as they are (only their offset is removed). The simulated signal, smooth and free of noise,
is brought to their instants, their clock and their sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel, Quality
from vibroimpact.analysis.replay.alignment import Alignment, Interpolated, align
from vibroimpact.analysis.replay.event import ChannelEvent, find_event
from vibroimpact.analysis.replay.held import Held, held_over
from vibroimpact.analysis.replay.matching import EventMatch, match_events
from vibroimpact.analysis.replay.peaks import PeakErrors, compare_peaks
from vibroimpact.analysis.replay.scoring import (
    Span,
    best_gain,
    running_windows,
    variance_accounted_for,
    windowed_variance,
)
from vibroimpact.analysis.replay.spectra import DominantFrequency, dominant_frequency
from vibroimpact.fmus.errors import EstimationError

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

RUNNING_WINDOWS = 10
"""Number of running windows for the record after the onset."""
RUNNING_PERIODS = 2.0
"""Smallest number of dominant periods of the event in a running window."""
EVENT_TOLERANCE = 0.25
"""Share of the dominant period up to which events are paired."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """One simulated signal compared with one measured channel; values in the SI unit of the channel.

    Attributes
    ----------
    measured : Channel
        The channel as it was recorded.
    simulated_name : str
        Name of the simulated signal.
    values : ndarray of float, shape (sample,)
        Measured values minus the offset.
    simulated : ndarray of float, shape (sample,)
        At the instants, on the clock and with the sign of the measured channel; NaN without a simulated value.
    scored : ndarray of bool, shape (sample,)
        Mask of the good measured samples with a simulated value.
    event : ChannelEvent
        Event of the measured channel: onset, noise, dominant period.
    offset : float
        Offset removed from the measured values.
    alignment : Alignment
    variance : float
        Variance accounted for over all scored samples, percent.
    windows : list of tuple of float
        Requested windows, s from the onset.
    running : list of tuple of float
        Consecutive windows from the onset to the end, s from the onset.
    peaks : PeakErrors or None
        Peaks in the requested window.
    events : EventMatch or None
        Events of both signals, if they were given, on the clock of the channel.
    remarks : tuple of str
    """

    measured: Channel
    simulated_name: str
    values: Floats
    simulated: Floats
    scored: Flags
    event: ChannelEvent
    offset: float
    alignment: Alignment
    variance: float
    windows: list[Span]
    running: list[Span]
    peaks: PeakErrors | None
    events: EventMatch | None
    remarks: tuple[str, ...]

    @property
    def residual(self) -> Floats:
        """Measured minus simulated values, shape (sample,); NaN without a simulated value."""
        return self.values - self.simulated

    @property
    def noise_ceiling(self) -> float:
        """Score of a perfect model under the noise before the event, percent; NaN where the noise is unknown."""
        variance = float(np.var(self.values[self.scored]))
        return 100.0 * (1.0 - self.event.noise**2 / variance) if variance > 0.0 else float("nan")

    @property
    def gain(self) -> float:
        """Factor on the simulated signal that brings it nearest; 1 if its size is right."""
        return best_gain(self.values, self.simulated, self.scored)

    @property
    def window_variance(self) -> Floats:
        """Scores of the requested windows, percent, shape (window,)."""
        return self._variance_in(self.windows)

    @property
    def running_variance(self) -> Floats:
        """Scores of the running windows, percent, shape (running window,)."""
        return self._variance_in(self.running)

    @property
    def running_ceiling(self) -> Floats:
        """Scores of a perfect model in the running windows, percent, shape (running window,)."""
        clock = self.measured.time - self.event.onset
        noise = np.full(len(clock), self.event.noise)
        return windowed_variance(clock, self.values, self.values + noise, self.scored, self.running)

    @property
    def held(self) -> Held:
        """The span over which the simulation stays within the trusted error, from the running windows."""
        since = "the onset" if self.event.quiet is not None else "the start of the record"
        return held_over(self.running, self.running_variance, self.running_ceiling, since=since)

    def _variance_in(self, windows: list[Span]) -> Floats:
        clock = self.measured.time - self.event.onset
        return windowed_variance(clock, self.values, self.simulated, self.scored, windows)

    @property
    def measured_frequency(self) -> DominantFrequency:
        """Dominant frequency of the measured signal over the event, Hz."""
        return self._line(self.values)

    @property
    def simulated_frequency(self) -> DominantFrequency:
        """Dominant frequency of the simulated signal over the same stretch, Hz."""
        # a record on the same uncertain clock drives it, so the same uncertainty holds
        return self._line(self.simulated)

    def _line(self, values: Floats) -> DominantFrequency:
        time = self.measured.time
        rows = (time >= self.event.onset) & (time <= self.event.end) & np.isfinite(self.simulated)
        uncertainty = self.measured.axis.interval_uncertainty
        return dominant_frequency(time[rows], values[rows], interval_uncertainty=uncertainty)

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of samples that were scored, and of samples left out, by reason."""
        quality = self.measured.quality
        clipped = (quality & np.uint8(Quality.clipped)) != 0
        bad = ~self.measured.good & ~clipped
        return {
            "scored": int(np.count_nonzero(self.scored)),
            "clipped": int(np.count_nonzero(clipped)),
            "missing": int(np.count_nonzero(bad)),
            "not_simulated": int(np.count_nonzero(self.measured.good & ~np.isfinite(self.simulated))),
        }


def compare(
    simulated_time: Floats,
    simulated: Floats,
    measured: Channel,
    *,
    most_lag: float | None = None,
    lag: Literal["auto"] | float = "auto",
    polarity: Literal["auto"] | int = "auto",
    event_window: Span | None = None,
    offset: Literal["before", "level", "none"] | float = "before",
    windows: Sequence[Span] = (),
    peak_window: Span | None = None,
    measured_events: Floats | None = None,
    simulated_events: Floats | None = None,
    simulated_name: str = "simulated",
) -> Comparison:
    """Compare a simulated signal with a measured channel.

    Parameters
    ----------
    simulated_time, simulated : ndarray of float, shape (simulated sample,)
        s on the clock of the drive, ascending; values in the SI unit of the channel.
    measured : Channel
    most_lag : float, optional
        s, largest lag searched if `lag` is "auto"; default: half of the record.
    lag, polarity, event_window
        As in `align`. Give lag=0.0 and polarity=1 for channels with one trigger and known sign.
    offset : {"before", "level", "none"} or float
        Offset to remove from the measured values, as a value in the SI unit or by a rule. "before": their mean before
        the event. "level": the difference of the means of both signals. It suits a sensor without a zero whose record
        does not begin quietly, but hides a constant error of the model. "none": no offset.
    windows : sequence of tuple of float
        Windows to score one by one, s from the onset of the event.
    peak_window : tuple of float, optional
        Window for the comparison of extremes, s from the onset.
    measured_events, simulated_events : ndarray of float, shape (event,), optional
        s, each on its own clock: impacts, or spikes.
    simulated_name : str
        Name of the simulated signal in tables: `beam.sensor.acceleration`.

    Raises
    ------
    EstimationError
        Too few good samples in the channel, or the simulation does not overlap it.
    """
    event = find_event(measured)
    time, values = measured.time, measured.si()
    alignment = align(
        simulated_time,
        simulated,
        measured,
        most_lag=0.5 * float(time[-1] - time[0]) if most_lag is None else most_lag,
        event_window=event_window,
        polarity=polarity,
        lag=lag,
        event=event,
    )
    shifted = _shifted(simulated_time, simulated, measured, alignment)
    scored = measured.good & np.isfinite(shifted)
    removed = _offset(offset, event, values[scored], shifted[scored])
    values = values - removed
    peaks = None
    if peak_window is not None:
        # heights count from the rest value: 0 if the offset before the event was removed, otherwise the mean
        level = 0.0 if offset == "before" and event.quiet is not None else float(np.mean(values[scored]))
        peaks = compare_peaks(time - event.onset, values, shifted, scored, peak_window, event.period, level)
    stretch = float(time[-1]) - event.onset
    length = max(stretch / RUNNING_WINDOWS, RUNNING_PERIODS * event.period)
    return Comparison(
        measured=measured,
        simulated_name=simulated_name,
        values=values,
        simulated=shifted,
        scored=scored,
        event=event,
        offset=removed,
        alignment=alignment,
        variance=variance_accounted_for(values, shifted, scored),
        windows=list(windows),
        # the last sample is within the last window
        running=running_windows(0.0, stretch * (1.0 + 1e-9), length),
        peaks=peaks,
        events=_matched(measured_events, simulated_events, alignment.lag, EVENT_TOLERANCE * event.period),
        remarks=(*alignment.remarks, *_remarks(measured, event, offset, scored)),
    )


def _shifted(simulated_time: Floats, simulated: Floats, measured: Channel, alignment: Alignment) -> Floats:
    """Return the simulated signal at the measured instants, NaN without a simulated value."""
    model = Interpolated(simulated_time, simulated)
    at = measured.time - alignment.lag
    # a lag of zero must not lose the first or the last sample by rounding
    slack = 1e-9 * (model.end - model.start)
    inside = (at >= model.start - slack) & (at <= model.end + slack)
    if np.count_nonzero(inside & measured.good) < 2:
        raise EstimationError(
            f"{measured.name}: expected a simulation that overlaps the recording, on the clock of the drive "
            f"{at[0]:.6g} s to {at[-1]:.6g} s, got one of {model.start:.6g} s to {model.end:.6g} s. "
            "Simulate this stretch, or give the lag."
        )
    return np.where(inside, alignment.polarity * model(at), np.nan)


def _offset(offset: str | float, event: ChannelEvent, values: Floats, shifted: Floats) -> float:
    if offset == "level":
        return float(np.mean(values) - np.mean(shifted))
    return {"before": event.offset, "none": 0.0}[offset] if isinstance(offset, str) else float(offset)


def _matched(
    measured: Floats | None, simulated: Floats | None, lag: float, tolerance: float
) -> EventMatch | None:
    if measured is None and simulated is None:
        return None
    own, others = (np.asarray(() if t is None else t, dtype=np.float64) for t in (measured, simulated))
    return match_events(own, others + lag, tolerance)


def _remarks(measured: Channel, event: ChannelEvent, offset: str | float, scored: Flags) -> list[str]:
    """Return remarks on the parts of the record that were not scored, and on unknown quantities."""
    found = []
    if event.quiet is None and offset == "before":
        found.append(
            "the recording does not begin quietly (a continuous signal, or noise only): its offset could not be "
            "estimated and was left, and the start of the record stands for the onset of the event"
        )
    good, done = int(np.count_nonzero(measured.good)), int(np.count_nonzero(scored))
    if done < good:
        found.append(f"{good - done} good samples lie outside the simulated time and are not scored")
    if good < len(scored):
        found.append(f"{len(scored) - good} samples are clipped, missing or out of range and are not scored")
    if measured.axis.interval_uncertainty > 0.0:
        found.append(
            f"the sampling interval is uncertain by {100 * measured.axis.interval_uncertainty:.2g} %: so is "
            "every frequency"
        )
    return found


def naive_variance(
    drive_time: Floats,
    drive: Floats,
    measured: Channel,
    *,
    most_lag: float,
    lag: Literal["auto"] | float = "auto",
    event_window: tuple[float, float] | None = None,
) -> float:
    """Return the variance that the drive itself accounts for, with its best gain and offset, percent.

    A body that follows its base rigidly would reach 100. No response at all scores 0, so the result is never less.
    Lag and polarity are found as for a replay. Gain and offset are the best of the whole record, an advantage that a
    replay does not have.

    Parameters
    ----------
    drive_time, drive : ndarray of float, shape (drive sample,)
        s, ascending; any unit. The drive is constant before and after.
    measured : Channel
    most_lag, lag, event_window
        As in `align`.
    """
    found = align(drive_time, drive, measured, most_lag=most_lag, lag=lag, event_window=event_window)
    good = measured.good
    shifted = Interpolated(drive_time, drive)(measured.time[good] - found.lag)
    shifted = shifted - np.mean(shifted)
    values = measured.si()[good]
    values = values - np.mean(values)
    size = float(np.sum(shifted**2) * np.sum(values**2))
    return 100.0 * float(np.sum(shifted * values)) ** 2 / size if size > 0.0 else 0.0
