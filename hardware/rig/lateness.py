"""Arrival times of samples in the program, by the clock of the computer."""

from __future__ import annotations

import numpy as np

_KEPT = 2**14
"""Number of arrivals for the median: the last quarter of an hour."""
_DRIFT = 1e-4
"""Relative difference of two clocks that is not lateness."""
_SETTLED = 0.5
"""Time after the start, s, from which the pace of a rig is measured."""
_REAL_TIME = 0.2
"""Relative difference of paces, below which a rig runs in real time."""


class Lateness:
    """Delay of each block behind the promptest one, at a rate in samples per second.

    It uses the computer's time; for a virtual rig faster than real time it has no meaning.

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
        """Note the start of the acquisition, s."""
        self._began = self._last = now
        self._floor = np.inf

    def arrived(self, end: int, now: float) -> None:
        """Note the arrival (s) of a block; `end` is the number after its last sample."""
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
        """Median lateness of the last blocks, s."""
        kept = self._values[: min(self._count, _KEPT)]
        return float(np.median(kept)) if len(kept) else 0.0

    def sample_at(self, now: float) -> tuple[int, float]:
        """Return the number of the sample at an instant (s), and its uncertainty, s."""
        if not self._count:
            return round((now - self._began) * self._rate), now - self._began
        if self._pace and abs(self._pace - 1.0) > _REAL_TIME:  # a virtual rig with a speed of its own
            passed = (now - self._last) * self._pace
            return self._end + round(passed * self._rate), _REAL_TIME * passed
        return round((now - self._floor) * self._rate), self.median
