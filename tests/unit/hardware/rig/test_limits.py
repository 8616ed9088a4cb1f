"""Limits of an output: no voltage exceeds them, and each voltage returns to 0 within them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.rig.limits import LONGEST_FALL, Limits

LIMITS = Limits(amplitude=2.0, slew=100.0)
RATE = 1000.0


@pytest.mark.parametrize(
    ("volts", "said"),
    [
        ([0.0, np.nan], "expected numbers from -2 to 2 V, got nan at sample 8"),
        ([0.0, -np.inf], "got -inf at sample 8"),
        ([1.95, 2.001], "got 2.001 at sample 8"),
        ([0.0, 0.11], "expected steps of at most 100 V/s, got 110 at sample 8"),
        ([0.2, 0.2], "got 200 at sample 7"),
    ],
)
def test_a_sample_beyond_the_limits_is_refused(volts: list[float], said: str) -> None:
    last = 1.9 if volts[0] > 1.0 else 0.0
    with pytest.raises(UsageError, match=said):
        LIMITS.check(np.array(volts), last, RATE, 7)


@pytest.mark.parametrize(
    ("amplitude", "slew"), [(np.nan, 1.0), (0.0, 1.0), (1.0, -1.0), (1.0, np.inf), (5.0, 1e-3)]
)
def test_what_is_no_limit_is_refused(amplitude: float, slew: float) -> None:
    with pytest.raises(UsageError, match=r"limits: \w+: expected"):
        Limits(amplitude, slew)


@given(
    held=st.floats(-10.0, 10.0),
    slew=st.floats(1.0, 1e6),
    rate=st.floats(10.0, 1e5),
)
def test_every_voltage_falls_to_0_within_the_limits(held: float, slew: float, rate: float) -> None:
    limits = Limits(10.0, slew)
    fall = limits.fall(held, rate)
    volts = fall.volts(0, min(fall.samples, 200_000))
    limits.check(volts, held, rate)
    assert (np.abs(volts) <= abs(held)).all()
    assert fall.volts(fall.samples - 1, 3).tolist() == [0.0, 0.0, 0.0]
    assert fall.samples <= LONGEST_FALL * rate + 1
