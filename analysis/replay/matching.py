"""Events of two signals (impacts, spikes), paired within a tolerance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class EventMatch:
    """Measured and simulated events, paired.

    Attributes
    ----------
    measured, simulated : ndarray of float, shape (pair,)
        Instants of the pairs, s, in order.
    missed : ndarray of float, shape (missed,)
        Measured events without a simulated one, s.
    extra : ndarray of float, shape (extra,)
        Simulated events without a measured one, s.
    """

    measured: Floats
    simulated: Floats
    missed: Floats
    extra: Floats

    @property
    def delay(self) -> Floats:
        """Simulated minus measured instant of each pair, s."""
        return self.simulated - self.measured


def match_events(measured: Floats, simulated: Floats, tolerance: float) -> EventMatch:
    """Return pairs of events that are each other's nearest and no further apart than a tolerance.

    Parameters
    ----------
    measured, simulated : ndarray of float, shape (event,)
        s, ascending, on one clock.
    tolerance : float
        s; a quarter of the shortest interval between events is a safe choice.

    Examples
    --------
    >>> pairs = match_events(np.array([1.0, 2.0, 3.0]), np.array([1.01, 2.6, 3.02, 4.0]), 0.1)
    >>> pairs.measured, pairs.missed, pairs.extra
    (array([1., 3.]), array([2.]), array([2.6, 4. ]))
    """
    if not len(measured) or not len(simulated):
        return EventMatch(np.empty(0), np.empty(0), measured, simulated)
    partner, back = _nearest(measured, simulated), _nearest(simulated, measured)
    mutual = back[partner] == np.arange(len(measured))
    rows = np.flatnonzero(mutual & (np.abs(simulated[partner] - measured) <= tolerance))
    return EventMatch(
        measured[rows],
        simulated[partner[rows]],
        np.delete(measured, rows),
        np.delete(simulated, partner[rows]),
    )


def _nearest(events: Floats, others: Floats) -> Rows:
    """Return the row of the nearest other event for each event."""
    after = np.clip(np.searchsorted(others, events), 1, max(1, len(others) - 1))
    before = after - 1
    if len(others) == 1:
        return np.zeros(len(events), dtype=np.intp)
    return np.where(np.abs(others[after] - events) < np.abs(events - others[before]), after, before)
