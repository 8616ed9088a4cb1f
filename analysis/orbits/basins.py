"""Basins of attraction: the ends of the starts of a grid, and the borders between them.

Starts are followed period by period until they are near a known attractor. The limit of near is determined first:
probe starts at that distance must come back. Long runs of some of the starts find the attractors, later also long
runs of some starts that are near none.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.chaotic_groups import (
    BLOCK,
    BLOCKS,
    LEAST_AGREEING,
    MOST_BLOCKS,
    NO_GROUPS,
    Blocks,
    Feature,
    grouped,
    merged,
)
from vibroimpact.analysis.orbits.classify import RunClass

Floats = NDArray[np.float64]
Labels = NDArray[np.int16]

UNDECIDED, BEYOND_A_STOP = -1, -2
"""Labels of starts that are near no attractor yet, and of starts that are impossible for a body."""
FIRST_SAMPLE, LATER_SAMPLE = 64, 32
"""Number of starts whose long runs find attractors: at first, and of the starts that are near none later."""
CHAOS_SAMPLE = 256
"""Number of the last starts that must all be chaotic for the others to count as chaotic."""
ROUNDS = (24, 32, 48, 96, 200, 400, 800)
"""Forcing periods between two checks of the starts."""
SEARCH_PERIODS = (104, 400)
"""Forcing periods after which attractors are searched again."""
NEAREST, FARTHEST = 1e-7, 1e-2
"""Smallest and largest distance from an attractor, over the size of the motion, to try as the limit of near."""
TRANSIENT, TRANSIENT_OF_CHAOS = 1000, 10_000
"""Forcing periods after which a run has its class, and after which its chaos counts as permanent."""
SETTLING, MOST_SETTLING, SETTLED = 64, 30, 1e-13
"""Rounds between two checks of an attractor's state, largest number of checks, and change that counts as none."""
PROBES, PROBE_PERIODS = 24, 400
"""Number of probe starts at that distance, and forcing periods in which they must come back."""
MISSED = 0.05
"""Probability with which a sample misses all starts of a share that it excludes."""
SAME = 1e-5
"""Distance, over the size of the motion, below which two attractors are equal."""


class Ends(NamedTuple):
    """States at forcing phase 0 some periods later, shape (start, variable), and whether each run succeeded."""

    states: Floats
    well: NDArray[np.bool_]


class Flow(Protocol):
    """Interface to simulate many starts at once."""

    def follow(self, states: Floats, periods: int, *, first: bool = False) -> Ends:
        """Return the states after some forcing periods, from states of shape (start, variable).

        With `first` they are at time 0, not at forcing phase 0; the periods then count from the next phase 0.
        """

    def classes(
        self, states: Floats, transient: int, *, first: bool = False
    ) -> tuple[list[RunClass], Floats]:
        """Return the class of a run from each state after a transient of forcing periods, and its last states."""

    def measure(self, states: Floats, periods: int, blocks: int) -> Blocks:
        """Return the features of the impacts in consecutive blocks of forcing periods, from forcing phase 0 on."""


@dataclass(frozen=True, eq=False)
class Attractor:
    """An attractor on which starts end."""

    kind: RunClass
    states: Floats
    """States at forcing phase 0, shape (period, variable); empty for chaos."""
    radius: float
    """Distance, over the size of the motion, from which probe starts came back."""
    impacts: Floats
    """Mean number in a forcing period, shape (stop,), without the slow impacts of a chatter; NaN if infinite."""
    is_one: bool = True
    """False for chaotic motion that may lie on several attractors, which could not be separated."""

    @property
    def is_chaotic(self) -> bool:
        """Whether it has no period."""
        return self.kind.kind is OrbitClass.chaos

    @property
    def name(self) -> str:
        """`P(p,q)`, `no impacts`, `chaos` ...; `chaotic, not told apart` where there may be several."""
        return self.kind.name if self.is_one else "chaotic, not told apart"


@dataclass(eq=False)
class Basins:
    """Starts and the attractors on which they end.

    Attributes
    ----------
    starts : array, shape (start, variable)
    labels : array of int, shape (start,)
        Numbers of attractors, or UNDECIDED, BEYOND_A_STOP.
    scale : array, shape (variable,)
        Size of the motion.
    attractors : list of Attractor
    told_by_sample : int
        Number of starts that count as chaotic because a sample of them was.
    undetected_share_below : float
        Share of the possible starts that may end elsewhere although none in that sample does. A larger share would have
        a start in the sample with a probability of 95 %.
    """

    starts: Floats
    labels: Labels
    scale: Floats
    attractors: list[Attractor] = field(default_factory=list)
    told_by_sample: int = 0
    undetected_share_below: float = 0.0

    @property
    def names(self) -> list[str]:
        """Names of the attractors; attractors of one kind have letters."""
        plain = [each.name for each in self.attractors]
        return [
            f"{name} {_letter(plain[:place].count(name))}" if plain.count(name) > 1 else name
            for place, name in enumerate(plain)
        ]

    @property
    def possible(self) -> int:
        """Number of starts that are possible for a body."""
        return int((self.labels != BEYOND_A_STOP).sum())

    @property
    def decided(self) -> float:
        """Share of the possible starts with a known end."""
        return float((self.labels >= 0).sum()) / max(self.possible, 1)

    @property
    def fractions(self) -> Floats:
        """Share of the possible starts that end on each attractor."""
        counts = np.bincount(self.labels[self.labels >= 0], minlength=len(self.attractors))
        found: Floats = counts / max(self.possible, 1)
        return found


def _letter(place: int) -> str:
    """Return a, b, ..., z, aa, ab, ...

    >>> _letter(0), _letter(25), _letter(26)
    ('a', 'z', 'aa')
    """
    letters = ""
    while place >= 0:
        letters = chr(ord("a") + place % 26) + letters
        place = place // 26 - 1
    return letters


def find_basins(basins: Basins, flow: Flow, *, block: int, seed: int = 1) -> Generator[Basins, None, None]:
    """Find the ends of the undecided starts; yield `basins`, which grow, after each block.

    Parameters
    ----------
    basins : Basins
    flow : Flow
    block : int
        Number of starts in one call.
    seed : int
        Seed of the choice of starts whose long runs find the attractors.
    """
    yield from _Search(basins, flow, block, np.random.default_rng(seed)).blocks()


class _Search:
    def __init__(self, basins: Basins, flow: Flow, block: int, draw: np.random.Generator) -> None:
        self._basins, self._flow, self._block, self._draw = basins, flow, block, draw
        self._now = basins.starts.copy()
        self._lost = np.zeros(len(self._now), np.bool_)
        # of chaotic runs: their features, groups, and the number of each group's attractor
        self._features = np.empty((0, 0))
        self._groups, self._numbers = NO_GROUPS, np.empty(0, np.int16)

    def blocks(self) -> Generator[Basins, None, None]:
        """Follow block after block."""
        self._find_attractors(self._left(), FIRST_SAMPLE, first=True)
        yield self._basins
        passed = 0
        for periods in ROUNDS:
            if not self._left().size:
                return
            for places in self._blocks():
                self._follow(places, periods, first=passed == 0)
                yield self._basins
            passed += periods
            if passed in SEARCH_PERIODS:
                self._find_attractors(self._left(), LATER_SAMPLE)
                self._match(self._left())
                self._label_chaos()
        self._find_attractors(self._left(), CHAOS_SAMPLE)
        self._match(self._left())
        self._label_chaos()

    def _left(self) -> NDArray[np.int64]:
        return np.flatnonzero((self._basins.labels == UNDECIDED) & ~self._lost)

    def _blocks(self) -> list[NDArray[np.int64]]:
        left = self._left()
        return np.array_split(left, max(1, -(-left.size // self._block)))

    def _follow(self, places: NDArray[np.int64], periods: int, *, first: bool) -> None:
        ends = self._flow.follow(self._now[places], periods, first=first)
        self._now[places] = ends.states
        self._lost[places] = ~ends.well
        self._match(places[ends.well])

    def _match(self, places: NDArray[np.int64]) -> None:
        """Label the starts that are near an attractor now."""
        for number, attractor in enumerate(self._basins.attractors):
            places = places[self._basins.labels[places] == UNDECIDED]
            near = self._near(self._now[places], attractor.states, attractor.radius)
            self._basins.labels[places[near]] = number

    def _near(self, states: Floats, points: Floats, radius: float) -> NDArray[np.bool_]:
        near = np.zeros(len(states), np.bool_)
        for point in points:
            near |= (np.abs(states - point) <= radius * self._basins.scale).all(axis=1)
        return near

    # ---- attractors ----

    def _find_attractors(self, places: NDArray[np.int64], most: int, *, first: bool = False) -> None:
        """Find the attractors of some of these starts."""
        if not places.size:
            return
        chosen = self._draw.choice(places, min(most, places.size), replace=False)
        kinds, states = self._flow.classes(self._now[chosen], TRANSIENT, first=first)
        for kind, state in zip(kinds, states, strict=True):
            if kind.kind is OrbitClass.chaos:
                if not any(each.is_chaotic for each in self._basins.attractors):
                    self._basins.attractors.append(self._chaotic(self._impacts(state, BLOCK)))
            elif kind.kind is not OrbitClass.unknown and np.isfinite(state).all():
                self._add(kind, state)

    def _add(self, kind: RunClass, state: Floats) -> None:
        known = [each for each in self._basins.attractors if not each.is_chaotic]
        if any(self._near(state[None], each.states, SAME)[0] for each in known):
            return
        state = self._settled(state, max(kind.periods, 1))
        rounds = [state]
        for _ in range(max(kind.periods, 1) - 1):
            rounds.append(self._flow.follow(rounds[-1][None], 1).states[0])
        states = np.array(rounds)
        radius = self._tried(states)
        if radius > 0.0:
            impacts = self._impacts(states[0], len(states))
            if kind.kind is OrbitClass.sticking:
                impacts = np.full_like(impacts, np.nan)
            self._basins.attractors.append(Attractor(kind, states, radius, impacts))

    def _impacts(self, state: Floats, periods: int) -> Floats:
        """Return the mean number of impacts in a forcing period at each stop."""
        return np.asarray(self._flow.measure(state[None], periods, 1).features[0, 0, :, Feature.impacts])

    def _settled(self, state: Floats, periods: int) -> Floats:
        """Return the state once it no longer changes between rounds, or after the largest number of checks."""
        for _ in range(MOST_SETTLING):
            later = self._flow.follow(state[None], SETTLING * periods)
            if not later.well[0]:
                break
            change, state = np.abs(later.states[0] - state), later.states[0]
            if (change <= SETTLED * self._basins.scale).all():
                break
        return state

    def _tried(self, states: Floats) -> float:
        """Return a distance from which all probe starts come back; 0 where none is large enough."""
        scale, radius = self._basins.scale, FARTHEST
        others = [each for each in self._basins.attractors if not each.is_chaotic]
        while radius >= NEAREST:
            offsets = self._draw.uniform(-1.0, 1.0, (PROBES, states.shape[1]))
            offsets *= self._draw.uniform(0.25, 1.0, (PROBES, 1)) / np.abs(offsets).max(axis=1, keepdims=True)
            places = np.repeat(states, PROBES, axis=0) + radius * scale * np.tile(offsets, (len(states), 1))
            ends = self._flow.follow(places, PROBE_PERIODS)
            # impossible probes (beyond a stop) do not count; all others must come nearer
            back = self._near(ends.states, states, 0.5 * radius) & ends.well
            separate = not any(
                self._near(states, each.states, 2.0 * (radius + each.radius)).any() for each in others
            )
            if ends.well.any() and (back | ~ends.well).all() and separate:
                return radius
            radius /= 4.0
        return 0.0

    # ---- chaos ----

    def _label_chaos(self) -> None:
        """Label the undecided starts as chaotic if all of a sample of them are."""
        chaotic = [n for n, each in enumerate(self._basins.attractors) if each.is_chaotic]
        left = self._left()
        if not (chaotic and left.size):
            return
        chosen = self._draw.choice(left, min(CHAOS_SAMPLE, left.size), replace=False)
        kinds, states = self._flow.classes(self._now[chosen], TRANSIENT_OF_CHAOS)
        is_chaos = np.array([kind.kind is OrbitClass.chaos for kind in kinds])
        if is_chaos.all():
            self._assign(left, chosen, states, chaotic[0])
        elif left.size <= CHAOS_SAMPLE and is_chaos.any():
            self._assign(chosen[is_chaos], chosen[is_chaos], states[is_chaos], chaotic[0])

    def _assign(
        self, places: NDArray[np.int64], chosen: NDArray[np.int64], states: Floats, first: int
    ) -> None:
        """Assign chaotic starts to attractors, separated by long runs of the chosen starts from the given states."""
        are_new = len(self._numbers) < 2
        own = self._grouped(self._flow.measure(states, BLOCK, BLOCKS).features, first)
        labels = np.zeros(self._basins.labels.size, np.int64)
        if len(self._numbers) > 1 and places.size > chosen.size:
            labels[places] = self._groups_by_blocks(places)
            if float((labels[chosen] == own).mean()) < LEAST_AGREEING:
                if are_new:
                    self._merge(first)
                    own = np.zeros_like(own)
                labels = np.full_like(labels, 0 if are_new else -1)
        labels[chosen] = own
        self._basins.labels[places] = np.append(self._numbers, UNDECIDED)[labels[places]]
        if places.size > chosen.size:
            self._basins.told_by_sample += int((labels[places] >= 0).sum()) - chosen.size
            missed = 1.0 - MISSED ** (1.0 / chosen.size)
            self._basins.undetected_share_below += missed * places.size / self._basins.possible

    def _grouped(self, features: Floats, first: int) -> NDArray[np.int64]:
        """Return the group of each of some long runs; a new group gets an attractor."""
        if len(self._numbers) > 1:
            return self._groups.of(features.mean(axis=1).reshape(len(features), -1))
        earlier = len(self._features)
        self._features = np.concatenate([self._features.reshape(-1, *features.shape[1:]), features])
        self._groups = grouped(self._features)
        known = int(self._groups.labels[0]) if earlier else 0
        self._numbers = np.full(len(self._groups.means), first, np.int16)
        for group, each in enumerate(self._impacts_of_groups()):
            if group != known:
                self._numbers[group] = len(self._basins.attractors)
                self._basins.attractors.append(self._chaotic(each))
            else:
                self._basins.attractors[first] = self._chaotic(each)
        return self._groups.labels[earlier:]

    def _merge(self, first: int) -> None:
        """Merge groups that single blocks do not separate."""
        self._groups, self._numbers = merged(self._groups), self._numbers[:1]
        chaotic = [each for each in self._basins.attractors if each.is_chaotic]
        self._basins.attractors[:] = [each for each in self._basins.attractors if not each.is_chaotic]
        self._basins.attractors.insert(first, replace(chaotic[0], is_one=False))

    def _chaotic(self, impacts: Floats) -> Attractor:
        state = np.empty((0, self._now.shape[1]))
        return Attractor(RunClass(OrbitClass.chaos), state, 0.0, impacts, self._groups.is_sure)

    def _impacts_of_groups(self) -> Floats:
        means = self._groups.means
        return means.reshape(len(means), -1, len(Feature))[..., Feature.impacts]

    def _groups_by_blocks(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the group of each start by its own impacts; -1 if it fits no group in the allowed blocks."""
        labels = np.full(places.size, -1, np.int64)
        for _ in range(MOST_BLOCKS):
            left = np.flatnonzero((labels < 0) & ~self._lost[places])
            for part in np.array_split(left, max(1, -(-left.size // self._block))):
                if part.size:
                    found = self._flow.measure(self._now[places[part]], BLOCK, 1)
                    self._now[places[part]], self._lost[places[part]] = found.states, ~found.well
                    labels[part] = self._groups.of(found.features.reshape(part.size, -1))
        return np.where(self._lost[places], -1, labels)


# ---- the border ----


class BorderDimension(NamedTuple):
    """Dimension of the border between basins in a plane of starts, and its standard error."""

    value: float
    error: float


def border_share(labels: Labels, distance: int = 1) -> float:
    """Return the share of grid starts with another end than a start at this distance along an axis.

    Parameters
    ----------
    labels : array, shape (y, x)
        Labels below 0 do not count.
    distance : int
        In cells.

    Examples
    --------
    >>> border_share(np.repeat([[0] * 4 + [1] * 4], 4, axis=0))
    0.25
    """
    there = labels >= 0
    differs, counted = np.zeros(labels.shape, np.bool_), np.zeros(labels.shape, np.bool_)
    for axis in (0, 1):
        if labels.shape[axis] <= distance:
            continue
        low = tuple(slice(None, -distance) if a == axis else slice(None) for a in (0, 1))
        high = tuple(slice(distance, None) if a == axis else slice(None) for a in (0, 1))
        both = there[low] & there[high]
        other = both & (labels[low] != labels[high])
        for part in (low, high):
            counted[part] |= both
            differs[part] |= other
    return float(differs.sum()) / max(int(counted.sum()), 1)


def border_dimension(labels: Labels, distances: Sequence[int] = (1, 2, 4, 8, 16)) -> BorderDimension | None:
    """Return the dimension of the border of basins, from the share of uncertain starts over their uncertainty.

    A start is uncertain if another start at a distance d has another end. The share of uncertain starts grows as
    d^(2 - D) (McDonald, Grebogi, Ott and Yorke 1985).

    Parameters
    ----------
    labels : array, shape (y, x)
    distances : sequence of int
        In cells.

    Returns
    -------
    BorderDimension or None
        None if there is no border, or the grid is smaller than 8 of the largest distances.
    """
    if min(labels.shape) < 8 * max(distances):
        return None
    shares = np.array([border_share(labels, distance) for distance in distances])
    if not (shares > 0.0).all() or shares.max() > 0.9:
        return None
    places, logs = np.log(np.array(distances, dtype=np.float64)), np.log(shares)
    slope, start = np.polyfit(places, logs, 1)
    off = logs - slope * places - start
    error = np.sqrt(float(off @ off) / (places.size - 2) / float(((places - places.mean()) ** 2).sum()))
    return BorderDimension(2.0 - float(slope), float(error))
