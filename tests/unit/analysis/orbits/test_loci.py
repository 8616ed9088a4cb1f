"""Loci of bifurcations against the explicit loci of one mode: equations.md 4.5 and 4.6."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.orbits import Contact, ImpactingBody, PeriodicOrbit, closed_form
from vibroimpact.analysis.orbits.bifurcations import Bifurcation, Locus, joined_loci
from vibroimpact.analysis.orbits.branch import Branch, SpecialPoint
from vibroimpact.analysis.orbits.following import Follower, FollowSettings
from vibroimpact.analysis.orbits.loci.follower import LocusFollower

RATIO = 0.04
DAMPED = np.sqrt(1.0 - RATIO**2)


def oscillator(
    frequency: float, force: float, ratio: float = RATIO, restitution: float = 0.75
) -> ImpactingBody:
    one = np.ones(1)
    return ImpactingBody(
        one, ratio * one, force * one, 0.0 * one, frequency, 0.0, (Contact(one, 1.0, 0.8, restitution),), one
    )


@pytest.fixture(scope="module")
def points() -> dict[str, SpecialPoint]:
    """Return the special points of a branch at a force of .3, by their kind."""
    follower = Follower(lambda value: oscillator(value, 0.3), FollowSettings(0.7, 2.2, 0.03))
    branch: Branch = follower.branch(closed_form(oscillator(1.1, 0.3))[0], 1.1)
    kinds = [point.kind for point in branch.points]
    assert kinds.count("period doubling") == kinds.count("fold") == 1
    return dict(zip(kinds, branch.points, strict=True))


def locus_to(frequency: float, point: SpecialPoint, force: float) -> Locus:
    """Return the locus of a bifurcation up to a frequency."""
    bounds = sorted((frequency, point.at.value))
    reach = FollowSettings(bounds[0] - (bounds[0] != frequency), bounds[1] + (bounds[1] != frequency), 0.03)
    return LocusFollower(oscillator, reach, FollowSettings(0.01, 3.0)).locus(point, (point.at.value, force))


def test_a_period_doubling_goes_through_the_explicit_one(points: dict[str, SpecialPoint]) -> None:
    ends = locus_to(0.88, points["period doubling"], 0.3)
    met = [
        each for each in (ends.points[0], ends.points[-1]) if each.values[0] == pytest.approx(0.88, abs=1e-12)
    ]
    assert met[0].values[1] == pytest.approx(0.450214238658253, abs=1e-11)
    assert met[0].orbit.velocities[0] == pytest.approx(0.603188578597231, abs=1e-10)
    assert met[0].orbit.multipliers[0] == pytest.approx(-1.0, abs=1e-9)


def test_a_fold_goes_through_the_explicit_one(points: dict[str, SpecialPoint]) -> None:
    ends = locus_to(1.35, points["fold"], 0.3)
    met = [
        each for each in (ends.points[0], ends.points[-1]) if each.values[0] == pytest.approx(1.35, abs=1e-12)
    ]
    assert met[0].values[1] == pytest.approx(0.180607698844102, abs=1e-11)
    assert met[0].orbit.velocities[0] == pytest.approx(0.914676801783975, abs=1e-10)


def test_folds_and_doublings_end_at_the_points_of_codimension_two(points: dict[str, SpecialPoint]) -> None:
    follower = LocusFollower(oscillator, FollowSettings(0.3, 2.2, 0.03), FollowSettings(0.01, 1.5))
    doubling = follower.locus(points["period doubling"], (points["period doubling"].at.value, 0.3))
    fold = follower.locus(points["fold"], (points["fold"].at.value, 0.3))
    ends = sorted(point.values[0] for _, point in doubling.special)
    np.testing.assert_allclose(ends, [2.0 * DAMPED / 3.0, DAMPED], atol=1e-10)
    assert fold.special[0][1].values == pytest.approx(
        next(point.values for _, point in doubling.special if point.values[0] > 0.9), abs=1e-9
    )


@settings(max_examples=3, deadline=None)
@given(ratio=st.floats(0.005, 0.3), restitution=st.floats(0.1, 0.95), frequency=st.floats(1.05, 1.2))
def test_one_fold_and_one_doubling_leave_each_point_of_codimension_two_of_a_curve_of_grazes(
    ratio: float, restitution: float, frequency: float
) -> None:
    """Equations.md 4.6: the frequencies are 2 w_d / n; the loci that leave have the multipliers 1 and -1."""
    force = 0.8 * np.hypot(1.0 - frequency**2, 2.0 * ratio * frequency)
    lag = np.arctan2(2.0 * ratio * frequency, 1.0 - frequency**2)
    body = oscillator(frequency, force, ratio, restitution)
    graze = PeriodicOrbit(body, 1, np.array([lag]), np.zeros(1, np.int32), np.zeros(1))
    follower = LocusFollower(
        lambda w, f: oscillator(w, f, ratio, restitution),
        FollowSettings(0.6, 1.3, 0.05),
        FollowSettings(1e-3, 3.0),
    )
    ways = Locus("graze"), Locus("graze")
    assert list(follower.both_ways(*ways, Bifurcation("graze", graze, (frequency, force), 0)))
    grazes = joined_loci(*ways)
    expected = 2.0 * np.sqrt(1.0 - ratio**2) / np.arange(1, 10)
    expected = expected[(expected > 0.6) & (expected < 1.3)]
    for kind, multiplier in (("fold", 1.0), ("period doubling", -1.0)):
        met = sorted((each for each in grazes.starts if each.kind == kind), key=lambda each: -each.values[0])
        np.testing.assert_allclose([each.values[0] for each in met], expected, atol=1e-9)
        leaving = Locus(kind), Locus(kind)
        assert list(follower.both_ways(*leaving, met[0]))
        locus = joined_loci(*leaving)
        assert follower.goes_through(locus, met[0])
        assert not follower.goes_through(grazes, met[0])
        middle = locus.points[len(locus.points) // 2].orbit
        assert middle.velocities[0] > 0.0
        assert np.abs(middle.multipliers - multiplier).min() < 1e-6


def test_a_closed_locus_ends_where_it_began() -> None:
    """At a fixed frequency the fold has one force, which this body has on a circle of both parameters."""
    force = 0.180607698844102
    follower = LocusFollower(
        lambda x, y: oscillator(1.35, force + x**2 + y**2 - 0.01),
        FollowSettings(-1.0, 1.0, 0.02),
        FollowSettings(-1.0, 1.0),
    )
    orbit = closed_form(oscillator(1.35, force + 1e-15))[0]
    ways = Locus("fold"), Locus("fold")
    assert list(follower.both_ways(*ways, Bifurcation("fold", orbit, (0.1, 0.0))))
    assert ways[0].ends == ["closed"]
    assert ways[1].points == []
    path = np.array([each.values for each in ways[0].points])
    np.testing.assert_allclose(np.hypot(*path.T), 0.1, atol=1e-9)
    assert (path[0] == path[-1]).all()
    turned = np.unwrap(np.arctan2(path[:, 1], path[:, 0]))
    assert abs(turned[-1] - turned[0]) == pytest.approx(2.0 * np.pi)
    assert follower.goes_through(ways[0], Bifurcation("fold", orbit, (0.0, 0.1)))
