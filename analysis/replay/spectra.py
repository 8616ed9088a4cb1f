"""The frequency at which a signal is strongest, and the frequency resolution of the record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FEWEST_SAMPLES = 8
"""Smallest number of samples for a spectrum."""
PADDING = 8
"""Zero padding: points of the spectrum within one resolved frequency."""
LOWEST_CYCLES = 1.0
"""Cycles in the record below which a frequency is indistinguishable from a drift."""


@dataclass(frozen=True, slots=True)
class DominantFrequency:
    """The strongest line of a spectrum.

    Attributes
    ----------
    frequency : float
        Hz; NaN if the signal is constant or too short.
    resolution : float
        Hz, one over the length of the record: closer lines are not separable. The frequency of a single line is known
        better than this.
    uncertainty : float
        Hz, from the uncertainty of the sampling interval alone.
    """

    frequency: float
    resolution: float
    uncertainty: float


def dominant_frequency(
    time: Floats, values: Floats, *, interval_uncertainty: float = 0.0
) -> DominantFrequency:
    """Return the frequency of the highest peak of the Hann-windowed spectrum.

    The peak is refined by the parabola through the logarithms of its three highest points. Samples that are not
    finite, and uneven instants, are interpolated linearly; a clipped sample does little harm to a frequency.

    Parameters
    ----------
    time, values : ndarray of float, shape (sample,)
        s, ascending; and any unit.
    interval_uncertainty : float
        Relative uncertainty of the sampling interval.

    Examples
    --------
    >>> time = np.arange(400) * 1e-3
    >>> line = dominant_frequency(time, np.sin(2 * np.pi * 41.3 * time), interval_uncertainty=0.01)
    >>> round(line.frequency, 2), round(line.resolution, 2), round(line.uncertainty, 3)
    (41.3, 2.5, 0.413)
    """
    from scipy.fft import next_fast_len, rfft, rfftfreq
    from scipy.signal import get_window

    known = np.isfinite(values)
    if np.count_nonzero(known) < FEWEST_SAMPLES:
        return DominantFrequency(np.nan, np.nan, np.nan)
    count = len(time)
    even = np.linspace(time[0], time[-1], count)
    interval = float(even[1] - even[0])
    resolution = 1.0 / (count * interval)
    signal = np.interp(even, time[known], values[known])
    window = get_window("hann", count)
    signal = window * (signal - np.sum(window * signal) / np.sum(window))
    length = next_fast_len(PADDING * count)
    magnitude = np.abs(rfft(signal, length))
    frequencies = rfftfreq(length, interval)
    magnitude[frequencies < LOWEST_CYCLES * resolution] = 0.0
    peak = int(np.argmax(magnitude))
    if magnitude[peak] <= np.finfo(float).eps * np.max(np.abs(values[known])) * count:
        return DominantFrequency(np.nan, resolution, np.nan)
    frequency = float(frequencies[peak]) + _vertex(magnitude, peak) / (length * interval)
    return DominantFrequency(frequency, resolution, frequency * interval_uncertainty)


def _vertex(magnitude: Floats, peak: int) -> float:
    """Return the place where the parabola through a peak and its neighbours is highest, in steps from the peak."""
    if peak in (0, len(magnitude) - 1) or np.min(magnitude[peak - 1 : peak + 2]) <= 0.0:
        return 0.0
    left, middle, right = np.log(magnitude[peak - 1 : peak + 2])
    return float(0.5 * (left - right) / (left - 2.0 * middle + right))
