"""Periodic orbits against the worked examples of equations.md and finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from vibroimpact.analysis.orbits import Contact, ImpactingBody, OrbitError, closed_form, find_orbit
from vibroimpact.analysis.orbits.finding import shortened
from vibroimpact.analysis.orbits.periodic import PeriodicOrbit
from vibroimpact.analysis.orbits.search import orbits_of
from vibroimpact.fmus.core.modes import chain_modes
from vibroimpact.fmus.errors import UsageError


def oscillator(
    force: float, frequency: float, ratio: float = 0.04, position: float = 0.8, restitution: float = 0.75
) -> ImpactingBody:
    one = np.ones(1)
    contact = Contact(one, 1.0, position, restitution)
    return ImpactingBody(one, ratio * one, force * one, 0.0 * one, frequency, 0.0, (contact,), one)


def test_the_closed_form_is_that_of_the_worked_example() -> None:
    (orbit,) = closed_form(oscillator(0.45, 1.1))
    assert orbit.velocities[0] == pytest.approx(0.952486147774719, abs=1e-14)
    assert orbit.phases[0] == pytest.approx(0.210560661892213, abs=1e-14)
    assert orbit.multipliers[0] == pytest.approx(-0.35720824 + 0.47810128j, abs=1e-8)
    assert orbit.determinant == pytest.approx(0.356178568728976, abs=1e-14)
    assert orbit.exact_determinant == pytest.approx(orbit.determinant, rel=1e-13)
    assert orbit.is_stable
    assert orbit.is_physical
    assert orbit.highest[2] == -1


def test_newton_finds_the_orbit_of_two_impacts_in_two_periods() -> None:
    body = oscillator(0.44, 0.88)
    orbit = find_orbit(body, 0.88 * np.array([0.6, 6.9]), periods=2)
    assert orbit.name == "P(2,2)"
    np.testing.assert_allclose(orbit.phases / 0.88, [0.59544845, 6.86299676], atol=1e-8)
    np.testing.assert_allclose(orbit.velocities, [0.41652521, 0.8717915], atol=1e-8)
    np.testing.assert_allclose(orbit.multipliers, [0.83541348, 0.12083889], atol=2e-8)
    assert orbit.exact_determinant == pytest.approx(0.1009504356848, abs=1e-13)
    assert orbit.turns == 1


def test_an_orbit_that_is_counted_twice_is_known() -> None:
    body = oscillator(0.45, 1.1)
    (once,) = closed_form(body)
    twice = find_orbit(body, np.array([once.phases[0], once.phases[0] + 2.0 * np.pi]), periods=2)
    assert twice.turns == 2


def test_two_orbits_below_the_graze_are_both_found_and_one_is_unstable() -> None:
    slow, fast = reversed(closed_form(oscillator(0.5, 1.45, 0.05, 1.0, 0.7)))
    assert fast.is_stable
    assert not slow.is_stable
    assert slow.multipliers[0].real > 1.0


def test_derivatives_over_the_phases_are_those_of_differences() -> None:
    shapes = np.array([[0.6, -1.1, 0.8], [0.3, 0.5, 0.2]])
    contacts = (Contact(shapes[0], 1.0, 0.1, 0.6), Contact(shapes[1], -1.0, -0.2, 0.8))
    body = ImpactingBody(
        np.array([1.0, 2.7, 6.1]),
        np.array([0.02, 1.0, 1.7]),
        np.array([0.3, -0.2, 0.1]),
        np.array([0.01, 0.02, 0.0]),
        1.9,
        0.0,
        contacts,
        shapes[0],
    )
    hit, phases, h = np.array([0, 1, 0], np.int32), np.array([0.3, 2.0, 6.6]), 1e-6
    found = body.kernel.evaluate(hit, phases, 2)
    for k in range(3):
        ends = [body.kernel.evaluate(hit, phases + s * h * (np.arange(3) == k), 2) for s in (1.0, -1.0)]
        slope = (ends[0].distances - ends[1].distances) / (2.0 * h)
        np.testing.assert_allclose(found.distance_slopes[:, k], slope, atol=1e-8)
        faster = (ends[0].velocities - ends[1].velocities) / (2.0 * h)
        np.testing.assert_allclose(found.velocity_slopes[:, k], faster, atol=1e-8)


def test_the_flip_of_the_worked_example_has_a_multiplier_of_minus_one() -> None:
    # equations.md 4.5
    (orbit,) = closed_form(oscillator(0.450214238658253, 0.88))
    assert orbit.velocities[0] == pytest.approx(0.603188578597231, abs=1e-13)
    assert orbit.multipliers[0] == pytest.approx(-1.0, abs=1e-12)


def test_at_the_fold_of_the_worked_example_two_orbits_meet_and_end() -> None:
    # equations.md 4.5; the multipliers separate with the square root of the distance from the fold
    force = 0.180607698844102
    assert closed_form(oscillator(force - 1e-9, 1.35)) == ()
    fast, slow = closed_form(oscillator(force + 1e-9, 1.35))
    assert fast.velocities[0] == pytest.approx(0.914676801783975, abs=1e-4)
    assert (fast.multipliers[0].real, slow.multipliers[0].real) == pytest.approx((0.99989, 1.00011), abs=1e-5)


@pytest.mark.parametrize(("frequency", "physical"), [(0.8358, False), (0.8359, True), (0.839, True)])
def test_physical_orbits_end_at_the_graze_of_a_maximum_between_impacts(
    frequency: float, physical: bool
) -> None:
    # equations.md 9: the P(1,2) of damping ratio .1 grazes at .83585707234244, and still misses the stop at .839
    (orbit,) = closed_form(oscillator(0.5, frequency, 0.1, 1.0, 0.7), 2)
    assert orbit.is_physical is physical
    (at_graze,) = closed_form(oscillator(0.5, 0.83585707234244, 0.1, 1.0, 0.7), 2)
    assert abs(at_graze.highest[0]) <= 1e-12
    assert at_graze.highest[2] == 0


def test_the_chain_of_the_energy_example_penetrates() -> None:
    # equations.md 5.4: "that orbit penetrates: algebra test only"
    modes = chain_modes(
        np.array([1.0, 2.0, 0.5]), np.array([3.0, 1.0, 2.0, 0.0]), 0.04 * np.array([3, 1, 2, 0])
    )
    force = np.array([0.6, 0.0, 0.2]) @ modes.shapes
    contact = Contact(modes.shapes[-1], 1.0, 0.1, 0.6)
    body = ImpactingBody(
        modes.frequencies, modes.damping_ratios, force, 0.0 * force, 0.75, 0.0, (contact,), modes.shapes[-1]
    )
    orbits = closed_form(body)
    assert len(orbits) > 0
    assert not any(orbit.is_physical for orbit in orbits)
    assert contact.mass == pytest.approx(0.5, rel=1e-14)
    assert all(orbit.highest[0] > 0.0 for orbit in orbits)


@pytest.mark.parametrize("ratio", [0.05, 1.0, 1.0 + 1e-9, 3.0, 40.0])
def test_the_motion_between_impacts_ends_where_the_next_impact_is(ratio: float) -> None:
    # a stiff mode of high damping decays as exp(-2 ratio natural u); a cosh in its place would overflow
    shape = np.array([1.0, 0.4])
    natural, ratios, force = np.array([1.0, 60.0]), np.array([0.05, ratio]), np.array([0.5, 0.2])
    contact = Contact(shape, 1.0, 0.3, 0.7)
    body = ImpactingBody(natural, ratios, force, 0.0 * force, 0.9, 0.0, (contact,), shape)
    for orbit in closed_form(body):
        phases = orbit.phases[0] + np.linspace(0.0, 2.0 * np.pi, 200)
        x, v = orbit.at(phases)
        assert np.isfinite([x, v]).all()
        assert x[[0, -1]] == pytest.approx(0.3, abs=1e-9)
        assert v[0] == pytest.approx(-0.7 * orbit.velocities[0], abs=1e-9)
        assert v[-1] == pytest.approx(orbit.velocities[0], abs=1e-9)


def test_a_body_at_rest_on_its_stop_has_no_orbit() -> None:
    still = oscillator(0.0, 1.1, position=0.0)
    assert closed_form(still) == ()
    assert orbits_of(still, 2, 3, starts=8, penetrating=True) == []


def test_the_determinant_of_a_graze_is_none() -> None:
    body = oscillator(0.45, 1.1)
    (orbit,) = closed_form(body)
    graze = PeriodicOrbit(body, 1, orbit.phases, orbit.contacts, 0.0 * orbit.velocities)
    assert np.isnan(graze.determinant)
    assert np.isnan(graze.multipliers).all()


def test_what_is_no_orbit_is_said() -> None:
    body = oscillator(0.1, 1.6)
    assert closed_form(body) == ()
    with pytest.raises(
        OrbitError, match=r"orbit: expected an orbit P\(1,1\) near to the phases \[0.3\], got none"
    ):
        find_orbit(body, [0.3])
    with pytest.raises(UsageError, match="phases: expected ascending ones within 1 turns"):
        find_orbit(body, [0.3, 0.2])
    with pytest.raises(UsageError, match="contacts: expected 0 to 0"):
        find_orbit(body, [0.3], [1])
    with pytest.raises(OrbitError, match="got an undamped one in resonance"):
        closed_form(oscillator(0.45, 1.0, 0.0))


@pytest.mark.parametrize(("frequency", "periods"), [(2.0, 2), (3.0, 3), (0.5, 1), (1.5, 3)])
def test_an_undamped_mode_that_is_back_after_the_orbit_is_refused_without_a_resonant_force(
    frequency: float, periods: int
) -> None:
    with pytest.raises(OrbitError, match="got an undamped one in resonance"):
        closed_form(oscillator(0.9, frequency, 0.0), periods)


@pytest.mark.parametrize("periods", [1, 2])
def test_damping_given_as_a_matrix_is_that_of_the_damping_ratios(periods: int) -> None:
    modes = chain_modes([1.0, 2.0, 0.5], [3.0, 1.0, 2.0, 0.0], [0.12, 0.04, 0.08, 0.0])
    force, tip = np.array([0.6, 0.0, 0.2]) @ modes.shapes, modes.shapes[-1]
    contacts = (Contact(tip, 1.0, 0.1, 0.6), Contact(modes.shapes[0], -1.0, -2.0, 0.8))
    numbers = modes.frequencies, modes.damping_ratios, force, 0.01 * force, 0.75, 0.0, contacts, tip
    (one,), (other,) = (
        closed_form(ImpactingBody(*numbers, coupling), periods) for coupling in (None, modes.coupling)
    )
    close = {"rtol": 1e-12, "atol": 1e-12}
    for name in ("phases", "velocities", "states", "monodromy", "determinant", "multipliers"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), **close, err_msg=name)
    assert other.highest[0] == pytest.approx(one.highest[0], abs=1e-12)
    assert other.highest[2] == one.highest[2]
    at = np.linspace(one.phases[0], one.phases[0] + 2.0 * np.pi * periods, 40)
    np.testing.assert_allclose(other.at(at), one.at(at), **close)
    sizes = [np.sort(np.abs(each.body.rates)) for each in (one, other)]
    np.testing.assert_allclose(sizes[1], sizes[0], **close)
    assert other.body.slowest_decay == pytest.approx(one.body.slowest_decay, rel=1e-12)


def test_rates_far_apart_next_to_critical_damping_are_refused() -> None:
    frequencies, critical = np.array([1.0, 1e7]), np.array([[2.0, 0.0], [0.0, 1e3]])
    contact, none = Contact(np.ones(2), 1.0, 0.1, 0.6), np.zeros(2)
    body = ImpactingBody(frequencies, none, np.ones(2), none, 0.75, 0.0, (contact,), none, critical)
    with pytest.raises(OrbitError, match="away from critical damping"):
        closed_form(body)


def test_impacts_that_fall_together_are_said() -> None:
    phases = np.array([1.0, 1.0 + 2.0 * np.pi])
    with pytest.raises(OrbitError, match="expected impacts one after the other, got two at one phase"):
        shortened(np.array([0.1, 0.2]), phases, 1)


def test_a_body_may_have_32_contacts() -> None:
    one = np.ones(1)
    stops = [Contact(one, 1.0, 0.8 if k == 31 else 9.0, 0.75) for k in range(33)]
    (orbit,) = closed_form(
        ImpactingBody(one, 0.04 * one, 0.45 * one, 0.0 * one, 1.1, 0.0, tuple(stops[:32]), one), 1, 31
    )
    assert orbit.velocities[0] == pytest.approx(0.952486147774719, rel=1e-12)
    assert orbit.is_physical
    with pytest.raises(OrbitError):
        closed_form(ImpactingBody(one, 0.04 * one, 0.45 * one, 0.0 * one, 1.1, 0.0, tuple(stops), one), 1, 31)
