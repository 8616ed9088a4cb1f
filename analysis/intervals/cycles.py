"""The periodic motion P(p,q) behind the intervals: p impacts in q periods of the forcing (thesis 5.4.4).

It is read from the order of the intervals, and from their density. A P(p,q) motion has at most p distinct intervals,
and a cycle of them lasts q periods. Intervals alone leave some questions open; the verdict names these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.intervals.density import FINEST, spread_within, typical_interval
from vibroimpact.analysis.intervals.lattice import Lattice
from vibroimpact.analysis.intervals.trains import Floats, IntervalTrain

# Longest cycle searched, and smallest number of repeats for a cycle.
LONGEST_CYCLE, FEWEST_REPEATS = 16, 4
# Largest difference of equal intervals one cycle apart, in standard deviations of their cluster, and at most relative
# to the median interval. The last number is the smallest share of equal intervals.
LARGEST_DEVIATION, LARGEST_DIFFERENCE, LEAST_EQUAL = 4.5, 0.1, 0.8
# Largest deviation of a cycle from a whole number of forcing periods.
PERIOD_DEVIATION = 0.1


@dataclass(frozen=True, slots=True)
class Cycle:
    """The motion behind the intervals."""

    impacts: int
    """p, the smallest number that the intervals allow; 0: they do not repeat."""
    duration: float
    """Duration of one cycle, s: median sum of p successive intervals; NaN without a cycle."""
    periods: int
    """q; 0: unknown."""
    words: str
    """The verdict, with the open questions."""


def read_cycle(train: IntervalTrain, forcing_period: float | None) -> Cycle:
    """Return the motion P(p,q) that the intervals show; without a forcing period (s) q stays unknown.

    >>> from vibroimpact.analysis.intervals import interval_train
    >>> train = interval_train(np.cumsum(np.tile([0.4, 1.6], 20)))
    >>> cycle = read_cycle(train, 1.0)
    >>> cycle.impacts, cycle.periods
    (2, 2)
    """
    tolerance = _tolerance(train)
    impacts = _repeats_after(train.separated, tolerance)
    if not impacts:
        words = (
            f"the intervals repeat after no cycle of up to {LONGEST_CYCLE} (to within {tolerance:.2g} s): "
            "no P(p,q) is read from them"
        )
        return Cycle(0, float("nan"), 0, words)
    windows = np.lib.stride_tricks.sliding_window_view(train.separated, impacts)
    duration = float(np.nanmedian(windows.sum(axis=1)))
    return _verdict(impacts, duration, forcing_period, f"repeat to within {tolerance:.2g} s")


def cycle_of_lattice(lattice: Lattice, forcing_period: float | None) -> Cycle:
    """Return the motion of a train whose intervals do not repeat only because spikes are missed or spurious."""
    return _verdict(1, lattice.interval, forcing_period, "lie on a lattice")


def _verdict(impacts: int, duration: float, forcing_period: float | None, how: str) -> Cycle:
    same = f"the intervals {how}"
    if impacts == 1:
        same += "; equal intervals hide p: k impacts in k q periods look the same"
    if forcing_period is None:
        return Cycle(impacts, duration, 0, f"P({impacts},q), q needs the forcing period; {same}")
    ratio = duration / forcing_period
    periods = round(ratio)
    if periods < 1 or abs(ratio - periods) > PERIOD_DEVIATION:
        words = (
            f"{same}; a cycle of {impacts} lasts {ratio:.3f} forcing periods, not a whole number of them: the "
            "response is not locked to that forcing, or spikes are missed"
        )
        return Cycle(impacts, duration, 0, words)
    words = f"P({impacts},{periods}), a cycle of {ratio:.4g} forcing periods; {same}"
    return Cycle(impacts, duration, periods, words)


def _tolerance(train: IntervalTrain) -> float:
    """Return the difference up to which two intervals are equal, s."""
    intervals = train.intervals
    typical = typical_interval(intervals)
    scatter = min(LARGEST_DEVIATION * spread_within(intervals), LARGEST_DIFFERENCE * typical)
    return max(scatter, FINEST * typical, 2.1 * train.resolution)


def _repeats_after(intervals: Floats, tolerance: float) -> int:
    """Return the smallest p for which most intervals are equal p places later; 0: none.

    Not all need to be equal: some spikes may be missed. One whole cycle must be known; masked intervals may leave none.
    """
    for count in range(1, min(LONGEST_CYCLE, len(intervals) // FEWEST_REPEATS) + 1):
        change = np.abs(intervals[count:] - intervals[:-count])
        known = change[np.isfinite(change)]
        whole = np.isfinite(np.lib.stride_tricks.sliding_window_view(intervals, count).sum(axis=1))
        if len(known) and np.any(whole) and np.mean(known < tolerance) >= LEAST_EQUAL:
            return count
    return 0
