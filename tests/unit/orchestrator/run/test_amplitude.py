"""Frequency and damping that depend on the amplitude, against their differential equation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.run import Session
from vibroimpact.orchestrator.scene import parse_scene

BODY = """
[body]
mass = 2
stiffness = 800
damping_ratio = 0.002
displacement_start = 1
{}
[record]
recorded_time = 1
"""
LAW = "damping_slope = 0.004\nfrequency_slope = -0.02\ndamping_reciprocal = 0.001"
NATURAL = 20.0


def decay(text: str, step: float) -> np.ndarray:
    times = np.arange(0.0, 10.0 + step / 2, step)
    with Session(parse_scene(text, "decay.toml"), ["displacement"]) as session:
        session.begin()
        return session.follow(times)[:: round(0.1 / step), 0]


def test_short_steps_tend_to_the_motion_whose_numbers_change_all_the_time() -> None:
    # reference: the same law in solve_ivp, to 1e-9; a step holds the numbers constant, an error of first order
    def motion(_: float, y: np.ndarray) -> list[float]:
        amplitude = np.hypot(y[0], y[1] / NATURAL)
        ratio = 0.002 + 0.004 * amplitude + 0.001 / amplitude
        frequency = NATURAL * (1.0 - 0.02 * amplitude)
        return [y[1], -(frequency**2) * y[0] - 2.0 * ratio * NATURAL * y[1]]

    exact = solve_ivp(
        motion, (0.0, 10.0), [1.0, 0.0], t_eval=np.linspace(0.0, 10.0, 101), rtol=1e-9, atol=1e-12
    ).y[0]
    errors = [float(np.abs(decay(BODY.format(LAW), step) - exact).max()) for step in (0.01, 0.005, 0.0025)]
    assert errors[0] > 1.7 * errors[1] > 2.8 * errors[2]
    assert errors[2] < 5e-4


def test_the_equivalent_mode_is_dry_and_quadratic_damping() -> None:
    # reference: solve_ivp with friction mu sign(v) and b |v| v; averaging gives the damping ratio of each
    friction, quadratic = 0.001 * np.pi * NATURAL**2 / 2.0, 3.0 * np.pi * 0.004 / 4.0

    def motion(_: float, y: np.ndarray) -> list[float]:
        x, v = y
        losses = friction * np.tanh(v / 1e-3) + quadratic * abs(v) * v
        return [v, -(NATURAL**2) * x - 2.0 * 0.002 * NATURAL * v - losses]

    exact = solve_ivp(
        motion,
        (0.0, 10.0),
        [1.0, 0.0],
        t_eval=np.linspace(0.0, 10.0, 101),
        rtol=1e-7,
        atol=1e-10,
        method="LSODA",
    ).y[0]
    law = "damping_slope = 0.004\ndamping_reciprocal = 0.001"
    assert np.abs(decay(BODY.format(law), 0.005) - exact).max() < 2e-3
    assert np.abs(decay(BODY.format(""), 0.005) - exact).max() > 0.1


def test_a_mode_of_a_beam_follows_the_same_law_as_an_oscillator() -> None:
    beam = (
        '[body]\nkind = "beam"\nboundary = "clamped-clamped"\nlength = 1.0\nmass_per_length = 1.0\nmodes = 1\n'
        f"frequency = {NATURAL / (2 * np.pi)!r}\ndamping_ratio = 0.002\ndisplacement_start = [1.0]\n{LAW}\n"
        "[record]\nrecorded_time = 1\n"
    )
    times = np.arange(0.0, 5.0, 0.005)
    with Session(parse_scene(beam, "beam.toml"), ["modal_displacement[1]"]) as session:
        session.begin()
        modal = session.follow(times)[:, 0]
    with Session(parse_scene(BODY.format(LAW), "decay.toml"), ["displacement"]) as session:
        session.begin()
        np.testing.assert_allclose(modal, session.follow(times)[:, 0], atol=1e-10)


def test_an_amplitude_law_without_a_spring_is_refused_in_one_line() -> None:
    text = BODY.format(LAW).replace("stiffness = 800\ndamping_ratio = 0.002", "stiffness = 0")
    with pytest.raises(ComponentError, match="amplitude: expected a stiffness > 0"):
        decay(text, 0.01)
