"""The quantisation steps that the converter of a record leaves in a signal.

A converter resolves nothing between two steps. Noise below a step appears as a few samples one step higher, far above
the median magnitude, which is 0. A random part of a step, added before the noise is measured, corrects this (dither;
Widrow and Kollar 2008). The result then is the noise together with that of the steps, step / sqrt(12).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.robust import robust_sigma

Floats = NDArray[np.float64]

LEAST_STEPS = 1.5
"""Lowest threshold in steps: the next value is noise."""
#: Rounding of values, relative to the largest: they may have been stored as float32, or printed with seven digits.
_ROUNDING = 4.0 * float(np.finfo(np.float32).eps)
#: Smallest step in units of this rounding, and largest deviation of values from the grid, in steps.
_CLEAR, _OFF_GRID = 20.0, 0.1
#: Noise, in steps, above which estimates of the noise are independent of the steps.
_RESOLVED_NOISE = 10.0
#: Largest number of distinct values of a converter: no record contains all values of 24 bits.
_MOST_VALUES = 1 << 18
#: Number of levels from which a signal is no switch, and number of samples for which a switch keeps its level.
_FEWEST_LEVELS, _STAYS = 4, 4


def converter_step(values: Floats) -> float:
    """Return the step of the grid of all values, calibrated or not; 0 without a grid, or where noise hides it.

    >>> counts = np.array([3, 4, 4, 3, 5, 4, 9, 4])
    >>> round(converter_step(0.25 * counts + 0.1), 12)
    0.25
    >>> converter_step(np.random.default_rng(0).normal(size=100))
    0.0
    """
    distinct = np.unique(values)
    if not 1 < distinct.size <= min(_MOST_VALUES, max(3, len(values) // 2)):
        return 0.0
    rounding = _ROUNDING * float(np.max(np.abs(distinct)))
    distinct = distinct[np.concatenate(([True], np.diff(distinct) > rounding))]
    gaps = np.diff(distinct)
    if not gaps.size or gaps.min() < _CLEAR * rounding:
        return 0.0
    counts = np.round(gaps / gaps.min())
    step = float(gaps.sum() / counts.sum())
    places = (distinct - distinct[0]) / step
    if np.max(np.abs(places - np.round(places))) > _OFF_GRID:
        return 0.0
    if distinct.size < _FEWEST_LEVELS and _is_switched(values):
        return 0.0
    return step if _noise_between(values) < _RESOLVED_NOISE * step else 0.0


def _is_switched(values: Floats) -> bool:
    """Return whether a signal of a few levels keeps each new level, as a switch does and noise does not."""
    levels, counts = np.unique(values, return_counts=True)
    away = values != levels[np.argmax(counts)]
    edges = np.flatnonzero(np.diff(np.concatenate(([False], away, [False])).astype(np.int8)))
    return float(np.median(edges[1::2] - edges[::2])) >= _STAYS


def between_steps(length: int, step: float) -> Floats:
    """Return random parts of a step, one for each sample, the same in each call."""
    return step * (np.random.default_rng(0).random(length) - 0.5)


def _noise_between(values: Floats) -> float:
    """Return the noise from one sample to the next, which is independent of a motion."""
    return robust_sigma(np.diff(values)) / float(np.sqrt(2.0))
