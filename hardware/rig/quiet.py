"""Whether a channel has a signal above its noise: a missing drive else looks like a sound recording."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.robust import robust_sigma

_FEWEST = 20
# Distance from 1, in standard errors of 1 / sqrt(samples), of the mean squared difference of neighbours over twice the
# variance. The ratio is 1 for white noise, and far below 1 for a well-sampled signal.
_BEYOND = 4.0
# Largest deviation from the median, in standard deviations of the noise, above which a sample is a pulse. White noise
# of 10^8 samples, the most of a recording, ends at 5.7.
_PULSE = 7.0
# Steps of the converter, within which a channel stands still.
_STILL = 2.0


def noise_of(volts: NDArray[np.float64], step: float) -> float | None:
    """Return the noise of a channel without a signal, V; None for a channel with a signal, or with too few samples.

    Missing samples are NaN; `step` is the converter's, V.

    >>> time = np.arange(2000.0)
    >>> noise_of(np.sin(0.1 * time), 1e-4) is None
    True
    >>> round(noise_of(np.random.default_rng(0).normal(0.0, 0.01, 2000), 1e-4), 3)
    0.01
    """
    there = volts[np.isfinite(volts)]
    if len(there) < _FEWEST:
        return None
    spread = there - np.median(there)
    largest, variance = float(np.max(np.abs(spread))), float(np.var(there))
    if largest <= _STILL * step:
        return math.sqrt(variance)
    if largest > max(_PULSE * robust_sigma(spread), _STILL * step):
        return None
    ratio = float(np.mean(np.diff(there) ** 2)) / (2.0 * variance)
    return math.sqrt(variance) if ratio > 1.0 - _BEYOND / math.sqrt(len(there)) else None


def quiet_remark(name: str, volts: NDArray[np.float64], step: float, is_loopback: bool) -> str:
    """Return the remark on a channel without a signal above its noise; empty for a channel with a signal.

    `step` is the converter's, V; an output is wired to a loopback.
    """
    noise = noise_of(volts, step)
    if noise is None:
        return ""
    level = f"{float(np.nanmedian(volts)):.3g} V, noise {noise:.2g} V"
    if is_loopback:
        return f"{name}: the loopback shows no drive ({level}): nothing drove the output, or it is not wired here"
    return f"{name}: nothing is above its noise ({level})"
