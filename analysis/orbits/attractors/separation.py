"""Largest Lyapunov exponents from the separation of two neighbouring motions of a flow (Benettin et al. 1976)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vibroimpact.analysis.orbits.attractors.basins import Floats, Flow

STEP = 1e-8
"""Distance of neighbours, over the size of the motion, at the beginning of each round."""
PERIODS, ROUNDS, TURNING = 8, 200, 24
"""Forcing periods of a round; rounds; first rounds, in which the distance turns to the fastest direction."""
BLOCKS = 8
"""Number of blocks of rounds whose scatter gives the error."""
CERTAIN = 3.0
"""Exponent, over its error, above which it is positive."""
LEAST = 1e-3
"""Exponent, 1 / forcing period, below which no motion counts as chaotic."""


class Separation(NamedTuple):
    """The largest Lyapunov exponent of a motion, and its standard error, 1 / forcing period."""

    exponent: float
    error: float

    @property
    def is_chaotic(self) -> bool:
        """Whether the exponent is positive beyond its error."""
        return self.exponent > max(CERTAIN * self.error, LEAST)

    @property
    def text(self) -> str:
        """The exponent in words.

        >>> Separation(0.3111, 0.012).text
        'exponent 0.311 +- 0.01 a period'
        """
        if self.exponent == -np.inf:
            return "neighbours meet"
        return f"exponent {self.exponent:.3g} +- {self.error:.1g} a period"


UNKNOWN = Separation(float("nan"), float("nan"))
"""Exponent of a motion that was not followed."""


def separation_of(flow: Flow, state: Floats, scale: Floats) -> Separation:
    """Return the largest exponent of a motion from a state at forcing phase 0 on; -infinity where neighbours meet.

    Parameters
    ----------
    flow : Flow
    state : array, shape (variable,)
    scale : array, shape (variable,)
        Size of the motion; 0 for phases of the force, which neighbours share.
    """
    counts = scale > 0.0
    offset = np.where(counts, np.sqrt(1.0 + np.arange(scale.size)), 0.0)
    rates: list[float] = []
    for _ in range(ROUNDS):
        size = float(np.linalg.norm(offset[counts]))
        around = np.array([state, state + offset / size * STEP * scale])
        states, well = flow.follow(around, PERIODS)
        if not well.all():
            return UNKNOWN
        state = states[0]
        offset = np.divide(states[1] - state, STEP * scale, np.zeros_like(scale), where=counts)
        grown = float(np.linalg.norm(offset[counts]))
        if grown == 0.0:
            return Separation(-np.inf, 0.0)
        rates.append(np.log(grown) / PERIODS)
    return of_rates(rates[TURNING:])


def of_rates(rates: list[float]) -> Separation:
    """Return the mean of the rates at which neighbours part in consecutive rounds, and its error."""
    if len(rates) < 2 * BLOCKS:
        return UNKNOWN
    means = np.array([float(np.mean(part)) for part in np.array_split(rates, BLOCKS)])
    return Separation(float(np.mean(rates)), float(means.std(ddof=1) / np.sqrt(BLOCKS)))
