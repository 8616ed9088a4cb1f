"""The order of an error in the step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def observed_order(step: NDArray[np.float64], error: NDArray[np.float64]) -> float:
    """Return the order p of error ~ step^p: the median of the slopes between neighbouring steps.

    The median ignores a few steps that are too large for the order, or so small that rounding dominates.

    Parameters
    ----------
    step : ndarray of float, shape (n,)
        In any order, any unit.
    error : ndarray of float, shape (n,)
        Of either sign; zeros and values that are not finite are left out.

    Returns
    -------
    float
        NaN where fewer than two errors are left.

    >>> round(observed_order(np.array([0.1, 0.2, 0.4]), np.array([0.03, 0.12, 0.48])), 6)
    2.0
    """
    used = np.isfinite(error) & (error != 0.0)
    order = np.argsort(step[used])
    logs = np.log(step[used][order]), np.log(np.abs(error[used][order]))
    if len(logs[0]) < 2:
        return float("nan")
    return float(np.median(np.diff(logs[1]) / np.diff(logs[0])))
