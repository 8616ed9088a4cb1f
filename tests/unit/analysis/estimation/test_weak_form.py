import math
from dataclasses import replace

import numpy as np
import pytest
from support.impact_records import CHAOTIC, THESIS, WORKED, record_of

from vibroimpact.analysis.estimation.flight_fit import fit_flights, search_flights
from vibroimpact.analysis.estimation.segments import segment
from vibroimpact.analysis.estimation.weak_form import (
    WeightedFlight,
    linear_estimate,
    robust_weak_form,
    weak_form,
    weighted,
    weighted_flights,
    with_own_clock,
)
from vibroimpact.fmus.errors import EstimationError

BOTH = ("damping_ratio", "natural_frequency")


def flights_of(record, noise=0.0, seed=0):
    channel = record.channel(noise, seed)
    found = segment(channel.time, channel.values, channel.good, fastest=record.truth.angular_frequency)
    flights = [flight for flight in found.flights if flight.usable]
    return found, flights, weighted_flights(found.signal, flights, record.truth.angular_frequency)


@pytest.mark.parametrize("parameters", [THESIS, WORKED, CHAOTIC])
def test_noiseless_flights_give_damping_and_frequency(parameters):
    record = record_of(parameters, periods=8)
    found, _ = robust_weak_form(flights_of(record)[2], record.truth, BOTH, 1e-12)
    assert found.natural_frequency == pytest.approx(parameters.natural_frequency, rel=1e-5)
    assert found.damping_ratio == pytest.approx(parameters.damping_ratio, abs=2e-5)


def test_linear_form_reproduces_the_worked_example():
    # 200 samples in a flight, K = 5, s^3 (1-s)^3: the worked example has .0599998 and 19.9999997 without noise. Here
    # samples lie anywhere between the impacts; noise of 1e-3 of the peak gives .05987 +- .00051 and 20.0004 +- .0028.
    record = record_of(WORKED, periods=6, per_period=200)
    _found, flights, _ = flights_of(record)
    errors = 1e-3 * record.peak * np.random.default_rng(2).standard_normal((60, len(record.time)))
    estimates = []
    for draw in errors:
        tested = [
            weighted(record.time[flight.index], (record.values + draw)[flight.index], 5, power=3)
            for flight in flights
        ]
        one = linear_estimate(tested, record.truth, BOTH)
        estimates.append((one.damping_ratio, one.natural_frequency))
    assert np.mean(estimates, axis=0) == pytest.approx([0.06, 20.0], rel=5e-3)
    assert np.all(np.std(estimates, axis=0) < [0.0008, 0.004])


def test_weighting_by_the_noise_halves_the_scatter_and_takes_the_bias_away():
    record = record_of(THESIS, periods=4)
    plain, whitened, searched, stated = [], [], [], []
    for seed in range(60):
        cut, flights, tested = flights_of(record, 0.01, seed)
        first = linear_estimate(tested, record.truth, BOTH)
        found, _ = weak_form(tested, first, BOTH)
        search = search_flights(cut.signal, flights, found, BOTH)
        plain.append(first.damping_ratio)
        whitened.append(found.damping_ratio)
        searched.append(search.parameters.damping_ratio)
        stated.append(math.sqrt(search.covariance[0, 0]))
    assert np.std(whitened) < 0.7 * np.std(plain)
    # the search over all samples from this start states its own scatter, which is no larger
    for values in (whitened, searched):
        assert np.std(values) == pytest.approx(np.mean(stated), rel=0.3)
        assert abs(np.mean(values) - 0.1) < 3.0 * np.std(values) / math.sqrt(60)


def test_unknown_force_has_columns_of_its_own():
    record = record_of(WORKED, periods=8)
    free = (*BOTH, "static_deflection", "phase")
    start = replace(record.truth, static_deflection=1.0, phase=0.0)
    found, _ = robust_weak_form(flights_of(record)[2], start, free, 1e-12)
    assert found.static_deflection == pytest.approx(1.5, rel=1e-3)
    assert found.phase % (2.0 * math.pi) == pytest.approx(record.truth.phase, abs=1e-3)


def test_an_unknown_zero_of_the_displacement_is_found():
    record = record_of(replace(WORKED, offset=-3.0, stop_position=-2.6), periods=8)
    found, _ = robust_weak_form(
        flights_of(record)[2], replace(record.truth, offset=0.0), (*BOTH, "offset"), 1e-12
    )
    assert found.offset == pytest.approx(-3.0, abs=5e-3)


def test_a_drifting_clock_is_found_over_many_flights():
    # the generator is .2 % faster than the recording's clock: over 60 periods three quarters of a radian
    record = record_of(WORKED, periods=60)
    flights = flights_of(record, 3e-3)[2]
    wrong = replace(record.truth, angular_frequency=35.0 / 1.002)
    start = with_own_clock(flights, wrong, BOTH)
    found, _ = robust_weak_form(flights, start, (*BOTH, "angular_frequency"), 3e-3 * record.peak)
    assert found.angular_frequency == pytest.approx(35.0, rel=2e-5)
    assert found.damping_ratio == pytest.approx(0.06, abs=0.005)


def test_flights_with_an_impact_that_was_not_seen_are_left_out():
    record = record_of(THESIS, periods=10)
    found, flights, tested = flights_of(record, 3e-3)
    both = np.arange(flights[2].index[0], flights[3].index[-1] + 1)
    joined: list[WeightedFlight] = [*tested, weighted(record.time[both], found.signal.values[both], 10)]
    result, kept = robust_weak_form(joined, record.truth, BOTH, 3e-3 * record.peak)
    assert kept == list(range(len(tested)))
    assert result.damping_ratio == pytest.approx(0.1, abs=0.005)


def test_flights_that_cannot_tell_are_refused():
    flight = WeightedFlight(np.arange(4.0), np.zeros(4), np.zeros((3, 2, 4)))
    with pytest.raises(EstimationError, match="depends on all free parameters"):
        linear_estimate([flight], THESIS, BOTH)
    with pytest.raises(EstimationError, match="more than 2 equations"):
        weak_form([flight], THESIS, BOTH)


def test_exact_flow_on_the_flights_gives_restitution_speed_and_stop():
    record = record_of(WORKED, periods=8)
    found, flights, _ = flights_of(record)
    fit = fit_flights(found.signal, flights, record.truth, None)
    assert fit.reading.restitution == pytest.approx(0.8, abs=1e-6)
    assert fit.reading.impact_velocity == pytest.approx(88.24906850683556, rel=1e-7)
    assert fit.reading.stop_position == pytest.approx(0.4, abs=1e-5)
    assert not fit.reading.periodic


def test_standard_errors_of_the_reading_are_its_scatter():
    record = record_of(WORKED, periods=5)
    values, stated = [], []
    for seed in range(40):
        found, flights, tested = flights_of(record, 0.01, seed)
        weak, _ = robust_weak_form(tested, record.truth, BOTH, 0.01 * record.peak)
        search = search_flights(found.signal, flights, weak, BOTH)
        fit = fit_flights(found.signal, flights, search.parameters, None, BOTH, search.influence)
        values.append([fit.reading.restitution, fit.reading.impact_velocity, fit.reading.stop_position])
        stated.append([fit.standard_errors[n] for n in ("restitution", "impact_velocity", "stop_position")])
    np.testing.assert_allclose(np.std(values, axis=0), np.mean(stated, axis=0), rtol=0.3)
