"""Invariances of spikes: the unit, the offset, the origin of time, the sign of the signal."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.spike_signals import channel, pulses, time_above

from vibroimpact.analysis.spikes import SpikeSettings, identify, measure_pulses
from vibroimpact.analysis.spikes.waveforms import WAVEFORMS

RATE, LENGTH = 20_000.0, 1e-3
SCALES = st.floats(-6.0, 6.0).map(lambda exponent: 10.0**exponent)


def record(seed: int) -> np.ndarray:
    """Return four half-sines of unequal height in noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(6000) / RATE
    starts = 0.03 + 0.06 * np.arange(4) + rng.uniform(0.0, 0.01, 4)
    return pulses(time, starts, rng.uniform(1.0, 3.0, 4), LENGTH) + 0.02 * rng.standard_normal(len(time))


@settings(max_examples=15)
@given(
    seed=st.integers(0, 1000),
    scale=SCALES,
    sign=st.sampled_from([-1.0, 1.0]),
    offset=st.floats(-100.0, 100.0),
)
def test_a_factor_scales_peaks_and_impulses_and_an_offset_changes_nothing(
    seed: int, scale: float, sign: float, offset: float
) -> None:
    values = record(seed)
    plain = measure_pulses(identify(channel(values, 1.0 / RATE)))
    other = measure_pulses(identify(channel(sign * scale * (values + offset), 1.0 / RATE)))
    assert len(other) == len(plain) == 4
    # an offset of 100 costs the samples 1e-14 of a peak; fits stop when a step lowers no sum of squares
    assert other.start == pytest.approx(plain.start, abs=1e-12)
    assert other.peak == pytest.approx(sign * scale * plain.peak, rel=1e-9)
    assert other.impulse == pytest.approx(sign * scale * plain.impulse, rel=1e-6)
    assert other.duration == pytest.approx(plain.duration, rel=1e-7)


@settings(max_examples=15)
@given(seed=st.integers(0, 1000), shift=st.floats(-1e3, 1e3))
def test_another_origin_of_time_shifts_instants_and_nothing_else(seed: int, shift: float) -> None:
    values = record(seed)
    plain = measure_pulses(identify(channel(values, 1.0 / RATE)))
    later = measure_pulses(identify(channel(values, 1.0 / RATE, start=shift)))
    assert later.start == pytest.approx(plain.start + shift, abs=1e-9)
    assert later.impulse == pytest.approx(plain.impulse, rel=1e-6)


@settings(max_examples=15)
@given(part=st.floats(0.01, 0.9), offset=st.floats(0.0, 1.0), peak=SCALES)
def test_a_half_sine_is_above_a_threshold_as_long_as_its_formula_says(
    part: float, offset: float, peak: float
) -> None:
    # duration length (1 - (2/pi) arcsin(H/A)); impulse above H: the part sqrt(1 - (H/A)^2) of 2 A length / pi. Linear
    # interpolation between 40 samples a pulse costs less than .5 % of its length
    time = np.arange(2000) / 40_000.0
    signal = pulses(time, np.array([0.02 + offset / 40_000.0]), np.array([peak]), LENGTH)
    chosen = SpikeSettings(threshold=part * peak, minimum_samples=1)
    found = measure_pulses(identify(channel(signal, 1.0 / 40_000.0), chosen))
    assert len(found) == 1
    expected = time_above(part * peak, np.array([peak]), LENGTH)
    assert found.duration == pytest.approx(expected, abs=5e-3 * LENGTH)
    above = np.sqrt(1.0 - part**2) * 2.0 / np.pi * peak * LENGTH
    assert found.impulse_above == pytest.approx(above, abs=5e-3 * peak * LENGTH)
    assert found.impulse == pytest.approx(2.0 / np.pi * peak * LENGTH, rel=4e-3)


@given(level=st.floats(1e-3, 0.95), name=st.sampled_from(sorted(WAVEFORMS)))
def test_the_part_of_an_impulse_above_a_level_is_the_integral_between_its_crossings(
    level: float, name: str
) -> None:
    shape = WAVEFORMS[name]
    half = shape.half_width(np.array([level]))[0]
    assert shape.value(np.array([half * (1.0 - 1e-12)]))[0] == pytest.approx(level, abs=1e-9)
    time = np.linspace(-half, half, 4001)
    # inside of the ends, where half-sines are cut off
    between = np.trapezoid(shape.value(time * (1.0 - 1e-12)), time)
    assert between == pytest.approx(shape.impulse * shape.part_above(np.array([level]))[0], rel=1e-5)
