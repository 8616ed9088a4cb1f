"""Branch points of equations with known branches, and of a chain between two equal stops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.orbits import Contact, ImpactingBody, find_orbit
from vibroimpact.analysis.orbits.branch import Branch
from vibroimpact.analysis.orbits.branch_points import (
    bordered_determinant,
    crossing_direction,
    interpolated_zeros,
)
from vibroimpact.analysis.orbits.departures import departures
from vibroimpact.analysis.orbits.following import Follower, FollowSettings
from vibroimpact.fmus.bodies.impacting_body import Floats

SLOPES = st.floats(-2.0, 2.0)


def crossing_lines(one: float, other: float, bend: float, turn: Floats) -> object:
    """Return the derivatives of equations whose branches are x = one y and x = other y + bend x^2 at z = 0, turned."""

    def matrix_at(unknowns: Floats) -> Floats:
        x, y, _ = turn @ unknowns
        left, right = x - one * y, x - other * y - bend * x**2
        both = np.array([right + left * (1.0 - 2.0 * bend * x), -one * right - other * left, 0.0])
        return np.array([both, [0.0, 0.0, 1.0]]) @ turn

    return matrix_at


@given(SLOPES, SLOPES, SLOPES, st.integers(0, 50))
@settings(max_examples=60, deadline=None)
def test_the_other_branch_is_found_in_any_coordinates(
    one: float, other: float, bend: float, seed: int
) -> None:
    if abs(one - other) < 0.05:
        return
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    matrix_at = crossing_lines(one, other, bend, turn)
    own = np.array([one, 1.0, 0.0]) @ turn / np.hypot(one, 1.0)
    expected = np.array([other, 1.0, 0.0]) @ turn / np.hypot(other, 1.0)
    found = crossing_direction(matrix_at, np.zeros(3), own)  # type: ignore[arg-type]
    assert abs(found @ expected) == pytest.approx(1.0, abs=1e-8)
    borders = [bordered_determinant(matrix_at(side * 0.01 * own), own) for side in (1.0, -1.0)]  # type: ignore[operator]
    assert borders[0] * borders[1] < 0.0


@given(st.floats(0.02, 0.98), st.floats(0.5, 5.0))
@settings(max_examples=60, deadline=None)
def test_a_zero_is_interpolated_to_rounding_although_no_orbit_is_found_next_to_it(
    zero: float, rate: float
) -> None:
    def orbit_at(place: float) -> tuple[Floats, float] | None:
        if abs(place - zero) < 1e-3:
            return None
        return np.array([np.sin(place), place]), float(np.expm1(rate * (place - zero)))

    guesses = list(interpolated_zeros(orbit_at, 1.0))
    place, unknowns, slopes = min(guesses, key=lambda guess: abs(guess[0] - zero))
    assert place == pytest.approx(zero, abs=1e-11)
    np.testing.assert_allclose(unknowns, [np.sin(zero), zero], atol=1e-11)
    assert slopes[0] / slopes[1] == pytest.approx(np.cos(zero), abs=1e-8)


def chain(frequency: float) -> ImpactingBody:
    """Return a chain of two masses, m = k = 1, c = .1, whose second mass is between stops at .3 and -.3."""
    squares, shapes = np.linalg.eigh(np.array([[2.0, -1.0], [-1.0, 1.0]]))
    natural, tip = np.sqrt(squares), shapes[1]
    stops = Contact(tip, 1.0, 0.3, 0.7), Contact(tip, -1.0, -0.3, 0.7)
    return ImpactingBody(natural, 0.05 * natural, 0.5 * shapes[0], 0.0 * tip, frequency, 0.0, stops, tip)


def test_a_chain_between_two_equal_stops_loses_its_symmetry() -> None:
    follower = Follower(chain, FollowSettings(0.85, 1.7, longest=0.05))
    branch = follower.branch(find_orbit(chain(1.2), [0.64, 3.78], [0, 1]), 1.2)
    assert branch.is_symmetric
    found = [(point.kind, point.at.value) for point in branch.points]
    # each found from starts at ten frequencies with steps of .02, and here with .05
    assert found == [
        ("branch point", pytest.approx(0.9162467276641, abs=1e-10)),
        ("branch point", pytest.approx(1.5463427700428, abs=1e-10)),
    ]
    for point in branch.points:
        (departure,) = departures(follower, point)
        broken = Branch("")
        for _ in zip(range(12), follower.leave(broken, departure.start), strict=False):
            pass
        assert departure.cause == "pitchfork"
        assert not broken.is_symmetric
        assert not [each for each in broken.points if each.kind in ("stability change", "branch point")]
