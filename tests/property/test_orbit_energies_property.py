"""Energies of the modes of random chains: the identity of the thesis, balances of each mode, matrices of an impact."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.orbits import Contact, ImpactingBody, OrbitError, PeriodicOrbit, closed_form
from vibroimpact.analysis.orbits.energies import energy_transfer, orbit_energies, velocity_transfer
from vibroimpact.fmus.core.modes import chain_modes

FEW = settings(max_examples=150, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
#: Error of the identity over the energy through the modes: a slow force moves the rest position's energy to and fro.
ROUNDING = 1e-12


@st.composite
def chains(draw: st.DrawFn) -> ImpactingBody:
    """Draw chains of up to six masses, with a stop on one of them; the damping may couple the modes."""
    count = draw(st.integers(1, 6))
    numbers = st.floats(0.2, 5.0)
    masses, springs, loads = (
        np.array(draw(st.lists(numbers, min_size=count, max_size=count))) for _ in range(3)
    )
    damping = draw(st.sampled_from([0.0, 0.01, 0.1, 1.0]))
    springs = np.append(springs, draw(st.sampled_from([0.0, 1.0])))
    dashpots = damping * springs
    if draw(st.booleans()):
        dashpots = np.array(draw(st.lists(st.floats(0.0, 2.0), min_size=count + 1, max_size=count + 1)))
    modes = chain_modes(masses, springs, dashpots)
    hit = modes.shapes[draw(st.integers(0, count - 1))]
    side = draw(st.sampled_from([1.0, -1.0]))
    stop = Contact(hit, side, side * draw(st.floats(-0.2, 1.0)), draw(st.floats(0.0, 1.0)))
    held = draw(st.floats(-0.1, 0.1)) * modes.shapes[-1]
    rate = draw(st.floats(0.1, 8.0))
    return ImpactingBody(
        modes.frequencies,
        modes.damping_ratios,
        loads @ modes.shapes,
        held,
        rate,
        draw(st.floats(0.0, 6.0)),
        (stop,),
        hit,
        None if modes.is_classical else modes.coupling,
    )


def orbits(body: ImpactingBody, periods: int) -> tuple[PeriodicOrbit, ...]:
    try:
        found = closed_form(body, periods)
    except OrbitError:  # an undamped mode has an unbounded response
        found = ()
    assume(found)
    return tuple(orbit for orbit in found if orbit.velocities[0] > 1e-6)


@FEW
@given(chains(), st.integers(1, 3))
def test_what_impacts_lose_is_what_all_modes_have_left(body: ImpactingBody, periods: int) -> None:
    for orbit in orbits(body, periods):
        found = orbit_energies(orbit)
        rest = ((body.force / body.frequencies) ** 2).sum()
        through = np.abs(found.forcing).sum() + np.abs(found.damping).sum() + found.before.sum() + rest
        assert abs(found.residual.sum() - found.lost.sum()) <= ROUNDING * through
        # each mode on its own: impacts take the balance of force and damping
        assert np.abs(found.residual + found.change.sum(axis=0)).max() <= ROUNDING * through


@FEW
@given(chains(), st.integers(1, 3))
def test_changes_at_an_impact_are_those_of_equations_5_4_and_sum_up_to_the_loss(
    body: ImpactingBody, periods: int
) -> None:
    for orbit in orbits(body, periods):
        found = orbit_energies(orbit)
        np.testing.assert_allclose(found.change, found.after - found.before, atol=1e-13 * found.before.max())
        assert abs(found.change.sum() + found.lost.sum()) <= ROUNDING * found.before.sum()
        loss = found.damping if body.coupling is None else found.damping.sum(axis=1)
        assert (loss >= -ROUNDING * found.before.sum()).all()


@FEW
@given(chains())
def test_the_matrix_of_energy_has_the_eigenvalue_of_the_restitution_once_and_else_one(
    body: ImpactingBody,
) -> None:
    (contact,) = body.contacts
    of_velocity, of_energy = velocity_transfer(contact), energy_transfer(contact)
    restitution = contact.restitution
    assert np.array_equal(of_energy, of_energy.T)
    np.testing.assert_allclose(
        np.linalg.eigvalsh(of_energy), [restitution**2, *np.ones(contact.shape.size - 1)], atol=1e-14
    )
    np.testing.assert_allclose(of_velocity.T @ of_velocity, of_energy, atol=1e-14)
    assert abs(np.linalg.det(of_velocity) + restitution) <= 1e-14
    # the contact rebounds with the restitution, for any modes
    np.testing.assert_allclose(contact.shape @ of_velocity, -restitution * contact.shape, atol=1e-14)
