"""Scatter that outliers do not move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Ratio of the standard deviation of normal noise to its median absolute deviation.
MAD_TO_SIGMA = 1.482602218505602


def robust_sigma(deviations: NDArray[np.float64]) -> float:
    """Return the standard deviation of normal noise from deviations about 0: 1.4826 times their median magnitude.

    Examples
    --------
    >>> quiet = np.tile([-1.0, 1.0], 50)
    >>> round(robust_sigma(np.append(quiet, 1000.0)), 4)
    1.4826
    >>> robust_sigma(np.empty(0))
    0.0
    """
    return float(MAD_TO_SIGMA * np.median(np.abs(deviations))) if deviations.size else 0.0
