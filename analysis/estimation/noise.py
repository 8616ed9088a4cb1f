"""The noise of a smooth signal with a few kinks, and the best window for it: both from the samples alone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.estimation.physics import Floats
from vibroimpact.analysis.robust import robust_sigma
from vibroimpact.fmus.errors import EstimationError

Mask = NDArray[np.bool_]

# Orders of the differences to try: each order shrinks a smooth signal by its radians per sample, but not noise.
_ORDERS = range(2, 9)
# Smallest noise, relative to the range of the signal; smaller values are rounding.
_ROUNDING = 1e-13
_FEWEST_SAMPLES = 20
_FEWEST_IN_WINDOW = 6
# Slope at the end of a one-sided cubic through m samples at interval h: its standard error is sqrt(1200 / m^3) sigma /
# h. Its bias from the fourth derivative, which a cubic lacks, is y'''' (m h)^3 / 84.
_SLOPE_NOISE = math.sqrt(1200.0)
_SLOPE_BIAS = 1.0 / 84.0


def noise_level(values: Floats, good: Mask) -> float:
    """Return the standard deviation of white noise on a smooth signal, in its unit.

    It is the smallest median of |differences| of orders 2 to 8, each over its own noise gain. Kinks touch only a few
    differences, which the median ignores. Fewer than 20 neighbouring good samples raise EstimationError.
    """
    found = []
    for order in _ORDERS:
        whole = np.lib.stride_tricks.sliding_window_view(good, order + 1).all(axis=1)
        differences = np.diff(values, order)[whole]
        if len(differences) >= _FEWEST_SAMPLES:
            found.append(robust_sigma(differences) / math.sqrt(math.comb(2 * order, order)))
    if not found:
        raise EstimationError(
            f"noise: expected at least {_FEWEST_SAMPLES} good samples in a row, got fewer. "
            "Give a longer part of the recording."
        )
    return max(min(found), _ROUNDING * float(np.ptp(values[good])))


def one_sided_window(noise: float, interval: float, size: float, fastest: float, longest: float) -> float:
    """Return the window (s), at most the longest, in which a one-sided cubic has the best slope at its end.

    `noise` is the standard deviation, `size` the amplitude of the motion, and `interval` the sampling interval, s.
    `fastest` is the angular frequency of the fastest smooth part, rad/s.
    """
    count = np.arange(_FEWEST_IN_WINDOW, max(_FEWEST_IN_WINDOW + 1, int(longest / interval) + 1))
    width = count * interval
    error = np.hypot(
        _SLOPE_NOISE * noise / (count**1.5 * interval), _SLOPE_BIAS * size * fastest**4 * width**3
    )
    return float(width[np.argmin(error)])
