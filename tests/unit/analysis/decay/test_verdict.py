"""The first line of a free decay: the sure estimates, and motion that no damping law explains."""

from __future__ import annotations

import numpy as np
import pytest
from support.decay_motion import Damped

from vibroimpact.analysis.decay import DecaySamples, FreeDecay, damping_law, estimate_decay

TIME = np.arange(0.0, 40.0, 0.02)
OMEGA = 4.0 * np.pi
LAWS = [damping_law(name) for name in ("viscous", "viscous+coulomb", "viscous+quadratic")]
MODE = 3.0 * np.exp(-0.05 * TIME) * np.cos(OMEGA * TIME)


def estimated(motion: np.ndarray, noise: float = 0.02) -> FreeDecay:
    return estimate_decay(
        DecaySamples(TIME, motion + noise * np.random.default_rng(1).normal(size=len(TIME))), LAWS
    )


@pytest.mark.parametrize(
    ("frequency", "other"),
    [
        (2.08, 1.5 * np.exp(-0.05 * TIME) * np.cos(1.04 * OMEGA * TIME + 1.0)),
        (6.6, 0.5 * np.exp(-0.2 * TIME) * np.cos(3.3 * OMEGA * TIME)),
        (2.3, 0.06 * np.sin(2.3 * 2.0 * np.pi * TIME)),
        (17.3, 0.06 * np.sin(17.3 * 2.0 * np.pi * TIME)),
    ],
    ids=["beat", "second mode", "slow hum", "fast hum"],
)
def test_a_beat_or_a_hum_is_named_and_no_damping_law_explains_it(frequency: float, other: np.ndarray) -> None:
    found = estimated(MODE + other)
    assert found.verdict.startswith(
        f"not sure, because a second oscillation of {frequency:g} Hz is in the window"
    )
    assert "law" not in found.estimates()
    assert not any("lowest AIC" in line for line in found.words())
    dataset = found.dataset()
    assert (dataset.attrs["verdict"], dataset.attrs["best_law"]) == (found.verdict, "")


@pytest.mark.parametrize(
    ("truth", "sure"),
    [
        (
            Damped(omega=OMEGA, viscous=0.05),
            "sure of logarithmic decrement, decaying cosine, best damping law.",
        ),
        (Damped(omega=OMEGA, viscous=0.02, coulomb=1.0), "sure of best damping law; not sure of logarithmic"),
        (
            Damped(omega=OMEGA, viscous=0.02, quadratic=0.03),
            "sure of best damping law; not sure of logarithmic",
        ),
    ],
    ids=["viscous", "coulomb", "quadratic"],
)
def test_a_decay_that_a_law_explains_is_sure_of_it(truth: Damped, sure: str) -> None:
    found = estimated(truth.motion(3.0, TIME))
    assert found.second is None
    assert found.verdict.startswith(sure)


def test_a_frequency_that_changes_with_the_amplitude_is_no_second_oscillation() -> None:
    found = estimated(Damped(omega=OMEGA, viscous=0.05, cubic=-0.02).motion(3.0, TIME))
    assert found.second is None
    assert found.verdict.startswith("not sure, because ")
