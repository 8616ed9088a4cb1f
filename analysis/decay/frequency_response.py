"""The frequency response between two channels, H1 and H2, and their coherence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.decay.samples import Floats, clock_remark, unit_power
from vibroimpact.analysis.recording import Channel, channel_of
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.wording import option

Complexes = NDArray[np.complex128]

WINDOWS = ("bartlett", "hann", "boxcar")
_SEGMENTS = 8
_SHORTEST = 16


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
        `|S_xy|^2 / (S_xx S_yy)`; 1 throughout where there is one segment only: then it says nothing.
    drive_power : ndarray of float, shape (line,)
        Spectral density of the drive over its largest.
    averages : float
        Independent segments; overlap counted as what it is worth.
    resolution : float
        Noise bandwidth of a line, Hz.
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
        Samples of a segment; by default the power of two that gives eight segments or more. As many as there
        are, or more: one segment of all samples, as a single transient wants it.
    window : {"bartlett", "hann", "boxcar"}
        `bartlett` is the periodic one: `1 - |j - M/2| / (M/2)`.
    start, stop : float, optional
        s; part of the record.

    Raises
    ------
    UsageError
        Unknown window, uneven sampling, or too few samples.
    """
    from scipy.signal import csd, get_window, welch

    if window not in WINDOWS:
        raise UsageError(f'{option("window")}: expected one of {", ".join(WINDOWS)}, got "{window}".')
    drive, response = channel_of(drive), channel_of(response)
    x, y, interval, remarks = _pair(drive, response, start, stop)
    count = len(x)
    if segment is None:
        segment = 1 << max(int(np.log2(count / (0.5 * (_SEGMENTS + 1)))), 4)
    segment = min(segment, count)
    if segment < _SHORTEST:
        raise UsageError(
            f"{option('segment')}: expected {_SHORTEST} samples or more, got {segment}. Take longer segments."
        )
    shape = get_window(window, segment, fftbins=True)
    options = {"fs": 1.0 / interval, "window": shape, "noverlap": segment // 2, "detrend": False}
    frequency, xx = welch(x, **options)
    _, yy = welch(y, **options)
    _, xy = csd(x, y, **options)
    # Without the offset line; a line on which nothing was driven has no response.
    lines = (frequency > 0.0) & (xx > 0.0) & (yy > 0.0) & (np.abs(xy) > 0.0)
    frequency, xx, yy, xy = frequency[lines], xx[lines], yy[lines], xy[lines]
    segments = 1 + (count - segment) // (segment - segment // 2)
    if segments == 1:
        remarks.append("one segment only: the coherence is 1 by construction and says nothing.")
    return FrequencyResponse(
        frequency,
        xy / xx,
        yy / np.conj(xy),
        np.minimum(np.abs(xy) ** 2 / (xx * yy), 1.0),
        xx / float(np.max(xx)),
        _independent(shape, segments),
        float(np.sum(shape**2) / np.sum(shape) ** 2 / interval),
        drive.axis.trigger == response.axis.trigger,
        (measured_unit(drive.unit).si, measured_unit(response.unit).si),
        tuple(remarks),
    )


def _independent(shape: Floats, segments: int) -> float:
    """Return how many independent segments overlapping ones are worth (Welch 1967)."""
    half = len(shape) // 2
    overlap = float(np.sum(shape[: len(shape) - half] * shape[half:]) / np.sum(shape**2)) ** 2
    return segments / (1.0 + 2.0 * overlap * (segments - 1.0) / segments)


def _pair(
    drive: Channel, response: Channel, start: float | None, stop: float | None
) -> tuple[Floats, Floats, float, list[str]]:
    """Return both signals in SI units on the instants of the drive, their interval, and remarks."""
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
            f"{drive.name} and {response.name}: expected {2 * _SHORTEST} samples or more in common, got {len(time)}. "
            f"Widen {option('start')} and {option('stop')}."
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
