"""Zeros of sums of sines: all of them, also two that touch, and none that are not there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.orbits.trigonometric import TURN, SumOfSines

numbers = st.floats(-1.0, 1.0)


@st.composite
def sums(draw: st.DrawFn) -> SumOfSines:
    order = np.array(sorted(draw(st.sets(st.integers(1, 40), min_size=1, max_size=5))), dtype=float)
    cosine, sine = (np.array([draw(numbers) for _ in order]) for _ in range(2))
    assume(np.abs(cosine).max() + np.abs(sine).max() > 1e-3)
    return SumOfSines(draw(numbers), order, cosine, sine)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(sums())
def test_all_zeros_that_dense_samples_show_are_found(one: SumOfSines) -> None:
    found = np.array(one.zeros())
    size = abs(one.level) + np.hypot(one.cosine, one.sine).sum()
    assert found.size <= 2.0 * one.order.max()
    if found.size:
        assert np.abs(one.at(found)[0]).max() <= 1e-12 * size * one.order.max()
    phases = np.linspace(0.0, TURN, 20_001)
    values = one.at(phases)[0]
    for place in np.flatnonzero((values[:-1] < 0.0) != (values[1:] < 0.0)):
        near = np.abs(np.mod(found - phases[place] + 1e-9, TURN))
        assert (near <= phases[1] + 2e-9).any(), phases[place]


@settings(max_examples=40, derandomize=True, deadline=None)
@given(sums())
def test_a_sum_that_touches_zero_has_a_zero_there_or_two_beside(one: SumOfSines) -> None:
    phases = np.linspace(0.0, TURN, 20_001)
    low = float(phases[int(np.argmin(one.at(phases)[0]))])
    for _ in range(60):  # Newton's method for the slope
        slope, step = one.at(np.array([low]))[1][0], 1e-6 / one.order.max()
        bend = (one.at(np.array([low + step]))[1][0] - one.at(np.array([low - step]))[1][0]) / (2.0 * step)
        assume(bend > 1e-3)
        low -= slope / bend
    lifted = SumOfSines(one.level - one.at(np.array([low]))[0][0], one.order, one.cosine, one.sine)
    found = np.array(lifted.zeros())
    away = np.abs(np.mod(found - low + np.pi, TURN) - np.pi)
    assert found.size <= 2.0 * one.order.max()
    assert found.size == 0 or away.min() <= 1e-6  # rounding may lift the touch off
    above = SumOfSines(lifted.level + 1e-9, one.order, one.cosine, one.sine).zeros()
    below = SumOfSines(lifted.level - 1e-9, one.order, one.cosine, one.sine).zeros()
    assert len(below) >= len(above) + 2


@pytest.mark.parametrize(
    ("level", "expected"), [(1.5, []), (-1.0, [0.0]), (0.0, [0.5 * np.pi, 1.5 * np.pi]), (1.0, [np.pi])]
)
def test_one_sine_has_the_zeros_of_its_closed_form(level: float, expected: list[float]) -> None:
    one = SumOfSines(level, np.ones(1), np.ones(1), np.zeros(1))
    assert one.zeros() == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("level", [0.3, 0.0])
def test_a_sum_without_amplitudes_has_no_isolated_zeros(level: float) -> None:
    assert SumOfSines(level, np.array([1.0, 2.0]), np.zeros(2), np.zeros(2)).zeros() == []


def test_high_orders_are_taken() -> None:
    one = SumOfSines(0.1, np.array([1.0, 2000.0]), np.array([0.5, 0.0]), np.array([0.0, 0.01]))
    found = one.zeros()
    assert len(found) >= 2
    assert np.abs(one.at(np.array(found))[0]).max() <= 1e-12
