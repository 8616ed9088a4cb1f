"""When samples reach the program, by the clock of the computer."""

from __future__ import annotations

import numpy as np

_KEPT = 2**14
"""Arrivals of which the median is taken: of the last quarter of an hour."""
_DRIFT = 1e-4
"""Relative difference of two clocks that is no lateness."""
_SETTLED = 0.5
"""Time after the start, s, from which on the pace of a rig can be told."""
_REAL_TIME = 0.2
"""Relative difference of paces up to which a rig goes in real time."""


class Lateness:
    """How much later than the promptest of all blocks the others came, at a rate in samples per second.

    It counts in the time of the computer; of a virtual rig that is faster than life it is of no interest.

    >>> late = Lateness(100.0)
    >>> late.begin(5.0)
    >>> for end, now in ((100, 6.01), (200, 7.02), (300, 8.01)):
    ...     late.arrived(end, now)
    >>> round(late.worst, 3), round(late.median, 3), late.sample_at(8.51)[0]
    (0.01, 0.0, 350)
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._values = np.zeros(_KEPT)
        self._count, self.worst = 0, 0.0
        self._began = self._last = self._floor = 0.0
        self._end, self._pace = 0, 0.0

    def begin(self, now: float) -> None:
        """Say when (s) the acquisition was started."""
        self._began = self._last = now
        self._floor = np.inf

    def arrived(self, end: int, now: float) -> None:
        """Say that a block came, of which the number after the last sample is `end`."""
        since = now - end / self._rate
        self._floor = min(since, self._floor + _DRIFT * (now - self._last))
        self._last, self._end = now, end
        late = since - self._floor
        self._values[self._count % _KEPT] = late
        self._count += 1
        self.worst = max(self.worst, late)
        if now - self._began > _SETTLED:
            self._pace = max(self._pace, end / self._rate / (now - self._began))

    @property
    def median(self) -> float:
        """Of the lateness of the last blocks, s."""
        kept = self._values[: min(self._count, _KEPT)]
        return float(np.median(kept)) if len(kept) else 0.0

    def sample_at(self, now: float) -> tuple[int, float]:
        """Return which sample is taken at an instant (s), and the doubt about it, s."""
        if not self._count:
            return round((now - self._began) * self._rate), now - self._began
        if self._pace and abs(self._pace - 1.0) > _REAL_TIME:  # a virtual rig at a speed of its own
            passed = (now - self._last) * self._pace
            return self._end + round(passed * self._rate), _REAL_TIME * passed
        return round((now - self._floor) * self._rate), self.median
