"""A channel counts as quiet if it shows noise alone, and only then."""

from __future__ import annotations

import numpy as np
import pytest

from vibroimpact.hardware.rig.quiet import noise_of, quiet_remark

STEP = 10.0 / 2**15
TIME = np.arange(20_000) / 5000.0


def noise(volts: float, seed: int = 0) -> np.ndarray:
    return volts * np.random.default_rng(seed).standard_normal(len(TIME))


def rounded(volts: np.ndarray) -> np.ndarray:
    return STEP * np.rint(volts / STEP)


@pytest.mark.parametrize("volts", [0.0, 0.3 * STEP, 2.0 * STEP, 0.01])
def test_noise_about_any_level_is_noise(volts: float) -> None:
    for seed in range(20):
        found = noise_of(rounded(1.3 + noise(volts, seed)), STEP)
        assert found is not None
        assert found == pytest.approx(volts, rel=0.1, abs=STEP)


@pytest.mark.parametrize(
    "signal",
    [
        pytest.param(0.002 * np.sin(2.0 * np.pi * 5.0 * TIME), id="a sine of twice the noise"),
        pytest.param(0.002 * TIME, id="a drift"),
        pytest.param(np.where((TIME % 1.0) < 1e-3, 0.1, 0.0), id="a pulse each second"),
        pytest.param(np.where(TIME > 2.0, 0.01, 0.0), id="a step"),
    ],
)
def test_a_signal_in_noise_is_no_noise(signal: np.ndarray) -> None:
    assert noise_of(rounded(signal + noise(0.001)), STEP) is None


def test_missing_samples_and_short_channels_are_left_out() -> None:
    volts = noise(0.01)
    volts[::7] = np.nan
    assert noise_of(volts, STEP) == pytest.approx(0.01, rel=0.05)
    assert noise_of(np.full(100, np.nan), STEP) is None
    assert noise_of(volts[:19], STEP) is None


def test_a_loopback_is_told_from_a_sensor() -> None:
    assert quiet_remark("back", np.full(100, 2.0), STEP, True).startswith(
        "back: the loopback shows no drive (2 V,"
    )
    assert (
        quiet_remark("tip", np.zeros(100), STEP, False) == "tip: nothing is above its noise (0 V, noise 0 V)"
    )
    assert quiet_remark("tip", np.sin(TIME), STEP, False) == ""
