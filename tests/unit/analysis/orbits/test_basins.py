"""Basins of maps with known basins, and dimensions of known borders."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.attractors.basin_search import find_basins
from vibroimpact.analysis.orbits.attractors.basins import (
    BEYOND_A_STOP,
    UNDECIDED,
    Basins,
    Ends,
    Floats,
    Section,
)
from vibroimpact.analysis.orbits.attractors.borders import border_dimension, border_share
from vibroimpact.analysis.orbits.attractors.chaotic_groups import Blocks, Feature
from vibroimpact.analysis.orbits.classify import RunClass

BORDER = 0.3


class KnownMap:
    """A map: starts left of BORDER go to (-1, 0), starts from there to 3 to a cycle of two, others never settle.

    The chaotic starts above y = 0 hit a second stop at a rate of their own. The share `bridge` of all chaotic starts
    changes over.
    """

    def __init__(
        self, *, is_slow: bool = False, rates: tuple[float, float] = (0.2, 0.2), bridge: float = 0.0
    ) -> None:
        self._rate = 0.99 if is_slow else 0.5
        self._rates, self._bridge = rates, bridge
        self._draw = np.random.default_rng(5)
        self.followed = 0

    def _after(self, states: Floats, periods: int) -> Floats:
        x, y = states.T
        rate = self._rate**periods
        left = np.column_stack([-1.0 + rate * (x + 1.0), rate * y])
        # a cycle of two about (1, 0): y changes its sign
        turned = (-1.0) ** periods * np.sign(y + 1e-300)
        right = np.column_stack([1.0 + rate * (x - 1.0), turned * (0.5 + rate * (abs(y) - 0.5))])
        where = np.where(x < BORDER, 0, np.where(x < 3.0, 1, 2))
        found = np.where(where[:, None] == 0, left, right)
        if (where == 2).any():
            found[where == 2] = self._wild(states[where == 2], periods)
        return found

    @staticmethod
    def _wild(states: Floats, periods: int) -> Floats:
        logistic = (states[:, 0] - 4.0) % 1.0
        for _ in range(periods):
            logistic = np.clip(3.999 * logistic * (1.0 - logistic), 1e-9, 1.0 - 1e-9)
        return np.column_stack([4.0 + logistic, states[:, 1]])

    decay = float("inf")
    free_state = None
    turns = None

    @staticmethod
    def stays_free(states: Floats) -> NDArray[np.bool_]:
        return np.zeros(len(states), np.bool_)

    def section(self, states: Floats, periods: int) -> Section:
        points = [states]
        for _ in range(periods - 1):
            points.append(self._after(points[-1], 1))
        table = np.stack(points, axis=1)
        return Section(table, np.column_stack([table[..., 0].min(axis=1), table[..., 0].max(axis=1)]))

    def follow(self, states: Floats, periods: int, *, first: bool = False) -> Ends:
        self.followed += len(states) * periods if len(states) > 1 else 0
        states = self._after(states, periods)
        return Ends(states, np.isfinite(states).all(axis=1))

    def classes(
        self, states: Floats, transient: int, *, first: bool = False
    ) -> tuple[list[RunClass], Floats]:
        ends = self.follow(states, min(transient, 4000)).states
        found = []
        for x, _ in ends:
            if x > 3.0:
                found.append(RunClass(OrbitClass.chaos))
            elif x > BORDER:
                found.append(RunClass(OrbitClass.periodic, 1, 2))
            else:
                found.append(RunClass(OrbitClass.no_impacts))
        return found, ends

    def measure(self, states: Floats, periods: int, blocks: int) -> Blocks:
        features = np.zeros((len(states), blocks, 2, len(Feature)))
        for block in range(blocks):
            above = (states[:, 1] > 0.0).astype(int)
            above ^= self._draw.random(len(states)) < self._bridge
            rate = np.array(self._rates)[above]
            features[:, block, 0, Feature.impacts] = 1.0
            features[:, block, 1, Feature.impacts] = self._draw.binomial(periods, rate) / periods
            features[:, block, 1, Feature.speed] = 2.0 * features[:, block, 1, Feature.impacts]
        ends = self.follow(states, periods * blocks)
        return Blocks(features, ends.states, ends.well)


def plane(x: Floats, y: Floats) -> Basins:
    states = np.column_stack([np.tile(x, y.size), np.repeat(y, x.size)])
    return Basins(states, np.full(len(states), UNDECIDED, np.int16), np.ones(2))


@pytest.mark.parametrize("is_slow", [False, True])
def test_each_start_gets_the_attractor_that_it_ends_on(is_slow: bool) -> None:
    found = plane(np.linspace(-2.0, 2.0, 11), np.linspace(-1.0, 1.0, 3))
    deque(find_basins(found, KnownMap(is_slow=is_slow), block=12), 0)
    names = np.array(found.names)[found.labels]
    assert set(found.names) == {"P(1,2)", "no impacts"}
    assert (names == np.where(found.starts[:, 0] < BORDER, "no impacts", "P(1,2)")).all()
    assert found.decided == 1.0
    assert found.fractions.sum() == pytest.approx(1.0)
    cycle = found.attractors[found.names.index("P(1,2)")].states
    assert np.abs(cycle[:, 1]) == pytest.approx([0.5, 0.5], abs=1e-9)
    assert all(1e-7 <= each.radius <= 1e-2 for each in found.attractors)


def test_chaos_is_told_by_a_sample_of_what_is_left() -> None:
    found = plane(np.linspace(3.2, 4.8, 60), np.linspace(-1.0, 1.0, 10))
    deque(find_basins(found, KnownMap(), block=1000), 0)
    assert found.names == ["chaos"]
    assert (found.labels == 0).all()
    assert found.told_by_sample == 600 - 256


CHAOTIC = np.linspace(3.2, 4.8, 60), np.linspace(-1.0, 1.0, 10)


def test_a_sample_says_what_share_it_may_have_missed() -> None:
    found = plane(*CHAOTIC)
    deque(find_basins(found, KnownMap(), block=1000), 0)
    missed = found.undetected_share_below
    assert (1.0 - missed) ** 256 == pytest.approx(0.05)
    few = plane(CHAOTIC[0][::3], CHAOTIC[1])
    deque(find_basins(few, KnownMap(), block=1000), 0)
    assert few.undetected_share_below == 0.0, "all 200 starts have a long run of their own"


def test_chaotic_attractors_are_told_apart_by_the_impacts_at_a_stop() -> None:
    found = plane(*CHAOTIC)
    deque(find_basins(found, KnownMap(rates=(0.1, 0.9)), block=100), 0)
    assert found.names == ["chaos a", "chaos b"]
    assert found.decided == 1.0
    assert found.fractions == pytest.approx([0.5, 0.5])
    above = found.labels[found.starts[:, 1] > 0.0]
    assert len(np.unique(above)) == 1
    assert found.attractors[above[0]].impacts == pytest.approx([1.0, 0.9], abs=0.01)


def test_chaotic_runs_that_differ_but_overlap_are_not_told_apart() -> None:
    found = plane(*CHAOTIC)
    deque(find_basins(found, KnownMap(rates=(0.4, 0.5)), block=1000), 0)
    assert found.names == ["chaotic, not told apart"]
    assert (found.labels == 0).all()


def test_runs_that_change_over_belong_to_one_attractor() -> None:
    found = plane(*CHAOTIC)
    deque(find_basins(found, KnownMap(rates=(0.1, 0.9), bridge=0.5), block=1000), 0)
    assert found.names == ["chaos"]


def test_starts_beyond_a_stop_are_left_alone_and_do_not_count() -> None:
    found = plane(np.linspace(-2.0, 0.2, 20), np.linspace(-1.0, 1.0, 10))
    found.labels[:50] = BEYOND_A_STOP
    deque(find_basins(found, KnownMap(), block=64), 0)
    assert (found.labels[:50] == BEYOND_A_STOP).all()
    assert (found.possible, found.decided) == (150, 1.0)
    assert found.fractions == pytest.approx([1.0])


def test_what_a_search_that_is_given_up_leaves_is_right_as_far_as_it_is_known() -> None:
    found = plane(np.linspace(-2.0, 2.0, 41), np.linspace(-1.0, 1.0, 21))
    next(now for now in find_basins(found, KnownMap(), block=100) if now.decided > 0.5)
    known = found.labels >= 0
    assert 0.5 < known.mean() < 1.0
    names = np.array(found.names)[found.labels[known]]
    assert (names == np.where(found.starts[known, 0] < BORDER, "no impacts", "P(1,2)")).all()


def test_a_start_is_followed_no_longer_than_it_takes() -> None:
    flow = KnownMap()
    deque(find_basins(plane(np.linspace(-2.0, 0.0, 100), np.linspace(-1.0, 1.0, 100)), flow, block=1000), 0)
    long_runs = 64 * 1064 + 2 * 24 * 400 * 4
    assert flow.followed < 10_000 * 24 + 64 * 1064 + long_runs


def test_the_share_of_a_border_and_the_dimension_of_a_line() -> None:
    labels = np.zeros((256, 256), np.int16)
    labels[:, 100:] = 1
    assert border_share(labels) == pytest.approx(2.0 / 256.0)
    found = border_dimension(labels)
    assert found is not None
    assert found.value == pytest.approx(1.0, abs=1e-9)
    assert border_dimension(np.zeros((256, 256), np.int16)) is None, "no border"
    assert border_dimension(labels[:100, :100]) is None, "too small"


def test_the_dimension_of_a_cantor_set_of_lines() -> None:
    # the border is the Cantor set: points are labelled by the parity of the step in which they fall into a middle third
    x = (np.arange(3**7) + 0.5) / 3**7
    side = np.full(x.size, -1)
    for step in range(7):
        side[(x > 1.0 / 3.0) & (x < 2.0 / 3.0) & (side < 0)] = step % 2
        x = np.where(side < 0, np.where(x < 0.5, 3.0 * x, 3.0 * x - 2.0), x)
    labels = np.tile(np.where(side < 0, 1, side).astype(np.int16), (256, 1))
    found = border_dimension(labels, (3, 9, 27))
    assert found is not None
    assert found.value == pytest.approx(1.0 + np.log(2.0) / np.log(3.0), abs=0.08)


@given(st.integers(0, 2**31), st.integers(1, 5))
@settings(max_examples=60)
def test_shares_of_borders_are_those_counted_one_by_one(seed: int, distance: int) -> None:
    labels = np.random.default_rng(seed).integers(-2, 3, (9, 12)).astype(np.int16)
    differs, counted = 0, 0
    for y, x in np.ndindex(labels.shape):
        near = [
            labels[b, a]
            for b, a in ((y - distance, x), (y + distance, x), (y, x - distance), (y, x + distance))
            if 0 <= b < 9 and 0 <= a < 12 and labels[b, a] >= 0
        ]
        if labels[y, x] >= 0 and near:
            counted += 1
            differs += any(other != labels[y, x] for other in near)
    assert border_share(labels, distance) == pytest.approx(differs / max(counted, 1))
