"""Branches against the exact bifurcations of the impact oscillator."""

from __future__ import annotations

import numpy as np
import pytest

from vibroimpact.analysis.orbits import Contact, ImpactingBody, closed_form
from vibroimpact.analysis.orbits.following import Branch, Follower, FollowSettings


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
