"""The frequency response between two channels, H1 and H2, and their coherence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from vibroimpact.analysis.decay.leakage import NO_LEAKAGE, Leakage, leakage_of
from vibroimpact.analysis.decay.samples import WIDEN, Complexes, Floats, clock_remark, unit_power
from vibroimpact.analysis.recording import Channel, channel_of
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, message

WINDOWS = ("bartlett", "hann", "boxcar")
_SEGMENTS, _FEWEST_SEGMENTS = 8, 5
"""Default number of segments, and the smallest number after doubling their length; fewer give a poor coherence."""
_LINES = 4.0
"""Lines in the half-power bandwidth of the highest peak, below which segments become twice as long."""
_SHORTEST = 16
DRIVEN = 1e-3
"""Power of the drive at a line, relative to the largest, below which the line is ignored."""


@dataclass(frozen=True, slots=True)
class FrequencyResponse:
    """Response over drive, in units of the response per unit of the drive (SI).

    Attributes
    ----------
    frequency : ndarray of float, shape (line,)
        Hz; without 0.
    h1, h2 : ndarray of complex, shape (line,)
        `S_xy / S_xx` (noise on the response only) and `S_yy / S_yx` (noise on the drive only).
    coherence : ndarray of float, shape (line,)
        `|S_xy|^2 / (S_xx S_yy)`; 1 throughout for a single segment, and without meaning then.
    drive_power : ndarray of float, shape (line,)
        Spectral density of the drive, relative to its largest value.
    averages : float
        Number of independent segments equivalent to the overlapping ones.
    resolution : float
        Noise bandwidth of a line, Hz.
    leakage : Leakage
        Effect of the segments on the response, for this drive.
    common : float
        Number of neighbouring lines equivalent to one independent line, since the window correlates their errors.
    phase_known : bool
        Whether both channels share a clock.
    units : tuple of str
        SI units of drive and response.
    """

    frequency: Floats
    h1: Complexes
    h2: Complexes
    coherence: Floats
    drive_power: Floats
    averages: float
    resolution: float
    phase_known: bool = True
    units: tuple[str, str] = ("1", "1")
    remarks: tuple[str, ...] = ()
    leakage: Leakage = NO_LEAKAGE
    common: float = 1.0

    @property
    def unit(self) -> str:
        """CF unit of the response."""
        drive, response = self.units
        if drive == response:
            return "1"
        return " ".join(unit for unit in (response, unit_power(drive, -1)) if unit != "1")

    @property
    def relative_error(self) -> Floats:
        """Standard error of `|H1|` over `|H1|`: `sqrt((1 - coherence) / (2 averages coherence))`."""
        error: Floats = np.sqrt((1.0 - self.coherence) / (2.0 * self.averages * self.coherence))
        return error


def frequency_response(
    drive: Channel | xr.DataArray,
    response: Channel | xr.DataArray,
    *,
    segment: int | None = None,
    window: str = "bartlett",
    start: float | None = None,
    stop: float | None = None,
) -> FrequencyResponse:
    """Return the frequency response by averaged spectra (Welch; Bartlett window of thesis eq. B.1).

    Segments overlap by half; nothing is detrended but the mean of the whole record.

    Parameters
    ----------
    drive, response : Channel or xarray.DataArray
        Evenly sampled. On different axes the response is taken at the instants of the drive.
    segment : int, optional
        Samples of a segment, at most all: a single transient needs one segment of all samples. Default: the power of
        two that gives eight segments or more. It is doubled where the highest peak has fewer than four lines in its
        half-power bandwidth and five segments remain.
    window : {"bartlett", "hann", "boxcar"}
        `bartlett` is the periodic form: `1 - |j - M/2| / (M/2)`.
    start, stop : float, optional
        Part of the record, s.

    Raises
    ------
    UsageError
        Unknown window, uneven sampling, or too few samples.
    """
    if window not in WINDOWS:
        raise UsageError(
            message(Argument("window"), f': expected one of {", ".join(WINDOWS)}, got "{window}".')
        )
    drive, response = channel_of(drive), channel_of(response)
    x, y, interval, remarks = _pair(drive, response, start, stop)
    count = len(x)
    automatic = 1 << max(int(np.log2(count / (0.5 * (_SEGMENTS + 1)))), 4)
    chosen = min(automatic if segment is None else segment, count)
    if chosen < _SHORTEST:
        raise UsageError(
            message(
                Argument("segment"),
                f": expected {_SHORTEST} samples or more, got {chosen}. Take longer segments.",
            )
        )
    known = (
        drive.axis.trigger == response.axis.trigger,
        (measured_unit(drive.unit).si, measured_unit(response.unit).si),
    )
    found = _averaged(x, y, interval, window, chosen, known, remarks)
    if segment is None and _segments(count, 2 * chosen) >= _FEWEST_SEGMENTS and _narrow(found):
        return _averaged(x, y, interval, window, 2 * chosen, known, remarks)
    return found


def _segments(count: int, segment: int) -> int:
    return 1 + (count - segment) // (segment - segment // 2)


def _narrow(found: FrequencyResponse) -> bool:
    """Tell whether the highest peak of the driven lines has too few lines in its half-power bandwidth."""
    magnitude = np.abs(found.h1) * (found.drive_power > DRIVEN)
    low, high = half_power(found.frequency, magnitude)
    return bool(high - low < _LINES * (found.frequency[1] - found.frequency[0]))


def _averaged(
    x: Floats,
    y: Floats,
    interval: float,
    window: str,
    segment: int,
    known: tuple[bool, tuple[str, str]],
    remarks: list[str],
) -> FrequencyResponse:
    """Return the response by segments of this length; `known`: whether the phase is known, and the units."""
    from scipy.signal import csd, get_window, welch

    shape = get_window(window, segment, fftbins=True)
    options = {"fs": 1.0 / interval, "window": shape, "noverlap": segment // 2, "detrend": False}
    frequency, xx = welch(x, **options)
    _, yy = welch(y, **options)
    _, xy = csd(x, y, **options)
    # The offset line is left out; a line without drive has no response.
    lines = (frequency > 0.0) & (xx > 0.0) & (yy > 0.0) & (np.abs(xy) > 0.0)
    frequency, xx, yy, xy = frequency[lines], xx[lines], yy[lines], xy[lines]
    segments = _segments(len(x), segment)
    one = ["one segment only: the coherence is 1 by construction and says nothing."] if segments == 1 else []
    return FrequencyResponse(
        frequency,
        xy / xx,
        yy / np.conj(xy),
        np.minimum(np.abs(xy) ** 2 / (xx * yy), 1.0),
        xx / float(np.max(xx)),
        _independent(shape, segments),
        float(np.sum(shape**2) / np.sum(shape) ** 2 / interval),
        *known,
        (*remarks, *one),
        leakage_of(x, shape, interval, DRIVEN),
        _common(shape),
    )


def half_power(frequency: Floats, magnitude: Floats) -> tuple[float, float]:
    """Return both frequencies where the magnitude falls to its maximum over sqrt 2; NaN where it does not."""
    top = int(np.argmax(magnitude))
    level = _highest(magnitude, top) / np.sqrt(2.0)
    below = np.flatnonzero(magnitude < level)
    left, right = below[below < top], below[below > top]

    def crossing(low: int, high: int) -> float:
        share = (level - magnitude[low]) / (magnitude[high] - magnitude[low])
        return float(frequency[low] + share * (frequency[high] - frequency[low]))

    return (
        crossing(int(left[-1]), int(left[-1]) + 1) if len(left) else np.nan,
        crossing(int(right[0]), int(right[0]) - 1) if len(right) else np.nan,
    )


def _highest(magnitude: Floats, top: int) -> float:
    """Return the height of the parabola through the highest value and its neighbours."""
    if not 0 < top < len(magnitude) - 1:
        return float(magnitude[top])
    before, here, after = magnitude[top - 1 : top + 2]
    bend = before - 2.0 * here + after
    return float(here - (after - before) ** 2 / (8.0 * bend)) if bend < 0.0 else float(here)


def _common(shape: Floats) -> float:
    """Return the number of correlated lines equivalent to one: the sum of their errors' squared correlations."""
    spectrum = np.abs(np.fft.fft(shape**2)) / float(np.sum(shape**2))
    return float(np.sum(spectrum**4))


def _independent(shape: Floats, segments: int) -> float:
    """Return the number of independent segments equivalent to the overlapping ones (Welch 1967)."""
    half = len(shape) // 2
    overlap = float(np.sum(shape[: len(shape) - half] * shape[half:]) / np.sum(shape**2)) ** 2
    return segments / (1.0 + 2.0 * overlap * (segments - 1.0) / segments)


def _pair(
    drive: Channel, response: Channel, start: float | None, stop: float | None
) -> tuple[Floats, Floats, float, list[str]]:
    """Return both signals in SI units at the instants of the drive, their interval, and remarks."""
    for channel in (drive, response):
        if channel.axis.interval is None:
            raise UsageError(
                f"{channel.name}: expected even sampling for a frequency response, got uneven times. "
                "Import it with a rate, or fit its decay instead."
            )
    remarks = clock_remark(drive)
    low = max(drive.time[0], response.time[0], -np.inf if start is None else start)
    high = min(drive.time[-1], response.time[-1], np.inf if stop is None else stop)
    time = drive.time[(drive.time >= low) & (drive.time <= high)]
    if len(time) < 2 * _SHORTEST:
        raise UsageError(
            message(
                f"{drive.name} and {response.name}: expected {2 * _SHORTEST} samples or more in common, got "
                f"{len(time)}. ",
                WIDEN,
            )
        )
    signals = []
    for channel in (drive, response):
        bad = int(np.count_nonzero(~channel.good))
        if bad:
            remarks.append(f"{channel.name}: {bad} clipped or missing samples are bridged by straight lines.")
        if not np.any(channel.good):
            raise UsageError(f"{channel.name}: expected good samples, got none.")
        signals.append(np.interp(time, channel.time[channel.good], channel.si()[channel.good]))
    if drive.axis.trigger != response.axis.trigger:
        remarks.append("the channels have triggers of their own: the phase of the response is not known.")
    interval = float(time[-1] - time[0]) / (len(time) - 1)
    return signals[0] - np.mean(signals[0]), signals[1] - np.mean(signals[1]), interval, remarks
