"""Corners of loci of grazes: motion without impacts that touches two stops at once has an explicit one."""

from __future__ import annotations

import numpy as np
import pytest

from vibroimpact.analysis.orbits import Contact, ImpactingBody, PeriodicOrbit
from vibroimpact.analysis.orbits.bifurcations import BETWEEN, GRAZE, Bifurcation, Locus, joined_loci
from vibroimpact.analysis.orbits.following import FollowSettings
from vibroimpact.analysis.orbits.loci.corners import CORNER
from vibroimpact.analysis.orbits.loci.follower import LocusFollower

RATIO, FREQUENCY, FORCE = 0.05, 0.8, 0.5
SIZE = FORCE / np.hypot(1.0 - FREQUENCY**2, 2.0 * RATIO * FREQUENCY)
"""Amplitude of the motion without impacts."""


def between_stops(
    upper: float, lower: float, restitutions: tuple[float, float] = (0.7, 0.6)
) -> ImpactingBody:
    one = np.ones(1)
    stops = (Contact(one, 1.0, upper, restitutions[0]), Contact(one, -1.0, lower, restitutions[1]))
    return ImpactingBody(one, RATIO * one, FORCE * one, 0.0 * one, FREQUENCY, 0.0, stops, one)


def followed(follower: LocusFollower, start: Bifurcation) -> Locus:
    ways = Locus(start.kind), Locus(start.kind)
    assert list(follower.both_ways(*ways, start))
    return joined_loci(*ways)


def test_four_curves_of_grazes_meet_where_a_motion_touches_both_stops() -> None:
    follower = LocusFollower(
        between_stops,
        FollowSettings(0.9 * SIZE, 1.1 * SIZE, 0.02),
        FollowSettings(-1.1 * SIZE, -0.9 * SIZE),
    )
    lag = np.arctan2(2.0 * RATIO * FREQUENCY, 1.0 - FREQUENCY**2)
    body = between_stops(SIZE, -1.05 * SIZE)
    orbit = PeriodicOrbit(body, 1, np.array([lag]), np.zeros(1, np.int32), np.zeros(1))
    upper = followed(follower, Bifurcation(GRAZE, orbit, (SIZE, -1.05 * SIZE), 0))
    assert sorted(upper.ends) == [CORNER, "end of the range"]
    assert [kind for kind, _ in upper.special] == [BETWEEN]
    np.testing.assert_allclose([each.values[0] for each in upper.points], SIZE, rtol=1e-12)
    met = [*upper.starts, *upper.beyond]
    np.testing.assert_allclose([each.values for each in met], [(SIZE, -SIZE)] * 3, rtol=1e-9)
    assert [(each.kind, each.orbit.full_name) for each in met] == [
        (BETWEEN, "P(1,1) at stop 1"),
        (GRAZE, "P(2,1), 1 at stop 1, 1 at stop 2"),
        (GRAZE, "P(1,1) at stop 2"),
    ]
    loci = [followed(follower, each) for each in met]
    for locus in loci:
        assert sorted(locus.ends) == [CORNER, "end of the range"]
        assert len(locus.points) > 5
        for point in locus.points:
            assert point.orbit.velocities.min() > -1e-9
            assert point.orbit.highest[0] < 1e-9 * SIZE
    np.testing.assert_allclose([each.values[1] for each in loci[2].points], -SIZE, rtol=1e-9)


@pytest.mark.parametrize("restitution", [0.5, 0.9])
def test_both_grazes_of_a_symmetric_orbit_are_one_curve(restitution: float) -> None:
    """Both touches lie at the amplitude of the motion without impacts, whatever the force and the stops."""

    def body_at(position: float, ratio: float) -> ImpactingBody:
        one, force = np.ones(1), np.hypot(1.0 - FREQUENCY**2, 2.0 * ratio * FREQUENCY) * SIZE
        stops = tuple(Contact(one, side, side * position, restitution) for side in (1.0, -1.0))
        return ImpactingBody(one, ratio * one, force * one, 0.0 * one, FREQUENCY, 0.0, stops, one)

    follower = LocusFollower(body_at, FollowSettings(0.9 * SIZE, 1.1 * SIZE, 0.02), FollowSettings(0.02, 0.2))
    lag = np.arctan2(2.0 * RATIO * FREQUENCY, 1.0 - FREQUENCY**2)
    orbit = PeriodicOrbit(
        body_at(SIZE, RATIO), 1, np.array([lag, lag + np.pi]), np.array([0, 1], np.int32), np.zeros(2)
    )
    locus = followed(follower, Bifurcation(GRAZE, orbit, (SIZE, RATIO), 0))
    assert locus.ends == ["end of the range"] * 2
    np.testing.assert_allclose([each.values[0] for each in locus.points], SIZE, rtol=1e-10)
    np.testing.assert_array_equal(
        sorted(each.values[1] for each in locus.points)[:: len(locus.points) - 1], [0.02, 0.2]
    )
