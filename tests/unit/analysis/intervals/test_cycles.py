import math

import numpy as np
import pytest
from numpy.typing import NDArray

from vibroimpact.analysis.intervals import interval_report, interval_train
from vibroimpact.analysis.intervals.cycles import read_cycle
from vibroimpact.analysis.intervals.density import interval_density
from vibroimpact.fmus.core import Oscillator, next_contact

Floats = NDArray[np.float64]


def impact_times(forcing: float, damping_ratio: float, r: float, stop: float, frequency: float) -> Floats:
    """Return 600 impacts of the impact oscillator (thesis 2.1) after 200 of transient, on its exact flow."""
    body = Oscillator(1.0, 2.0 * damping_ratio, 1.0, forcing, frequency)
    state, phase, now, times = (0.0, 0.0), 0.0, 0.0, []
    for _ in range(800):
        contact = next_contact(body, state, stop, 1e4, phase=phase)
        assert contact is not None
        now += contact.time
        phase = math.fmod(phase + frequency * contact.time, 2.0 * math.pi)
        state = (stop, -r * contact.velocity)
        times.append(now)
    return np.array(times[200:])


def test_the_p_2_2_motion_of_thesis_figure_5_16a_is_read_from_its_two_peaks() -> None:
    frequency = 0.838687
    report = interval_report(
        impact_times(0.5, 0.05, 0.7, 1.0, frequency), forcing_period=2.0 * math.pi / frequency
    )
    assert (int(report["cycle_impacts"]), int(report["cycle_periods"])) == (2, 2)
    assert report.sizes["peak"] == 2
    assert float(report["cycle_duration"]) == pytest.approx(4.0 * math.pi / frequency, rel=1e-9)
    assert "periodic" in report.attrs["dimension_raw"]
    assert np.array_equal(report["slope_raw"], np.zeros(6))


def test_the_chaotic_motion_of_thesis_figure_5_15_is_no_p_p_q() -> None:
    report = interval_report(impact_times(1.0, 0.0, 0.8, 0.0, 2.8), forcing_period=2.0 * math.pi / 2.8)
    assert int(report["cycle_impacts"]) == 0
    assert "low-dimensional" in report.attrs["dimension_raw"]
    # the impact map is two-dimensional
    assert 0.7 < float(report["slope_raw"][-1]) < 2.0


@pytest.mark.parametrize("jitter", [0.0, 1e-3, 1e-2])
@pytest.mark.parametrize("intervals", [(1.0,), (0.4, 1.6), (0.5, 0.7, 1.8), (0.5, 0.5, 0.6, 2.4)])
def test_a_cycle_is_found_through_jitter(intervals: tuple[float, ...], jitter: float) -> None:
    rng = np.random.default_rng(1)
    times = np.cumsum(np.tile(intervals, 80)) + jitter * rng.normal(size=80 * len(intervals))
    train = interval_train(times)
    cycle = read_cycle(train, 1.0)
    assert (cycle.impacts, cycle.periods) == (len(intervals), round(sum(intervals)))
    assert len(interval_density(train.intervals).peaks) == len(set(intervals))


def test_equal_intervals_hide_p_and_the_verdict_says_so() -> None:
    # P(2,4) with equal intervals of two periods each cannot be distinguished from P(1,2)
    train = interval_train(np.arange(0.0, 100.0, 2.0))
    cycle = read_cycle(train, 1.0)
    assert cycle.words.startswith("P(1,2)")
    assert "equal intervals hide p" in cycle.words


def test_without_the_forcing_period_q_is_not_known() -> None:
    train = interval_train(np.cumsum(np.tile([0.4, 1.6], 30)))
    cycle = read_cycle(train, None)
    assert (cycle.impacts, cycle.periods) == (2, 0)
    assert "q needs the forcing period" in cycle.words


def test_a_cycle_that_is_no_whole_number_of_forcing_periods_is_called_so() -> None:
    train = interval_train(np.cumsum(np.tile([0.4, 1.1], 30)))
    cycle = read_cycle(train, 1.0)
    assert cycle.periods == 0
    assert "1.500 forcing periods, not a whole number" in cycle.words


def test_noise_is_no_motion_however_few_its_intervals() -> None:
    rng = np.random.default_rng(3)
    for number in (20, 60, 400):
        train = interval_train(np.cumsum(rng.gamma(4.0, 0.25, number)))
        assert read_cycle(train, 1.0).impacts == 0


def test_the_density_is_one_in_all_and_states_its_widths() -> None:
    intervals = np.random.default_rng(4).exponential(size=3000)
    density = interval_density(intervals)
    assert np.sum(density.histogram) * density.bin_width == pytest.approx(1.0)
    assert np.trapezoid(density.kernel, density.at) == pytest.approx(1.0, abs=0.01)
    assert density.bandwidth > 0.0


def test_bins_of_intervals_on_a_grid_are_whole_steps_of_it() -> None:
    intervals = 0.02 * np.random.default_rng(5).integers(10, 30, 500)
    density = interval_density(intervals, resolution=0.02)
    assert density.bandwidth >= 0.02
    assert density.bin_width / 0.02 == pytest.approx(round(density.bin_width / 0.02))


def test_a_single_hump_has_one_peak_and_two_bands_have_two() -> None:
    rng = np.random.default_rng(6)
    assert len(interval_density(rng.normal(1.0, 0.05, 2000)).peaks) == 1
    bands = np.concatenate([rng.normal(1.0, 0.02, 700), rng.normal(1.4, 0.02, 300)])
    assert interval_density(bands).peaks == pytest.approx([1.0, 1.4], abs=0.02)
