"""Intervals of a resonance driven by a random force, alone or next to another: the drawn parameters are the truth."""

from __future__ import annotations

import numpy as np
import pytest
from support.driven_modes import Mode, drawn_modes, driven

from vibroimpact.analysis.decay import curve_of, fit_resonance, frequency_response
from vibroimpact.fmus.errors import EstimationError


@pytest.mark.parametrize(("records", "share"), [(9, 0.75), pytest.param(400, 0.92, marks=pytest.mark.long)])
def test_intervals_of_a_resonance_that_is_sure_hold_the_truth(records: int, share: float) -> None:
    held, alone, sure_alone = [], 0, 0
    for case in range(records):
        rng = np.random.default_rng([11, case])
        modes, noise = drawn_modes(case, rng)
        alone += len(modes) == 1
        try:
            fit = fit_resonance(curve_of(frequency_response(*driven(modes, noise, rng))))
        except EstimationError:
            assert len(modes) == 2  # a fit of one resonance to two may leave the band
            continue
        natural = fit.natural_angular_frequency
        mode = min(modes, key=lambda one: abs(2.0 * np.pi * one.frequency - natural.value))
        if fit.doubts:
            continue
        sure_alone += len(modes) == 1
        for found, truth in (
            (natural, 2.0 * np.pi * mode.frequency),
            (fit.damping_ratio, mode.damping_ratio),
        ):
            low, high = found.interval
            held.append(low <= truth <= high)
    assert sure_alone >= 0.95 * alone
    assert share <= np.mean(held) <= (0.98 if records > 100 else 1.0)


def test_two_modes_within_a_hertz_are_not_surely_one() -> None:
    modes = Mode(20.0, 0.01), Mode(20.6, 0.01)
    for segment in (4096, None):
        force, tip = driven(modes, 0.0, np.random.default_rng(3))
        fit = fit_resonance(curve_of(frequency_response(force, tip, segment=segment)))
        assert fit.verdict.startswith("not sure, because the fit leaves")
        assert "another resonance" in fit.verdict


@pytest.mark.parametrize("ratio", [0.002, 0.003, 0.02])
def test_small_damping_is_not_doubled_by_leakage(ratio: float) -> None:
    force, tip = driven((Mode(20.0, ratio),), 0.0, np.random.default_rng(4))
    fit = fit_resonance(curve_of(frequency_response(force, tip)))
    assert fit.verdict == "sure."
    assert abs(fit.damping_ratio.value - ratio) < 4.0 * fit.damping_ratio.standard_error
    assert fit.damping_ratio.value == pytest.approx(ratio, rel=0.25)


def test_segments_are_longer_where_the_peak_has_fewer_than_four_lines() -> None:
    for ratio, resolution in ((0.002, 4.0 / 3.0 * 400.0 / 16384), (0.03, 4.0 / 3.0 * 400.0 / 8192)):
        found = frequency_response(*driven((Mode(20.0, ratio),), 0.0, np.random.default_rng(5), 60_000))
        assert found.resolution == pytest.approx(resolution, rel=1e-3)


def test_leakage_is_that_of_the_drive() -> None:
    """Noise leaks like the correlation of the window; a drive with one period in each segment does not leak at all."""
    rng = np.random.default_rng(6)
    force, tip = driven((Mode(20.0, 0.01),), 0.0, rng, 20_000)
    noise = frequency_response(force, tip, segment=2048, window="boxcar").leakage
    period = np.tile(rng.normal(size=1024), 20)
    from vibroimpact.analysis.decay.leakage import leakage_of

    periodic = leakage_of(period, np.ones(1024), 1.0 / 400.0, 1e-3)
    delays = np.arange(5) * 2048.0 / 400.0 / 16.0
    rho = noise.weights @ np.cos(noise.spacing * np.outer(np.arange(17), delays))
    # for a boxcar: 1 - t / T
    assert rho == pytest.approx(1.0 - np.arange(5) / 16.0, abs=0.03)
    # there is no force before the record: the first of 39 segments counts in part
    assert periodic.weights[0] == pytest.approx(1.0, abs=0.05)
