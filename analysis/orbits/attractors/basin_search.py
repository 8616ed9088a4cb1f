"""The search for the ends of the starts of a plane.

Starts are followed from one forcing phase 0 to another until they are near a known attractor. The limit of near is
determined first: probe starts at that distance must come back. Long runs of some of the starts find the attractors,
later also long runs of some starts that are near none. The slowest decay that was met says how long starts run.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.attractors.aperiodic import (
    APERIODIC,
    DRAWN,
    LongRuns,
    are_aperiodic,
    attractor_of_runs,
)
from vibroimpact.analysis.orbits.attractors.basins import (
    UNDECIDED,
    Attractor,
    Basins,
    Features,
    Floats,
    Flow,
    Section,
    Separation,
    missed_share,
)
from vibroimpact.analysis.orbits.attractors.chaotic_groups import (
    BLOCK,
    BLOCKS,
    LEAST_AGREEING,
    MOST_BLOCKS,
    Feature,
    grouped,
    merged,
)
from vibroimpact.analysis.orbits.attractors.recurrence import Recurrence, long_period, recurrence
from vibroimpact.analysis.orbits.classify import RunClass

Places = NDArray[np.int64]

FIRST_SAMPLE, LATER_SAMPLE = 64, 32
"""Number of starts whose long runs find attractors: at first, and of the starts that are near none later."""
CHAOS_SAMPLE = 256
"""Number of the last starts that must all be chaotic for the others to count as chaotic."""
MOST_SINGLE = 4096
"""Largest number of the last starts that get long runs of their own."""
ROUNDS = (24, 32, 48, 96, 200, 400, 800)
"""Forcing periods between two checks of the starts."""
SEARCH_PERIODS = (104, 400, 1600)
"""Forcing periods after which attractors are searched again."""
SETTLING = 12.0
"""Logarithm of the fall of the slowest motion for which a start is followed; most are near an attractor by then."""
NEAREST, FARTHEST = 1e-7, 1e-2
"""Smallest and largest distance from an attractor, over the size of the motion, to try as the limit of near."""
TRANSIENT, TRANSIENT_OF_CHAOS = 1000, 10_000
"""Forcing periods after which a run has its class, and after which its chaos counts as permanent."""
ROUND, SETTLED, NEARLY_SETTLED = 64, 1e-13, 1e-9
"""Rounds before the first check of an attractor's state; changes, over the size, that count as none and as rounding."""
PROBES, PROBE_PERIODS, PROBE_FALL = 24, 400, 7.0
"""Number of probe starts, least number of periods in which they must come back, and logarithm of their fall."""
MOST_PROBED = 32
"""Largest number of states of an attractor around which probe starts begin."""
STEP = 1e-8
"""Step of the differences that give the multipliers of an attractor, over the size of the motion."""
LEAST_MULTIPLIER = 1e-7
"""Multiplier over all periods of an attractor below which it counts as 0: differences of STEP have this rounding."""
SAME = 1e-5
"""Distance, over the size of the motion, below which two attractors are equal."""


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


class OnTheirWay:
    """Starts on their way, which get the number of the attractor that they come near to."""

    def __init__(self, basins: Basins, flow: Flow, block: int) -> None:
        self._basins, self._flow, self._block = basins, flow, block
        self._now = basins.starts.copy()
        self._lost = np.zeros(len(self._now), np.bool_)

    def left(self) -> Places:
        """Return the undecided starts whose runs did not fail."""
        return np.flatnonzero((self._basins.labels == UNDECIDED) & ~self._lost)

    def blocks_of(self, places: Places) -> list[Places]:
        """Return starts in blocks of one call."""
        return np.array_split(places, max(1, -(-places.size // self._block)))

    def follow(self, places: Places, periods: int, *, first: bool = False) -> None:
        """Follow starts for some forcing periods, and label those that are near an attractor then."""
        ends = self._flow.follow(self._now[places], periods, first=first)
        self._now[places] = ends.states
        self._lost[places] = ~ends.well
        self.match(places[ends.well])

    def match(self, places: Places) -> None:
        """Label the starts that are near an attractor now."""
        for number, attractor in enumerate(self._basins.attractors):
            places = places[self._basins.labels[places] == UNDECIDED]
            near = self.near(self._now[places], attractor.states, attractor.radius)
            if attractor.kind.kind is OrbitClass.no_impacts and self._flow.free_state is not None:
                near |= self._flow.stays_free(self._now[places])
            self._basins.labels[places[near]] = number

    def near(self, states: Floats, points: Floats, radius: float) -> NDArray[np.bool_]:
        """Return a mask of the states within a distance, over the size of the motion, of one of the points."""
        near = np.zeros(len(states), np.bool_)
        for point in points:
            near |= (np.abs(states - point) <= radius * self._basins.scale).all(axis=1)
        return near

    def groups_by_blocks(self, places: Places) -> NDArray[np.int64]:
        """Return the chaotic group of each start by its own impacts; -1 if it fits none in the allowed blocks."""
        labels = np.full(places.size, -1, np.int64)
        for _ in range(MOST_BLOCKS):
            left = np.flatnonzero((labels < 0) & ~self._lost[places])
            for part in self.blocks_of(left):
                if part.size:
                    found = self._flow.measure(self._now[places[part]], BLOCK, 1)
                    self._now[places[part]], self._lost[places[part]] = found.states, ~found.well
                    labels[part] = self._basins.groups.of(found.features.reshape(part.size, -1))
        return np.where(self._lost[places], -1, labels)


class _Search(OnTheirWay):
    def __init__(self, basins: Basins, flow: Flow, block: int, draw: np.random.Generator) -> None:
        super().__init__(basins, flow, block)
        self._draw = draw
        self._runs: LongRuns | None = None
        self._seen_aperiodic = False

    def blocks(self) -> Generator[Basins, None, None]:
        """Follow block after block."""
        self._find_attractors(self.left(), FIRST_SAMPLE, first=True)
        yield self._basins
        while self.left().size and (periods := self._next_round()):
            passed = self._basins.followed_periods
            for places in self.blocks_of(self.left()):
                self.follow(places, periods, first=passed == 0)
                self._see_free_motion(places)
                yield self._basins
            self._basins.followed_periods += periods
            if passed + periods in SEARCH_PERIODS or passed >= SEARCH_PERIODS[-1]:
                self._search_again()
                yield self._basins
        self._decide_by_long_runs()
        yield self._basins

    def _next_round(self) -> int:
        """Return the periods of the next round; 0 where the slowest motion has decayed, or the budget is used up."""
        passed, least = self._basins.followed_periods, sum(ROUNDS)
        rates = [self._flow.decay, *(each.decay for each in self._basins.attractors)]
        slowest = min(rate for rate in rates if rate > 0.0)
        self._basins.needed_periods = max(least, int(np.ceil(SETTLING / slowest)))
        longest = min(self._basins.needed_periods, self._basins.most_periods)
        rounds = np.cumsum(ROUNDS)
        planned = ROUNDS[int(np.searchsorted(rounds, passed, side="right"))] if passed < least else passed
        return max(0, min(planned, longest - passed))

    def _search_again(self) -> None:
        self._find_attractors(self.left(), LATER_SAMPLE)
        self.match(self.left())
        self._label_aperiodic()

    # ---- attractors with a period ----

    def _see_free_motion(self, places: Places) -> None:
        """Name the motion without impacts once a start can meet no stop any more."""
        state, left = self._flow.free_state, places[self._basins.labels[places] == UNDECIDED]
        if (
            state is None
            or self._knows_free_motion()
            or not (free := self._flow.stays_free(self._now[left])).any()
        ):
            return
        if self._flow.turns is None:
            self._keep(RunClass(OrbitClass.no_impacts, 0, 1), state[None])
        else:
            self._keep_free_motion(self._now[left[free][0]])
        self.match(left)

    def _knows_free_motion(self) -> bool:
        return any(each.kind.kind is OrbitClass.no_impacts for each in self._basins.attractors)

    def _keep_free_motion(self, state: Floats) -> None:
        """Append the motion without impacts of forces that do not repeat; it has no state that repeats."""
        section = self._flow.section(state[None], BLOCK * BLOCKS)
        measured = self._flow.measure(state[None], BLOCK, 1).features[0, 0]
        features = Features(measured, section.extremes[0])
        drawn, none = self._states_of(state, DRAWN), np.empty((0, state.size))
        kind = RunClass(OrbitClass.no_impacts)
        self._basins.attractors.append(Attractor(kind, none, 0.0, features, self._flow.decay, drawn))

    def _find_attractors(self, places: Places, most: int, *, first: bool = False) -> None:
        """Find the attractors of some of these starts."""
        if not places.size:
            return
        chosen = self._draw.choice(places, min(most, places.size), replace=False)
        kinds, states = self._flow.classes(self._now[chosen], TRANSIENT, first=first)
        for kind, state in zip(kinds, states, strict=True):
            self._add(kind, state)

    def _add(self, kind: RunClass, state: Floats) -> None:
        """Keep the attractor of a run that repeats, unless it is known or no attractor."""
        if not np.isfinite(state).all():
            return
        if kind.kind is OrbitClass.no_impacts and self._flow.turns is not None:
            return  # its starts are known as soon as they can meet no stop
        if kind.kind in APERIODIC:
            self._seen_aperiodic = True
            return
        periods = max(kind.periods, 1)
        if self._is_known(state):
            return
        settled = self._settled(state, periods)
        if settled is None or self._is_known(settled):
            return
        states = self._states_of(settled, periods)
        # a transient with a multiplier near -1 alternates: its class has twice the period
        again = [n for n in range(1, len(states)) if periods % n == 0 and self._is_same(states[n], settled)]
        if again:
            kind = replace(kind, impacts=kind.impacts * again[0] // periods, periods=again[0])
            states = states[: again[0]]
        self._keep(kind, states)

    def _states_of(self, state: Floats, periods: int) -> Floats:
        """Return the states of some consecutive periods, shape (period, variable)."""
        found = state[None]
        while len(found) < periods:
            found = np.concatenate([found, self._flow.follow(found, len(found)).states])
        return found[:periods]

    def _is_same(self, one: Floats, other: Floats) -> bool:
        return bool((np.abs(one - other) <= NEARLY_SETTLED * self._basins.scale).all())

    def _is_known(self, state: Floats) -> bool:
        return any(self.near(state[None], each.states, SAME)[0] for each in self._basins.attractors)

    def _keep(self, kind: RunClass, states: Floats) -> None:
        """Append an attractor with a period, unless its neighbours leave it."""
        decay = self._decay(states)
        radius = self._tried(states, decay)
        if radius == 0.0 and decay <= 0.0:
            return  # a run that had not settled: an unstable orbit
        measured = self._flow.measure(states[:1], len(states), 1).features[0, 0]
        if kind.kind is OrbitClass.sticking:
            measured = np.full_like(measured, np.nan)
        extremes = self._flow.section(states[:1], len(states)).extremes[0]
        found = Attractor(kind, states, radius, Features(measured, extremes), decay)
        self._basins.attractors.append(found)

    def _settled(self, state: Floats, periods: int) -> Floats | None:
        """Return the state once it no longer changes between rounds; None where it still does after the budget."""
        passed, rounds, change = 0, ROUND, np.full(state.shape, np.inf)
        while passed == 0 or passed + rounds * periods <= self._basins.most_periods:
            later = self._flow.follow(state[None], rounds * periods)
            if not later.well[0]:
                return None
            change, state = np.abs(later.states[0] - state) / self._basins.scale, later.states[0]
            passed += rounds * periods
            if (change <= SETTLED).all():
                break
            rounds = max(ROUND, passed // periods // 2)
        return state if (change <= NEARLY_SETTLED).all() else None

    def _decay(self, states: Floats) -> float:
        """Return the rate at which the slowest neighbours of an orbit come back, 1 / forcing period, by differences."""
        size, steps = states.shape[1], STEP * self._basins.scale
        around = np.concatenate([states[0] + np.diag(steps), states[0] - np.diag(steps), states[:1]])
        ends = self._flow.follow(around, len(states))
        # impossible neighbours, beyond a stop, leave the difference to the other side
        there = np.where(ends.well[:, None], ends.states, ends.states[-1])
        apart = np.maximum(ends.well[:size].astype(float) + ends.well[size : 2 * size], 1.0) * steps
        jacobian = (there[:size] - there[size : 2 * size]) / apart[:, None]
        largest = float(np.abs(np.linalg.eigvals(jacobian)).max()) if np.isfinite(jacobian).all() else 1.0
        return -np.log(largest) / len(states) if largest > LEAST_MULTIPLIER else np.inf

    def _tried(self, states: Floats, decay: float) -> float:
        """Return a distance from which all probe starts come back; 0 where none is large enough."""
        scale, radius, periods = self._basins.scale, FARTHEST, len(states)
        others = [each for each in self._basins.attractors if each.has_period]
        needed = PROBE_FALL / decay if decay > 0.0 else 0.0
        # whole rounds, so that probes are compared at the state around which they began
        passed = periods * int(np.ceil(min(max(needed, PROBE_PERIODS), self._basins.most_periods) / periods))
        tried = states[:: -(-periods // MOST_PROBED)]
        while radius >= NEAREST:
            offsets = self._draw.uniform(-1.0, 1.0, (PROBES, states.shape[1]))
            offsets *= self._draw.uniform(0.25, 1.0, (PROBES, 1)) / np.abs(offsets).max(axis=1, keepdims=True)
            places = np.repeat(tried, PROBES, axis=0) + radius * scale * np.tile(offsets, (len(tried), 1))
            ends = self._flow.follow(places, passed)
            # impossible probes (beyond a stop) do not count; all others must come nearer
            back = self.near(ends.states, states, 0.5 * radius) & ends.well
            separate = not any(
                self.near(states, each.states, 2.0 * (radius + each.radius)).any() for each in others
            )
            if ends.well.any() and (back | ~ends.well).all() and separate:
                return radius
            radius /= 4.0
        return 0.0

    # ---- attractors without a period ----

    def _label_aperiodic(self) -> None:
        """Label the undecided starts as on attractors without a period if all of a sample of them are."""
        left = self.left()
        if not (self._seen_aperiodic and left.size):
            return
        chosen = self._draw.choice(left, min(CHAOS_SAMPLE, left.size), replace=False)
        kinds, states = self._flow.classes(self._now[chosen], self._transient)
        if all(kind.kind is OrbitClass.chaos for kind in kinds):
            self._assign(left, chosen, kinds, states)

    def _count_sample(self, places: Places, chosen: Places) -> None:
        """Count the starts that a sample of them labelled, and the share that it may have missed."""
        found = self._basins
        found.told_by_sample += int((found.labels[places] >= 0).sum()) - chosen.size
        found.undetected_share_below += missed_share(chosen.size) * places.size / found.possible

    @property
    def _transient(self) -> int:
        """Forcing periods after which chaos counts as permanent."""
        return min(max(TRANSIENT_OF_CHAOS, self._basins.needed_periods), self._basins.most_periods)

    def _decide_by_long_runs(self) -> None:
        """Label the last starts by long runs: of a sample of them if all of it is aperiodic, else of each of them."""
        left = self.left()
        if not left.size:
            return
        chosen, kinds = self._long_runs(left, CHAOS_SAMPLE)
        if not are_aperiodic(kinds, self._now[chosen]).all() and left.size > chosen.size:
            chosen, kinds = self._long_runs(left, MOST_SINGLE)
        for place, kind in zip(chosen, kinds, strict=True):
            self._add(kind, self._now[place])
        for place, kind in zip(chosen, kinds, strict=True):
            self._basins.labels[place] = self._ended_on(kind, self._now[place])
        self.match(self.left())
        aperiodic = are_aperiodic(kinds, self._now[chosen])
        if aperiodic.any() and not aperiodic.all():
            # some of them may not yet have come near to the attractors of the others
            self.follow(chosen[aperiodic], self._transient)
            aperiodic &= (self._basins.labels[chosen] == UNDECIDED) & ~self._lost[chosen]
        kinds = [kind for kind, each in zip(kinds, aperiodic, strict=True) if each]
        if kinds:
            places = left if aperiodic.all() else chosen[aperiodic]
            self._assign(places, chosen[aperiodic], kinds, self._now[chosen[aperiodic]])

    def _long_runs(self, left: Places, most: int) -> tuple[Places, list[RunClass]]:
        """Run some of the starts for long; return them and their classes."""
        chosen = self._draw.choice(left, min(most, left.size), replace=False)
        kinds, self._now[chosen] = self._flow.classes(self._now[chosen], self._transient)
        return chosen, self._with_long_periods(kinds, self._now[chosen])

    def _with_long_periods(self, kinds: list[RunClass], states: Floats) -> list[RunClass]:
        """Return the classes of runs; chaos and unknown ones get the period with which their section repeats."""
        unknown = np.flatnonzero(are_aperiodic(kinds, states))
        if not unknown.size or self._flow.turns is not None:  # no state has its phases of further sines again
            return kinds
        found, sections = list(kinds), self._flow.section(states[unknown], BLOCK * BLOCKS).states
        for place, section in zip(unknown.tolist(), sections, strict=True):
            if periods := long_period(section):
                measured = self._flow.measure(states[place][None], periods, 1).features
                impacts = round(float(measured[..., Feature.impacts].sum()) * periods)
                found[place] = RunClass(OrbitClass.periodic, impacts, periods)
        return found

    def _ended_on(self, kind: RunClass, state: Floats) -> int:
        """Return the attractor of the same class whose state a long run has reached."""
        for number, each in enumerate(self._basins.attractors):
            if each.kind.name == kind.name and self.near(state[None], each.states, max(each.radius, SAME))[0]:
                return number
        return UNDECIDED

    def _assign(self, places: Places, chosen: Places, kinds: list[RunClass], states: Floats) -> None:
        """Assign aperiodic starts to attractors, separated by long runs of the chosen starts from the given states."""
        section = self._flow.section(states, BLOCK * BLOCKS)
        by_cells = recurrence(section.states)
        recurs = by_cells.recurs
        if not recurs.all():  # transients among them: only those that recur have ended
            chosen = places = chosen[recurs]
            if not chosen.size:
                return
            kinds = [kind for kind, each in zip(kinds, recurs, strict=True) if each]
            states, section = states[recurs], Section(section.states[recurs], section.extremes[recurs])
        are_new = len(self._basins.numbers) < 2
        measured = self._flow.measure(states, BLOCK, BLOCKS).features
        chaotic = np.array([kind.kind is OrbitClass.chaos for kind in kinds])
        runs = LongRuns(chaotic, measured, section.states, section.extremes, states)
        own = self._grouped(runs, by_cells if recurs.all() else recurrence(section.states))
        labels = np.zeros(self._basins.labels.size, np.int64)
        if len(self._basins.numbers) > 1 and places.size > chosen.size:
            labels[places] = self.groups_by_blocks(places)
            if float((labels[chosen] == own).mean()) < LEAST_AGREEING:
                if are_new:
                    self._merge()
                    own = np.zeros_like(own)
                labels = np.full_like(labels, 0 if are_new else -1)
        labels[chosen] = own
        self._basins.labels[places] = np.append(self._basins.numbers, UNDECIDED)[labels[places]]
        if places.size > chosen.size:
            self._count_sample(places, chosen)

    def _grouped(self, runs: LongRuns, by_cells: Recurrence) -> NDArray[np.int64]:
        """Return the group of each of some long runs; a new group gets an attractor."""
        found = self._basins
        if len(found.numbers) > 1:
            return found.groups.of(runs.features.mean(axis=1).reshape(len(runs.features), -1))
        earlier = 0 if self._runs is None else len(self._runs.chaotic)
        if self._runs is not None:
            runs = LongRuns(*(np.concatenate(both) for both in zip(self._runs, runs, strict=True)))
            by_cells = recurrence(runs.sections)
        self._runs, found.groups = runs, grouped(runs.features)
        known = int(found.groups.labels[0]) if earlier else -1
        numbers = np.full(len(found.groups.means), found.numbers[0] if earlier else -1, np.int16)
        for group in range(len(numbers)):
            attractor = self._aperiodic(group, runs)
            if group == known:
                found.attractors[numbers[group]] = attractor
            else:
                numbers[group] = len(found.attractors)
                found.attractors.append(attractor)
        found.numbers = numbers
        agree = _same_partition(by_cells.labels, found.groups.labels)
        found.separation = Separation(len(numbers), int(by_cells.labels.max()) + 1, agree)
        return found.groups.labels[earlier:]

    def _aperiodic(self, group: int, runs: LongRuns) -> Attractor:
        """Return the attractor of a group of runs."""
        groups, flow = self._basins.groups, self._flow
        found = attractor_of_runs(runs.of(groups.labels == group), flow, self._basins.scale)
        section = self._states_of(runs.states[groups.labels == group][0], DRAWN)
        at_stops = groups.means[group].reshape(-1, len(Feature))
        features = replace(found.features, at_stops=at_stops)
        return replace(found, features=features, section=section, is_one=groups.is_sure)

    def _merge(self) -> None:
        """Merge groups that single blocks do not separate."""
        found = self._basins
        found.groups, first, others = merged(found.groups), found.numbers[0], set(found.numbers[1:].tolist())
        found.attractors[first] = replace(found.attractors[first], is_one=False)
        found.attractors[:] = [each for n, each in enumerate(found.attractors) if n not in others]
        found.numbers = found.numbers[:1]


def _same_partition(one: NDArray[np.int64], other: NDArray[np.int64]) -> bool:
    """Tell whether two labellings separate the same members."""
    return bool(((one[:, None] == one) == (other[:, None] == other)).all())
