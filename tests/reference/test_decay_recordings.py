"""Free decays recorded in laboratories, against published results or earlier checks by hand."""

from __future__ import annotations

import numpy as np
import pytest
from support.real_data import recording_folder

from vibroimpact.analysis.decay.backbone import backbone
from vibroimpact.analysis.decay.decrement import logarithmic_decrement
from vibroimpact.analysis.decay.exponential import fit_exponential
from vibroimpact.analysis.decay.law_fit import choose_law
from vibroimpact.analysis.decay.samples import DecaySamples, decay_samples
from vibroimpact.analysis.recording import Channel, Quality, TimeAxis


def pendulum(start: float | None = None, stop: float | None = None) -> DecaySamples:
    time, place = np.loadtxt(recording_folder("damped_pendulum") / "pendolo_smorzato.txt", unpack=True)
    flags = np.zeros(len(time), np.uint8)
    return decay_samples(Channel("pos", place, "1", TimeAxis(time, None), flags), start, stop)


def board(trial: str, start: float) -> DecaySamples:
    time, shock = np.loadtxt(recording_folder("pcb_repeated_shock") / f"acc_pcb_{trial}.txt", unpack=True)
    clipped = np.where(np.abs(shock) > 546.0, np.uint8(Quality.clipped), np.uint8(0)).astype(np.uint8)
    return decay_samples(Channel("board", shock, "9.80665 m s-2", TimeAxis(time, 2e-5), clipped), start)


def test_the_published_fit_of_the_pendulum_is_found_again() -> None:
    # Published for 40 to 80 s: amplitude 57.78 au, omega 4.43478 rad/s, lambda .02469 1/s, offset 438.66 au.
    samples = pendulum(40.0, 80.0)
    fit = fit_exponential(samples)
    assert fit.amplitude.value == pytest.approx(57.8, abs=0.1)
    assert fit.angular_frequency.value == pytest.approx(4.4348, abs=0.0002)
    assert fit.decay_rate.value == pytest.approx(0.0247, abs=0.0001)
    assert fit.offset.value == pytest.approx(438.7, abs=0.1)
    # The published amplitude belongs to the first sample of the window, at 40.023 s, not to t = 0 or 40.
    at_first_sample = fit.amplitude.value * np.exp(-fit.decay_rate.value * (samples.time[0] - 40.0))
    assert at_first_sample == pytest.approx(57.78, abs=0.005)
    # The residual is coloured: the errors are well above those of white noise (.000060 rad/s), and the fit says so.
    assert fit.angular_frequency.standard_error > 2.0 * 0.00006
    assert not fit.test.adequate


def test_the_decrement_of_the_pendulum_agrees_with_its_exponential() -> None:
    samples = pendulum(40.0, 80.0)
    found, fit = logarithmic_decrement(samples), fit_exponential(samples)
    errors = np.hypot(found.damping_ratio.standard_error, fit.damping_ratio.standard_error)
    assert abs(found.damping_ratio.value - fit.damping_ratio.value) < 2.0 * errors
    assert found.peaks.equilibrium == pytest.approx(438.66, abs=0.05)
    assert found.bent


def test_no_damping_law_fits_the_whole_pendulum_and_the_sum_of_all_three_is_the_least_wrong() -> None:
    choice = choose_law(pendulum())
    assert choice.best.law.terms == ("viscous", "coulomb", "quadratic")
    assert choice.best.physical
    assert choice.best.settled
    assert choice.fits[1].aic - choice.best.aic > 100.0
    assert not any(fit.test.adequate for fit in choice.fits)
    words = " ".join(choice.words())
    assert "viscous + Coulomb + quadratic has the lowest AIC" in words
    assert "none of the laws is adequate" in words
    assert "AIC assumes white residuals" in words
    # A residual that lasts for many periods, sampled 28 times in each, is worth a hundredth of its samples.
    assert choice.effective_samples < 0.05 * len(choice.best.fitted)


@pytest.mark.parametrize("trial", ["a0", "a1"])
def test_the_circuit_board_is_slower_at_large_amplitudes(trial: str) -> None:
    # Earlier check by hand: 800 Hz at 350 g, 807 Hz below 26 g, damping ratio about .010.
    samples = board(trial, 0.012)
    found = backbone(samples)
    hertz = found.angular_frequency / (2.0 * np.pi)
    large, small = found.amplitude > 250.0, (found.amplitude < 26.0) & (found.amplitude > 8.0)
    assert np.all(np.abs(hertz[large] - 801.0) < 1.5)
    assert np.all(np.abs(hertz[small] - 807.0) < 1.0)
    assert np.median(found.damping_ratio) == pytest.approx(0.0095, abs=0.001)
    assert "the frequency rises by" in found.words(samples.unit)
