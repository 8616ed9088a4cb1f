"""Motions told apart by the cells of the section that they visit again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.attractors.recurrence import correlation_dimension, recurrence

Floats = NDArray[np.float64]


def logistic(start: float, rate: float = 3.999, periods: int = 2048) -> Floats:
    """Return states of a chaotic map and their successors, shape (period, 2)."""
    found = np.empty(periods + 1)
    found[0] = start
    for place in range(periods):
        found[place + 1] = rate * found[place] * (1.0 - found[place])
    return np.column_stack([found[:-1], found[1:]])


@given(st.lists(st.integers(0, 2), min_size=2, max_size=9), st.integers(0, 1000))
@settings(max_examples=20)
def test_motions_on_one_attractor_get_one_label(kinds: list[int], seed: int) -> None:
    draw = np.random.default_rng(seed)
    runs = np.array([logistic(draw.uniform(0.1, 0.4)) + 1.5 * kind for kind in kinds])
    found = recurrence(runs)
    same = np.equal.outer(found.labels, found.labels)
    assert (same == np.equal.outer(np.array(kinds), np.array(kinds))).all()
    assert found.is_sure
    assert found.recurs.all()


def test_a_transient_does_not_recur() -> None:
    decaying = np.exp(-np.arange(2048.0) / 300.0)
    angle = np.arange(2048.0)
    spiral = decaying[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    steady = np.column_stack([np.cos(angle), np.sin(angle)])
    assert recurrence(np.array([steady] * 12 + [spiral])).recurs.tolist() == [True] * 12 + [False]


def test_interleaved_attractors_share_large_cells_but_no_small_ones() -> None:
    # two circles that cross each other: their cells at the crossings are shared
    angle = np.arange(4096.0)
    one = np.column_stack([np.cos(angle), np.sin(angle)])
    found = recurrence(np.array([one, one + np.array([0.5, 0.0]), one]))
    assert found.labels.tolist() == [0, 1, 0]


@pytest.mark.parametrize(("states", "dimension"), [(np.zeros((500, 2)), 0.0), (np.zeros((50, 2)), 0.0)])
def test_an_orbit_has_no_dimension(states: Floats, dimension: float) -> None:
    assert correlation_dimension(states) == dimension


def test_the_dimension_of_a_henon_attractor() -> None:
    states = np.empty((1500, 2))
    x, y = 0.1, 0.1
    for place in range(1600):
        x, y = 1.0 - 1.4 * x * x + y, 0.3 * x
        if place >= 100:
            states[place - 100] = x, y
    # Grassberger and Procaccia (1983): 1.21 +- .01 from 15,000 states
    assert correlation_dimension(states) == pytest.approx(1.21, abs=0.06)
