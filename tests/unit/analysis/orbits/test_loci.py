"""Loci of bifurcations against the explicit loci of one mode: equations.md 4.5 and 4.6."""

from __future__ import annotations

import numpy as np
import pytest

from vibroimpact.analysis.orbits import Contact, ImpactingBody, closed_form
from vibroimpact.analysis.orbits.bifurcations import Locus
from vibroimpact.analysis.orbits.following import Branch, Follower, FollowSettings, SpecialPoint
from vibroimpact.analysis.orbits.loci import LocusFollower

RATIO = 0.04
DAMPED = np.sqrt(1.0 - RATIO**2)


def oscillator(frequency: float, force: float) -> ImpactingBody:
    one = np.ones(1)
    return ImpactingBody(
        one, RATIO * one, force * one, 0.0 * one, frequency, 0.0, (Contact(one, 1.0, 0.8, 0.75),), one
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
