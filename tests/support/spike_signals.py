"""Signals whose spikes are known: pulses on given instants, drift, noise of several kinds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel, TimeAxis
from vibroimpact.analysis.spikes.waveforms import WAVEFORMS

Floats = NDArray[np.float64]


def channel(values: Floats, interval: float, unit: str = "N", start: float = 0.0) -> Channel:
    time = start + interval * np.arange(len(values))
    return Channel(
        "cell",
        np.asarray(values, np.float64),
        unit,
        TimeAxis(time, interval),
        np.zeros(len(values), np.uint8),
    )


def pulses(time: Floats, starts: Floats, peaks: Floats, length: float, waveform: str = "half_sine") -> Floats:
    """Return pulses that begin at `starts` (a bell five standard deviations after them)."""
    shape = WAVEFORMS[waveform]
    reach = 5.0 if waveform == "bell" else 0.5
    signal = np.zeros(len(time))
    for start, peak in zip(starts, peaks, strict=True):
        first, stop = np.searchsorted(time, [start, start + 2.0 * reach * length])
        signal[first:stop] += peak * shape.value((time[first:stop] - start) / length - reach)
    return signal


def pink(rng: np.random.Generator, length: int) -> Floats:
    """Return noise whose power falls as 1 / f, of unit variance."""
    frequency = np.maximum(np.arange(length // 2 + 1), 1.0)
    phases = rng.standard_normal((2, length // 2 + 1))
    noise = np.fft.irfft((phases[0] + 1j * phases[1]) / np.sqrt(frequency), length)
    return noise / noise.std()


def time_above(threshold: float, peaks: Floats, length: float) -> Floats:
    """Return how long half-sines are above a threshold: length (1 - (2/pi) arcsin(H/A))."""
    return length * (1.0 - 2.0 / np.pi * np.arcsin(threshold / peaks))
