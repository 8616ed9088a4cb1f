"""Branches against the exact bifurcations of the impact oscillator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vibroimpact.analysis.orbits import Contact, ImpactingBody, closed_form, find_orbit
from vibroimpact.analysis.orbits.branch import Branch
from vibroimpact.analysis.orbits.departures import departures, passes
from vibroimpact.analysis.orbits.following import Follower, FollowSettings
from vibroimpact.analysis.orbits.sign_changes import is_explained
from vibroimpact.analysis.orbits.symmetry import are_alike, mirror_image


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
    (departure,) = departures(follower, branch.points[1])
    assert (departure.cause, departure.goes_both_ways) == ("period doubling", False)
    for _ in follower.leave(doubled, departure.start):
        pass
    assert doubled.name == "P(2,2)"
    assert [point.kind for point in doubled.points] == ["fold", "graze"]
    assert doubled.points[0].at.value == pytest.approx(0.9363626913, abs=1e-9)
    assert all(each.orbit.turns == 1 for each in doubled.orbits)


def between_two_stops(frequency: float) -> ImpactingBody:
    one = np.ones(1)
    stops = Contact(one, 1.0, 1.0, 0.7), Contact(one, -1.0, -1.0, 0.7)
    return ImpactingBody(one, 0.04 * one, 0.5 * one, 0.0 * one, frequency, 0.0, stops, one)


@pytest.fixture(scope="module")
def between() -> Follower:
    return Follower(between_two_stops, FollowSettings(0.95, 1.0, longest=0.05))


@pytest.fixture(scope="module")
def symmetric(between: Follower) -> Branch:
    return between.branch(find_orbit(between_two_stops(0.99), [0.1, 0.1 + np.pi], [0, 1]), 0.99)


def test_a_loss_of_symmetry_is_a_branch_point(symmetric: Branch) -> None:
    (point,) = symmetric.points
    assert point.kind == "branch point"
    # half an orbit combined with its mirror image has the multiplier 1: a zero of a function of one unknown
    assert point.at.value == pytest.approx(0.972824295465, abs=1e-11)
    assert point.at.orbit.multipliers[0] == pytest.approx(1.0, abs=1e-9)
    assert all(each.orbit.is_stable for each in symmetric.orbits if each.value > point.at.value + 1e-9)
    assert not any(each.orbit.is_stable for each in symmetric.orbits if each.value < point.at.value - 1e-9)
    assert symmetric.full_name == "P(2,1), 1 at stop 1, 1 at stop 2"
    assert symmetric.is_symmetric


def test_both_broken_branches_are_mirror_images_up_to_their_graze(
    between: Follower, symmetric: Branch
) -> None:
    (departure,) = departures(between, symmetric.points[0])
    assert (departure.cause, departure.goes_both_ways) == ("pitchfork", False)
    ways = [Branch(""), Branch("")]
    across = replace(departure.start, tangent=-departure.start.tangent)
    for way, start in zip(ways, (departure.start, across), strict=True):
        for _ in between.leave(way, start):
            pass
        assert way.ends == ["graze"]
        assert way.orbits[-1].value == pytest.approx(0.97375271868, abs=1e-10)
        assert not any(each.orbit.is_stable for each in way.orbits[1:])
        assert not way.is_symmetric
    # each ends at the graze between impacts of P(1,1) at one stop
    one, other = (way.orbits[-1].orbit for way in ways)
    image = mirror_image(one)
    assert image is not None
    assert are_alike(image, other)
    assert passes(ways[1], ways[0].orbits[-1], between.settings.span)


def test_the_broken_branch_ends_at_the_symmetric_one_and_finds_it(
    between: Follower, symmetric: Branch
) -> None:
    start = closed_form(between_two_stops(0.965), 1, 0)[0]
    one = between.branch(start, 0.965)
    point = one.points[-1]
    assert point.kind == "graze between impacts"
    met = departures(between, point)
    assert [each.start.orbit.name for each in met if each.start.orbit.periods == 1] == ["P(2,1)"]
    assert not met[0].is_stable
    assert met[0].side == "lower"
    broken = Branch("")
    for _ in between.leave(broken, met[0].start):
        pass
    assert broken.ends == ["branch point of the symmetric P(2,1)"]
    assert [each.kind for each in broken.points] == ["branch point"]
    assert passes(symmetric, broken.points[0].at, between.settings.span)
    (back,) = departures(between, broken.points[0])
    assert (back.cause, back.goes_both_ways) == ("pitchfork", True)
    assert abs(back.start.tangent @ symmetric.points[0].at.tangent) == pytest.approx(1.0, abs=1e-8)


def test_a_step_never_ends_next_to_a_branch_point_where_rounding_decides() -> None:
    one = np.ones(1)
    stops = tuple(Contact(one, side, 1.0675758039625938 * side, 0.6853762672469907) for side in (1.0, -1.0))

    def body(frequency: float) -> ImpactingBody:
        ratio, force = 0.03803687402432025 * one, 0.5394579227278282 * one
        return ImpactingBody(one, ratio, force, 0.0 * one, frequency, 0.0, stops, one)

    follower = Follower(body, FollowSettings(0.7237596684432425, 1.0856395026648635))
    branch = follower.branch(closed_form(body(0.96), 1, 0)[0], 0.96)
    broken = Branch("")
    for _ in follower.leave(broken, departures(follower, branch.points[-1])[0].start):
        pass
    # a step once ended 7e-6 before the point: a fold and a change of stability were found in its rounding
    assert [point.kind for point in broken.points] == ["branch point"]
    assert broken.points[0].at.value == pytest.approx(0.970740040791, abs=1e-11)


def test_a_doubled_branch_ends_where_its_halves_are_equal(follower: Follower, branch: Branch) -> None:
    (departure,) = departures(follower, branch.points[1])
    way = Branch("")
    orbits = follower.leave(way, departure.start)
    away = [next(orbits) for _ in range(6)][-1]
    back = Branch("")
    for _ in follower.walk(back, away.orbit, away.value, -1.0 if away.tangent[-1] > 0.0 else 1.0):
        pass
    assert back.ends == ["period doubling of P(1,1)"]
    assert back.orbits[-1].value == pytest.approx(0.9364931207407, abs=1e-10)
    assert not [point for point in back.points if point.kind == "fold"]


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
