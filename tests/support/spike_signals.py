"""Signals with known spikes: pulses at given instants, drift, noise of several kinds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

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
    """Return pulses that begin at `starts` (a bell has its peak five standard deviations later)."""
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
    """Return the time of half-sines above a threshold: length (1 - (2/pi) arcsin(H/A))."""
    return length * (1.0 - 2.0 / np.pi * np.arcsin(threshold / peaks))


RATE = 20_000.0
"""Sample rate of `SpikeRecord`, Hz."""
SHAPES = ("half sine", "biphasic", "ringing")
NOISES = ("white", "red", "low-pass", "high-pass")


class SpikeRecord:
    """A channel of spikes of one shape and height, at least three lengths apart, in noise of unit variance.

    Attributes
    ----------
    channel : Channel
    starts : ndarray of float, shape (spike,)
        Start times, s.
    length : float
        Length of a spike, ringing included, s.
    """

    def __init__(
        self, rng: np.random.Generator, shape: str, ratio: float, kind: str, samples: int = 40_000
    ) -> None:
        values = _of_unit_variance(rng, kind, samples)
        spike, self.length = _spike(rng, shape, ratio)
        time = np.arange(samples) / RATE
        fit = int((time[-1] - 0.02) / (4.0 * self.length))
        count = min(fit, int(rng.uniform(0.0, 0.2) * time[-1] / self.length))
        room = time[-1] - 0.01 - count * 4.0 * self.length
        self.starts = 0.005 + np.sort(rng.uniform(0.0, room, count)) + 4.0 * self.length * np.arange(count)
        height = ratio * rng.choice([-1.0, 1.0])
        for start in self.starts:
            near = slice(*np.searchsorted(time, [start, start + 8.0 * self.length]))
            values[near] += height * spike(time[near] - start)
        self.channel = channel(values, 1.0 / RATE, "V")

    def found_once(self, instants: Floats) -> tuple[int, int]:
        """Return the number of spikes that contain exactly one instant (s), and of instants outside of all spikes."""
        ends = self.starts + 1.5 * self.length
        within = (instants > self.starts[:, None] - 0.3 * self.length - 1e-4) & (instants < ends[:, None])
        return int(np.sum(within.sum(axis=1) == 1)), int(np.sum(~within.any(axis=0)))


def _spike(rng: np.random.Generator, shape: str, ratio: float) -> tuple[Callable[[Floats], Floats], float]:
    """Return a spike of unit height as a function of the time since its start, s, and its length, s."""
    if shape == "half sine":
        length = rng.uniform(0.4e-3, 3e-3)
        return lambda time: np.where(time < length, np.sin(np.pi * time / length), 0.0), length
    if shape == "biphasic":
        wide = rng.uniform(0.2e-3, 0.6e-3)

        def two_phases(time: Floats) -> Floats:
            first, second = (time - 3.0 * wide) / wide, (time - 5.7 * wide) / (1.7 * wide)
            return np.exp(-(first**2) / 2.0) - 0.4 * np.exp(-(second**2) / 2.0)

        return two_phases, 9.0 * wide
    turn, decay = 2.0 * np.pi * rng.uniform(700.0, 2000.0), rng.uniform(1.5e-3, 4e-3)
    times = np.linspace(0.0, 2e-3, 2000)
    height = np.abs(np.exp(-times / decay) * np.sin(turn * times)).max()
    return lambda time: np.exp(-time / decay) * np.sin(turn * time) / height, decay * np.log(ratio)


def _of_unit_variance(rng: np.random.Generator, kind: str, samples: int) -> Floats:
    settled = 2000
    white = rng.standard_normal(samples + settled)
    if kind == "red":
        noise = lfilter([1.0], [1.0, -0.7], white)
    elif kind == "low-pass":
        noise = lfilter(*butter(2, 0.2), white)
    elif kind == "high-pass":
        noise = lfilter([1.0, -0.7], [1.0], white)
    else:
        noise = white
    noise = noise[settled:]
    return np.asarray(noise / noise.std())
