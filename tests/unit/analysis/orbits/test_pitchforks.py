"""Loci of pitchforks against their explicit form, and against pitchforks over one number: equations.md 4.20."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.orbits import Contact, ImpactingBody, OrbitError, find_orbit
from vibroimpact.analysis.orbits.bifurcations import Bifurcation, Locus, joined_loci, kind_of
from vibroimpact.analysis.orbits.branch import Branch, SpecialPoint
from vibroimpact.analysis.orbits.departures import departures
from vibroimpact.analysis.orbits.following import Follower, FollowSettings
from vibroimpact.analysis.orbits.loci.follower import LocusFollower
from vibroimpact.analysis.orbits.mirrored_halves import halves_of, slopes_of
from vibroimpact.analysis.orbits.symmetry import is_symmetric


def oscillator(
    frequency: float, force: float, ratio: float = 0.04, restitution: float = 0.7, lower: float = -1.0
) -> ImpactingBody:
    one = np.ones(1)
    stops = Contact(one, 1.0, 1.0, restitution), Contact(one, -1.0, lower, restitution)
    return ImpactingBody(one, ratio * one, force * one, 0.0 * one, frequency, 0.0, stops, one)


def chain(frequency: float, force: float) -> ImpactingBody:
    """Return a chain of two masses, m = k = 1, c = .1, whose second mass is between stops at .3 and -.3."""
    squares, shapes = np.linalg.eigh(np.array([[2.0, -1.0], [-1.0, 1.0]]))
    natural, tip = np.sqrt(squares), shapes[1]
    stops = Contact(tip, 1.0, 0.3, 0.7), Contact(tip, -1.0, -0.3, 0.7)
    return ImpactingBody(natural, 0.05 * natural, force * shapes[0], 0.0 * tip, frequency, 0.0, stops, tip)


def explicit(
    frequency: float, ratio: float = 0.04, restitution: float = 0.7, half_multiplier: float = -1.0
) -> tuple[float, float, float]:
    """Return force, phase and speed of the symmetric P(2,1) between stops at 1 and -1, by 4.5 on half a period."""
    w, z, r = frequency, ratio, restitution
    natural, half = np.sqrt(1.0 - z**2), np.pi / w
    decay, c, s = np.exp(-z * half), np.cos(natural * half), np.sin(natural * half)
    phi11, phi12 = -decay * (c + z * s / natural), -decay * s / natural
    border = 1.0 + 2.0 * decay * c + decay**2
    alpha, beta = -(1.0 + r) * phi12 / border, (1.0 + r) * ((phi11 - 1.0) / border + 1.0)
    kappa = (half_multiplier * (1.0 + (r * decay) ** 2) - 2.0 * r * decay * c) / ((1.0 + r) * phi12)
    speed = -(w**2) / (kappa + (1.0 - w**2) * alpha - 2.0 * z * (1.0 - beta))
    cosine = 1.0 + kappa * speed
    sine = 2.0 * z * w * (1.0 - alpha * speed) - (1.0 - w**2) * (1.0 - beta) * speed / w
    return float(np.hypot(cosine, sine)), float(np.arctan2(sine, cosine)), float(speed)


def followed(follower: LocusFollower, start: Bifurcation) -> Locus:
    ways = Locus(start.kind), Locus(start.kind)
    assert list(follower.both_ways(*ways, start))
    return joined_loci(*ways)


@pytest.fixture(scope="module")
def follower() -> LocusFollower:
    return LocusFollower(oscillator, FollowSettings(0.3, 2.0, 0.03), FollowSettings(0.01, 3.0))


@pytest.fixture(scope="module")
def pitchforks(follower: LocusFollower) -> Locus:
    along = Follower(lambda value: oscillator(value, 0.5), FollowSettings(0.95, 1.0, 0.05))
    (point,) = along.branch(find_orbit(oscillator(0.99, 0.5), [0.1, 0.1 + np.pi], [0, 1]), 0.99).points
    assert kind_of(point) == "pitchfork"
    return follower.locus(point, (point.at.value, 0.5))


def test_pitchforks_of_one_mode_are_the_explicit_ones(pitchforks: Locus) -> None:
    assert pitchforks.kind == "pitchfork"
    assert all(is_symmetric(point.orbit) for point in pitchforks.points)
    for point in pitchforks.points[1:-1]:
        force, phase, speed = explicit(point.values[0])
        assert point.values[1] == pytest.approx(force, abs=1e-11)
        np.testing.assert_allclose(point.orbit.velocities, speed, atol=1e-11)
        np.testing.assert_allclose(np.exp(1j * point.orbit.phases[0]), np.exp(1j * phase), atol=1e-10)


def test_pitchforks_end_where_symmetric_grazes_have_both_multipliers_of_half_an_orbit(
    follower: LocusFollower, pitchforks: Locus
) -> None:
    """The frequencies are q w_d / n: half the period of the force is a multiple of half the body's own."""
    natural = np.sqrt(1.0 - 0.04**2)
    assert pitchforks.ends == ["graze", "graze"]
    ends = [pitchforks.points[place].values[0] for place in (0, -1)]
    np.testing.assert_allclose(sorted(ends), [natural / 2.0, natural], atol=1e-10)
    graze = next(start for start in pitchforks.starts if start.kind == "graze" and start.values[0] < 0.6)
    grazes = followed(follower, graze)
    for kind in ("fold", "pitchfork"):
        met = sorted(start.values[0] for start in grazes.starts if start.kind == kind)
        np.testing.assert_allclose(met, [natural / 3.0, natural], atol=1e-9)  # the curve itself begins at 1/2
    begun = next(start for start in grazes.starts if start.kind == "pitchfork" and start.values[0] > 0.4)
    assert follower.goes_through(pitchforks, begun)


def test_folds_of_broken_orbits_begin_at_the_degenerate_pitchfork(
    follower: LocusFollower, pitchforks: Locus
) -> None:
    (at,) = [point for kind, point in pitchforks.special if kind == "degenerate pitchfork"]
    (fold,) = [start for start in pitchforks.starts if start.kind == "fold"]
    assert not is_symmetric(fold.orbit)
    folds = followed(follower, fold)
    assert folds.ends[0] == "degenerate pitchfork" or folds.ends[-1] == "degenerate pitchfork"
    (met,) = [point for kind, point in folds.special if kind == "degenerate pitchfork"]
    # found by the sign of the cubic coefficient along one curve, and by Newton's method from the other curve
    assert met.values == pytest.approx(at.values, abs=1e-9)
    assert follower.goes_through(pitchforks, next(each for each in folds.starts if each.kind == "pitchfork"))


def test_broken_orbits_lie_on_the_other_side_beyond_the_degenerate_pitchfork(pitchforks: Locus) -> None:
    (at,) = [point for kind, point in pitchforks.special if kind == "degenerate pitchfork"]
    sides = []
    for frequency in (at.values[0] - 0.01, at.values[0] + 0.01):
        force, phase, _ = explicit(frequency)
        along = Follower(
            lambda value, fixed=frequency: oscillator(fixed, value),  # type: ignore[misc]  # of a lambda with a default
            FollowSettings(force - 0.05, force + 0.05, 0.02),
        )
        start = find_orbit(oscillator(frequency, force + 0.02), [phase, phase + np.pi], [0, 1])
        (point,) = [each for each in along.branch(start, force + 0.02).points if each.kind == "branch point"]
        assert point.at.value == pytest.approx(force, abs=1e-9)
        (departure,) = departures(along, point)
        broken = Branch("")
        for _ in zip(range(3), along.leave(broken, departure.start), strict=False):
            pass
        sides.append(np.sign(broken.orbits[-1].value - force))
    assert sides[0] == -sides[1] != 0.0


@settings(max_examples=4, deadline=None)
@given(ratio=st.floats(0.01, 0.2), restitution=st.floats(0.2, 0.9), frequency=st.floats(0.93, 0.97))
def test_every_explicit_pitchfork_is_on_the_curve_of_pitchforks(
    ratio: float, restitution: float, frequency: float
) -> None:
    force, phase, _ = explicit(frequency, ratio, restitution)
    orbit = find_orbit(oscillator(frequency, force, ratio, restitution), [phase, phase + np.pi], [0, 1])
    follower = LocusFollower(
        lambda w, f: oscillator(w, f, ratio, restitution),
        FollowSettings(0.92, 0.98, 0.1),
        FollowSettings(0.05, 3.0),
    )
    locus = followed(follower, Bifurcation("pitchfork", orbit, (frequency, force)))
    assert len(locus.points) > 2
    for point in locus.points:
        if point.orbit.velocities[0] > 1e-6:
            assert point.values[1] == pytest.approx(
                explicit(point.values[0], ratio, restitution)[0], abs=1e-10
            )


def first_pitchfork(force: float) -> SpecialPoint:
    along = Follower(lambda value: chain(value, force), FollowSettings(0.85, 1.25, 0.1))
    branch = along.branch(find_orbit(chain(1.2, force), [0.64, 3.78], [0, 1]), 1.2)
    (point,) = [each for each in branch.points if each.kind == "branch point"]
    return point


def test_pitchforks_of_a_chain_are_those_of_its_branches_at_another_force() -> None:
    one, other = first_pitchfork(0.5), first_pitchfork(0.4)
    follower = LocusFollower(chain, FollowSettings(0.9, 1.2, 0.1), FollowSettings(0.4, 0.55))
    locus = follower.locus(one, (one.at.value, 0.5))
    (last,) = [point.values[0] for point in locus.points if point.values[1] == 0.4]
    assert last == pytest.approx(other.at.value, abs=1e-9)
    assert follower.goes_through(locus, Bifurcation.of(other, (other.at.value, 0.4)))


def test_no_pitchforks_are_followed_over_a_number_that_breaks_the_symmetry() -> None:
    force, phase, _ = explicit(0.95)
    orbit = find_orbit(oscillator(0.95, force), [phase, phase + np.pi], [0, 1])
    follower = LocusFollower(
        lambda w, lower: oscillator(w, force, lower=-lower),
        FollowSettings(0.9, 1.0),
        FollowSettings(0.9, 1.1),
    )
    with pytest.raises(OrbitError, match="parameters that keep the mirror symmetry"):
        followed(follower, Bifurcation("pitchfork", orbit, (0.95, 1.0)))


def test_slopes_of_a_symmetric_orbit_split_into_two_halves() -> None:
    force, phase, _ = explicit(0.95)
    orbit = find_orbit(oscillator(0.95, force + 0.1), [phase, phase + np.pi], [0, 1])
    halves = halves_of(orbit)
    assert halves is not None
    slopes = slopes_of(orbit)
    np.testing.assert_allclose(halves.mean @ slopes @ halves.opposite, 0.0, atol=1e-12)
    np.testing.assert_allclose(halves.difference @ slopes @ halves.equal, 0.0, atol=1e-12)
    assert halves.folding(orbit) * halves.breaking(orbit) == pytest.approx(np.linalg.det(slopes), rel=1e-10)
    np.testing.assert_allclose(halves.apart @ orbit.unknowns, halves.offset, atol=1e-12)
