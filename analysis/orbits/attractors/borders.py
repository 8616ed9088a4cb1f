"""Borders between basins of attraction: the share of starts next to one, and its dimension."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Labels = NDArray[np.int16]


class BorderDimension(NamedTuple):
    """Dimension of the border between basins in a plane of starts, and its standard error."""

    value: float
    error: float


def border_share(labels: Labels, distance: int = 1) -> float:
    """Return the share of grid starts with another end than a start at this distance along an axis.

    Parameters
    ----------
    labels : array, shape (y, x)
        Labels below 0 do not count.
    distance : int
        In cells.

    Examples
    --------
    >>> border_share(np.repeat([[0] * 4 + [1] * 4], 4, axis=0))
    0.25
    """
    there = labels >= 0
    differs, counted = np.zeros(labels.shape, np.bool_), np.zeros(labels.shape, np.bool_)
    for axis in (0, 1):
        if labels.shape[axis] <= distance:
            continue
        low = tuple(slice(None, -distance) if a == axis else slice(None) for a in (0, 1))
        high = tuple(slice(distance, None) if a == axis else slice(None) for a in (0, 1))
        both = there[low] & there[high]
        other = both & (labels[low] != labels[high])
        for part in (low, high):
            counted[part] |= both
            differs[part] |= other
    return float(differs.sum()) / max(int(counted.sum()), 1)


def border_dimension(labels: Labels, distances: Sequence[int] = (1, 2, 4, 8, 16)) -> BorderDimension | None:
    """Return the dimension of the border of basins, from the share of uncertain starts over their uncertainty.

    A start is uncertain if another start at a distance d has another end. The share of uncertain starts grows as
    d^(2 - D) (McDonald, Grebogi, Ott and Yorke 1985).

    Parameters
    ----------
    labels : array, shape (y, x)
    distances : sequence of int
        In cells.

    Returns
    -------
    BorderDimension or None
        None if there is no border, or the grid is smaller than 8 of the largest distances.
    """
    if min(labels.shape) < 8 * max(distances):
        return None
    shares = np.array([border_share(labels, distance) for distance in distances])
    if not (shares > 0.0).all() or shares.max() > 0.9:
        return None
    places, logs = np.log(np.array(distances, dtype=np.float64)), np.log(shares)
    slope, start = np.polyfit(places, logs, 1)
    off = logs - slope * places - start
    error = np.sqrt(float(off @ off) / (places.size - 2) / float(((places - places.mean()) ** 2).sum()))
    return BorderDimension(2.0 - float(slope), float(error))
