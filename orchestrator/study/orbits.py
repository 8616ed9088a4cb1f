"""The class of an orbit: P(p,q), p impacts in q forcing periods; P(inf,q) with infinitely many impacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.orchestrator.study.errors import LEAST_SPEED
from vibroimpact.orchestrator.study.observation import Observation

REPEATS = 1e-6
"""Relative difference of times and velocities below which an impact repeats an impact of an earlier period."""
LEAST_TURNS = 2
"""Number of times that a recording must contain the orbit; longer orbits count as not periodic."""


def orbit_of(found: Observation, period: float | None, window: tuple[float, float]) -> str:
    """Return the class of an orbit: `P(p,q)`, `no impacts`, `not periodic in the recording`; empty without forcing.

    A complete chatter is `P(inf,q)` and a body that rests for good is at `rest`, as `classify` names them. The slowest
    impacts of a chatter are not compared: their number depends on the engine. `period` is the forcing period, s;
    `window` is start and end of the recording, s.

    Examples
    --------
    >>> train = np.array([[0.3, 1.0, 1.0], [0.9, 0.5, 1.0], [2.3, 1.0, 1.0], [2.9, 0.5, 1.0]])
    >>> orbit_of(Observation(train), 1.0, (0.0, 4.0)), orbit_of(Observation(), 1.0, (0.0, 4.0))
    ('P(2,2)', 'no impacts')
    >>> orbit_of(Observation(train, held=OrbitClass.sticking), 1.0, (0.0, 4.0))
    'P(inf,2)'
    """
    if period is None:
        return ""
    if found.held is OrbitClass.rest:
        return "rest"
    is_endless = found.held is OrbitClass.sticking
    if is_endless:
        speeds = found.impacts[:, 1]
        found = replace(found, impacts=found.impacts[speeds > LEAST_SPEED * speeds.max(initial=0.0)])
    if not len(found.impacts):
        return "P(inf,1)" if is_endless else "no impacts"
    most = round((window[1] - window[0]) / period) // LEAST_TURNS
    for periods in range(1, most + 1):
        if _repeats(found, periods * period, period, window):
            count = np.count_nonzero(found.impacts[:, 0] < window[0] + periods * period)
            return f"P({'inf' if is_endless else count},{periods})"
    return "not periodic in the recording"


def _repeats(found: Observation, length: float, period: float, window: tuple[float, float]) -> bool:
    """Return whether all impacts repeat after `length`, s, except at the edges of the recording."""
    rows, margin = found.impacts, REPEATS * period
    speed = float(np.abs(rows[:, 1]).max()) or 1.0
    early = rows[rows[:, 0] < window[1] - length - margin]
    late = rows[rows[:, 0] > window[0] + length + margin]
    if not len(early) or len(early) != len(late):
        return False
    off = np.abs(late[:, :2] - early[:, :2] - (length, 0.0)) / (period, speed)
    return bool(off.max() < REPEATS) and bool((late[:, 2] == early[:, 2]).all())
