"""Scores of a simulated against a measured signal: variance accounted for, over a record and over windows."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

Span = tuple[float, float]


def variance_accounted_for(
    measured: Floats, simulated: Floats, good: Flags | None = None, reference: float | None = None
) -> float:
    """Return the share of the measured variance that the simulation accounts for, percent.

    The score is 100 (1 - sum (y - s)^2 / sum (y - reference)^2) over the good samples. The reference is the mean of
    the good measured samples, so that a common constant gives no advantage: predicting the mean alone scores 0. The
    mean is not removed from the residual: a constant error costs. 100 is perfect; there is no lower limit.

    The root of 1 - VAF/100 is the error of the simulation per standard deviation of the measured signal. A score of
    99 % is an error of 10 %, a score of 75 % an error of 50 %.

    Parameters
    ----------
    measured, simulated : ndarray of float, shape (sample,)
        In one unit, at the same instants.
    good : ndarray of bool, shape (sample,), optional
        Samples to score; default: samples where both are finite.
    reference : float, optional
        In the same unit. For windows it is the reference of the whole record: the windows' residual and reference
        energies then sum to those of the whole.

    Returns
    -------
    float
        NaN if fewer than two samples are scored, or the measured signal is constant.

    Examples
    --------
    >>> y = np.array([1.0, -1.0, 1.0, -1.0])
    >>> round(variance_accounted_for(y, 0.9 * y), 9)
    99.0
    >>> round(variance_accounted_for(y + 5.0, 0.9 * y + 5.0), 9)
    99.0
    """
    scored = np.isfinite(measured) & np.isfinite(simulated)
    if good is not None:
        scored &= good
    if np.count_nonzero(scored) < 2:
        return float("nan")
    values = measured[scored]
    about = float(np.mean(values)) if reference is None else reference
    energy = float(np.sum((values - about) ** 2))
    if energy <= 0.0:
        return float("nan")
    return 100.0 * (1.0 - float(np.sum((values - simulated[scored]) ** 2)) / energy)


def windowed_variance(
    time: Floats,
    measured: Floats,
    simulated: Floats,
    good: Flags,
    windows: Sequence[Span],
) -> Floats:
    """Return the variance accounted for in windows, percent, shape (window,).

    The measured energy is taken about the mean of all good samples of the record.

    Parameters
    ----------
    time, measured, simulated, good : ndarray, shape (sample,)
        As in `variance_accounted_for`; instants in s.
    windows : sequence of tuple of float
        Start (included) and stop (excluded), s on the clock of `time`.
    """
    reference = float(np.mean(measured[good])) if np.any(good) else 0.0
    return np.array(
        [
            variance_accounted_for(measured, simulated, good & (time >= start) & (time < stop), reference)
            for start, stop in windows
        ]
    )


def running_windows(start: float, stop: float, length: float) -> list[Span]:
    """Return consecutive windows of one length from `start`, s; a rest shorter than half a window joins the last one.

    >>> running_windows(0.0, 1.1, 0.25)
    [(0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.1)]
    """
    count = max(1, int((stop - start) / length + 0.5))
    edges = [start + place * length for place in range(count)] + [stop]
    return list(pairwise(edges))


def best_gain(measured: Floats, simulated: Floats, good: Flags) -> float:
    """Return the factor on the simulated signal that brings it nearest to the measured one (least squares).

    A gain far from 1 means that sensitivity or participation is wrong, not the motion.
    """
    scored = good & np.isfinite(measured) & np.isfinite(simulated)
    energy = float(np.sum(simulated[scored] ** 2))
    return float(np.sum(measured[scored] * simulated[scored])) / energy if energy > 0.0 else float("nan")
