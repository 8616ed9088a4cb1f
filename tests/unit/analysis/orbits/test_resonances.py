"""Shifted natural frequencies against worked examples and a simulated elastic orbit; peaks of known curves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import vibroimpact as vi
from vibroimpact.analysis.orbits.resonances import frequency_shift, peaks_of, stop_ratio
from vibroimpact.fmus.errors import UsageError


def test_the_shift_is_that_of_the_worked_example_in_both_directions() -> None:
    # equations.md 1.7
    assert frequency_shift(0.25) == pytest.approx(1.72285878782861, abs=1e-14)
    assert stop_ratio(1.72285878782861) == pytest.approx(0.25, abs=1e-14)


@given(st.floats(-0.99, 1.0))
def test_both_directions_undo_each_other(ratio: float) -> None:
    assert stop_ratio(frequency_shift(ratio)) == pytest.approx(ratio, abs=1e-12)


def test_a_touch_that_rounding_puts_beyond_the_stop_has_no_shift() -> None:
    assert frequency_shift(np.nextafter(1.0, 2.0)) == 1.0
    assert stop_ratio(np.nextafter(1.0, 0.0)) == 1.0


@pytest.mark.parametrize("ratio", [-1.0, 1.1, np.nan, np.inf])
def test_a_ratio_that_no_motion_has_is_refused(ratio: float) -> None:
    with pytest.raises(UsageError, match="stop_ratio: expected -1 < ratio <= 1, got"):
        frequency_shift([0.5, ratio])


@pytest.mark.parametrize("shift", [0.9, 0.0, -2.0, np.nan, np.inf])
def test_a_shift_below_one_is_refused(shift: float) -> None:
    with pytest.raises(UsageError, match="shift: expected 1 or more, got"):
        stop_ratio(shift)


@pytest.mark.parametrize("position", [0.5, 0.0, -0.4])
def test_an_elastic_oscillator_that_is_let_go_impacts_at_the_shifted_frequency(position: float) -> None:
    body = {"mass": 1.0, "stiffness": 4.0, "displacement_start": -1.0}
    stop = {"position": position, "restitution": 1.0}
    found = vi.run({"body": body, "stop": [stop], "record": {"recorded_time": 20.0}})
    between = np.diff(found.vibroimpact.impacts().impact_time.values)
    np.testing.assert_allclose(2.0 * np.pi / between, 2.0 * frequency_shift(position), rtol=1e-12)


def test_peaks_are_found_between_the_points_of_a_sweep_and_low_ones_left_out() -> None:
    rate = np.linspace(0.0, 4.0, 161)
    curve = np.exp(-(((rate - 1.012) / 0.3) ** 2)) + 0.5 * np.exp(-(((rate - 2.986) / 0.3) ** 2))
    high, low = peaks_of(rate, curve + 0.01 * np.sin(40.0 * rate))
    assert (high.frequency, low.frequency) == pytest.approx((1.012, 2.986), abs=0.025)
    assert high.height == pytest.approx(1.0, abs=0.02)
    assert high.step == pytest.approx(0.025)


def test_the_end_of_what_is_known_is_no_peak() -> None:
    rate = np.arange(20.0)
    rising = np.where(rate < 12, rate, np.nan)
    assert peaks_of(rate, rising) == []
    assert peaks_of(rate, np.full(20, np.nan)) == []
    assert peaks_of(rate, np.ones(20)) == []
