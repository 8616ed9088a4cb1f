"""Extrema of a sampled displacement in each forcing period, between its samples."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

_KINK = 10.0
"""Curvature at an extremum, over the usual one of the signal, above which the extremum is the kink of an impact."""


def extrema_of(values: Floats, edges: Indices) -> tuple[Floats, Floats]:
    """Return the largest and the smallest value of each period, shape (period,); NaN if a sample of it is missing.

    A smooth extremum is that of the parabola through its three samples. At an impact it is the intersection of the
    lines before and after it. In both cases the error falls with the square of the sample interval. Periods begin at
    `edges`, and the last edge is the end of the last period.

    >>> wave = np.sin(2.0 * np.pi * (np.arange(100) + 0.3) / 50)
    >>> highest, lowest = extrema_of(wave, np.array([0, 50, 100]))
    >>> bool(np.abs(highest - 1.0).max() < 2e-5 > np.abs(lowest + 1.0).max())
    True
    """
    return _maxima(values, edges), -_maxima(-values, edges)


def _maxima(values: Floats, edges: Indices) -> Floats:
    curvature = np.abs(np.diff(values, 2))
    usual = float(np.nanmedian(curvature)) if np.isfinite(curvature).any() else np.nan
    found = np.full(len(edges) - 1, np.nan)
    for period, (begin, end) in enumerate(pairwise(edges)):
        part = values[begin:end]
        if len(part) and np.isfinite(part).all():
            found[period] = _maximum(values, int(begin + np.argmax(part)), usual)
    return found


def _maximum(values: Floats, at: int, usual: float) -> float:
    """Return the maximum near a sample that is the largest of its period."""
    before, here, after = (float(values[k]) if 0 <= k < len(values) else np.nan for k in (at - 1, at, at + 1))
    bend = before - 2.0 * here + after
    # at the end of a period the motion may still rise; comparisons with NaN are false too
    if not (before <= here >= after and bend < 0.0):
        return here
    if -bend > _KINK * usual and 2 <= at < len(values) - 2:
        kink = _kink(values[at - 2 : at + 3])
        if kink is not None:
            return kink
    return here - (before - after) ** 2 / (8.0 * bend)


def _kink(five: Floats) -> float | None:
    """Return the intersection of the lines before and after a kink; None if it is not near the middle."""
    rise, before, after, fall = np.diff(five).tolist()
    found = []
    # the middle sample lies on one of the two lines; a line across the kink is too flat and gives a lower value
    for slope_up, slope_down, low in ((rise, after, -1.0), (before, fall, 0.0)):
        if not slope_up > slope_down:
            continue
        # lines through the samples (-1, five[1]) and (1, five[3])
        base_up, base_down = five[1] + slope_up, five[3] - slope_down
        place = (base_down - base_up) / (slope_up - slope_down)
        if low <= place <= low + 1.0:
            found.append(float(base_up + slope_up * place))
    return max(found, default=None)
