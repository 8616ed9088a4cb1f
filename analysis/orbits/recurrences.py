"""Periodic orbits that a run passes by: impacts that nearly repeat after some forcing periods start Newton's method."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.errors import OrbitError
from vibroimpact.analysis.orbits.finding import find_orbit
from vibroimpact.analysis.orbits.periodic import PeriodicOrbit
from vibroimpact.analysis.orbits.trigonometric import TURN
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.core.orbits import MOST_IMPACTS
from vibroimpact.fmus.errors import UsageError

MOST_RECURRENCES = 24
"""Number of closest recurrences of a run from which Newton's method starts."""


def orbits_passed(
    body: ImpactingBody, phases: Floats, speeds: Floats, contacts: NDArray[np.int64], periods: int
) -> Iterator[PeriodicOrbit]:
    """Yield the physical orbits of some forcing periods near which a run passes; equal ones may come again.

    Parameters
    ----------
    body : ImpactingBody
    phases, speeds : array, shape (impact,)
        Phases of the impacts of a run, rad, ascending over its turns; their speeds, m/s.
    contacts : array of int, shape (impact,)
    periods : int
        Forcing periods after which the orbits repeat.

    """
    later = phases + TURN * periods
    after = np.searchsorted(phases, later)
    apart = np.full(phases.size, np.inf)
    count = np.zeros(phases.size, dtype=np.int64)
    scale = max(float(np.abs(speeds).max(initial=0.0)), float(np.finfo(np.float64).tiny))
    for first in range(phases.size):
        for other in (after[first] - 1, after[first]):
            if first < other < phases.size and contacts[other] == contacts[first]:
                off = abs(phases[other] - later[first]) + abs(speeds[other] - speeds[first]) / scale
                if off < apart[first]:
                    apart[first], count[first] = off, other - first
    count[count > MOST_IMPACTS] = 0
    for first in np.argsort(apart, kind="stable")[:MOST_RECURRENCES]:
        window = slice(first, first + count[first])
        if not (count[first] and np.isfinite(apart[first])):
            continue
        try:
            orbit = find_orbit(body, phases[window], contacts[window].tolist(), periods)
        except (OrbitError, UsageError):  # no orbit there, or impacts closer than phases can resolve
            continue
        if orbit.is_physical:
            yield orbit.once
