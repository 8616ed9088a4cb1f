"""Gaps in instants: the places and numbers of missing samples between rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.hardware.formats.table import MOST_SAMPLES, Floats
from vibroimpact.hardware.recordings.printed_grid import digits_of

AGREEMENT = 1e-4
"""Relative difference of two intervals, below which they agree."""
EVEN = 1e-3
"""Largest residual of an evenly sampled instant, in intervals, if its digits do not explain it."""
_GAP = 0.5
"""Excess of a step over the interval, in intervals, above which samples are missing."""


@dataclass(frozen=True, slots=True)
class Gaps:
    """Gaps in instants."""

    row: NDArray[np.intp]
    """First row after each gap, shape (gap,)."""
    skipped: NDArray[np.intp]
    """Missing samples before it, shape (gap,)."""
    at: float
    length: float
    """Start `at`, s, and length of the longest gap, s."""
    on_grid: bool
    """The rows between the gaps are evenly spaced."""

    @property
    def missing(self) -> int:
        """Missing samples in all gaps."""
        return int(self.skipped.sum())

    def before(self, row: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the number of missing samples before each row."""
        total = np.append(0, np.cumsum(self.skipped))
        return np.asarray(total[np.searchsorted(self.row, row, side="right")], dtype=np.intp)

    def text(self) -> str:
        """Return the number of gaps, and the longest one, in words."""
        several = f"{len(self.row)} gaps, the longest" if len(self.row) > 1 else "1 gap"
        return f"{several} of {self.length:.6g} s at {self.at:.6g} s"

    def remark(self) -> str:
        """Return the remark on filled gaps."""
        many = self.missing > 1
        return (
            f"{self.missing} {'samples are' if many else 'sample is'} missing in {self.text()}: "
            f"{'they are' if many else 'it is'} there as NaN"
        )


@np.errstate(over="ignore", invalid="ignore")
def gaps_in(row: NDArray[np.intp], instants: Floats, interval: float | None = None) -> Gaps | None:
    """Return the gaps in the instants of rows, s; None without any.

    Each run of rows between gaps has a start, averaged over its instants. Two starts give the number of missing
    samples between their runs, even if the digits of one instant are too few. Steps may differ by any factor.
    `interval` is the user's sampling interval, s, used unless the instants contradict it.
    """
    if len(row) < 3:
        return None
    steps, rows, digits = np.diff(instants), np.diff(row), digits_of(instants)
    usual = float(np.median(steps / rows))
    # if each step is a whole number of intervals, nothing was rounded
    coarse = 0.0 if usual > 0.0 and are_whole(steps / usual) else digits
    if coarse:
        lag = max(1, len(row) // 20)
        usual = float(np.median((instants[lag:] - instants[:-lag]) / (row[lag:] - row[:-lag])))
    if usual <= 0.0:
        return None
    is_gap = steps - rows * usual > _GAP * usual + coarse
    if not np.any(is_gap) or np.all(is_gap):
        return None
    pace = pace_of(steps[~is_gap], rows[~is_gap], digits, interval)
    if pace <= 0.0:
        return None
    run = np.append(0, np.cumsum(is_gap))
    starts = instants - row * pace
    if not np.all(np.isfinite(starts)):
        return None
    start = np.bincount(run, starts) / np.bincount(run)
    skipped = np.clip(np.rint(np.diff(start) / pace), 0, MOST_SAMPLES).astype(np.intp)
    on_grid = float(np.abs(starts - start[run]).max()) <= _GAP * pace + coarse and bool(np.any(skipped))
    longest = int(np.argmax(np.where(is_gap, steps, -np.inf)))
    return Gaps(row[1:][is_gap], skipped, float(instants[longest]), float(steps[longest]), on_grid)


def pace_of(steps: Floats, rows: NDArray[np.intp], digits: float, interval: float | None) -> float:
    """Return the mean step from row to row, s, or the user's interval if both agree up to the digits."""
    pace = float(steps.sum()) / int(rows.sum())
    if interval is None or abs(pace - interval) > AGREEMENT * interval + digits / int(rows.sum()):
        return pace
    return interval


def are_whole(jumps: Floats) -> bool:
    """Whether steps are whole numbers of intervals, at least one each."""
    return bool(np.all(np.abs(jumps - np.rint(jumps)) <= EVEN) and np.all(jumps > 0.5))
