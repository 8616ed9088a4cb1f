"""The output rate changes a motion by no more than rounding."""

import itertools
import math

import numpy as np
import pytest
from support.structure import Modes, Structure
from support.tolerance import ROUNDING

from vibroimpact.orchestrator.run import Session
from vibroimpact.orchestrator.scene import parse_scene

PERIODS = 512
RATES = (1, 10, 97)
FREE = """
[body]
mass = 1.0
stiffness = 1.0
displacement_start = 1.0
velocity_start = 0.3
{stop}
[record]
recorded_time = 1.0
"""
STOP = "[[stop]]\nposition = 1.5\nrestitution = 0.7\n"


def sampled(text: str, rate: int) -> tuple[float, float]:
    """Return displacement and velocity after PERIODS periods of 2 pi, with `rate` outputs in each."""
    with Session(parse_scene(text, "free.toml")) as session:
        session.begin()
        for period, part in itertools.product(range(PERIODS), range(1, rate + 1)):
            session._driver.advance(2.0 * math.pi * (period + part / rate))
        return session.observed()


@pytest.mark.parametrize("stop", ["", STOP])
def test_an_undamped_free_motion_keeps_its_energy_at_any_output_rate(stop: str) -> None:
    ends = [sampled(FREE.format(stop=stop), rate) for rate in RATES]
    for x, v in ends:
        assert abs(x * x + v * v - 1.09) <= 4.0 * ROUNDING
    np.testing.assert_allclose(ends, [ends[0]] * len(ends), atol=4.0 * ROUNDING)


@pytest.mark.parametrize("steps", [pytest.param(100_000, marks=pytest.mark.long), 10_000])
def test_the_modes_of_a_structure_keep_their_energies_over_many_steps(steps: int) -> None:
    with Structure(Modes([1.0, 2.37, 3.74], 0.0), [], [1.0, 1.0, 1.0], [0.3, 0.3, 0.3]) as body:
        before = body.energy
        for _ in range(steps):
            body.advance(0.1)
        assert abs(body.energy / before - 1.0) <= 4.0 * ROUNDING


def test_an_input_that_changes_is_a_motion_of_its_own() -> None:
    with Session(parse_scene(FREE.format(stop=""), "free.toml")) as session:
        session.begin()
        session.advance(1.0)
        session.advance(1.0, {"force": (0.5, 0.0)})
        session.advance(1.0)
        x, v = session.observed()
    a, b = 1.0 * math.cos(1.0) + 0.3 * math.sin(1.0), 0.3 * math.cos(1.0) - math.sin(1.0)
    a, b = a - 0.5, b
    exact = 0.5 + a * math.cos(2.0) + b * math.sin(2.0), b * math.cos(2.0) - a * math.sin(2.0)
    np.testing.assert_allclose((x, v), exact, atol=8.0 * ROUNDING)
