"""Branches against the exact bifurcations of the impact oscillator."""

from __future__ import annotations

import numpy as np
import pytest

from vibroimpact.analysis.orbits import Contact, ImpactingBody, closed_form, find_orbit
from vibroimpact.analysis.orbits.following import Branch, Follower, FollowSettings, is_explained


def oscillator(frequency: float) -> ImpactingBody:
    one = np.ones(1)
    return ImpactingBody(
        one, 0.05 * one, 0.5 * one, 0.0 * one, frequency, 0.0, (Contact(one, 1.0, 1.0, 0.7),), one
    )


@pytest.fixture(scope="module")
def follower() -> Follower:
    return Follower(oscillator, FollowSettings(0.6, 1.6, longest=0.05))


@pytest.fixture(scope="module")
def branch(follower: Follower) -> Branch:
    return follower.branch(closed_form(oscillator(1.0))[0], 1.0)


def test_the_bifurcations_of_one_impact_a_period_are_the_exact_ones(branch: Branch) -> None:
    found = {point.kind + str(place): point.at.value for place, point in enumerate(branch.points)}
    assert found == pytest.approx(
        {
            "graze0": 0.7106873690939,
            "period doubling1": 0.9364931207407,
            "fold2": 1.5166110861182,
            "graze3": 1.2185743569476,
        },
        abs=1e-12,
    )
    assert branch.ends == ["graze", "graze"]


def test_the_determinant_holds_on_every_orbit_and_stability_changes_at_its_points(branch: Branch) -> None:
    inside = [each for each in branch.orbits if each.orbit.velocities.min() > 1e-6]
    for each in inside:
        assert each.orbit.determinant == pytest.approx(each.orbit.exact_determinant, rel=1e-8)
        assert each.orbit.is_physical
    doubling, fold = (point.at.value for point in branch.points[1:3])
    lower = [each for each in inside if np.real(each.orbit.multipliers[0]) < -1.0]
    assert max(each.value for each in lower) <= doubling
    saddles = [each for each in inside if np.real(each.orbit.multipliers[0]) > 1.0]
    assert all(1.2185 < each.value <= fold for each in saddles)


def test_the_branch_that_leaves_at_the_doubling_has_its_fold_and_its_graze(
    follower: Follower, branch: Branch
) -> None:
    doubled = Branch("")
    for _ in follower.leave(doubled, branch.points[1]):
        pass
    assert doubled.name == "P(2,2)"
    assert [point.kind for point in doubled.points] == ["fold", "graze"]
    assert doubled.points[0].at.value == pytest.approx(0.9363626913, abs=1e-9)
    assert all(each.orbit.turns == 1 for each in doubled.orbits)


def between_two_stops(frequency: float) -> ImpactingBody:
    one = np.ones(1)
    stops = Contact(one, 1.0, 1.0, 0.7), Contact(one, -1.0, -1.0, 0.7)
    return ImpactingBody(one, 0.04 * one, 0.5 * one, 0.0 * one, frequency, 0.0, stops, one)


def test_a_change_of_stability_at_a_branch_point_is_said_to_have_no_cause_that_was_found() -> None:
    follower = Follower(between_two_stops, FollowSettings(0.95, 1.0, longest=0.05))
    body = between_two_stops(0.99)
    branch = follower.branch(find_orbit(body, [0.1, 0.1 + np.pi], [0, 1]), 0.99)
    (point,) = branch.points
    assert point.kind == "stability change"
    # the loss of symmetry: a multiplier of half an orbit combined with its mirror image passes +1
    assert point.at.value == pytest.approx(0.97282430, abs=2e-6)
    assert all(each.orbit.is_stable for each in branch.orbits if each.value > point.at.value + 1e-6)
    assert not any(each.orbit.is_stable for each in branch.orbits if each.value < point.at.value - 1e-6)
    assert branch.full_name == "P(2,1), 1 at stop 1, 1 at stop 2"


def test_no_step_of_a_branch_with_known_causes_has_a_change_of_stability_without_one(branch: Branch) -> None:
    assert all(point.kind != "stability change" for point in branch.points)


def test_a_point_moves_as_many_multipliers_as_its_kind(branch: Branch) -> None:
    stable = next(each.orbit for each in branch.orbits if each.orbit.is_stable)
    unstable = next(
        each.orbit
        for each in branch.orbits
        if not each.orbit.is_stable and each.orbit.velocities.min() > 1e-3
    )
    assert is_explained(stable, stable, [])
    assert not is_explained(stable, unstable, [])
    assert not is_explained(stable, unstable, ["torus"])
    assert not is_explained(stable, unstable, ["fold", "fold"])
    for kinds in (["fold"], ["period doubling"], ["fold", "torus"], ["graze"]):
        assert is_explained(stable, unstable, kinds)


def lightly_damped(frequency: float) -> ImpactingBody:
    one = np.ones(1)
    return ImpactingBody(
        one, 0.02 * one, 0.5 * one, 0.0 * one, frequency, 0.0, (Contact(one, 1.0, 1.0, 0.8),), one
    )


@pytest.mark.parametrize(("start", "longest"), [(2.2, 0.05), (2.5, 0.1), (2.63, 0.05)])
def test_a_closed_branch_is_passed_through_once_from_any_of_its_orbits(start: float, longest: float) -> None:
    follower = Follower(lightly_damped, FollowSettings(2.0, 2.8, longest=longest))
    branch = follower.branch(closed_form(lightly_damped(start), 2)[0], start)
    assert branch.ends == ["closed"]
    assert [point.kind for point in branch.points] == ["fold", "fold"]
    for point in branch.points:  # two orbits on one side of a fold, none on the other
        inwards = 1e-7 * np.sign(2.4 - point.at.value)
        assert len(closed_form(lightly_damped(point.at.value + inwards), 2)) == 2
        assert not closed_form(lightly_damped(point.at.value - inwards), 2)
    first, last = branch.orbits[0], branch.orbits[-1]
    assert last.value == pytest.approx(first.value, abs=1e-10)
    assert last.orbit.velocities == pytest.approx(first.orbit.velocities, abs=1e-9)
