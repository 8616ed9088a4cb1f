"""The time series of points in lanes: room for their samples, and the sampled variables."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.columns import Ragged
from vibroimpact.orchestrator.run.limits import contact_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

VALUES = 2
"""Number of values of a sample in C: displacement and velocity of the mode."""
ROUNDING = 1e-12
"""Relative excess over the last sample that counts as rounding, as in a fused run."""


MOST_BYTES = 2**28
"""Largest size of the samples of one call, bytes; further points run by another call."""


def most_samples(begin: Floats, end: Floats, rate: float) -> int:
    """Return the largest number of samples of a point whose recording begins and ends at these times, s."""
    with np.errstate(over="ignore", invalid="ignore"):  # C leaves a point with an infinite period
        count = (end - begin) * rate * (1.0 + ROUNDING)
    return int(count[np.isfinite(count)].max(initial=0.0)) + 1


def fits(begin: Floats, end: Floats, rate: float) -> bool:
    """Return whether points are few enough for one call: a single point, or samples below `MOST_BYTES`."""
    size = VALUES * np.dtype(np.float64).itemsize * len(begin) * most_samples(begin, end, rate)
    return len(begin) == 1 or size <= MOST_BYTES


class LaneSamples:
    """The samples of points that run in lanes.

    Parameters
    ----------
    names : tuple of str
        Sampled variables.
    rate : float
        Samples per s.
    given : mapping of str to ndarray
        Arrays of `LanesPoints.GIVEN` of the points.
    """

    def __init__(self, names: tuple[str, ...], rate: float, given: Mapping[str, Floats]) -> None:
        self._names, self._rate, self._given = names, rate, given
        points = len(given["begin"])
        self.count = np.zeros(points, dtype=np.int64)
        """Number of samples of each point, filled by C."""
        self.values = np.empty((VALUES, points, most_samples(given["begin"], given["end"], rate)))
        """Samples, filled by C; shape (value, point, sample)."""

    def rows(self, run: Ints) -> Ragged:
        """Return the samples of some points: time, s, then the variables."""
        count = self.count[run]
        taken = np.arange(self.values.shape[2]) < count[:, None]
        begin, end = (self._given[name][run, None] for name in ("begin", "end"))
        times = np.minimum(begin + np.arange(self.values.shape[2]) / self._rate, end)
        q, p = (each[run][taken] for each in self.values)
        columns = [times[taken], *(self._variable(name, run, count, q, p) for name in self._names)]
        return Ragged(count, np.column_stack(columns))

    def _variable(self, name: str, run: Ints, count: Ints, q: Floats, p: Floats) -> Floats:
        """Return a sampled variable at all samples, from the motion of the mode."""
        if name.startswith("contact_force"):
            return np.zeros(len(q))  # points that rest are left to the scalar engine
        contact = contact_of(name)
        shape = self._given["observed"][0] if contact is None else self._given["shape"][contact - 1, 0]
        return np.repeat(shape[run], count) * (p if "velocity" in name else q)
