"""A sine is exact after days, and the same for any division into blocks."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.rig.limits import Limits
from vibroimpact.hardware.rig.waveforms import Sine


@given(
    frequency=st.floats(1e-3, 4e4),
    rate=st.floats(1e3, 1e6),
    first=st.integers(0, 10**12) | st.just(10**12),
)
def test_a_sine_is_exact_at_sample_1e12(frequency: float, rate: float, first: int) -> None:
    if not frequency < 0.5 * rate:
        return
    volts = Sine(frequency, 1.0, rate, 0.0).volts(first, 5000)
    with mpmath.workdps(60):
        for place in (0, 1, 4999):
            turns = mpmath.mpf(frequency) * (first + place) / mpmath.mpf(rate)
            assert abs(volts[place] - mpmath.sin(2 * mpmath.pi * (turns - mpmath.floor(turns)))) < 2e-15


def test_blocks_of_any_length_give_the_same_samples() -> None:
    sine = Sine(7.3, 1.0, 10_000.0, 0.5, samples=40_000)
    whole = sine.volts(0, 40_000)
    pieces = np.concatenate([sine.volts(first, 250) for first in range(0, 40_000, 250)])
    np.testing.assert_array_equal(pieces, whole)
    assert whole[0] == 0.0
    assert whole[-1] == 0.0


@given(
    frequency=st.floats(0.1, 2000.0),
    amplitude=st.floats(0.0, 10.0),
    ramp=st.floats(0.0, 1.0),
)
def test_the_bound_of_its_slew_holds(frequency: float, amplitude: float, ramp: float) -> None:
    rate = 10_000.0
    sine = Sine(frequency, amplitude, rate, ramp, samples=2 * math.ceil(ramp * rate) + 1000)
    assert sine.samples is not None
    steps = np.abs(np.diff(sine.volts(0, sine.samples))) * rate
    assert steps.max() <= sine.steepest * (1.0 + 1e-9) + 1e-12


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"frequency": np.nan}, "--frequency: expected a number > 0"),
        ({"frequency": 5000.0}, "below half of the rate"),
        ({"amplitude": -1.0}, "--amplitude: expected a number >= 0"),
        ({"amplitude": np.nan}, "--amplitude: expected a number >= 0"),
        ({"ramp": np.inf}, "--ramp: expected a number >= 0"),
        ({"rate": 0.0}, "--rate: expected a number > 0"),
        ({"samples": 100}, "--duration: expected more than twice the ramp"),
    ],
)
def test_what_is_no_sine_is_refused(changed: dict[str, float], said: str) -> None:
    good = {"frequency": 5.0, "amplitude": 1.0, "rate": 10_000.0, "ramp": 0.1}
    with pytest.raises(UsageError, match=said):
        Sine(**{**good, **changed})  # type: ignore[arg-type]


def test_a_sine_beyond_the_limits_is_refused_before_it_is_driven() -> None:
    with pytest.raises(UsageError, match="--amplitude: expected at most 1 V, got 2"):
        Sine(5.0, 2.0, 1000.0, 0.1).refuse_beyond(Limits(1.0, 2000.0))
    with pytest.raises(UsageError, match="expected at most 100 V/s, got 1272"):
        Sine(200.0, 1.0, 1000.0, 0.1).refuse_beyond(Limits(1.0, 100.0))
