"""Feedback about an orbit. References: docs/equations.md 4.12, differences of the flow, Ackermann's rule."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.orbits import Contact, ImpactingBody, OrbitError, PeriodicOrbit, find_orbit
from vibroimpact.analysis.orbits.feedback import ImpactMap, gains, impact_map
from vibroimpact.analysis.orbits.search import orbits_of
from vibroimpact.fmus.core.oscillator import Oscillator, flow


def body_of(
    damping: float = 0.04,
    amplitude: float = 0.42,
    angular_frequency: float = 0.88,
    position: float = 0.8,
    restitution: float = 0.75,
    direction: float = 1.0,
    mass: float = 1.0,
    yield_velocity: float = 0.0,
) -> ImpactingBody:
    """Return an oscillator of natural frequency 1."""
    shape = np.array([1.0 / math.sqrt(mass)])
    return ImpactingBody(
        np.array([1.0]),
        np.array([damping]),
        amplitude * shape,
        np.zeros(1),
        angular_frequency,
        0.0,
        (Contact(shape, direction, direction * position, restitution, yield_velocity=yield_velocity),),
        shape,
    )


def orbit_of(body: ImpactingBody, periods: int = 1) -> PeriodicOrbit:
    return max(orbits_of(body, 1, periods, penetrating=True), key=lambda orbit: float(orbit.velocities[0]))


def next_impact(
    body: ImpactingBody, time: float, speed: float, amplitude: float, guess: float
) -> tuple[float, float]:
    """Return (t, V) of the next impact, by the exact flow and Newton's method on its time."""
    contact, w = body.contacts[0], body.angular_frequency
    mass = 1.0 / float(contact.shape[0]) ** 2
    oscillator = Oscillator(mass, 2.0 * float(body.damping_ratios[0]) * mass, mass, amplitude, w)
    at = guess
    for _ in range(30):
        start = contact.position, -contact.direction * float(contact.restitution_at(speed)) * speed
        x, v = flow(oscillator, start, at - time, phase=w * time)
        at -= (x - contact.position) / v
    return at, contact.direction * v


def test_gains_of_the_equation_sheet() -> None:
    orbit = orbit_of(body_of())
    about = impact_map(orbit, 0.42)
    assert orbit.velocities[0] == pytest.approx(0.53499972941, abs=5e-12)
    assert about.multipliers.real == pytest.approx([-1.17746, -0.26984], abs=5e-6)
    assert gains("deadbeat", about) == pytest.approx([0.18357192, -0.23928972], abs=5e-9)


@pytest.mark.parametrize(("periods", "w", "position"), [(1, 0.88, 0.3), (2, 3.2, 0.1)])
@pytest.mark.parametrize(("direction", "mass", "falls"), [(1.0, 1.0, 0.0), (-1.0, 1.2, 0.0), (1.0, 1.2, 0.1)])
def test_derivatives_of_the_impact_map_are_those_of_the_flow(
    direction: float, mass: float, falls: float, periods: int, w: float, position: float
) -> None:
    body = body_of(
        angular_frequency=w, direction=direction, mass=mass, position=position, yield_velocity=falls
    )
    orbit = orbit_of(body, periods)
    about, size = impact_map(orbit, 0.42), 1e-6
    time, speed = float(orbit.phases[0]) / w, float(orbit.velocities[0])
    end = time + periods * body.period

    def after(dt: float, dv: float, df: float) -> np.ndarray:
        return np.array(next_impact(body, time + dt, speed + dv, 0.42 + df, end))

    assert after(0, 0, 0) == pytest.approx([end, speed], rel=1e-12)
    for column, step in enumerate(np.eye(3) * size):
        slope = (after(*step) - after(*-step)) / (2.0 * size)
        expected = about.jacobian[:, column] if column < 2 else about.response
        assert slope == pytest.approx(expected, rel=1e-7, abs=1e-8)


@given(
    damping=st.floats(0.0, 0.3),
    amplitude=st.floats(0.1, 2.0),
    frequency=st.floats(0.5, 4.0),
    position=st.floats(-1.0, 1.0),
    restitution=st.floats(0.1, 0.95),
)
@settings(max_examples=100)
def test_the_impact_map_has_the_multipliers_of_the_orbit_and_gains_take_them_away(
    damping: float, amplitude: float, frequency: float, position: float, restitution: float
) -> None:
    body = body_of(damping, amplitude, frequency, position, restitution)
    try:
        found = orbits_of(body, 1, 1, penetrating=True)
    except OrbitError:
        assume(False)
    for orbit in found:
        assume(orbit.velocities[0] > 1e-2)
        about = impact_map(orbit, amplitude)
        scale = 1.0 + abs(about.multipliers[0])
        assert about.multipliers == pytest.approx(orbit.multipliers, abs=1e-6 * scale)
        decay = math.exp(-2.0 * damping * orbit.body.period)
        assert np.linalg.det(about.jacobian) == pytest.approx(restitution**2 * decay, rel=1e-7 * scale**2)
        for law in ("ogy", "deadbeat"):
            gain = gains(law, about)
            closed = np.linalg.eigvals(about.jacobian - np.outer(about.response, gain))
            trust = 1e-7 * (scale + np.abs(about.response).max() * np.abs(gain).max()) ** 2
            if law == "deadbeat":
                assert np.abs(closed).max() < math.sqrt(trust)
            elif about.multipliers[0].imag == 0.0:
                assert np.sort(np.abs(closed)) == pytest.approx(
                    [0.0, abs(about.multipliers[1])], abs=math.sqrt(trust)
                )


def test_turning_orbits_that_come_back_are_left_alone_and_those_that_leave_are_not() -> None:
    turning = np.array([[0.5, 0.4], [-0.4, 0.5]])
    assert not gains("ogy", ImpactMap(turning, np.array([1.0, 0.3]))).any()
    leaving = ImpactMap(2.0 * turning, np.array([1.0, 0.3]))
    assert gains("ogy", leaving) == pytest.approx(gains("deadbeat", leaving))


@pytest.mark.parametrize("law", ["ogy", "deadbeat"])
def test_an_amplitude_without_effect_is_refused(law: str) -> None:
    with pytest.raises(OrbitError, match="that the amplitude acts on"):
        gains(law, ImpactMap(np.diag([-2.0, 0.3]), np.array([0.0, 1.0 if law == "ogy" else 0.0])))  # type: ignore[arg-type]


def test_orbits_of_several_impacts_or_modes_are_refused() -> None:
    body = body_of()
    two = dataclasses.replace(
        body,
        frequencies=np.array([1.0, 3.0]),
        damping_ratios=np.array([0.04, 0.02]),
        force=np.array([0.42, 0.1]),
        held=np.zeros(2),
        contacts=(Contact(np.array([1.0, 0.5]), 1.0, 0.8, 0.75),),
        observed=np.ones(2),
    )
    orbit = find_orbit(body, orbit_of(body).phases)
    with pytest.raises(OrbitError, match="one impact and one mode, got P"):
        impact_map(dataclasses.replace(orbit, body=two), 0.42)
