"""The span of a record over which a replay holds: where its running error stays within the trusted error.

Most of the energy of a decaying motion is at its beginning, so a score of the whole record says little about its end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.replay.scoring import Span

Floats = NDArray[np.float64]

MOST_ERROR = 0.25
"""Largest error per standard deviation of the measured signal, about VAF 94. It is the geometric mean of two errors.
At .5 (VAF 75) the motion is just recognised; a good linear replay of a real structure has .12."""
NOISE_TIMES = 2.0
"""Energy of a residual, relative to that of the noise, below which it may be noise: the window is undecided."""
_MOST_SPANS = 3


@dataclass(frozen=True, slots=True)
class Held:
    """The spans of a record in which a replay holds.

    Attributes
    ----------
    spans : tuple of tuple of float
        Spans in which each decided running window holds, s from `since`.
    broken : tuple of float or None
        Start and stop of the first window that does not hold, s from `since`, and its score, percent.
    end : float
        End of the record, s from `since`.
    since : str
        `the onset`, or `the start of the record` if it does not begin quietly.
    """

    spans: tuple[Span, ...]
    broken: tuple[float, float, float] | None
    end: float
    since: str

    @property
    def words(self) -> str:
        """The spans that hold, as words to follow a comma."""
        if not self.spans:
            return "nowhere"
        if self.spans == ((0.0, self.end),):
            return f"over the whole record ({instant(self.end)})"
        shown = [
            f"to {instant(stop)}" if start == 0.0 else f"from {instant(start)} to {instant(stop)}"
            for start, stop in self.spans[:_MOST_SPANS]
        ]
        more = f" and in {len(self.spans) - _MOST_SPANS} spans more" if len(self.spans) > _MOST_SPANS else ""
        hidden = self.broken is None and self.spans[-1][1] < self.end
        return f"{', '.join(shown)} after {self.since}{more}{' (noise hides the rest)' if hidden else ''}"


def held_over(
    windows: Sequence[Span],
    variance: Floats,
    ceiling: Floats,
    *,
    most_error: float = MOST_ERROR,
    since: str = "the onset",
) -> Held:
    """Return the spans in which the windows of a record hold.

    A window holds if its error sqrt(1 - VAF/100) is at most `most_error`. It does not hold if it leaves more than that
    plus `NOISE_TIMES` times the energy of the noise. Between the two, and without samples, it is undecided.

    Parameters
    ----------
    windows : sequence of tuple of float
        Consecutive windows from 0, s.
    variance, ceiling : ndarray of float, shape (window,)
        Score, and score of a perfect model under the noise, percent; NaN if unknown.
    most_error : float
    since : str
        Words for the origin of the times.

    Examples
    --------
    >>> tenths = [(0.1 * place, 0.1 * (place + 1)) for place in range(4)]
    >>> held_over(tenths, np.array([99.0, 97.0, 60.0, -50.0]), np.full(4, 100.0)).words
    'to 200 ms after the onset'
    """
    states = _states(variance, ceiling, most_error)
    good = np.flatnonzero(states == 1.0)
    cuts = [0, *(np.flatnonzero(states == 0.0) + 1).tolist(), len(states) + 1]
    runs = [good[(good >= first) & (good < stop)] for first, stop in pairwise(cuts)]
    spans = tuple((windows[run[0]][0], windows[run[-1]][1]) for run in runs if len(run))
    failed = np.flatnonzero(states == 0.0)
    broken = (*windows[failed[0]], float(variance[failed[0]])) if len(failed) else None
    return Held(spans, broken, windows[-1][1], since)


def _states(variance: Floats, ceiling: Floats, most_error: float) -> Floats:
    """Return 1 for each window that holds, 0 for one that does not, NaN for an undecided one."""
    left, most = 100.0 - variance, 100.0 * most_error**2
    noise = np.where(np.isnan(ceiling), 0.0, 100.0 - ceiling)
    return np.where(left <= most, 1.0, np.where(left > most + NOISE_TIMES * noise, 0.0, np.nan))


def instant(time: float) -> str:
    """Return a time in words, s or ms.

    >>> instant(0.0504), instant(40.0)
    ('50.4 ms', '40 s')
    """
    return f"{1e3 * time:.4g} ms" if abs(time) < 1.0 else f"{time:.4g} s"
