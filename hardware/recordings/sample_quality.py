"""Marks samples that are no plain measurements: clipped, overrange, missing, at doubtful times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Quality
from vibroimpact.hardware.formats.table import Flags, Floats

FEWEST_CLIPPED = 3
"""Fewest equal samples at the extreme that are no chance."""
_REST = 0.2
"""Share of the samples, above which a value is the level of rest, or a state of a switch, and no limit."""
_SMOOTH_TOP = 6.0
"""Largest fall of a smooth top next to its flat part, in steps of the converter; see `_falls_steeply`."""


def clipped_samples(values: Floats, rails: tuple[float, float] | None = None) -> Flags:
    """Return a mask of the samples at the limit of the measuring chain.

    At a limit, the extreme value comes again and again, exactly, and more often than its neighbouring values. The
    signal also arrives there too steeply for a smooth top that the converter's steps make flat. `rails` are the limits
    of the converter, if the file gives them: every sample there is clipped.

    >>> t = np.linspace(0.0, 1.0, 500)
    >>> int(clipped_samples(np.clip(np.sin(40 * t) * np.exp(-t), -0.7, 2.0)).sum()) > 20
    True
    >>> bool(clipped_samples(np.round(100 * np.sin(40 * t))).any())
    False
    """
    clipped = np.zeros(len(values), dtype=bool)
    finite = values[np.isfinite(values)]
    if len(finite) < FEWEST_CLIPPED:
        return clipped
    if rails is not None:
        margin = 1e-9 * (rails[1] - rails[0])
        clipped |= (values <= rails[0] + margin) | (values >= rails[1] - margin)
    # a single extreme is no limit; sorting millions of samples takes four times their memory
    if max(np.count_nonzero(finite == end) for end in (finite.min(), finite.max())) < FEWEST_CLIPPED:
        return clipped
    levels, counts = np.unique(finite, return_counts=True)
    if len(levels) < 2 * FEWEST_CLIPPED:
        return clipped
    for end in (0, -1):
        if _repeats(counts if end == 0 else counts[::-1], len(finite)) and _falls_steeply(
            values, levels[end], levels
        ):
            clipped |= values == levels[end]
    return clipped


def _repeats(counts: NDArray[np.intp], total: int) -> bool:
    """Whether the extreme value comes more often than by chance, and than its neighbouring values."""
    beside = counts[1 : max(4, len(counts) // 20)]
    return bool(
        counts[0] >= FEWEST_CLIPPED and counts[0] < _REST * total and counts[0] >= 2 * beside.max(initial=1)
    )


def _falls_steeply(values: Floats, extreme: float, levels: Floats) -> bool:
    """Whether the signal leaves its extreme by more than a smooth top would.

    The step q of the converter makes a parabola flat over k >= 2 samples. From there to the next sample it falls by at
    most q (1 + 2/k)^2 + q <= 5 q.
    """
    runs = np.flatnonzero(np.diff(np.concatenate([[False], values == extreme, [False]]))).reshape(-1, 2)
    ends = np.concatenate([runs[:, 0] - 1, runs[:, 1]])
    beside = values[ends[(ends >= 0) & (ends < len(values))]]
    falls = np.abs(beside[np.isfinite(beside)] - extreme)
    longest = int(np.diff(runs).max())
    step = float(np.diff(levels).min())
    return longest >= 2 and len(falls) > 0 and bool(np.median(falls) > _SMOOTH_TOP * step)


def flags(values: Floats, overrange: Flags, clipped: Flags, suspect: Flags) -> NDArray[np.uint8]:
    """Return the quality of each sample, sums of `Quality`."""
    quality = np.zeros(len(values), dtype=np.uint8)
    quality[clipped] |= np.uint8(Quality.clipped)
    quality[np.isnan(values) & ~overrange] |= np.uint8(Quality.missing)
    quality[overrange] |= np.uint8(Quality.overrange)
    quality[suspect] |= np.uint8(Quality.suspect)
    return quality
