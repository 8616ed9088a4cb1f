"""Rotation numbers of quasi-periodic motions, and other motions that have none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.rotation import Rotation, rotation_of, rotations_in_words

Floats = NDArray[np.float64]
GOLDEN = (3.0 - np.sqrt(5.0)) / 2.0


def curve(number: float, periods: int, seed: int = 1, harmonics: int = 4) -> Floats:
    """Return states on a smooth random closed curve, which turn by the rotation number in each period."""
    draw = np.random.default_rng(seed)
    angle = 2.0 * np.pi * (number * np.arange(periods) + draw.random())
    sizes = draw.normal(size=(2, 2, harmonics)) / np.arange(1, harmonics + 1) ** 2
    turns = np.outer(np.arange(1, harmonics + 1), angle)
    return np.stack([each @ np.cos(turns) + other @ np.sin(turns) for each, other in sizes], axis=1)


@given(first=st.integers(1, 6), second=st.integers(1, 6), seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_the_rotation_number_of_a_closed_curve(first: int, second: int, seed: int) -> None:
    number = 1.0 / (first + 1.0 / (second + GOLDEN))  # no resonance is near
    found = rotation_of(curve(number, 600, seed))
    assert found is not None
    assert found.curves == 1
    assert abs(found.number - min(number, 1.0 - number)) <= max(found.error, 1e-12) <= 1e-5


def test_its_error_falls_faster_than_any_power_of_the_number_of_periods() -> None:
    errors = []
    for periods in (100, 200, 400, 800):
        found = rotation_of(curve(GOLDEN, periods))
        assert found is not None
        errors.append(abs(found.number - GOLDEN))
    assert errors[0] < 1e-4
    assert errors[2] < 1e-3 * errors[1] < 1e-6 * errors[0]
    assert errors[3] < 1e-14


@given(curves=st.integers(2, 5), seed=st.integers(0, 1000))
@settings(max_examples=8)
def test_a_motion_visits_several_curves_one_after_the_other(curves: int, seed: int) -> None:
    parts = [curve(GOLDEN, 200, seed + place) * 0.3 + [3.0 * place, 0.0] for place in range(curves)]
    found = rotation_of(np.stack(parts, axis=1).reshape(-1, 2))
    assert found is not None
    assert (found.curves, found.number) == (curves, pytest.approx(GOLDEN, abs=1e-6))


def test_states_next_to_a_curve_are_not_quasi_periodic() -> None:
    # a driven chaotic motion has the line of the drive, too
    scatter = np.random.default_rng(1).normal(size=(1000, 2))
    assert all(rotation_of(curve(GOLDEN, 1000) + size * scatter) is None for size in (1e-4, 1e-3, 1e-2, 0.1))


@given(rate=st.floats(3.58, 4.0), periods=st.integers(100, 600))
@settings(max_examples=40)
def test_a_chaotic_map_has_no_rotation_number(rate: float, periods: int) -> None:
    states = np.empty(periods + 1)
    states[0] = 0.3
    for place in range(periods):
        states[place + 1] = rate * states[place] * (1.0 - states[place])
    assert rotation_of(np.column_stack([states[:-1], states[1:]])) is None


@given(multiplier=st.floats(0.9, 0.9999), size=st.floats(1e-3, 1.0))
@settings(max_examples=20)
def test_a_spiral_into_an_orbit_has_no_rotation_number(multiplier: float, size: float) -> None:
    falling = size * multiplier ** np.arange(400.0)
    assert rotation_of(1.0 + falling[:, None] * curve(GOLDEN, 400, harmonics=1)) is None


@pytest.mark.parametrize("number", [3.0 / 16.0, 3.0 / 16.0 + 1e-8, 1.0 / 3.0 + 1e-6, 0.5 - 1e-7])
def test_a_motion_that_may_be_locked_to_a_resonance_has_no_rotation_number(number: float) -> None:
    assert rotation_of(curve(number, 400)) is None


def circle_map(number: float, size: float, periods: int) -> Floats:
    """Return states of Arnold's circle map without its transient, shape (period, 2)."""
    angle, angles = 0.1, []
    for place in range(periods + 2000):
        angle += number + size / (2.0 * np.pi) * np.sin(2.0 * np.pi * angle)
        if place >= 2000:
            angles.append(2.0 * np.pi * angle)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def test_a_circle_map_is_quasi_periodic_beside_its_tongue_and_locked_in_it() -> None:
    # 1/2 locks from .5 - d to .5 + d; d = .0155 for the size .6
    assert rotation_of(circle_map(0.5, 0.6, 800)) is None
    assert rotation_of(circle_map(0.51, 0.6, 800)) is None
    beside = rotation_of(circle_map(0.525, 0.6, 800))
    assert beside is not None
    assert 0.45 < beside.number < 0.5 - 1e-3


def test_a_constant_state_and_too_few_states_have_no_rotation_number() -> None:
    assert rotation_of(np.ones((400, 2))) is None
    assert rotation_of(curve(GOLDEN, 99)) is None


def test_rotation_numbers_in_words() -> None:
    one = Rotation(GOLDEN, 1e-9)
    assert one.text == "rotation number 0.381966011 +- 1e-09"
    assert rotations_in_words([one, one]) == one.text
    assert rotations_in_words([]) == ""
    assert rotations_in_words([one, Rotation(0.25, 1e-3)]) == "rotation numbers 0.25 to 0.381966"
