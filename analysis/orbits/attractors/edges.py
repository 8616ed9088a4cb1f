"""Edge states: motions on the border between two basins, followed by bisection (Skufca, Yorke and Eckhardt 2006).

Two starts that end on different attractors straddle the border. Bisection brings them together, both are followed
until they part, and bisection brings them together again. They stay on the border, and approach the saddle on it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.attractors.basin_search import ROUNDS, SEARCH_PERIODS, OnTheirWay
from vibroimpact.analysis.orbits.attractors.basins import UNDECIDED, Basins, Floats, Flow, Labels
from vibroimpact.analysis.orbits.attractors.separation import UNKNOWN, Separation, of_rates
from vibroimpact.analysis.orbits.periodic import PeriodicOrbit

TOGETHER, APART = 1e-12, 1e-7
"""Distances of the straddling states, over the size of the motion: bisection ends below, and begins above."""
INNER = 30
"""States between the straddling states that are followed at once."""
MOST_BISECTIONS = 40
"""Largest number of rounds of one bisection; each divides the distance by INNER + 1."""
ROUNDING = 1e-16
"""Distance of the straddling states that counts where they meet."""
TURNING = 8
"""First periods, in which the straddling states turn to the direction in which they part."""
TRACKED, LOOKED_AT = 240, 40
"""Forcing periods for which an edge state is followed at most, and after which its orbit is looked for."""


Refine = Callable[[Floats], PeriodicOrbit | None]
"""Function of the last impacts of an edge state, which returns the orbit that they repeat."""


class EdgeFlow(Flow, Protocol):
    """A flow that also records impacts."""

    def impacts(self, state: Floats, periods: int) -> Floats:
        """Return the impacts from a state at phase 0 on: rows of `RunRecord.impacts`, times from this phase 0."""


class Track(NamedTuple):
    """An edge state, period by period, and the orbit that it has approached."""

    between: tuple[int, int]
    """Numbers of both attractors."""
    states: Floats
    """States at forcing phase 0, shape (period, variable)."""
    gap: float
    """Largest distance of the straddling states, over the size of the motion."""
    orbit: PeriodicOrbit | None
    """None where the edge state has come near to no orbit that is found: it may be chaotic."""
    parting: Separation = UNKNOWN
    """Rate at which the straddling states part: the largest Lyapunov exponent of the edge state."""


def neighbouring_pairs(labels: Labels) -> list[tuple[tuple[int, int], NDArray[np.int64]]]:
    """Return pairs of attractors with starts side by side, the most frequent first, and the places of such starts.

    `labels` has the shape (y, x). Places have the shape (pair, 2), and count the starts row by row.

    >>> [(pair, len(places)) for pair, places in neighbouring_pairs(np.array([[0, 0, 1], [0, -1, 1]]))]
    [((0, 1), 1)]
    """
    places = np.arange(labels.size).reshape(labels.shape)
    sides = [(places[:, :-1], places[:, 1:]), (places[:-1], places[1:])]
    pairs = np.concatenate([np.column_stack([one.ravel(), other.ravel()]) for one, other in sides])
    ends = labels.ravel()[pairs]
    apart = (ends >= 0).all(axis=1) & (ends[:, 0] != ends[:, 1])
    pairs, ends = pairs[apart], ends[apart]
    pairs = np.where(ends[:, :1] > ends[:, 1:], pairs[:, ::-1], pairs)
    ends = np.sort(ends, axis=1)
    found = Counter((int(one), int(other)) for one, other in ends)
    return [(pair, pairs[(ends == pair).all(axis=1)]) for pair, _ in found.most_common()]


def ends_of(basins: Basins, flow: Flow, states: Floats, *, block: int) -> Labels:
    """Return the attractors, of those known, on which states at forcing phase 0 end; UNDECIDED where near none."""
    trial = replace(basins, starts=states, labels=np.full(len(states), UNDECIDED, np.int16))
    way, passed = OnTheirWay(trial, flow, block), 0
    all_aperiodic = not any(each.has_period for each in basins.attractors)
    rounds = [*ROUNDS, max(0, min(basins.needed_periods, basins.most_periods) - sum(ROUNDS))]
    for periods in rounds:
        if not (way.left().size and periods) or (all_aperiodic and passed >= SEARCH_PERIODS[0]):
            break
        way.follow(way.left(), periods)
        passed += periods
    left = way.left()
    if left.size and len(basins.numbers):
        groups = way.groups_by_blocks(left) if len(basins.numbers) > 1 else np.zeros(left.size, np.int64)
        trial.labels[left] = np.append(basins.numbers, UNDECIDED)[groups]
    return trial.labels


class EdgeTracking:
    """Tracks edge states between the attractors of some basins."""

    def __init__(self, basins: Basins, flow: EdgeFlow, refine: Refine, *, block: int, period: float) -> None:
        """Take the basins, their flow, a function that refines impacts into an orbit, and the forcing period, s."""
        self._basins, self._flow, self._refine = basins, flow, refine
        self._block, self._period = block, period

    def track(self, between: tuple[int, int], places: NDArray[np.int64]) -> Track | None:
        """Return the edge state between two starts side by side; None if both ended on one side of the edge.

        Parameters
        ----------
        between : tuple of int
            Attractors of both starts.
        places : array of int, shape (2,)
            Both starts.
        """
        pair = self._bisected(
            self._flow.follow(self._basins.starts[places], 1, first=True).states, between[0]
        )
        if pair is None:
            return None
        states: list[Floats] = []
        rows: list[Floats] = []
        gap = self._distance(pair)
        orbit: PeriodicOrbit | None = None
        rates: list[float] = []
        while orbit is None and len(states) < TRACKED:
            if self._distance(pair) > APART:
                pair = self._bisected(pair, between[0])
                if pair is None:  # rounding has moved both to one side
                    return None
            impacts = self._flow.impacts(pair[0], 1)
            impacts[:, 0] += len(states) * self._period
            states.append(pair[0])
            rows.append(impacts)
            before = self._distance(pair)
            pair = self._flow.follow(pair, 1).states
            gap = max(gap, self._distance(pair))
            rates.append(float(np.log(max(self._distance(pair), ROUNDING) / before)))
            if len(states) % LOOKED_AT == 0:
                found = self._refine(np.concatenate(rows[-2 * LOOKED_AT :]))
                orbit = None if found is None or found.is_stable else found
        return Track(between, np.array(states), gap, orbit, of_rates(rates[TURNING:]))

    def _distance(self, pair: Floats) -> float:
        counts = self._basins.scale > 0.0  # both sides share the phases of forces
        return float((np.abs(pair[1] - pair[0])[counts] / self._basins.scale[counts]).max())

    def _bisected(self, pair: Floats, label: int) -> Floats | None:
        """Return two states next to each other between two states: one ends on `label`, one does not.

        None if the two states do not straddle the border.
        """
        shares = np.linspace(0.0, 1.0, INNER + 2)
        for _ in range(MOST_BISECTIONS):
            if self._distance(pair) <= TOGETHER:
                break
            between = pair[0] + shares[:, None] * (pair[1] - pair[0])
            between[-1] = pair[1]  # a product rounds
            is_one = ends_of(self._basins, self._flow, between, block=self._block) == label
            changes = np.flatnonzero(is_one[:-1] != is_one[1:])
            if not changes.size:
                return None
            last = int(changes[0])
            # rounding may have exchanged the ends of states next to a border with many folds
            pair = between[last : last + 2][:: 1 if is_one[last] else -1]
        return pair
