"""Orbits of chains whose dashpots couple the modes, against Newton's method on the stroboscopic map of the engine."""

from __future__ import annotations

import numpy as np
import pytest
from support.structure import Modes, Stop, Structure

from vibroimpact.analysis.orbits import Contact, ImpactingBody, PeriodicOrbit, closed_form, find_orbit
from vibroimpact.analysis.orbits.energies import orbit_energies
from vibroimpact.analysis.orbits.search import orbits_of
from vibroimpact.fmus.core.modes import chain_modes

STEP = 1e-5
"""Step of the central differences of the map, over the size of the state."""
#: Masses, springs, dashpots; the last spring and dashpot tie the far end to the ground.
TWO = [1.0, 1.0], [1.0, 1.0, 0.0], [0.0, 0.3, 0.05]
THREE = [1.0, 2.0, 0.5], [3.0, 1.0, 2.0, 0.0], [0.0, 0.05, 0.4, 0.1]
STRONG = [1.0, 2.0, 0.5], [3.0, 1.0, 2.0, 0.0], [0.1, 9.0, 0.1, 0.0]
BARE = [1.0, 1.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.2]
CHAINS = {"two masses": TWO, "three masses": THREE, "overdamped": STRONG, "one dashpot": BARE}


def body_of(
    chain: tuple[list[float], list[float], list[float]], w: float, position: float, ratio: float = 1.0
) -> ImpactingBody:
    """Return a chain that is pulled at its first mass; `ratio` scales its dashpots."""
    masses, springs, dashpots = chain
    modes = chain_modes(masses, springs, ratio * np.array(dashpots))
    assert not modes.is_classical
    tip = modes.shapes[-1]
    return ImpactingBody(
        modes.frequencies,
        modes.damping_ratios,
        0.5 * modes.shapes[0],
        0.02 * modes.shapes[-1],
        w,
        0.0,
        (Contact(tip, 1.0, position, 0.7), Contact(modes.shapes[0], -1.0, -3.0, 0.8)),
        tip,
        modes.coupling,
    )


class Strobe:
    """The states of a body at one phase of the force, before and after q periods, by the engine."""

    def __init__(self, orbit: PeriodicOrbit) -> None:
        body = self.body = orbit.body
        ends = np.append(orbit.phases[1:], orbit.phases[0] + 2.0 * np.pi * orbit.periods)
        self.modes = body.frequencies.size
        self.length = orbit.periods * body.period
        first = int(np.argmax(ends - orbit.phases))
        gap = 0.5 * float(ends[first] - orbit.phases[first])
        self.phase = float(orbit.phases[first]) + gap
        self.start, _ = self.run(
            orbit.states[first], float(orbit.phases[first]), gap / body.angular_frequency
        )

    def run(self, state: np.ndarray, phase: float, length: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the state after a time, and the impacts on the way."""
        body, n = self.body, self.modes
        modes = Modes(
            body.frequencies,
            force=body.force,
            angular_frequency=body.angular_frequency,
            phase=phase,
            coupling=body.coupling,
        )
        stops = [
            Stop(each.shape, each.position, side={1.0: "upper", -1.0: "lower"}[each.direction],
                 restitution=each.restitution)
            for each in body.contacts
        ]  # fmt: skip
        with Structure(modes, stops, state[:n], state[n:]) as engine:
            engine.advance(length, held=body.held)
            return np.concatenate([engine.displacement, engine.velocity]), engine.impacts

    def slope(self, state: np.ndarray) -> np.ndarray:
        """Return the derivative of the map by differences of fourth order."""
        h, columns = STEP * np.abs(state).max(), []
        for each in np.eye(state.size):
            one, two = (
                self.run(state + k * h * each, self.phase, self.length)[0]
                - self.run(state - k * h * each, self.phase, self.length)[0]
                for k in (1.0, 2.0)
            )
            columns.append((8.0 * one - two) / (12.0 * h))
        return np.array(columns).T

    def fixed_point(self) -> np.ndarray:
        """Return the fixed point of the map, by Newton's method from a state beside the orbit."""
        state = self.start * (1.0 + 1e-4 * np.linspace(-1.0, 1.0, self.start.size))
        for _ in range(6):
            away = self.run(state, self.phase, self.length)[0] - state
            state = state - np.linalg.solve(self.slope(state) - np.eye(state.size), away)
        return state


def check(orbit: PeriodicOrbit) -> None:
    """Compare an orbit with the fixed point of the engine's map: state, impacts, multipliers, energy."""
    strobe = Strobe(orbit)
    state = strobe.fixed_point()
    size = np.abs(state).max()
    np.testing.assert_allclose(strobe.start, state, atol=1e-10 * size)
    _, impacts = strobe.run(state, strobe.phase, strobe.length)
    phases = np.mod(strobe.phase + orbit.body.angular_frequency * impacts[:, 1], 2.0 * np.pi * orbit.periods)
    order, own = np.argsort(phases), np.argsort(np.mod(orbit.phases, 2.0 * np.pi * orbit.periods))
    np.testing.assert_allclose(impacts[order, 3], orbit.velocities[own], rtol=1e-10)
    np.testing.assert_allclose(
        phases[order], np.mod(orbit.phases, 2.0 * np.pi * orbit.periods)[own], atol=1e-10
    )
    found = np.linalg.eigvals(strobe.slope(state))
    largest = float(np.abs(orbit.multipliers).max())
    for each in orbit.multipliers[:2]:  # smaller ones have fewer digits of differences
        assert np.abs(found - each).min() <= 1e-6 * max(1.0, largest)
    assert orbit_energies(orbit).identity_error < 1e-12


@pytest.mark.parametrize("name", CHAINS)
def test_orbits_of_one_impact_are_fixed_points_of_the_engine(name: str) -> None:
    found = [
        orbit
        for w in (0.7, 0.9, 1.5)
        for orbit in closed_form(body_of(CHAINS[name], w, 0.1))
        if orbit.is_physical
    ]
    assert found
    for orbit in found:
        check(orbit)


def test_orbits_of_two_impacts_and_unstable_ones_are_fixed_points_of_the_engine() -> None:
    two = orbits_of(body_of(TWO, 0.7, 0.1), 2, 1, starts=32)
    assert two
    check(two[0])
    near_a_fold = [orbit for orbit in closed_form(body_of(TWO, 2.05, 0.1)) if orbit.is_physical]
    unstable = [orbit for orbit in near_a_fold if not orbit.is_stable]
    assert unstable
    check(unstable[0])
    assert np.abs(unstable[0].multipliers[0]) > 1.01


def test_no_digit_is_lost_next_to_critical_damping_of_a_coupled_mode() -> None:
    # the dashpot of the second mass to the ground is such that two rates become one
    low, high = 1.0, 20.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        swings = np.abs(body_of(BARE, 0.9, 0.2, middle).rates.imag).min() > 1e-9
        low, high = (middle, high) if swings else (low, middle)
    orbits = []
    for off in (0.0, 1e-12, -1e-9, 1e-6, -1e-4, 1e-2):
        body = body_of(BARE, 0.9, 0.2, low * (1.0 + off))
        orbit = next(each for each in closed_form(body) if each.is_physical)
        check(orbit)
        again = find_orbit(body, orbit.phases + 1e-4)
        np.testing.assert_allclose(again.velocities, orbit.velocities, rtol=1e-12)
        orbits.append(orbit)
    speeds = np.array([each.velocities[0] for each in orbits])
    np.testing.assert_allclose(speeds[1], speeds[0], rtol=1e-11)
