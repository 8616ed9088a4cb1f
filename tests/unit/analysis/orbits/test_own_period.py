"""Orbits of bodies without a force: their period, their multipliers, and how they change."""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from vibroimpact.analysis.orbits import Contact, ImpactingBody, OrbitError
from vibroimpact.analysis.orbits.bifurcations import alternating, folding
from vibroimpact.analysis.orbits.departures import departures
from vibroimpact.analysis.orbits.following import Follower, FollowSettings
from vibroimpact.analysis.orbits.mirrored_halves import halves_of, slopes_of
from vibroimpact.analysis.orbits.own_orbits import find_own_orbit
from vibroimpact.analysis.orbits.periodic import PeriodicOrbit, tried
from vibroimpact.analysis.orbits.search import orbits_of, same_orbit
from vibroimpact.analysis.orbits.symmetry import is_symmetric
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.core.modes import chain_modes


def oscillator(
    ratio: float = -0.05, stops: tuple[float, ...] = (1.0,), restitution: float = 0.6, yields: float = 0.0
) -> ImpactingBody:
    """Return an oscillator of frequency 1 with stops above, then below."""
    one = np.ones(1)
    contacts = tuple(
        Contact(one, side, at, restitution, yield_velocity=yields)
        for side, at in zip((1.0, -1.0), stops, strict=False)
    )
    return ImpactingBody(one, ratio * one, 0.0 * one, 0.0 * one, 1.0, 0.0, contacts, one, has_own_period=True)


def chain(excitation: float = -0.2, restitution: float = 0.6, first: float = 1.0) -> ImpactingBody:
    """Return a chain of two masses with stops on the second, and a dashpot that gives energy to the first."""
    modes = chain_modes(np.array([1.0, 0.5]), np.array([1.0, 2.0, 0.0]), np.zeros(3))
    dampings = np.array([[excitation + 0.15, -0.15], [-0.15, 0.15]])
    coupling = modes.shapes.T @ dampings @ modes.shapes
    contacts = tuple(Contact(modes.shapes[1], side, side * first, restitution) for side in (1.0, -1.0))
    none = np.zeros(2)
    return ImpactingBody(
        modes.frequencies,
        coupling.diagonal() / (2.0 * modes.frequencies),
        none,
        none,
        1.0,
        0.0,
        contacts,
        modes.shapes[1],
        coupling,
        has_own_period=True,
    )


def orbit_of_chain(excitation: float = -0.4) -> PeriodicOrbit:
    """Return the orbit of one impact at each stop of the chain."""
    contacts = np.array([0, 1], dtype=np.int32)
    return find_own_orbit(chain(excitation), 5.4, np.array([0.0, 3.0]), np.array([1.4, 1.4]), contacts)


def flow_matrix(body: ImpactingBody) -> Floats:
    """Return the matrix of the free motion of states (q, q')."""
    size = body.frequencies.size
    damping = np.diag(2.0 * body.damping_ratios * np.abs(body.frequencies))
    damping = damping if body.coupling is None else np.asarray(body.coupling)
    return np.block([[np.zeros((size, size)), np.eye(size)], [-np.diag(body.stiffnesses), -damping]])


def after_a_round(orbit: PeriodicOrbit, start: Floats) -> Floats:
    """Return the state after the first impact one round later, from a state after it: by matrix exponentials."""
    body, matrix = orbit.body, flow_matrix(orbit.body)
    state, size = start.copy(), body.frequencies.size
    flights = np.diff(np.append(orbit.phases, orbit.phases[0] + 2.0 * np.pi)) / body.angular_frequency
    for flight, place in zip(flights, [*orbit.contacts[1:], orbit.contacts[0]], strict=True):
        contact, before = body.contacts[place], state.copy()

        def beyond(time: float, contact: Contact = contact, before: Floats = before) -> float:
            return float(contact.shape @ (expm(matrix * time) @ before)[:size] - contact.position)

        state = expm(matrix * brentq(beyond, 0.98 * flight, 1.02 * flight, xtol=1e-14)) @ before
        speed = contact.direction * float(contact.shape @ state[size:])
        taken = (1.0 + float(contact.restitution_at(speed))) * speed * contact.direction
        state[size:] -= taken * contact.mass * contact.shape
    return state


def multipliers_of_differences(orbit: PeriodicOrbit) -> Floats:
    """Return the eigenvalues of the map of the section of the first impact, by differences."""
    body, size = orbit.body, orbit.body.frequencies.size
    shape = body.contacts[orbit.contacts[0]].shape
    normal = np.concatenate([shape, np.zeros(size)]) / np.linalg.norm(shape)
    section = np.linalg.svd(normal[None])[2][1:].T
    columns = []
    for direction in section.T:
        ends = [after_a_round(orbit, orbit.states[0] + side * 1e-6 * direction) for side in (1.0, -1.0)]
        columns.append(section.T @ (ends[0] - ends[1]) / 2e-6)
    found = np.linalg.eigvals(np.column_stack(columns))
    return np.asarray(found[np.argsort(-np.abs(found), kind="stable")])


def test_the_limit_cycle_of_an_oscillator_and_a_stop_is_that_of_its_two_equations_in_40_digits() -> None:
    (orbit,) = orbits_of(oscillator())
    with mp.workdps(40):
        growth, r = mp.mpf("0.05"), mp.mpf("0.6")
        rate = mp.sqrt(1 - growth**2)

        def equations(period: mp.mpf, speed: mp.mpf) -> tuple[mp.mpf, mp.mpf]:
            """Return errors of place and speed at the next impact, after a flight from the stop at 1 with -r V."""
            grown, angle = mp.exp(growth * period), rate * period
            across = (-r * speed - growth) / rate
            place = grown * (mp.cos(angle) + across * mp.sin(angle))
            faster = growth * place + grown * rate * (across * mp.cos(angle) - mp.sin(angle))
            return place - 1, faster - speed

        period, speed = mp.findroot(equations, (mp.mpf("4.6"), mp.mpf("1.4")))
        assert orbit.period == pytest.approx(float(period), rel=1e-14)
        assert orbit.velocities[0] == pytest.approx(float(speed), rel=1e-14)
        assert orbit.multipliers[0] == pytest.approx(float(r**2 * mp.exp(2 * growth * period)), rel=1e-13)
    assert orbit.multiplier_of_motion == pytest.approx(1.0, abs=1e-13)
    assert orbit.multipliers.shape == (1,)
    assert orbit.is_stable
    assert orbit.is_physical
    assert repr(orbit) == "<P(1,1), stable: period 4.61444; phases 0; velocities 1.4187>"


@pytest.mark.parametrize("make", [oscillator, chain])
def test_derivatives_over_the_unknowns_are_those_of_differences(make: Callable[[], ImpactingBody]) -> None:
    body = make()
    contacts = np.array([0, 0, len(body.contacts) - 1], dtype=np.int32)
    like = PeriodicOrbit(
        body.with_period(7.0), 1, np.array([0.0, 1.5, 3.0]), contacts, np.array([0.7, 0.4, 0.9])
    )
    found = tried(body, like, like.unknowns)
    columns = []
    for k in range(like.unknowns.size):
        change = 1e-6 * np.eye(like.unknowns.size)[k]
        ends = [tried(body, like, like.unknowns + side * change).errors for side in (1.0, -1.0)]
        columns.append((ends[0] - ends[1]) / 2e-6)
    np.testing.assert_allclose(found.slopes, np.column_stack(columns), atol=2e-8 * np.abs(found.slopes).max())


def test_multipliers_of_coupled_modes_are_those_of_the_map_from_impact_to_impact() -> None:
    orbit = orbit_of_chain()
    np.testing.assert_allclose(orbit.multipliers, multipliers_of_differences(orbit), atol=2e-6)
    assert orbit.is_physical
    assert orbit.determinant == pytest.approx(orbit.exact_determinant, rel=1e-11)
    assert orbit.multiplier_of_motion == pytest.approx(1.0, abs=1e-11)
    np.testing.assert_allclose(after_a_round(orbit, orbit.states[0]), orbit.states[0], atol=1e-11)


def test_a_ball_in_a_cavity_of_a_self_excited_frame_has_unstable_orbits() -> None:
    frame, ball = np.array([0.0, 1.0]), np.array([np.sqrt(5.0), 0.0])  # masses 1 and .2
    contacts = tuple(Contact(side * (frame - ball), 1.0, 0.5, 0.7) for side in (1.0, -1.0))
    body = ImpactingBody(
        np.array([0.0, 1.0]), np.array([0.0, -0.02]), np.zeros(2), np.zeros(2), 1.0, 0.0, contacts, frame,
        has_own_period=True,
    )  # fmt: skip
    contacts_hit = np.array([0, 1], dtype=np.int32)
    orbit = find_own_orbit(body, 5.8, np.array([0.0, 3.0]), np.array([0.2, 0.2]), contacts_hit)
    assert is_symmetric(orbit)
    assert orbit.is_physical
    assert not orbit.is_stable
    np.testing.assert_allclose(after_a_round(orbit, orbit.states[0]), orbit.states[0], atol=1e-11)
    np.testing.assert_allclose(orbit.multipliers, multipliers_of_differences(orbit), atol=1e-5)
    assert orbit.multiplier_of_motion == pytest.approx(1.0, abs=1e-11)


def test_restitution_that_falls_with_speed_has_its_own_orbit() -> None:
    (orbit,) = orbits_of(oscillator(yields=0.3))
    assert orbit.falling.all()
    np.testing.assert_allclose(orbit.multipliers, multipliers_of_differences(orbit), atol=1e-6)
    np.testing.assert_allclose(after_a_round(orbit, orbit.states[0]), orbit.states[0], atol=1e-12)


def test_an_orbit_between_equal_stops_is_its_own_mirror_image() -> None:
    (orbit,) = orbits_of(oscillator(stops=(1.0, -1.0)), 2, starts=8)
    np.testing.assert_allclose(orbit.phases, [0.0, np.pi], atol=1e-12)
    assert is_symmetric(orbit)
    assert same_orbit(orbit, orbit.counted_from(1))
    assert orbit.repeated(3).turns == 3
    assert same_orbit(orbit.repeated(3).once, orbit)


def test_functions_of_bifurcations_change_their_signs_where_multipliers_pass_the_unit_circle() -> None:
    inner = [orbit_of_chain(excitation) for excitation in np.linspace(-0.55, -0.325, 10)]
    stable = {each.is_stable for each in inner}
    folds = {np.sign(folding(each) * np.prod(1.0 - each.multipliers).real) for each in inner}
    flips = {np.sign(alternating(each) * np.prod(1.0 + each.multipliers).real) for each in inner}
    assert stable == {False, True}
    assert len(folds) == len(flips) == 1


def test_a_branch_ends_where_the_motion_touches_a_second_stop_and_meets_the_orbit_of_both() -> None:
    (orbit,) = orbits_of(oscillator(stops=(1.0, -3.0)))
    follower = Follower(lambda below: oscillator(stops=(1.0, below)), FollowSettings(-3.0, -0.9, 0.05))
    branch = follower.branch(orbit, -3.0)
    (point,) = branch.points
    lowest = orbit.at(np.linspace(0.0, 2.0 * np.pi, 20_001))[0].min()
    assert point.kind == "graze between impacts"
    assert point.at.value == pytest.approx(lowest, abs=1e-7)
    (departure,) = departures(follower, point)
    assert departure.start.orbit.name == "P(2,1)"
    assert departure.is_stable
    assert departure.side == "higher"


def test_impacts_that_grow_without_bound_end_a_branch() -> None:
    (orbit,) = orbits_of(oscillator())
    follower = Follower(lambda r: oscillator(restitution=r), FollowSettings(0.5, 0.99, 0.5))
    branch = follower.branch(orbit, 0.6)
    # a fast impact is followed by half a turn: r e^(growth) = 1
    assert branch.values.max() == pytest.approx(np.exp(-0.05 * np.pi / np.sqrt(1.0 - 0.05**2)), abs=1e-3)
    assert branch.ends[1].endswith("its impacts grow without bound")


def test_no_orbit_near_a_guess_is_an_error() -> None:
    with pytest.raises(OrbitError, match=r"expected an orbit P\(1,1\) near to the period 1, got none"):
        find_own_orbit(oscillator(0.05), 1.0, np.zeros(1), np.ones(1), np.zeros(1, np.int32))


def test_slopes_of_a_symmetric_orbit_split_into_two_halves() -> None:
    """Equations.md 4.20: changes that keep the symmetry and changes that break it have errors of their own."""
    orbit = orbit_of_chain()
    halves, slopes = halves_of(orbit), slopes_of(orbit)
    assert halves is not None
    size = np.abs(slopes).max()
    np.testing.assert_allclose(halves.mean @ slopes @ halves.opposite, 0.0, atol=1e-11 * size)
    np.testing.assert_allclose(halves.difference @ slopes @ halves.equal, 0.0, atol=1e-11 * size)
    assert halves.folding(orbit) * halves.breaking(orbit) == pytest.approx(np.linalg.det(slopes), rel=1e-10)
    np.testing.assert_allclose(halves.apart @ orbit.unknowns, halves.offset, atol=1e-9)
    assert np.linalg.matrix_rank(np.hstack([halves.equal, halves.opposite])) == slopes.shape[0]
