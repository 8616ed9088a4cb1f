"""The decaying cosine, its errors under coloured noise, the decrement and the backbone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from support.decay_motion import Damped

from vibroimpact.analysis.decay.backbone import backbone
from vibroimpact.analysis.decay.decrement import logarithmic_decrement
from vibroimpact.analysis.decay.exponential import fit_exponential
from vibroimpact.analysis.decay.residuals import effective_samples, residual_test
from vibroimpact.analysis.decay.samples import DecaySamples, decay_samples
from vibroimpact.analysis.recording import Channel, Quality, TimeAxis
from vibroimpact.fmus.errors import EstimationError, UsageError

OMEGA, RATE = 5.0, 0.06
TIME = np.arange(0.0, 40.0, 0.05)


def decaying(
    time: np.ndarray, omega: float = OMEGA, rate: float = RATE, amplitude: float = 3.0
) -> np.ndarray:
    return 1.5 + amplitude * np.exp(-rate * time) * np.cos(omega * time + 0.7)


def channel(values: np.ndarray, quality: np.ndarray | None = None) -> Channel:
    flags = np.zeros(len(values), np.uint8) if quality is None else quality
    return Channel("arm", values, "m", TimeAxis(TIME, None), flags)


def test_a_clean_decay_is_recovered_to_rounding_from_uneven_times() -> None:
    time = np.sort(TIME + np.random.default_rng(2).uniform(-0.02, 0.02, len(TIME)))
    fit = fit_exponential(DecaySamples(time, decaying(time)))
    found = [
        fit.angular_frequency.value,
        fit.decay_rate.value,
        fit.amplitude.value,
        fit.offset.value,
        fit.phase.value,
    ]
    np.testing.assert_allclose(found, [OMEGA, RATE, 3.0, 1.5, 0.7], rtol=1e-9)
    assert fit.damping_ratio.value == pytest.approx(RATE / np.hypot(OMEGA, RATE), rel=1e-9)


def test_the_amplitude_is_that_of_the_reference_time() -> None:
    values = decaying(TIME)
    early = fit_exponential(decay_samples(channel(values), 0.0, 40.0))
    late = fit_exponential(decay_samples(channel(values), 10.0, 40.0))
    assert late.amplitude.value == pytest.approx(early.amplitude.value * np.exp(-RATE * 10.0), rel=1e-9)
    assert late.reference_time == 10.0


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_standard_errors_are_the_spread_of_repeated_fits_whether_noise_is_white_or_not(memory: float) -> None:
    # Autoregressive noise of unit variance; at memory .9 its spectrum at the oscillation is 3.4 times that of white
    # noise.
    draws, values, errors = 50, [], []
    generator = np.random.default_rng(11)
    for _ in range(draws):
        noise = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], generator.normal(size=len(TIME) + 200))[
            200:
        ]
        fit = fit_exponential(DecaySamples(TIME, decaying(TIME) + 0.1 * noise))
        values.append([fit.angular_frequency.value, fit.decay_rate.value, fit.amplitude.value])
        errors.append(
            [
                fit.angular_frequency.standard_error,
                fit.decay_rate.standard_error,
                fit.amplitude.standard_error,
            ]
        )
    ratio = np.std(values, axis=0, ddof=1) / np.sqrt(np.mean(np.square(errors), axis=0))
    # A spread of 50 draws is known to 10 %; the white formula would give 1.8 for the coloured noise.
    assert np.all((ratio > 0.7) & (ratio < 1.3)), ratio


def test_effective_samples_of_autoregressive_noise_follow_its_spectrum() -> None:
    # Spectrum at phase w over its mean: (1 - a^2) / (1 - 2 a cos w + a^2).
    memory, turn = 0.9, 0.3
    noise = lfilter([1.0], [1.0, -memory], np.random.default_rng(0).normal(size=60_000))
    expected = len(noise) * (1 - 2 * memory * np.cos(turn) + memory**2) / (1 - memory**2)
    assert effective_samples(noise, turn) == pytest.approx(expected, rel=0.2)


def test_white_noise_passes_for_noise_and_a_hidden_tone_does_not() -> None:
    generator = np.random.default_rng(4)
    alarms = sum(not residual_test(generator.normal(size=600), 10.0, 0.2).adequate for _ in range(300))
    # Significance .01: 3 of 300 are expected; more than 8 have the probability .004.
    assert alarms <= 8
    tone = generator.normal(size=600) + 0.5 * np.sin(0.2 * np.arange(600))
    verdict = residual_test(tone, 10.0, 0.2)
    assert not verdict.adequate
    assert verdict.structure == pytest.approx(0.5 / np.sqrt(2.0), rel=0.3)


@pytest.mark.parametrize("offset", [0.0, 400.0])
def test_the_decrement_is_that_of_the_damping_ratio_wherever_the_equilibrium_is(offset: float) -> None:
    # damping ratio .03: decrement 2 pi .03 / sqrt(1 - .03^2) = .188580439516
    ratio = 0.03
    omega = OMEGA * np.sqrt(1.0 - ratio**2)
    found = logarithmic_decrement(DecaySamples(TIME, offset + decaying(TIME, omega, ratio * OMEGA)))
    assert found.decrement.value == pytest.approx(0.188580439516, rel=2e-4)
    assert found.damping_ratio.value == pytest.approx(ratio, rel=2e-4)
    assert found.angular_frequency.value == pytest.approx(omega, rel=1e-5)
    assert not found.bent


def test_intervals_of_the_decrement_hold_the_truth() -> None:
    generator = np.random.default_rng(8)
    truth, draws = 2.0 * np.pi * RATE / OMEGA, 60
    inside = 0
    for _ in range(draws):
        low, high = logarithmic_decrement(
            DecaySamples(TIME, decaying(TIME) + 0.1 * generator.normal(size=len(TIME)))
        ).decrement.interval
        inside += low <= truth <= high
    # 57 expected, standard deviation 1.7.
    assert inside >= 52, inside


def test_dry_friction_bends_the_logarithm_of_the_peaks_down() -> None:
    motion = Damped(omega=OMEGA, coulomb=0.5).motion(3.0, TIME[:400])
    noise = 0.005 * np.random.default_rng(1).normal(size=400)
    found = logarithmic_decrement(DecaySamples(TIME[:400], motion + noise))
    assert found.bent
    # 2 c / (omega^2 A) per swing: the decrement grows as the amplitude falls.
    assert found.last > 1.5 * found.first


def test_a_hardening_spring_gives_its_backbone() -> None:
    # Perturbation of second order: omega = omega0 (1 + 3/8 mu A^2 - 21/256 (mu A^2)^2).
    known = Damped(omega=OMEGA, viscous=0.05, cubic=0.01)
    found = backbone(DecaySamples(TIME, known.motion(3.0, TIME)))
    bend = known.cubic * found.amplitude**2
    expected = OMEGA * (1.0 + 0.375 * bend - 21.0 / 256.0 * bend**2)
    np.testing.assert_allclose(found.angular_frequency, expected, rtol=1e-3)
    np.testing.assert_allclose(found.damping_ratio, 0.05 / expected, rtol=0.03)
    assert "falls" in found.words("m")
    linear = backbone(
        DecaySamples(TIME, decaying(TIME) + 0.02 * np.random.default_rng(1).normal(size=len(TIME)))
    )
    assert "does not change" in linear.words("m")


def test_clipped_samples_are_left_out_and_said() -> None:
    values = decaying(TIME)
    clipped = values > 3.0
    quality = np.where(clipped, np.uint8(Quality.clipped), np.uint8(0)).astype(np.uint8)
    samples = decay_samples(channel(np.minimum(values, 3.0), quality), 0.0)
    assert f"{np.count_nonzero(clipped)} clipped or missing samples" in samples.remarks[0]
    assert fit_exponential(samples).decay_rate.value == pytest.approx(RATE, rel=1e-9)


def test_a_doubtful_clock_is_said_to_shift_every_frequency() -> None:
    doubtful = Channel("arm", decaying(TIME), "m", TimeAxis(TIME, 0.05, 0.033), np.zeros(len(TIME), np.uint8))
    assert "uncertain by 3.3 %" in decay_samples(doubtful).remarks[0]
    assert not decay_samples(channel(decaying(TIME))).remarks


def test_the_decay_begins_at_the_largest_excursion_where_nobody_says() -> None:
    values = decaying(TIME)
    values[TIME < 12.0] = 1.5
    samples = decay_samples(channel(values))
    assert 12.0 <= samples.reference_time < 12.0 + 2.0 * np.pi / OMEGA
    assert "largest excursion" in samples.remarks[0]
    assert not decay_samples(channel(decaying(TIME))).remarks


def test_what_is_no_decay_is_refused_with_the_reason() -> None:
    with pytest.raises(UsageError, match=r"from 50 to 60 s, got 0; the channel runs from 0 to"):
        decay_samples(channel(decaying(TIME)), 50.0, 60.0)
    with pytest.raises(EstimationError, match="got a constant"):
        fit_exponential(decay_samples(channel(np.full(len(TIME), 2.0)), 0.0))
    with pytest.raises(EstimationError, match="2 periods"):
        fit_exponential(decay_samples(channel(decaying(TIME)), 0.0, 1.5))
    # Each turning point is a third of the one before: the fourth is below the noise of .3.
    noise = 0.3 * np.random.default_rng(0).normal(size=80)
    few = DecaySamples(TIME[:80], decaying(TIME[:80], rate=1.8) + noise)
    with pytest.raises(EstimationError, match="4 peaks or more above the noise"):
        logarithmic_decrement(few)
