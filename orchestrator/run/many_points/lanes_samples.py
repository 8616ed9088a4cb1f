"""The time series of points in lanes: room for their samples, and the sampled variables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.columns import Ragged
from vibroimpact.fmus.core.lanes import MOST_CONTACTS
from vibroimpact.orchestrator.run.limits import contact_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FORCE = "contact_force"
"""Begin of the names of forces at stops. They are 0, since lanes have no body that rests."""
ROUNDING = 1e-12
"""Relative excess over the last sample that counts as rounding, as in a fused run."""


MOST_BYTES = 2**28
"""Largest size of the samples of one call, bytes; further points run by another call."""


def most_samples(begin: Floats, end: Floats, rate: float) -> int:
    """Return the largest number of samples of a point whose recording begins and ends at these times, s."""
    with np.errstate(over="ignore", invalid="ignore"):  # C leaves a point with an infinite period
        count = (end - begin) * rate * (1.0 + ROUNDING)
    return int(count[np.isfinite(count)].max(initial=0.0)) + 1


def sampled_points(names: Iterable[str]) -> list[int | None]:
    """Return the points whose motion is sampled, in the order of C: contacts, from 1; None, the observed point.

    Examples
    --------
    >>> sampled_points(["velocity", "contact_force", "contact_velocity[2]"])
    [2, None]
    """
    points = {contact_of(name) for name in names if not name.startswith(FORCE)}
    return sorted(points, key=lambda point: MOST_CONTACTS + 1 if point is None else point)


def sampled_bits(names: Iterable[str]) -> int:
    """Return the sampled points as the bits of `LanesPlan.sampled`."""
    return sum(2 ** (MOST_CONTACTS if point is None else point - 1) for point in sampled_points(names))


def fits(begin: Floats, end: Floats, rate: float, names: Iterable[str]) -> bool:
    """Return whether points are few enough for one call: a single point, or samples below `MOST_BYTES`."""
    values = 2 * len(sampled_points(names))
    size = values * np.dtype(np.float64).itemsize * len(begin) * most_samples(begin, end, rate)
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
        self._sampled = sampled_points(names)
        most = most_samples(given["begin"], given["end"], rate)
        self.values = np.empty((2 * len(self._sampled), points, most))
        """Samples, filled by C: displacement and velocity of each sampled point; shape (value, point, sample)."""

    def rows(self, run: Ints) -> Ragged:
        """Return the samples of some points: time, s, then the variables."""
        count = self.count[run]
        taken = np.arange(self.values.shape[2]) < count[:, None]
        begin, end = (self._given[name][run, None] for name in ("begin", "end"))
        times = np.minimum(begin + np.arange(self.values.shape[2]) / self._rate, end)
        rows = np.zeros((count.sum(), 1 + len(self._names)))
        rows[:, 0] = times[taken]
        for column, name in enumerate(self._names, start=1):
            if not name.startswith(FORCE):
                value = 2 * self._sampled.index(contact_of(name)) + ("velocity" in name)
                rows[:, column] = self.values[value][run][taken]
        return Ragged(count, rows)
