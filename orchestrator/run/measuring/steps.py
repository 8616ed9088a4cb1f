"""Steps between samples, cut finely enough to follow the ring of a load cell until it has decayed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]

MOST_PIECES = 5000
"""Largest number of pieces of `finest` length in a step; a longer step is cut finely only at its end."""


def pieces_of(durations: Floats, finest: float, lead: float) -> Counts:
    """Return the numbers of pieces of steps of durations > 0, s, each piece up to `finest`, s; 0: no step is cut.

    A start state decays within `lead`, s: a longer step has one more piece, the long one before its fine end.

    Examples
    --------
    >>> pieces_of(np.array([0.5, 2.0, 9.0]), 1.0, 3.0).tolist()
    [1, 2, 4]
    """
    if finest == 0.0:
        return np.ones(len(durations), dtype=np.int64)
    followed = np.minimum(durations, _followed(finest, lead))
    fine = np.ceil(followed / finest * (1.0 - 1e-9)).astype(np.int64)
    return np.maximum(fine, 1) + (durations > followed)


def cut(
    times: Floats, volts: Floats, finest: float, lead: float
) -> tuple[Floats, Floats, NDArray[np.uint8], Counts]:
    """Return ends, voltages and `renewed` of the pieces of steps, see `pieces_of`, and the last piece of each step.

    `times` bound the steps, s, ascending, shape (step + 1,); each of `volts` is held over a step. The ends, voltages
    and `renewed` (1 where a piece begins a step) have the shape (piece,). The last piece of a step ends exactly with
    the step.

    Examples
    --------
    >>> ends, held, renewed, last = cut(np.array([0.0, 1.0, 9.0]), np.array([5.0, 6.0]), 1.0, 2.0)
    >>> ends.tolist(), held.tolist(), renewed.tolist(), last.tolist()
    ([1.0, 7.0, 8.0, 9.0], [5.0, 6.0, 6.0, 6.0], [1, 1, 0, 0], [0, 3])
    """
    durations = np.diff(times)
    counts = pieces_of(durations, finest, lead)
    last = np.cumsum(counts) - 1
    left = np.repeat(last, counts) - np.arange(last[-1] + 1)  # later pieces of the same step
    coarse = durations > (_followed(finest, lead) if finest else np.inf)
    followed = np.where(coarse, np.minimum(durations, _followed(finest, lead)), durations)
    piece = followed / (counts - coarse)
    ends = np.repeat(times[1:], counts) - left * np.repeat(piece, counts)
    ends[last] = times[1:]
    renewed = np.zeros(len(ends), dtype=np.uint8)
    renewed[last - counts + 1] = 1
    return ends, np.repeat(np.asarray(volts, dtype=np.float64), counts), renewed, last


def _followed(finest: float, lead: float) -> float:
    return min(lead, finest * MOST_PIECES)
