"""The slowly moving offset of a signal: a running median, immune to spikes that take less than half the time.

Thesis section 5.2.2: the zero of a strain gauge drifts during an experiment, and with it the meaning of a threshold.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.robust import robust_sigma

Floats = NDArray[np.float64]

#: Smallest number of samples whose median serves as an offset.
_FEWEST_SAMPLES = 32
#: Share of a block's samples, free of spikes, below which its median is not used.
_LEAST_FREE = 0.25
#: Relative decrease of the noise above which a window half as long is used.
_LEAST_DECREASE = 0.05
#: Shortest window, in lengths of the longest spike, which then moves its median by 3 % of the noise.
_SPIKES_IN_WINDOW = 20


def running_median(values: Floats, window: int, used: NDArray[np.bool_] | None = None) -> Floats:
    """Return medians, shape (sample,), of windows that overlap by half, joined by straight lines.

    The window is in samples; a window as long as the signal gives one constant. A window with less than a quarter of
    its samples `used` is bridged.

    >>> signal = np.full(100, 3.0)
    >>> signal[40:44] = 50.0
    >>> float(np.ptp(running_median(signal, 40)))
    0.0
    """
    length = len(values)
    kept = np.ones(length, dtype=bool) if used is None else used
    if window >= length or length < 2 * _FEWEST_SAMPLES:
        return np.full(length, float(np.median(values[kept])) if np.any(kept) else 0.0)
    centres, medians = [], []
    for start in range(0, length - window // 2, max(1, window // 2)):
        stop = min(start + window, length)
        part = values[start:stop][kept[start:stop]]
        if part.size >= _LEAST_FREE * (stop - start):
            centres.append(0.5 * (start + stop - 1))
            medians.append(float(np.median(part)))
    if not medians:
        return running_median(values, length, used)
    # extended by straight lines to both ends: a constant there would turn the slope of the drift into a spike
    for end, neighbour, place in ((0, 1, -0.5), (-1, -2, length - 0.5)):
        if len(medians) > 1 and len(centres) > 1:
            slope = (medians[end] - medians[neighbour]) / (centres[end] - centres[neighbour])
            value = medians[end] + slope * (place - centres[end])
            where = 0 if end == 0 else len(centres)
            centres.insert(where, place)
            medians.insert(where, value)
    return np.interp(np.arange(length), centres, medians)


def drift_window(values: Floats, longest_spike: int, used: NDArray[np.bool_]) -> int:
    """Return the longest window (samples) that follows the drift.

    Starting from the whole signal, the window is halved while that lowers the noise of the residual by more than 5 %.
    It is never shorter than 20 times the longest spike (samples). `used` are the samples outside spikes.
    """
    shortest = max(2 * _FEWEST_SAMPLES, _SPIKES_IN_WINDOW * longest_spike)
    window = len(values)
    best, lowest = window, robust_sigma((values - running_median(values, window, used))[used])
    while window // 2 >= shortest:
        window //= 2
        noise = robust_sigma((values - running_median(values, window, used))[used])
        if noise < (1.0 - _LEAST_DECREASE) * lowest:
            best, lowest = window, noise
    return best
