"""Energies of the modes of orbits: the worked examples of equations.md 5 and 9, limits, and contradictory data."""

from __future__ import annotations

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.analysis.orbits import Contact, ImpactingBody, PeriodicOrbit, closed_form, find_orbit
from vibroimpact.analysis.orbits.energies import (
    energy_transfer,
    orbit_energies,
    residual_restitution,
    velocity_transfer,
)
from vibroimpact.fmus.core.modes import chain_modes
from vibroimpact.fmus.errors import UsageError

#: Error of identity (6.32) over the energy before impacts, for orbits of a few periods.
CLOSED = 1e-12


def chain(
    masses: list[float],
    stiffnesses: list[float],
    force: list[float],
    rate: float,
    *,
    damping: float,
    restitution: float,
    position: float = 0.1,
) -> ImpactingBody:
    """Return a chain with dampings in proportion to the stiffnesses, and its stop at the last mass."""
    springs = np.array([*stiffnesses, 0.0])
    modes = chain_modes(np.array(masses), springs, damping * springs)
    tip = modes.shapes[-1]
    stop = Contact(tip, 1.0, position, restitution)
    nothing = np.zeros(len(masses))
    loads = np.array(force) @ modes.shapes
    return ImpactingBody(modes.frequencies, modes.damping_ratios, loads, nothing, rate, 0.0, (stop,), tip)


def thesis(restitution: float = 0.7) -> ImpactingBody:
    return chain([1.0, 1.0], [1.0, 1.0], [0.5, 0.0], 0.9, damping=0.1, restitution=restitution)


def three(damping: float = 0.04) -> ImpactingBody:
    return chain([1.0, 2.0, 0.5], [3.0, 1.0, 2.0], [0.6, 0.0, 0.2], 0.75, damping=damping, restitution=0.6)


def test_the_chain_of_the_thesis_exchanges_what_equations_9_says() -> None:
    (orbit, *_) = closed_form(thesis())
    found = orbit_energies(orbit)
    assert found.lost.sum() == pytest.approx(0.158204452755, abs=5e-13)
    # thesis 6.3.3 read -.3247 and .1668 J from its samples
    np.testing.assert_allclose(found.change, [[-0.32460411, 0.16639966]], atol=5e-9)
    np.testing.assert_allclose(found.before, [[0.36859999, 0.0078044]], atol=5e-9)
    np.testing.assert_allclose(found.after, [[0.04399588, 0.17420406]], atol=5e-9)
    assert found.identity_error < CLOSED
    # of each mode, what stays in it is what impacts change
    assert np.abs(found.residual + found.change.sum(axis=0)).max() < CLOSED * found.kinetic.sum()
    assert found.restitution.value == pytest.approx(0.7, abs=1e-14)


def test_the_worked_example_of_three_masses_has_its_changes_and_its_residual_energy() -> None:
    # equations.md 5.4 and 5.5; the orbit passes through its stop: an example of the algebra alone
    found = orbit_energies(closed_form(three())[0])
    np.testing.assert_allclose(found.change, [[-0.089094891794, -0.008200753577, 0.085666306514]], atol=2e-12)
    assert found.residual.sum() == pytest.approx(0.011629338856298, abs=2e-14)
    assert found.identity_error < CLOSED
    assert found.restitution.value == pytest.approx(0.6, abs=1e-13)
    assert found.change.sum() == pytest.approx(-found.lost.sum(), abs=1e-14)


def test_the_matrices_of_the_thesis_have_the_corrected_entries() -> None:
    (contact,) = thesis().contacts
    of_velocity, of_energy = velocity_transfer(contact), energy_transfer(contact)
    np.testing.assert_allclose(np.diag(of_velocity), [-0.230132, 0.530132], atol=5e-7)
    assert abs(of_velocity[0, 1]) == pytest.approx(0.760263, abs=5e-7)
    np.testing.assert_allclose(np.diag(of_energy), [0.630961, 0.859039], atol=5e-7)
    assert abs(of_energy[0, 1]) == pytest.approx(0.228079, abs=5e-7)
    # thesis (6.39) has .41225, which is psi_22^2 (1 + r^2), and a trace that is not 1 + r^2
    assert contact.shape[1] ** 2 * (1.0 + 0.7**2) == pytest.approx(0.41225, abs=1e-3)
    assert np.trace(of_energy) == pytest.approx(1.0 + 0.7**2, abs=1e-15)
    np.testing.assert_allclose(of_velocity.T @ of_velocity, of_energy, atol=1e-15)


@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_what_an_elastic_impact_loses_is_nothing_and_a_plastic_one_all_that_it_meets(
    restitution: float,
) -> None:
    found = orbit_energies(closed_form(thesis(restitution))[0])
    assert found.residual.sum() == pytest.approx((1.0 - restitution**2) * found.kinetic.sum(), abs=1e-14)
    # the slope is unbounded at 0: rounding of the energies shows as its square root
    assert found.restitution.value == pytest.approx(restitution, abs=1e-7 if restitution == 0.0 else 1e-13)
    assert not found.restitution.problem


def test_one_mode_keeps_nothing_for_others() -> None:
    one = np.ones(1)
    for falls_above in (0.0, 0.2):
        stop = Contact(one, -1.0, -0.8, 0.75, yield_velocity=falls_above)
        body = ImpactingBody(one, 0.04 * one, 0.45 * one, 0.1 * one, 1.1, 0.7, (stop,), one)
        (orbit,) = closed_form(body)
        found = orbit_energies(orbit)
        assert found.change.item() == pytest.approx(-found.lost.item(), abs=1e-14)
        assert found.identity_error < CLOSED
        expected = float(stop.restitution_at(orbit.velocities[0]))
        assert found.restitution.value == pytest.approx(expected, rel=1e-12)


def test_an_orbit_between_two_stops_closes_the_identity() -> None:
    """Ten impacts in two periods, each with the restitution of its own stop."""
    scene = vi.Scene.from_text(
        """
        [body]
        mass = 1.0
        stiffness = 1.0
        damping = 0.1
        [forcing]
        amplitude = 3.0
        angular_frequency = 1.2
        [[stop]]
        position = 0.5
        restitution = 0.8
        [[stop]]
        position = -0.6
        side = "lower"
        restitution = 0.6
        [record]
        transient_periods = 400
        recorded_periods = 8
        """
    )
    found = vi.energies(vi.run(scene))
    assert found.attrs["orbit"] == "P(10,2)"
    assert set(found.impact_contact.values.tolist()) == {1, 2}
    assert found.identity_error.item() < CLOSED
    assert 0.6 < found.residual_restitution.item() < 0.8


def test_an_unstable_orbit_of_twice_the_period_closes_the_identity_too() -> None:
    # equations.md 4.7: P(2,2) of an oscillator
    one = np.ones(1)
    stop = Contact(one, 1.0, 0.8, 0.75)
    body = ImpactingBody(one, 0.04 * one, 0.44 * one, 0.0 * one, 0.88, 0.0, (stop,), one)
    times = np.array([0.59544845, 6.86299676])
    found = orbit_energies(find_orbit(body, 0.88 * times, None, 2))
    np.testing.assert_allclose(found.orbit.velocities, [0.41652521, 0.8717915], atol=5e-8)
    assert found.forcing.shape == found.change.shape == (2, 1)
    assert found.identity_error < CLOSED


def test_a_graze_exchanges_nothing_and_is_refused() -> None:
    orbit = closed_form(thesis())[0]
    graze = PeriodicOrbit(orbit.body, 1, orbit.phases, orbit.contacts, np.zeros(1))
    with pytest.raises(UsageError, match="expected impacts with a speed, got a graze"):
        orbit_energies(graze)


@pytest.mark.parametrize(
    ("residual", "kinetic", "problem"),
    [
        (
            10.1,
            10.0,
            "residual energy 10.1 J is more than the impacts have, 10 J: data or contact mass are wrong",
        ),
        (-0.1, 10.0, "residual energy -0.1 J is negative: impacts would give energy; data are wrong"),
    ],
)
def test_energies_that_contradict_give_no_restitution_and_say_so(
    residual: float, kinetic: float, problem: str
) -> None:
    said = residual_restitution(residual, kinetic)
    assert np.isnan(said.value)
    assert said.problem == problem


@pytest.mark.parametrize(("residual", "kinetic"), [(np.nan, 1.0), (0.1, 0.0), (0.1, -1.0), (np.inf, 1.0)])
def test_energies_that_are_none_are_refused(residual: float, kinetic: float) -> None:
    with pytest.raises(UsageError, match="expected a residual energy and a kinetic energy > 0"):
        residual_restitution(residual, kinetic)


def test_the_slope_is_that_of_the_curve_of_figure_6_16() -> None:
    step = 1e-5
    low, high = (residual_restitution(5.1 + side * step, 10.0).value for side in (-1, 1))
    assert residual_restitution(5.1, 10.0).slope == pytest.approx((high - low) / (2.0 * step), rel=1e-8)
