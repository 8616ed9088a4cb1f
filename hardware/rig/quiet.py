"""Whether a channel shows anything above its noise: a drive that never came looks like a sound recording otherwise."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.robust import robust_sigma

_FEWEST = 20
# Mean squared difference of neighbours over twice the variance is 1 for white noise, with this many standard errors of
# 1 / sqrt(samples): a signal that is sampled well is far below 1.
_BEYOND = 4.0
# Largest deviation from the median, in standard deviations of the noise, above which a sample is a pulse: white noise
# of 10^8 samples, as many as a recording takes, ends at 5.7.
_PULSE = 7.0
# Steps of the converter within which a channel stands still.
_STILL = 2.0


def noise_of(volts: NDArray[np.float64], step: float) -> float | None:
    """Return the noise of a channel that shows nothing else, V; None where there is a signal, or too few samples.

    Missing samples are NaN; `step` is that of the converter, V.

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
    """Return what is said of a channel that shows nothing above its noise; empty where it shows something.

    `step` is that of the converter, V; an output is wired to a loopback.
    """
    noise = noise_of(volts, step)
    if noise is None:
        return ""
    level = f"{float(np.nanmedian(volts)):.3g} V, noise {noise:.2g} V"
    if is_loopback:
        return f"{name}: the loopback shows no drive ({level}): nothing drove the output, or it is not wired here"
    return f"{name}: nothing is above its noise ({level})"
