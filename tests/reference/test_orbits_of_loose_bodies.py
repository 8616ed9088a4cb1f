"""Orbits with bodies that no spring ties to the ground, against Newton's method on exact flights in 40 digits."""

from __future__ import annotations

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from mpmath import mp, mpf

from vibroimpact.analysis.orbits import Contact, ImpactingBody, find_orbit
from vibroimpact.analysis.orbits.periodic import PeriodicOrbit

FRAME, DAMPING, FORCE, RATE = 1.0, 0.1, 0.3, 1.3
BALL, CLEARANCE, RESTITUTION = 0.1, (0.4, 0.38), (0.5, 0.52)
EXACT = 1e-13
"""Largest error of phases and speeds."""


def impact_pair(held: float) -> ImpactingBody:
    """Return an oscillator with a ball in its cavity; a constant force pulls the ball."""
    root = np.sqrt(BALL)
    rows = np.array([[-1.0 / root, 1.0], [1.0 / root, -1.0]])
    contacts = tuple(Contact(rows[k], 1.0, CLEARANCE[k], RESTITUTION[k]) for k in (0, 1))
    return ImpactingBody(
        np.array([0.0, 1.0]),
        np.array([0.0, 0.5 * DAMPING]),
        np.array([0.0, FORCE]),
        np.array([held / root, 0.02]),
        RATE,
        0.0,
        contacts,
        np.array([0.0, 1.0]),
    )


def flight(held: mpf) -> Callable[[list[mpf], mpf, mpf], list[mpf]]:
    """Return the exact flight of (frame, its velocity, ball, its velocity) from a time for a length."""
    z = mpf(DAMPING) / 2
    rate = mp.sqrt(1 - z * z)
    w = mpf(RATE)
    answer = mpf(FORCE) / (1 - w * w + 2j * z * w)

    def steady(time: mpf) -> tuple[mpf, mpf]:
        turned = answer * mp.expj(w * time)
        return mp.re(turned) + mpf(0.02), mp.re(1j * w * turned)

    def fly(state: list[mpf], time: mpf, u: mpf) -> list[mpf]:
        (x0, v0), (x1, v1) = steady(time), steady(time + u)
        x, v, left = state[0] - x0, state[1] - v0, mp.exp(-z * u)
        c, s = left * mp.cos(rate * u), left * mp.sin(rate * u) / rate
        moved, faster = (c + z * s) * x + s * v, -s * x + (c - z * s) * v
        pull = held / mpf(BALL)
        ball = state[2] + u * state[3] + pull * u * u / 2
        return [moved + x1, faster + v1, ball, state[3] + pull * u]

    return fly


def struck(state: list[mpf], contact: int) -> tuple[list[mpf], mpf]:
    """Return the state after an impact, and the speed towards the stop before it."""
    side = 1 - 2 * contact
    speed = side * (state[1] - state[3])
    impulse = side * (1 + mpf(RESTITUTION[contact])) * speed / (1 / mpf(FRAME) + 1 / mpf(BALL))
    return [state[0], state[1] - impulse / mpf(FRAME), state[2], state[3] + impulse / mpf(BALL)], speed


def in_forty_digits(orbit: PeriodicOrbit, held: float) -> tuple[np.ndarray, np.ndarray]:
    """Return phases and speeds of the orbit next to one of two impacts, from the flow alone."""
    with mp.workdps(40):
        fly, period = flight(mpf(held)), 2 * mp.pi / mpf(RATE)
        first, second = (int(each) for each in orbit.contacts)

        def after(*unknowns: mpf) -> tuple[list[mpf], list[mpf], list[mpf]]:
            *state, one, two = unknowns
            hit = fly(list(state), one, two - one)
            left, _ = struck(hit, second)
            return hit, fly(left, two, one + period - two), left

        def off(*unknowns: mpf) -> list[mpf]:
            hit, end, _ = after(*unknowns)
            back, _ = struck(end, first)
            gaps = [
                side * (state[0] - state[2]) - mpf(CLEARANCE[contact])
                for state, contact, side in ((hit, second, 1 - 2 * second), (end, first, 1 - 2 * first))
            ]
            return gaps + [one - other for one, other in zip(back, unknowns[:4], strict=True)]

        root = float(np.sqrt(BALL))
        x_ball, x, v_ball, v = orbit.states[0]
        times = orbit.phases / RATE
        guess = [x, v, x_ball / root, v_ball / root, times[0], times[1]]
        found = list(mpmath.findroot(off, [mpf(float(each)) for each in guess], tol=mpf(10) ** -60))
        hit, end, _ = after(*found)
        speeds = [struck(end, first)[1], struck(hit, second)[1]]
        phases = np.array([float(mpf(RATE) * each) for each in found[4:]])
        return phases, np.array([float(each) for each in speeds])


@pytest.mark.parametrize(
    ("held", "near"), [(0.0, [0.77, 2.95]), (0.0, [0.33, 3.26]), (0.005, [1.01, 2.93]), (-0.02, [0.07, 4.67])]
)
def test_an_impact_pair_has_the_orbit_of_its_exact_flights(held: float, near: list[float]) -> None:
    orbit = find_orbit(impact_pair(held), near, [0, 1], 1)
    phases, speeds = in_forty_digits(orbit, held)
    assert orbit.is_physical
    assert np.abs(orbit.phases - phases).max() <= EXACT
    assert np.abs(orbit.velocities - speeds).max() <= EXACT
    # the impulses balance the constant force over the period
    impulses = [
        (1.0 + RESTITUTION[k]) * speed * (1 - 2 * k) / (1.0 / FRAME + 1.0 / BALL)
        for k, speed in zip(orbit.contacts, orbit.velocities, strict=True)
    ]
    assert abs(sum(impulses) + held * orbit.body.period) <= 1e-14
