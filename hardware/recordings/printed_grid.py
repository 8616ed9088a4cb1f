"""The grid of written numbers: the last digit, or a coarser multiple of it."""

from __future__ import annotations

import numpy as np

from vibroimpact.hardware.formats.table import Floats

_MOST_DIGITS = 12
_MOST_READ = 20_000
_NEARLY_ALL = 0.9
_LARGEST_ROUNDING = 0.2
"""Largest error of binary, in units of the last digit; 40 % of arbitrary numbers are as close to their digits."""


def decimal_step(values: Floats) -> float:
    """Return the power of ten of which nearly all values are multiples: the weight of their last digit.

    It is 0 if they have more digits than binary rounding can separate.

    >>> decimal_step(np.array([0.05, 0.1, 0.151])), decimal_step(np.arange(5) / 3)
    (0.001, 0.0)
    """
    finite = values[np.isfinite(values)]
    read = finite[:: max(1, len(finite) // _MOST_READ)]
    if not len(read):
        return 0.0
    # seconds since 1970 have lost some of their last digit in binary; whole numbers are on every grid
    rounding = float(np.spacing(np.abs(read).max())) / 2.0
    if rounding > _LARGEST_ROUNDING:
        return 0.0
    beyond = read - np.rint(read[0])
    for digits in range(_MOST_DIGITS + 1):
        scaled = beyond * 10.0**digits
        allowed = max(
            1e-6, 1.01 * (rounding + float(np.spacing(np.abs(scaled).max())) * 10.0**-digits) * 10.0**digits
        )
        if allowed > _LARGEST_ROUNDING:
            return 0.0
        if float(np.mean(np.abs(scaled - np.rint(scaled)) <= allowed)) >= _NEARLY_ALL:
            return 10.0**-digits
    return 0.0


def digits_of(instants: Floats) -> float:
    """Return the coarseness of written instants, s: the weight of their last digit, plus the rounding of binary."""
    return decimal_step(instants) + float(np.spacing(np.abs(instants).max(initial=0.0)))


def common_step(intervals: Floats, digits: float) -> float:
    """Return the coarsest step of which nearly all intervals (s) are multiples, up to their digits; 0 without one.

    Instants read off frames (of video, of blocks of audio) lie on such a step. For it, the mean of exp(2 pi i d /
    step) over the intervals d has modulus 1. The largest such step is chosen, and refined by least squares, d = step *
    whole number. `digits` is the weight of their last digit, s.

    >>> frames = np.random.default_rng(1).integers(14, 22, 3000) * 1024 / 44100
    >>> round(common_step(np.round(frames, 3), 1e-3), 4)
    0.0232
    """
    if digits <= 0.0 or len(intervals) < 30:
        return 0.0
    usual = float(np.median(intervals))
    rounded, times = np.unique(np.rint(intervals / digits), return_counts=True)
    used = rounded * digits <= 3.0 * usual
    values, weights = rounded[used] * digits, times[used] / times[used].sum()
    if len(values) < 3 or len(values) > _MOST_READ // 4:
        return 0.0
    # a step must have five times the last digit's weight, and an interval some steps
    frequencies = np.arange(2.0 / usual, 0.2 / digits, 0.05 / (3.0 * usual))[:_MOST_READ]
    coherence = np.concatenate(
        [
            np.abs(np.exp(2j * np.pi * np.outer(part, values)) @ weights)
            for part in np.array_split(frequencies, max(1, len(frequencies) * len(values) // 1_000_000))
        ]
    )
    coherent = np.flatnonzero(coherence > 0.95)
    if not len(coherent):
        return 0.0
    first = coherent[: int(np.argmax(np.append(np.diff(coherent) > 1, True))) + 1]
    steps = np.rint(values * frequencies[first[np.argmax(coherence[first])]])
    return float(np.sum(weights * values * steps) / np.sum(weights * steps * steps))
