"""The pulses of spikes: peak between the samples, impulse down to the baseline, duration.

Thesis sections 5.2.1 and 5.3, equations (5.3) and (5.4). Every quantity of a spike belongs to the largest excursion
of its group; the ringing after it is no contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording.channels import PAUSE
from vibroimpact.analysis.spikes.detection import crossing
from vibroimpact.analysis.spikes.identify import Identification
from vibroimpact.analysis.spikes.waveforms import WAVEFORMS, WaveformFit, chosen_waveform, fit_waveforms
from vibroimpact.fmus.errors import UsageError

Floats = NDArray[np.float64]

#: Foot of a pulse, relative to its peak.
FOOT = 0.05
#: Standard deviations of the noise below which no foot is searched.
_FOOT_NOISE = 3.0
#: Samples on each side of a peak in its band-limited interpolation, and interpolated points between two samples.
_SAMPLES_OUTSIDE = 32
_POINTS_BETWEEN = 16


@dataclass(frozen=True, slots=True)
class Pulses:
    """The pulses of the spikes found; every array has the shape (spike,), every number its SI unit.

    Attributes
    ----------
    start, end : ndarray of float
        First crossing of the threshold by the spike, and the end of its ringing, s.
    peak_time : ndarray of float
    duration : ndarray of float
        Time above the threshold, s.
    length : ndarray of float
        Time between the feet, s.
    peak, peak_error : ndarray of float
        Band-limited peak, signed, and its error: noise and resampling.
    sampled_peak : ndarray of float
        The largest sample.
    deficit : ndarray of float
        Largest possible shortfall of the largest sample from the peak of a half-sine of this length.
    impulse, impulse_error : ndarray of float
        Impulse down to the baseline, and its error; unit times s.
    impulse_above : ndarray of float
        Impulse only while above the threshold, as in thesis section 5.3; it depends on the threshold.
    excursions : ndarray of int
        Number of passes of the threshold, ringing included.
    complete : ndarray of bool
        Whether both feet are within the record.
    clipped : ndarray of bool
        Whether a sample of the pulse is clipped or missing.
    waveform : str
        The curve that fits the pulses best; it extends the impulse to the baseline.
    fits : dict of WaveformFit
    """

    start: Floats
    end: Floats
    peak_time: Floats
    duration: Floats
    length: Floats
    peak: Floats
    peak_error: Floats
    sampled_peak: Floats
    deficit: Floats
    impulse: Floats
    impulse_error: Floats
    impulse_above: Floats
    excursions: NDArray[np.int64]
    complete: NDArray[np.bool_]
    clipped: NDArray[np.bool_]
    waveform: str
    fits: dict[str, WaveformFit]

    def __len__(self) -> int:
        """Return the number of spikes."""
        return len(self.start)


@dataclass(frozen=True, slots=True)
class _Pulse:
    """One pulse between its feet, in its own sign."""

    time: Floats
    values: Floats
    sign: float
    level: float
    top: int
    complete: bool


def measure_pulses(found: Identification, foot: float = FOOT, waveform: str = "auto") -> Pulses:
    """Return the pulses of all spikes found, measured.

    The impulse is integrated between the feet, where the pulse has fallen to 5 % of its peak (or to three standard
    deviations of the noise). It is divided by the share of the best waveform between these levels: .9987 for a
    half-sine, .9952 for a haversine, .9856 for a bell. So it does not depend on the threshold, and neither ringing
    nor drift far from the pulse contributes.

    Parameters
    ----------
    found : Identification
    foot : float
        Level of the feet as a share of the peak, 0 to 0.5.
    waveform : {"auto", "half_sine", "haversine", "bell"}
        Waveform for the impulse below the feet.

    Raises
    ------
    UsageError
        `foot` or `waveform` is out of range.
    """
    if not 0.0 < foot <= 0.5:
        raise UsageError(f"foot: expected 0 < foot <= 0.5, got {foot!r}.")
    if waveform != "auto" and waveform not in WAVEFORMS:
        raise UsageError(f"waveform: expected one of auto, {', '.join(WAVEFORMS)}, got {waveform!r}.")
    spikes = [_cut_out(found, group.main, foot) for group in found.groups]
    levels = np.array([pulse.level for pulse in spikes])
    fits = fit_waveforms([(pulse.time, pulse.values * pulse.sign) for pulse in spikes], levels)
    chosen = chosen_waveform(fits) if waveform == "auto" else waveform
    rows = [_measured(found, number, pulse, chosen) for number, pulse in enumerate(spikes)]

    def column(name: str) -> Floats:
        return np.array([row[name] for row in rows], dtype=np.float64)

    return Pulses(
        start=np.array([found.excursions.up[group.first] for group in found.groups], dtype=np.float64),
        end=np.array(
            [found.time[found.excursions.last[group.last]] for group in found.groups], dtype=np.float64
        ),
        peak_time=column("peak_time"),
        duration=column("duration"),
        length=column("length"),
        peak=column("peak"),
        peak_error=column("peak_error"),
        sampled_peak=column("sampled_peak"),
        deficit=column("deficit"),
        impulse=column("impulse"),
        impulse_error=column("impulse_error"),
        impulse_above=column("impulse_above"),
        excursions=np.array([group.last - group.first + 1 for group in found.groups], dtype=np.int64),
        complete=np.array([pulse.complete for pulse in spikes], dtype=bool),
        clipped=column("clipped") > 0.0,
        waveform=chosen,
        fits=fits,
    )


def _cut_out(found: Identification, excursion: int, foot: float) -> _Pulse:
    """Return the pulse of an excursion from foot to foot."""
    first, last = int(found.excursions.first[excursion]), int(found.excursions.last[excursion])
    top = first + int(np.argmax(np.abs(found.residual[first : last + 1])))
    sign = -1.0 if found.residual[top] < 0.0 else 1.0
    peak = float(sign * found.residual[top])
    level = min(0.5 * peak, max(foot * peak, _FOOT_NOISE * found.noise))
    begin = _foot_index(found.residual, top, sign, level, -1)
    end = _foot_index(found.residual, top, sign, level, 1)
    time, values = _stretch(found, sign, begin, end, level)
    complete = begin >= 0 and end < len(found.time)
    return _Pulse(time, values, sign, level / peak if peak > 0.0 else 1.0, top, complete)


def _foot_index(residual: Floats, top: int, sign: float, level: float, direction: int) -> int:
    """Return the first sample next to a peak that is not above a level; just outside the record if there is none."""
    reach = 64
    while True:
        part = (
            residual[top : top + reach]
            if direction > 0
            else residual[max(0, top - reach + 1) : top + 1][::-1]
        )
        below = np.flatnonzero(sign * part <= level)
        if below.size:
            return top + direction * int(below[0])
        if len(part) < reach:
            return len(residual) if direction > 0 else -1
        reach *= 4


def _stretch(found: Identification, sign: float, begin: int, end: int, level: float) -> tuple[Floats, Floats]:
    """Return instants and values from one crossing of a level to the next, the samples between them included."""
    first, stop = max(0, begin), min(len(found.time), end + 1)
    time, values = found.time[first:stop].copy(), sign * found.residual[first:stop]
    if begin >= 0:
        time[0], values[0] = crossing(time, values, 0, 1, level), level
    if end < len(found.time):
        time[-1], values[-1] = crossing(time, values, len(time) - 2, len(time) - 1, level), level
    return time, values


def _measured(found: Identification, number: int, pulse: _Pulse, waveform: str) -> dict[str, float]:
    """Return the numbers of `Pulses` for one spike."""
    interval = found.interval
    length = float(pulse.time[-1] - pulse.time[0])
    level = np.array([pulse.level])
    half_sine = max(interval, 0.5 * length / float(WAVEFORMS["half_sine"].half_width(level)[0]))
    sampled = float(pulse.sign * found.residual[pulse.top])
    peak, peak_time = _band_limited(found, pulse)
    # a half-sine exceeds its largest sample by at most 1 - cos(pi interval / (2 length))
    deficit = sampled * float(1.0 - np.cos(0.5 * np.pi * interval / half_sine))
    impulse, impulse_error = _impulse(found, pulse, waveform)
    touched = slice(*np.searchsorted(found.time, pulse.time[[0, -1]]))
    main = found.groups[number].main
    up, down = float(found.excursions.up[main]), float(found.excursions.down[main])
    return {
        "peak_time": peak_time,
        "duration": down - up,
        "length": length,
        "peak": pulse.sign * peak,
        "peak_error": float(np.hypot(found.noise, deficit)),
        "sampled_peak": pulse.sign * sampled,
        "deficit": deficit,
        "impulse": pulse.sign * impulse,
        "impulse_error": impulse_error,
        "impulse_above": pulse.sign * _impulse_between(found, pulse.sign, up, down),
        "clipped": float(np.any(found.clipped[touched]) or np.any(found.bad[touched])),
    }


def _impulse(found: Identification, pulse: _Pulse, waveform: str) -> tuple[float, float]:
    """Return the impulse down to the baseline, and its error from the noise and half the range of the waveforms."""
    between = float(np.trapezoid(pulse.values, pulse.time))
    level = np.array([pulse.level])
    parts = {name: float(each.part_above(level)[0]) for name, each in WAVEFORMS.items()}
    waveform_error = 0.5 * between * (1.0 / min(parts.values()) - 1.0 / max(parts.values()))
    length = max(found.interval, float(pulse.time[-1] - pulse.time[0]))
    noise = found.noise * float(np.sqrt(found.interval * length))
    return between / parts[waveform], float(np.hypot(noise, waveform_error))


def _impulse_between(found: Identification, sign: float, begin: float, end: float) -> float:
    """Return the integral of the residual from one instant to another."""
    first, stop = np.searchsorted(found.time, [begin, end])
    near = slice(max(0, first - 1), stop + 1)
    time = np.concatenate(([begin], found.time[first:stop], [end]))
    values = np.interp(time, found.time[near], sign * found.residual[near])
    return float(np.trapezoid(values, time))


def _band_limited(found: Identification, pulse: _Pulse) -> tuple[float, float]:
    """Return the peak between the samples and its instant, s.

    The samples about the peak, up to a pause of the record, lose the line through their ends. They are then one period
    of a band-limited function, which is evaluated at sixteen points between samples. A clipped peak is not
    interpolated: its samples do not determine the motion between them.
    """
    from scipy.signal import resample

    top = pulse.top
    first, stop = max(0, top - _SAMPLES_OUTSIDE), min(len(found.time), top + _SAMPLES_OUTSIDE + 1)
    pauses = first + 1 + np.flatnonzero(np.diff(found.time[first:stop]) > PAUSE * found.interval)
    first, stop = max([first, *pauses[pauses <= top]]), min([stop, *pauses[pauses > top]])
    part = pulse.sign * found.residual[first:stop]
    if stop - first < 8 or np.any(found.clipped[first:stop]) or np.any(found.bad[first:stop]):
        return float(part[top - first]), float(found.time[top])
    line = np.linspace(part[0], part[-1], len(part))
    fine = np.asarray(resample(part - line, len(part) * _POINTS_BETWEEN))
    places = np.arange(len(fine)) / _POINTS_BETWEEN
    fine = fine + np.interp(places, np.arange(len(part)), line)
    near = np.abs(places - (top - first)) <= 1.0
    best = int(np.argmax(np.where(near, fine, -np.inf)))
    time = float(np.interp(places[best], np.arange(len(part)), found.time[first:stop]))
    return float(max(fine[best], part[top - first])), time
