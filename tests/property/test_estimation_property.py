"""Estimates from noiseless impacting motion, over a range of oscillators."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.impact_records import THESIS, channel_of, record_of

from vibroimpact.analysis.estimation import Known, estimate_impacts
from vibroimpact.analysis.estimation.physics import Forcing, Parameters
from vibroimpact.fmus.errors import EstimationError

METHODS = ["weak_form", "trajectory"]

oscillators = st.builds(
    Parameters,
    restitution=st.floats(0.4, 0.95),
    damping_ratio=st.floats(0.01, 0.3),
    natural_frequency=st.floats(2.0, 60.0),
    angular_frequency=st.just(1.0),
    static_deflection=st.floats(0.2, 5.0),
    phase=st.floats(0.0, 6.0),
    stop_position=st.floats(-0.1, 0.3),
)


def made(parameters, ratio):
    """Return the oscillator driven at `ratio` times its natural frequency, its stop in units of the deflection."""
    return replace(
        parameters,
        angular_frequency=ratio * parameters.natural_frequency,
        stop_position=parameters.stop_position * parameters.static_deflection,
    )


def estimated(time, values, forcing, known=None):
    """Return the trajectory fit; motion with few impacts is skipped."""
    try:
        found = estimate_impacts(channel_of(time, values), forcing, known, methods=METHODS)
    except EstimationError as problem:
        assume("impacts with" not in str(problem))
        raise
    assume("trajectory" in found.values or len(found.impact_times) < 4)
    return found


@settings(max_examples=12)
@given(oscillators, st.floats(1.5, 2.2))
def test_noiseless_record_gives_the_truth(parameters, ratio):
    record = record_of(made(parameters, ratio), periods=6, start=(parameters.stop_position - 0.3, 0.0))
    truth = record.truth
    # every impact is strong enough to be detected: there are no low bounces
    drops = record.velocity[:-1] - record.velocity[1:]
    hits = drops > 0.25 * np.max(np.abs(record.velocity))
    assume(5 <= np.count_nonzero(hits) <= 8)
    found = estimated(record.time, record.values, record.forcing())
    assume(found.facts["flights_left_out"] == 0.0 and "trajectory" in found.values)
    fit = found.values["trajectory"]
    assert fit["restitution"].value == pytest.approx(truth.restitution, abs=1e-5)
    assert fit["damping_ratio"].value == pytest.approx(truth.damping_ratio, abs=1e-5)
    assert fit["natural_frequency"].value == pytest.approx(truth.natural_frequency, rel=1e-5)
    weak = found.values["weak_form"]
    assert weak["damping_ratio"].value == pytest.approx(truth.damping_ratio, abs=1e-3)
    assert weak["restitution"].value == pytest.approx(truth.restitution, abs=2e-3)


@cache
def estimated_once(seed, known=None):
    record = record_of(THESIS, periods=6)
    return estimated(record.time, record.channel(0.005, seed).values, record.forcing(), known)


@settings(max_examples=5)
@given(st.floats(1e-6, 1e6), st.integers(0, 2))
def test_scale_of_the_displacement_leaves_restitution_and_damping_unchanged(scale, seed):
    record = record_of(THESIS, periods=6)
    values = record.channel(0.005, seed).values
    one = estimated_once(seed)
    other = estimated(record.time, scale * values, record.forcing(static_deflection=scale * 2.3))
    for method in METHODS:
        for quantity in ("restitution", "damping_ratio", "natural_frequency"):
            first, second = (found.values[method][quantity] for found in (one, other))
            assert second.value == pytest.approx(first.value, abs=1e-3 * first.standard_error)
            assert second.standard_error == pytest.approx(first.standard_error, rel=1e-3)


@settings(max_examples=5)
@given(st.floats(-100.0, 100.0), st.integers(0, 2))
def test_time_shift_leaves_all_but_the_phase_unchanged(shift, seed):
    record = record_of(THESIS, periods=6)
    values = record.channel(0.005, seed).values
    one = estimated_once(seed, Known(stop_position=0.0))
    phase = record.truth.phase - 64.32 * shift
    later = Forcing(64.32, 2.3, math.remainder(phase, 2.0 * math.pi))
    other = estimated(record.time + shift, values, later, Known(stop_position=0.0))
    np.testing.assert_allclose(other.impact_times, one.impact_times + shift, atol=1e-9)
    for method in METHODS:
        for quantity in ("restitution", "damping_ratio", "natural_frequency"):
            first, second = (found.values[method][quantity] for found in (one, other))
            assert second.value == pytest.approx(first.value, abs=1e-3 * first.standard_error)
