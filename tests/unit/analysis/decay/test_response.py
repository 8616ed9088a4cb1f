"""Frequency response and resonance, from two channels and from a swept campaign."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from vibroimpact.analysis.decay.frequency_response import FrequencyResponse, frequency_response
from vibroimpact.analysis.decay.resonance import (
    Curve,
    curve_of,
    fit_resonance,
    half_power_damping_ratio,
    resolution_remark,
)
from vibroimpact.analysis.decay.swept_response import swept_response
from vibroimpact.analysis.recording import Channel, TimeAxis
from vibroimpact.fmus.errors import DatasetError, EstimationError, UsageError
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import parse_scene

NATURAL, RATIO, MASS = 20.0, 0.03, 2.0
INTERVAL = 0.01
COUNT = 1 << 15


def oscillator(force: np.ndarray) -> np.ndarray:
    """Return the displacement under a force held constant over each interval: exact, by the matrix exponential."""
    system = np.array([[0.0, 1.0, 0.0], [-(NATURAL**2), -2.0 * RATIO * NATURAL, 1.0 / MASS], [0.0, 0.0, 0.0]])
    step = expm(system * INTERVAL)
    state, moved = np.zeros(2), np.empty(len(force))
    for place, held in enumerate(force):
        moved[place] = state[0]
        state = step[:2, :2] @ state + step[:2, 2] * held
    return moved


FORCE = np.random.default_rng(0).normal(size=COUNT)
MOVED = oscillator(FORCE)


def channel(name: str, values: np.ndarray, unit: str, trigger: str = "") -> Channel:
    axis = TimeAxis(np.arange(len(values)) * INTERVAL, INTERVAL, trigger=trigger)
    return Channel(name, values, unit, axis, np.zeros(len(values), np.uint8))


def response(force_noise: float = 0.0, motion_noise: float = 0.0, **options: object) -> FrequencyResponse:
    generator = np.random.default_rng(1)
    force = FORCE + force_noise * generator.normal(size=COUNT)
    moved = MOVED + motion_noise * np.std(MOVED) * generator.normal(size=COUNT)
    return frequency_response(channel("force", force, "N"), channel("tip", moved, "m"), **options)


def test_a_resonance_is_recovered_from_random_forcing() -> None:
    found = response(motion_noise=0.05, segment=8192)
    fit = fit_resonance(curve_of(found))
    for estimate, truth in (
        (fit.natural_angular_frequency, NATURAL),
        (fit.damping_ratio, RATIO),
        (fit.modal_constant, 1.0 / MASS),
    ):
        assert abs(estimate.value - truth) < 4.0 * estimate.standard_error + 0.005 * truth
        assert estimate.standard_error < 0.02 * truth
    assert fit.form == "displacement"
    assert fit.modal_constant.unit == "kg-1"
    assert fit.half_power_damping_ratio == pytest.approx(RATIO, rel=0.15)
    assert resolution_remark(found, fit) == ()


def test_spectra_are_those_of_the_thesis() -> None:
    # Thesis B.1, B.2 written out: segments of M with 50 % overlap, b_j = 1 - |j - M/2| / (M/2).
    size = 1024
    window = 1.0 - np.abs(np.arange(size) - size / 2) / (size / 2)
    starts = range(0, COUNT - size + 1, size // 2)
    force, moved = FORCE - FORCE.mean(), MOVED - MOVED.mean()
    x = np.array([np.fft.rfft(window * force[s : s + size]) for s in starts])
    y = np.array([np.fft.rfft(window * moved[s : s + size]) for s in starts])
    cross, own, other = np.mean(np.conj(x) * y, 0), np.mean(np.abs(x) ** 2, 0), np.mean(np.abs(y) ** 2, 0)
    found = response(segment=size)
    np.testing.assert_allclose(found.h1, (cross / own)[1:], rtol=1e-9)
    np.testing.assert_allclose(found.coherence, (np.abs(cross) ** 2 / (own * other))[1:], rtol=1e-9)
    # The noise bandwidth is 4/3 lines; half overlap of this window has a correlation of 1/16.
    assert found.resolution == pytest.approx(4.0 / 3.0 / (size * INTERVAL), rel=1e-3)
    segments = len(list(starts))
    assert found.averages == pytest.approx(segments / (1.0 + 2.0 / 16.0), rel=0.01)


def test_h1_bears_noise_on_the_response_and_h2_noise_on_the_drive() -> None:
    clean = response(segment=256)
    lines = clean.frequency < 1.5
    noisy_drive = response(force_noise=0.5, segment=256)
    noisy_response = response(motion_noise=0.5, segment=256)

    def share(found: FrequencyResponse, which: str) -> float:
        return float(np.mean(np.abs(getattr(found, which)[lines]) / np.abs(clean.h1[lines])))

    # Noise of a quarter of the power: H1 = H / 1.25.
    assert share(noisy_drive, "h1") == pytest.approx(0.8, rel=0.05)
    assert share(noisy_drive, "h2") == pytest.approx(1.0, rel=0.05)
    assert share(noisy_response, "h1") == pytest.approx(1.0, rel=0.1)
    assert share(noisy_response, "h2") > 1.3


def test_too_short_segments_are_called_too_short() -> None:
    found = response(segment=512)
    fit = fit_resonance(curve_of(found))
    assert "leakage" in resolution_remark(found, fit)[0]


def transmissibility(omega: np.ndarray) -> np.ndarray:
    top = NATURAL**2 + 2j * RATIO * NATURAL * omega
    return top / (top - omega**2)


@pytest.mark.parametrize("known", [True, False], ids=["complex", "magnitude"])
def test_a_noisy_transmissibility_is_recovered_within_its_errors_nineteen_times_in_twenty(
    known: bool,
) -> None:
    omega = np.linspace(15.0, 25.0, 200)
    exact, generator = 1.3 * transmissibility(omega), np.random.default_rng(3)
    noise, inside = 0.05, 0
    for _ in range(60):
        noisy = exact + noise * (generator.normal(size=200) + 1j * generator.normal(size=200))
        values = noisy if known else np.abs(noisy)
        fit = fit_resonance(Curve(omega, values, np.full(200, noise), "transmissibility"))
        low, high = fit.damping_ratio.interval
        inside += low <= RATIO <= high
        assert abs(fit.modal_constant.value - 1.3) < 5.0 * fit.modal_constant.standard_error
    # 57 expected, standard deviation 1.7.
    assert inside >= 52


def test_half_power_points_give_the_damping_ratio_of_a_light_resonance() -> None:
    omega = np.linspace(15.0, 25.0, 4001)
    magnitude = np.abs(transmissibility(omega))
    assert half_power_damping_ratio(omega, magnitude) == pytest.approx(RATIO, rel=0.01)
    assert np.isnan(half_power_damping_ratio(omega[1900:2100], magnitude[1900:2100]))


def test_channels_of_two_triggers_are_fitted_by_magnitude_alone() -> None:
    late = np.concatenate([np.zeros(7), MOVED[:-7]])
    found = frequency_response(
        channel("force", FORCE, "N", "first"), channel("tip", late, "m", "second"), segment=8192
    )
    assert not found.phase_known
    fit = fit_resonance(curve_of(found))
    assert fit.phase is None
    assert fit.damping_ratio.value == pytest.approx(RATIO, rel=0.1)


def test_misuse_is_refused_with_the_reason() -> None:
    with pytest.raises(UsageError, match="bartlett, hann, boxcar"):
        response(window="flat")
    uneven = Channel(
        "tip", MOVED, "m", TimeAxis(np.arange(COUNT) * INTERVAL, None), np.zeros(COUNT, np.uint8)
    )
    with pytest.raises(UsageError, match="even sampling"):
        frequency_response(channel("force", FORCE, "N"), uneven)
    with pytest.raises(UsageError, match="8 lines or more"):
        curve_of(response(), band=(3.0, 3.01))
    for band in ((20.0, 40.0), (5.0, 15.0), (30.0, 45.0)):
        with pytest.raises(EstimationError, match="Choose another band"):
            fit_resonance(curve_of(response(motion_noise=0.1), band=band))


def test_a_simulated_sweep_gives_back_its_oscillator(tmp_path: Path) -> None:
    path = tmp_path / "sweep.nc"
    run_scene(parse_scene(SWEEP, "sweep.toml"), path)
    curve, remarks = swept_response(path, 0.5, "N")
    fit = fit_resonance(curve)
    assert not remarks
    # Reference: the numbers of the scene; the transient has decayed by e^-37.
    assert fit.natural_angular_frequency.value == pytest.approx(NATURAL, rel=1e-9)
    assert fit.damping_ratio.value == pytest.approx(RATIO, rel=1e-8)
    assert fit.modal_constant.value == pytest.approx(1.0 / MASS, rel=1e-8)
    stopped = tmp_path / "stopped.nc"
    stop = '[[stop]]\nlaw = "restitution"\nposition = 0.003\nside = "upper"\nrestitution = 0.7\n[record]'
    run_scene(parse_scene(SWEEP.replace("[record]", stop), "sweep.toml"), stopped)
    outer, remarks = swept_response(stopped, 0.5, "N")
    assert "hit a stop" in remarks[0]
    assert len(outer.angular_frequency) < len(curve.angular_frequency)
    with pytest.raises(DatasetError, match="8 runs or more that touch no stop"):
        swept_response(stopped, 0.5, "N", band=(3.1, 3.3))


SWEEP = """
[scene]
title = "resonance"
units = "SI"
[body]
kind = "oscillator"
mass = 2.0
stiffness = 800.0
damping_ratio = 0.03
[forcing]
amplitude = 0.5
angular_frequency = 20.0
[record]
transient_periods = 200
recorded_periods = 2
extrema = true
impacts = true
[sweep]
"forcing.angular_frequency" = { start = 15.0, stop = 25.0, points = 41 }
"""


def test_lines_that_come_twice_without_a_half_power_point_are_fitted() -> None:
    # a sweep up and down that ends just past the peak: the peak has no width there, and lines have no distance
    omega = np.repeat(np.linspace(0.71, 1.02, 40), 2)
    amplitude = 1.0 / np.abs(1.0 - omega**2 + 0.1j * omega)
    found = fit_resonance(Curve(omega, amplitude, np.zeros(80), "displacement", "1"))
    assert found.natural_angular_frequency.value == pytest.approx(1.0, rel=1e-9)
    assert found.damping_ratio.value == pytest.approx(0.05, rel=1e-9)


def test_lines_at_one_frequency_are_no_resonance() -> None:
    curve = Curve(np.full(10, 0.7), np.ones(10), np.zeros(10), "displacement", "1")
    with pytest.raises(EstimationError, match="expected lines at several frequencies"):
        fit_resonance(curve)
