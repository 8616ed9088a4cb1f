"""Missed beats of a nearly periodic train: intervals that are too long for their neighbourhood.

Each interval is compared with the median of the intervals around it. So a drifting rate is no gap, and a neighbouring
gap does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.intervals.trains import Floats, IntervalTrain
from vibroimpact.analysis.robust import robust_sigma

# Number of intervals on either side for the median around an interval.
NEIGHBOURS = 10
# Length, in local medians, above which an interval is a gap: between one beat and two.
LONGEST_BEAT = 1.5
# Robust coefficient of variation about the local median up to which one beat and two are distinguishable.
NEARLY_PERIODIC = 0.2
FEWEST_INTERVALS = 10


@dataclass(frozen=True, slots=True)
class MissedBeats:
    """Intervals in which beats are missing."""

    ratio: Floats
    """Each interval over its local median, shape (interval,); NaN where masked."""
    spread: float = float("nan")
    """Robust coefficient of variation about the local median."""
    place: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))
    """Index of the interval among all intervals of the train, shape (gap,)."""
    missing: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    """Number of beats missing in each gap, shape (gap,): its length in local medians, rounded, minus one."""
    reason: str = ""
    """Reason why gaps were not searched; empty if they were."""


def find_gaps(train: IntervalTrain) -> MissedBeats:
    """Return the gaps of a nearly periodic train.

    Valid if intervals scatter by less than about a fifth about their local median. Otherwise one beat and two overlap,
    and gaps are not searched.

    >>> from vibroimpact.analysis.intervals import interval_train
    >>> beats = np.delete(np.arange(40.0), [7, 20, 21])
    >>> found = find_gaps(interval_train(beats))
    >>> found.place.tolist(), found.missing.tolist()
    ([6, 18], [1, 2])
    """
    intervals = train.intervals
    ratio = np.full(len(train.kept), np.nan)
    if len(intervals) < FEWEST_INTERVALS:
        reason = f"expected at least {FEWEST_INTERVALS} intervals, got {len(intervals)}"
        return MissedBeats(ratio, reason=reason)
    typical = local_median(intervals)
    if not np.all(typical > 0.0):
        return MissedBeats(ratio, reason="most events of some neighbourhood coincide")
    ratio[train.kept] = relative = intervals / typical
    spread = robust_sigma(relative - np.median(relative))
    if spread > NEARLY_PERIODIC:
        reason = (
            f"the train is not nearly periodic: its intervals scatter by {100 * spread:.0f} % about their local "
            f"median; expected at most {100 * NEARLY_PERIODIC:.0f} %"
        )
        return MissedBeats(ratio, spread, reason=reason)
    place = np.flatnonzero(np.nan_to_num(ratio) > LONGEST_BEAT)
    missing = np.maximum(np.rint(ratio[place]).astype(np.int64) - 1, 1)
    return MissedBeats(ratio, spread, place, missing)


def local_median(values: Floats) -> Floats:
    """Return the median of each value's neighbours, without the value; ends use the nearest whole window."""
    reach = min(NEIGHBOURS, (len(values) - 1) // 2)
    windows = np.lib.stride_tricks.sliding_window_view(values, 2 * reach + 1)
    others = np.delete(windows, reach, axis=1)
    middle = np.median(others, axis=1)
    return np.concatenate(
        [np.full(reach, middle[0]), middle, np.full(len(values) - reach - len(middle), middle[-1])]
    )
