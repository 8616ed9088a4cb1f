"""The closed forms and series of the hard cases, against 40 digits."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

from vibroimpact.orchestrator.hard_cases.finding import COUPLING, impacts_by_series
from vibroimpact.orchestrator.hard_cases.flights import (
    bounces,
    first_impact,
    flight,
    gained,
    start_that_ends_at_the_turn,
)


def way(load: mp.mpf, slope: mp.mpf, angle: mp.mpf) -> mp.mpf:
    """Return the displacement that the load a cos(u) + b sin(u) gives a mass at rest."""
    return load * (1 - mp.cos(angle)) + slope * (angle - mp.sin(angle))


@pytest.mark.parametrize("phase", [-1.2, -0.3, 1e-4, 0.7])
@pytest.mark.parametrize("restitution", [0.3, 0.9])
def test_bounces_under_a_turning_load_are_those_of_40_digits(phase: float, restitution: float) -> None:
    speed = 0.05 * phase**2
    found = bounces(phase, speed, restitution)
    with mp.workdps(40):
        at, v, sign = mp.mpf(phase), mp.mpf(speed), math.copysign(1.0, phase)
        for near, fast in zip(found.phases[1:6], found.speeds[1:6], strict=True):
            load, slope, rebound = sign * mp.sin(at), sign * mp.cos(at), restitution * v

            def height(u: mp.mpf, a: mp.mpf = load, b: mp.mpf = slope, back: mp.mpf = rebound) -> mp.mpf:
                return way(a, b, u) / u - back

            u = mp.findroot(height, near - float(at))
            v = load * mp.sin(u) + slope * (1 - mp.cos(u)) - rebound
            at += u
            assert near == pytest.approx(float(at), rel=1e-14)
            assert fast == pytest.approx(float(v), rel=1e-13)


def test_a_load_that_has_turned_lets_the_mass_go() -> None:
    assert flight(-0.1, -1.0, 0.1) is None
    assert flight(0.1, -1.0, 0.1) is None
    assert math.isnan(bounces(-0.1, 0.1, 0.5).rest)


@pytest.mark.parametrize("angle", [1e-9, 0.1, 0.49999, 0.5, 3.0])
def test_what_a_load_gives_keeps_its_digits_at_small_angles(angle: float) -> None:
    with mp.workdps(40):
        expected = float(way(mp.mpf(0), mp.mpf(1), mp.mpf(angle)))
    assert gained(0.0, 1.0, angle)[1] == pytest.approx(expected, rel=3e-15)


@pytest.mark.parametrize("restitution", [0.1, 0.5, 0.95])
def test_the_start_that_ends_at_the_turn_lies_between_rest_and_leaving(restitution: float) -> None:
    rests = []
    for change in (-1e-9, 1e-9):
        place, velocity = start_that_ends_at_the_turn(restitution, change)
        phase, speed = first_impact(place, velocity)
        with mp.workdps(40):
            time = mp.findroot(
                lambda t, x=place, v=velocity: mp.mpf(x) + v * t + 1 - mp.cos(t), phase + 0.5 * math.pi
            )
            assert phase == pytest.approx(float(time - mp.pi / 2), rel=1e-14)
            assert speed == pytest.approx(float(velocity + mp.sin(time)), rel=1e-12)
        rests.append(bounces(phase, speed, restitution).rest)
    assert [math.isnan(rest) for rest in sorted(rests, key=math.isnan)] == [False, True]
    assert -1e-3 < np.nanmax(rests) < 0.0


@pytest.mark.parametrize("offset", [0.0, 1e-8])
def test_the_series_of_a_chain_with_jordan_blocks_is_the_exponential_of_40_digits(offset: float) -> None:
    w, stop, r, damping = 0.9, 0.3, 0.7, 2.0 * COUPLING * (1.0 + offset)
    stiffness = np.array([[1.0 + COUPLING**2, -COUPLING], [-COUPLING, 1.0]])
    found = impacts_by_series(stiffness, damping, w, stop, r)
    with mp.workdps(40):
        matrix = mp.zeros(6)
        matrix[0, 2] = matrix[1, 3] = matrix[3, 4] = 1
        matrix[2, 2], matrix[4, 5], matrix[5, 4] = -damping, -w, w
        for i in range(2):
            for j in range(2):
                matrix[2 + i, j] = -stiffness[i, j]
        state, time = mp.matrix([0, 0, 0, 0, 1, 0]), mp.mpf(0)
        for near, fast in found[:2]:
            step = mp.mpf(float(near)) - time
            for _ in range(3):
                here = mp.expm(matrix * step) * state
                step -= (here[0] - stop) / here[2]
            state, time = mp.expm(matrix * step) * state, time + step
            assert near == pytest.approx(float(time), rel=1e-15)
            assert fast == pytest.approx(float(state[2]), rel=1e-15)
            state[0], state[2] = stop, -r * state[2]
