"""Decaying cosines in short windows, and the first guess of frequency, decay rate and equilibrium."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.decay.samples import DecaySamples
from vibroimpact.fmus.errors import EstimationError

Floats = NDArray[np.float64]

FEWEST_PERIODS = 2.0
_MOST_GRID = 1 << 18
# A window of this part of the largest amplitude says nothing.
_NO_WEIGHT = 1e-9


@dataclass(frozen=True, slots=True)
class Envelope:
    """Amplitude and phase of an oscillation, window by window.

    Attributes
    ----------
    time, amplitude, phase, offset : ndarray of float, shape (window,)
        s (middle of the window), unit of the samples, rad (unwrapped, of `cos(phase)`), unit of the samples.
    """

    time: Floats
    amplitude: Floats
    phase: Floats
    offset: Floats


@dataclass(frozen=True, slots=True)
class FirstGuess:
    """Where a fit starts: angular frequency (rad/s), decay rate (1/s), equilibrium (unit of the samples)."""

    angular_frequency: float
    decay_rate: float
    offset: float
    envelope: Envelope


def first_guess(samples: DecaySamples) -> FirstGuess:
    """Return frequency, decay rate and equilibrium of the strongest oscillation.

    The frequency is the highest peak of the spectrum of the samples, interpolated to an even grid, then the mean
    slope of the phase of one-period windows; the decay rate is the slope of the logarithm of their amplitudes.

    Raises
    ------
    EstimationError
        Fewer than two periods are in the window, or nothing oscillates.
    """
    omega = _spectral_peak(samples)
    length = float(samples.time[-1] - samples.time[0])
    if omega * length < FEWEST_PERIODS * 2.0 * np.pi:
        raise EstimationError(
            f"{samples.name}: expected {FEWEST_PERIODS:g} periods of an oscillation or more, got "
            f"{omega * length / (2.0 * np.pi):.2g} in {length:.4g} s. Widen the window, or begin it after the shock."
        )
    decay_rate = 0.0
    for _ in range(3):
        envelope = windowed_cosines(samples, omega, decay_rate)
        weights = envelope.amplitude
        if len(weights) < 2 or not np.sort(weights)[-2] > _NO_WEIGHT * np.max(weights):
            break  # one window has no slope
        slope = np.polyfit(envelope.time, envelope.phase, 1, w=weights)[0]
        omega = float(slope) if 0.5 * omega < slope < 2.0 * omega else omega
        logarithm = np.log(np.maximum(envelope.amplitude, 1e-300))
        decay_rate = -float(np.polyfit(envelope.time, logarithm, 1, w=weights)[0])
    return FirstGuess(omega, decay_rate, float(np.median(envelope.offset)), envelope)


def _spectral_peak(samples: DecaySamples) -> float:
    """Return the angular frequency (rad/s) of the highest peak of the spectrum."""
    count = min(len(samples.time), _MOST_GRID)
    grid = np.linspace(samples.time[0], samples.time[-1], count)
    value = np.interp(grid, samples.time, samples.value)
    value = value - np.polyval(np.polyfit(grid - grid[0], value, 1), grid - grid[0])
    if not np.any(np.abs(value) > 1e-12 * np.max(np.abs(samples.value))):
        raise EstimationError(
            f"{samples.name}: expected an oscillation, got a constant. Choose another channel."
        )
    # No window: it would take away the start, where the oscillation is; the decay itself tapers the end. Below one
    # and a half periods in the record there is only what is left of drifts.
    power = np.abs(np.fft.rfft(value, 4 * count))
    peak = 6 + int(np.argmax(power[6:]))
    return 2.0 * np.pi * peak / (4 * count * float(grid[1] - grid[0]))


def windowed_cosines(samples: DecaySamples, omega: float, decay_rate: float) -> Envelope:
    """Fit `offset + e^(-decay_rate t) (C cos(omega t) + S sin(omega t))` in windows of one period.

    The decay within a window matters: without it, it would show as an offset, the same in all windows.
    Windows with fewer than six samples are left out.

    Parameters
    ----------
    samples : DecaySamples
    omega : float
        rad/s.
    decay_rate : float
        1/s.
    """
    length = 2.0 * np.pi / omega
    window = np.floor((samples.time - samples.time[0]) / length).astype(int)
    found = []
    for part in np.split(np.arange(len(window)), np.flatnonzero(np.diff(window)) + 1):
        if len(part) >= 6 and np.ptp(samples.time[part]) > 0.7 * length:
            found.append(_cosine(samples.time[part], samples.value[part], omega, decay_rate))
    if len(found) < 2:
        raise EstimationError(
            f"{samples.name}: expected two periods with six samples or more, got {len(found)}; the oscillation of "
            f"{omega / (2.0 * np.pi):.4g} Hz is sampled every {samples.mean_interval:.4g} s. Record faster, or longer."
        )
    time, amplitude, phase, offset = np.array(found).T
    # The phase beyond omega t moves slowly: it is what is unwrapped.
    return Envelope(time, amplitude, np.unwrap(phase - omega * time) + omega * time, offset)


def _cosine(
    time: Floats, value: Floats, omega: float, decay_rate: float
) -> tuple[float, float, float, float]:
    middle = 0.5 * (time[0] + time[-1])
    turn, decay = omega * (time - middle), np.exp(-decay_rate * (time - middle))
    columns = np.column_stack([decay * np.cos(turn), decay * np.sin(turn), np.ones_like(turn)])
    cosine, sine, offset = np.linalg.lstsq(columns, value, rcond=None)[0]
    return float(middle), float(np.hypot(cosine, sine)), float(np.arctan2(-sine, cosine)), float(offset)
