"""Periodic orbits of random chains against a flow by matrix exponentials in physical coordinates."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from vibroimpact.analysis.orbits import (
    Contact,
    ImpactingBody,
    OrbitError,
    PeriodicOrbit,
    closed_form,
    find_orbit,
)
from vibroimpact.fmus.core.modes import chain_modes

FEW = settings(max_examples=60, derandomize=True, deadline=None)
STEP = 1e-6
"""Step of the central differences, over the size of the motion."""


def matrix_of(elements: np.ndarray) -> np.ndarray:
    """Return the matrix of the springs or the dashpots of a chain; its far end is free."""
    between = elements[1:]
    return np.diag(elements + np.append(between, 0.0)) - np.diag(between, 1) - np.diag(between, -1)


class Chain:
    """A chain whose last mass hits a stop above."""

    def __init__(
        self, masses: list[float], springs: list[float], dashpots: list[float], force: list[float], w: float
    ) -> None:
        n = len(masses)
        self.masses, self.force, self.w = np.array(masses), np.array(force), w
        stiffness, damping = matrix_of(np.array(springs)), matrix_of(np.array(dashpots))
        inverse = np.diag(1.0 / self.masses)
        self.equations = np.zeros((2 * n + 2, 2 * n + 2))
        self.equations[:n, n : 2 * n] = np.eye(n)
        self.equations[n : 2 * n, :n] = -inverse @ stiffness
        self.equations[n : 2 * n, n : 2 * n] = -inverse @ damping
        self.equations[n : 2 * n, 2 * n] = inverse @ self.force
        self.equations[2 * n, 2 * n + 1], self.equations[2 * n + 1, 2 * n] = -w, w
        self.modes = chain_modes(self.masses, [*springs, 0.0], [*dashpots, 0.0])

    def body(self, position: float, restitution: float) -> ImpactingBody:
        """Return the chain in modal coordinates."""
        shape = self.modes.shapes[-1]
        contact = Contact(shape, 1.0, position, restitution)
        force = self.force @ self.modes.shapes
        frequencies, ratios = self.modes.frequencies, self.modes.damping_ratios
        coupling = None if self.modes.is_classical else self.modes.coupling
        return ImpactingBody(
            frequencies, ratios, force, 0.0 * force, self.w, 0.0, (contact,), shape, coupling
        )

    def fly(self, state: np.ndarray, phase: float, u: float) -> np.ndarray:
        """Return the state after the time `u`."""
        return (expm(self.equations * u) @ np.append(state, [np.cos(phase), np.sin(phase)]))[:-2]


def after_a_period(chain: Chain, state: np.ndarray, phase: float, orbit: PeriodicOrbit) -> np.ndarray:
    """Return the state after the periods of an orbit P(1,q); its impact is searched near the orbit's own."""
    contact, n = orbit.body.contacts[0], chain.masses.size
    length = orbit.periods * orbit.body.period
    u = (orbit.phases[0] - phase) % (2.0 * np.pi * orbit.periods) / chain.w
    for _ in range(20):
        at = chain.fly(state, phase, u)
        u -= (at[n - 1] - contact.position) / at[2 * n - 1]
    at = chain.fly(state, phase, u)
    at[2 * n - 1] *= -contact.restitution
    return chain.fly(at, phase + chain.w * u, length - u)


@st.composite
def chains(draw: st.DrawFn) -> Chain:
    n = draw(st.integers(1, 4))
    some = st.floats(0.4, 3.0)
    masses, springs = ([draw(some) for _ in range(n)] for _ in range(2))
    force = [draw(st.floats(-1.0, 1.0)) for _ in range(n)]
    assume(max(map(abs, force)) > 0.1)
    damping = st.one_of(st.floats(0.01, 0.3), st.floats(1.0, 4.0))  # up to overdamped modes
    ratio = draw(damping)
    dashpots = [ratio * each for each in springs]
    if draw(st.booleans()):  # damping that couples the modes, also undamped springs
        dashpots = [draw(st.one_of(st.just(0.0), damping)) for _ in range(n)]
        assume(max(dashpots) > 0.0)
    return Chain(masses, springs, dashpots, force, draw(st.floats(0.4, 2.5)))


def orbits(chain: Chain, share: float, restitution: float, periods: int) -> tuple[PeriodicOrbit, ...]:
    """Return the orbits of a chain whose stop is at a share of its steady amplitude."""
    free = chain.body(1.0, restitution)
    amplitude = abs(free.contacts[0].shape @ free.steady(chain.w))
    assume(amplitude > 1e-3)
    found = closed_form(chain.body(share * amplitude, restitution), periods)
    # near a graze, multipliers grow without bound
    kept = tuple(each for each in found if each.velocities[0] > 0.05 * amplitude * chain.w)
    assume(kept)
    return kept


shares, restitutions, periods = st.floats(-0.5, 0.95), st.floats(0.1, 1.0), st.integers(1, 3)


@FEW
@given(chains(), shares, restitutions, periods)
def test_a_closed_orbit_is_closed_by_another_flow(chain: Chain, share: float, r: float, q: int) -> None:
    for orbit in orbits(chain, share, r, q):
        n, shapes = chain.masses.size, chain.modes.shapes
        state = np.append(shapes @ orbit.states[0, :n], shapes @ orbit.states[0, n:])
        end = chain.fly(state, orbit.phases[0], q * orbit.body.period)
        size = np.abs(state).max() + np.abs(end).max()
        assert abs(end[n - 1] - orbit.body.contacts[0].position) <= 1e-10 * size
        assert abs(end[-1] - orbit.velocities[0]) <= 1e-10 * size
        end[-1] *= -r
        np.testing.assert_allclose(end, state, atol=1e-10 * size)


@FEW
@given(chains(), shares, restitutions, periods)
def test_newton_comes_back_to_the_closed_form(chain: Chain, share: float, r: float, q: int) -> None:
    for orbit in orbits(chain, share, r, q):
        again = find_orbit(orbit.body, orbit.phases + 1e-5, periods=q)
        # the two orbits of a fold can be arbitrarily close to each other
        slope = abs(orbit.body.kernel.evaluate(orbit.contacts, orbit.phases, q).distance_slopes[0, 0])
        assume(slope > 1e-3 * orbit.body.scale)
        np.testing.assert_allclose(again.phases, orbit.phases, atol=1e-9)
        np.testing.assert_allclose(again.velocities, orbit.velocities, rtol=1e-8)


@FEW
@given(chains(), shares, restitutions, periods)
def test_the_determinant_is_what_restitution_and_damping_leave(
    chain: Chain, share: float, r: float, q: int
) -> None:
    for orbit in orbits(chain, share, r, q):
        size = np.prod(np.linalg.norm(orbit.monodromy, axis=1))  # Hadamard's bound of the determinant
        assert abs(orbit.determinant - orbit.exact_determinant) <= 1e-12 * size


@settings(FEW, max_examples=20)
@given(chains(), shares, restitutions, st.integers(1, 2))
def test_multipliers_are_those_of_differences_of_another_flow(
    chain: Chain, share: float, r: float, q: int
) -> None:
    for orbit in orbits(chain, share, r, q):
        n, shapes = chain.masses.size, chain.modes.shapes
        whole = np.kron(np.eye(2), shapes)  # from modal to physical states
        # a tenth of the flight after the impact: no difference begins beyond the stop
        u = 0.1 * q * orbit.body.period
        phase = orbit.phases[0] + chain.w * u
        state = chain.fly(whole @ orbit.states[0], orbit.phases[0], u)
        h = STEP * np.abs(state).max()
        columns = [
            after_a_period(chain, state + h * e, phase, orbit)
            - after_a_period(chain, state - h * e, phase, orbit)
            for e in np.eye(2 * n)
        ]
        moved = expm(chain.equations * u)[: 2 * n, : 2 * n]
        known = moved @ whole @ orbit.monodromy @ np.linalg.inv(whole) @ np.linalg.inv(moved)
        assume(np.linalg.cond(moved) < 1e4)
        size = np.abs(known).max() + 1.0
        np.testing.assert_allclose(np.array(columns).T / (2.0 * h), known, atol=1e-6 * size**2)


@FEW
@given(chains(), shares, restitutions, st.lists(st.floats(0.05, 0.95), min_size=2, max_size=4, unique=True))
def test_newton_ends_on_an_orbit_or_says_why_not(
    chain: Chain, share: float, r: float, places: list[float]
) -> None:
    body, phases = chain.body(share, r), 4.0 * np.pi * np.sort(places)
    said = ""
    try:
        orbit = find_orbit(body, phases, [0] * len(places), 2)
    except OrbitError as error:
        said = str(error)
    if said:
        assert said.startswith("orbit: expected")
        assert "\n" not in said
        return
    found = body.kernel.evaluate(orbit.contacts, orbit.phases, 2)
    assert np.abs(found.distances).max() <= 1e-11 * body.scale
    assert (np.diff(orbit.phases) > 0.0).all()
