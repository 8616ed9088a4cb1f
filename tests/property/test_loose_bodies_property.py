"""Orbits of random oscillators with balls in cavities against a flow by matrix exponentials."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag, expm

from vibroimpact.analysis.orbits import Contact, ImpactingBody, OrbitError, PeriodicOrbit, find_orbit
from vibroimpact.fmus.core.modes import chain_modes

FEW = settings(max_examples=20, derandomize=True, deadline=None)


@st.composite
def cavities(draw: st.DrawFn) -> ImpactingBody:
    """Draw a chain of one or two masses, and a ball in a cavity of its last mass; a force may pull the ball."""
    count = draw(st.integers(1, 2))
    springs, dashpots = [1.0, 0.8][:count], [draw(st.floats(0.02, 0.3)) for _ in range(count)]
    chain = chain_modes([1.0, 0.7][:count], [*springs, 0.0], [*dashpots, 0.0])
    mass = draw(st.floats(0.02, 0.5))
    clearance = [draw(st.floats(0.1, 0.5)) for _ in range(2)]
    restitution = [draw(st.floats(0.2, 0.9)) for _ in range(2)]
    row = np.append(-1.0 / np.sqrt(mass), chain.shapes[-1])
    contacts = tuple(Contact(side * row, 1.0, clearance[k], restitution[k]) for k, side in ((0, 1), (1, -1)))
    held = np.append(draw(st.floats(-0.01, 0.01)) / np.sqrt(mass), np.zeros(count))
    return ImpactingBody(
        np.append(0.0, chain.frequencies),
        np.append(0.0, chain.damping_ratios),
        np.append(0.0, 0.3 * chain.shapes[-1]),
        held,
        draw(st.floats(0.5, 1.8)),
        0.0,
        contacts,
        np.append(0.0, chain.shapes[-1]),
        None if chain.is_classical else block_diag(0.0, chain.coupling),
    )


def after_a_train(orbit: PeriodicOrbit) -> tuple[np.ndarray, np.ndarray]:
    """Return the state after the last impact of a train, and the gaps at its impacts, from the first state."""
    body, modes = orbit.body, orbit.body.frequencies.size
    w, moving = body.angular_frequency, slice(modes, 2 * modes)
    damping = (
        np.diag(2.0 * body.damping_ratios * body.frequencies) if body.coupling is None else body.coupling
    )
    motion = np.zeros((2 * modes + 3, 2 * modes + 3))
    motion[:modes, moving] = np.eye(modes)
    motion[moving, :modes], motion[moving, moving] = -np.diag(body.frequencies**2), -damping
    motion[moving, -3], motion[moving, -1] = body.force, body.held
    motion[-3, -2], motion[-2, -3] = -w, w
    state, gaps = orbit.states[0], []
    ends = np.append(orbit.phases, orbit.phases[0] + 2.0 * np.pi * orbit.periods)
    for i in range(orbit.phases.size):
        contact = body.contacts[orbit.contacts[(i + 1) % orbit.phases.size]]
        begin = np.concatenate([state, [np.cos(ends[i]), np.sin(ends[i]), 1.0]])
        state = (expm(motion * (ends[i + 1] - ends[i]) / w) @ begin)[:-3]
        gaps.append(contact.shape @ state[:modes] - contact.position)
        speed = contact.shape @ state[moving]
        state[moving] -= (1.0 + contact.restitution) * speed * contact.mass * contact.shape
    return state, np.array(gaps)


@FEW
@given(cavities(), st.integers(0, 2**31), st.integers(2, 4))
def test_an_orbit_with_a_ball_is_closed_by_another_flow(body: ImpactingBody, seed: int, impacts: int) -> None:
    draw = np.random.default_rng(seed)
    for _ in range(8):
        contacts = np.append([0, 1], draw.integers(0, 2, impacts - 2))
        try:
            orbit = find_orbit(body, np.sort(draw.uniform(0.0, 6.2, impacts)), contacts.tolist())
        except OrbitError:
            continue
        state, gaps = after_a_train(orbit)
        size = np.abs(orbit.states).max() + body.scale
        assert np.abs(gaps).max() <= 1e-9 * size
        assert np.abs(state - orbit.states[0]).max() <= 1e-9 * size
        return
    assume(False)
