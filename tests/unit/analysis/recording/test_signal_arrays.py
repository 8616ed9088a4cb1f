"""Signals as xarray's arrays: their use in analyses, and their refusals."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vibroimpact.analysis.decay import decay_samples, estimate_decay, frequency_response
from vibroimpact.analysis.estimation import Forcing, estimate_bounces, estimate_impacts
from vibroimpact.analysis.recording import Channel, TimeAxis, array_of, channel_of
from vibroimpact.analysis.spikes import spike_report
from vibroimpact.fmus.core import Oscillator, motion
from vibroimpact.fmus.errors import DatasetError, EstimationError

TIME = np.arange(0.0, 3.0, 0.002)


def array(values, time=TIME, **attributes):
    return xr.DataArray(values, {"time": time}, name="tip", attrs=attributes)


def channel(values, unit="m"):
    return Channel("tip", values, unit, TimeAxis(TIME, 0.002), np.zeros(len(values), np.uint8))


def bouncing():
    body = Oscillator(damping=1.0, stiffness=400.0, amplitude=600.0, angular_frequency=35.0)
    return motion(body, (-1.0, 0.0), TIME, position=0.4, restitution=0.8)[0]


def test_impacts_are_estimated_from_an_array_as_from_a_channel():
    both = [array(bouncing(), units="m"), channel(bouncing())]
    found, same = (estimate_impacts(one, Forcing(35.0, phase=0.0), methods=["weak_form"]) for one in both)
    assert found.values == same.values
    assert found.unit == "m"


def test_decays_spikes_bounces_and_responses_take_arrays():
    decay = np.exp(-0.8 * TIME) * np.cos(40.0 * TIME)
    rates = [estimate_decay(decay_samples(one), laws=()) for one in (array(decay, units="m"), channel(decay))]
    assert rates[0].exponential.decay_rate == rates[1].exponential.decay_rate
    force = np.random.default_rng(0).normal(0.0, 0.01, len(TIME))
    force[400:420] += 1.0
    spikes = [spike_report(one).dataset for one in (array(force, units="N"), channel(force, "N"))]
    xr.testing.assert_identical(*spikes)
    responses = [frequency_response(one, one) for one in (array(force, units="N"), channel(force, "N"))]
    assert np.array_equal(responses[0].h1, responses[1].h1)
    flight = TIME % 1.0
    height = array(flight * (1.0 - flight), units="m")
    with pytest.raises(EstimationError):  # flights that do not become shorter: the signal was read
        estimate_bounces(height)


def test_units_of_values_and_instants_are_read():
    found = channel_of(
        array(bouncing(), 1e3 * TIME, units="mm").assign_coords(time=("time", 1e3 * TIME, {"units": "ms"}))
    )
    assert found.unit == "0.001 m"
    np.testing.assert_allclose(found.time, TIME, rtol=1e-15)
    stamps = np.datetime64("2026-01-01T00:00:00", "ns") + (TIME * 1e9).astype("timedelta64[ns]")
    np.testing.assert_allclose(channel_of(array(TIME, stamps)).time, TIME, atol=1e-9)
    beside = xr.DataArray(TIME, {"time": ("sample", TIME)}, ["sample"])
    assert np.array_equal(channel_of(beside).time, TIME)


def test_missing_samples_are_missing_and_come_back_as_such():
    values = bouncing()
    values[7] = np.nan
    found = channel_of(array(values, units="m"))
    assert found.good.sum() == len(values) - 1
    xr.testing.assert_equal(array_of(found), array(values))


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        (TIME, "expected a Channel or an xarray.DataArray, got ndarray"),
        (xr.DataArray(TIME, dims="time"), "expected a coordinate with the instants"),
        (xr.DataArray(1.0), "expected two samples or more"),
        (array([1.0], [0.0]), "expected two samples or more"),
        (xr.DataArray(np.ones((2, 2)), {"time": [0.0, 1.0]}, ["time", "x"]), "got the shape (2, 2)"),
        (array(TIME, TIME[::-1]), "expected finite instants that ascend"),
        (array(TIME, np.zeros(len(TIME))), "expected finite instants that ascend"),
        (array(TIME, np.where(TIME > 1.0, np.nan, TIME)), "expected finite instants that ascend"),
        (array(TIME, TIME.astype(str)), "time: expected instants, got values of the type"),
        (array(TIME.astype(complex)), "expected real numbers, got values of the type complex128"),
        (array(TIME.astype(str)), "expected real numbers"),
        (array(TIME, units="furlongs per what"), "furlongs"),
        (
            array(TIME).assign_coords(time=("time", TIME, {"units": "m"})),
            "expected instants in seconds, got the unit m",
        ),
    ],
)
def test_what_is_no_signal_is_refused_in_one_line(signal, words):
    with pytest.raises(DatasetError) as caught:
        channel_of(signal)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@given(arrays(np.float64, st.integers(0, 5)), arrays(np.float64, st.integers(0, 5)))
def test_any_array_is_a_channel_or_one_error(values, time):
    if len(values) != len(time):
        time = np.resize(time, len(values))
    try:
        found = channel_of(xr.DataArray(values, {"time": time}, ["time"]))
    except DatasetError:
        return
    assert np.all(np.diff(found.time) > 0)
    np.testing.assert_array_equal(found.values, values)
