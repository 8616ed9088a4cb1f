"""Steps between samples, cut so finely that the ring of a load cell is followed where it is still heard."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]

MOST_PIECES = 5000
"""Of one step; of a longer one only its end is cut finely."""


def pieces_of(durations: Floats, finest: float, lead: float) -> Counts:
    """Return into how many pieces steps of durations > 0, s, are cut, each no longer than `finest`, s; 0 cuts none.

    After the time `lead`, s, nothing is left of what was before: a longer step has one piece more, up to there.

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
    """Cut steps into pieces, see `pieces_of`; return their ends and voltages, which begin a step, and each step's last.

    Times are the ends of steps, s, ascending, shape (step + 1,), and volts are held over each. Of the results, ends,
    volts and `renewed` (1 where a piece begins a step) have the shape (piece,); the last piece of a step ends exactly
    with it.

    Examples
    --------
    >>> ends, held, renewed, last = cut(np.array([0.0, 1.0, 9.0]), np.array([5.0, 6.0]), 1.0, 2.0)
    >>> ends.tolist(), held.tolist(), renewed.tolist(), last.tolist()
    ([1.0, 7.0, 8.0, 9.0], [5.0, 6.0, 6.0, 6.0], [1, 1, 0, 0], [0, 3])
    """
    durations = np.diff(times)
    counts = pieces_of(durations, finest, lead)
    last = np.cumsum(counts) - 1
    left = np.repeat(last, counts) - np.arange(last[-1] + 1)  # pieces after each one, of its step
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
