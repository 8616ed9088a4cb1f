import math

import numpy as np
import pytest
from interval_coverage._records import record as drawn
from scipy.signal import lfilter
from support.impact_records import CHAOTIC, THESIS, WORKED, channel_of, record_of

from vibroimpact.analysis.estimation.noise import noise_level
from vibroimpact.analysis.estimation.segments import segment
from vibroimpact.fmus.errors import EstimationError


def cut(record, noise=0.0, seed=0, **options):
    channel = record.channel(noise, seed)
    return segment(
        channel.time, channel.values, channel.good, fastest=record.truth.angular_frequency, **options
    )


@pytest.mark.parametrize("noise", [1e-4, 1e-3, 1e-2])
def test_noise_is_told_from_motion_with_impacts(noise):
    # the truth is the noise that was added
    record = record_of(THESIS, periods=20)
    channel = record.channel(noise, seed=3)
    assert noise_level(channel.values, channel.good) == pytest.approx(noise * record.peak, rel=0.1)


@pytest.mark.parametrize("parameters", [THESIS, WORKED])
@pytest.mark.parametrize("noise", [0.0, 1e-3, 1e-2])
def test_every_impact_of_a_period_one_motion_is_found_from_the_displacement_alone(parameters, noise):
    record = record_of(parameters, periods=8)
    found = cut(record, noise)
    # one impact in each forcing period; impacts at the very ends of the record leave no space for a fit
    assert len(found.impacts) in (7, 8)
    intervals = np.diff([impact.time for impact in found.impacts])
    period = 2.0 * math.pi / parameters.angular_frequency
    tolerance = 1e-6 + 6.0 * math.sqrt(2.0) * max(impact.time_error for impact in found.impacts) / period
    np.testing.assert_allclose(intervals / period, 1.0, atol=tolerance)


def test_the_instant_between_samples_is_found_to_a_small_part_of_a_sample():
    # Worked example of the kink: cubics over 12 samples on each side, 400 samples in a period, no noise.
    # The instants are one forcing period apart, and the ratio of the velocities is the restitution.
    record = record_of(WORKED, periods=6, per_period=400)
    step = record.time[1]
    found = cut(record, window=12 * step)
    instants = np.array([impact.time for impact in found.impacts])
    assert np.ptp(np.diff(instants)) < 2e-5 * step
    impact = found.impacts[1]
    assert impact.level == pytest.approx(0.4, abs=1e-5)
    assert -impact.after / impact.before == pytest.approx(0.8, abs=1e-5)
    assert impact.before == pytest.approx(88.24906850683556, rel=1e-4)


def test_the_stated_error_of_the_instants_is_their_scatter():
    record = record_of(WORKED, periods=4, per_period=400)
    exact = [impact.time for impact in cut(record).impacts]
    errors, stated = [], []
    for seed in range(40):
        found = cut(record, 1e-3, seed, window=12 * record.time[1])
        for impact in found.impacts:
            errors.append(
                min(impact.time - instant for instant in exact if abs(impact.time - instant) < 0.01)
            )
            stated.append(impact.time_error)
    # the scatter of 120 instants is known to 7 %
    assert np.std(errors) == pytest.approx(np.mean(stated), rel=0.25)


def test_a_known_stop_makes_the_instants_better():
    record = record_of(THESIS, periods=12)
    period = 2.0 * math.pi / THESIS.angular_frequency
    free, held = [], []
    for seed in range(12):
        for found, stop in ((free, None), (held, 0.0)):
            instants = [impact.time for impact in cut(record, 3e-3, seed, stop_position=stop).impacts]
            found.extend(np.diff(instants) / period - 1.0)
    assert np.std(held) < np.std(free)


def test_a_lower_stop_is_seen_from_the_kinks_and_mirrored():
    record = record_of(THESIS)
    channel = channel_of(record.time, -record.values)
    found = segment(channel.time, channel.values, channel.good, fastest=64.32)
    assert found.signal.sign == -1.0
    assert len(found.impacts) == len(cut(record).impacts)


def test_flights_of_aperiodic_motion_have_different_lengths_and_are_cut_at_one_level():
    found = cut(record_of(CHAOTIC, periods=40), 3e-3)
    lengths = [flight.duration for flight in found.flights]
    assert max(lengths) > 3.0 * min(lengths)
    assert found.stop_position == pytest.approx(0.0, abs=5e-3)


def test_a_gap_spoils_only_the_flights_that_it_touches():
    record = record_of(THESIS, periods=10)
    channel = record.channel(1e-3)
    values = channel.values.copy()
    values[430:460] = np.nan
    good = np.isfinite(values)
    found = segment(channel.time, np.where(good, values, 0.0), good, fastest=64.32)
    whole = cut(record, 1e-3)
    spoiled = [flight for flight in found.flights if not flight.usable]
    assert len(spoiled) <= 2
    assert len([flight for flight in found.flights if flight.usable]) >= len(whole.flights) - 2


def test_a_jump_of_the_time_axis_is_no_impact():
    record = record_of(THESIS, periods=12)
    channel = record.channel(1e-3)
    kept = np.r_[0:430, 480:1200]
    found = segment(channel.time[kept], channel.values[kept], np.ones(len(kept), bool), fastest=64.32)
    whole = [impact.time for impact in cut(record, 1e-3).impacts]
    for impact in found.impacts:
        assert min(abs(impact.time - instant) for instant in whole) < 0.1 * record.time[1]
    assert len(found.impacts) >= len(whole) - 1


def test_free_motion_without_impacts_is_refused():
    time = np.linspace(0.0, 10.0, 1000)
    values = np.sin(2.0 * time) + 0.01 * np.random.default_rng(1).standard_normal(1000)
    with pytest.raises(EstimationError, match="expected at least two impacts"):
        segment(time, values, np.ones(1000, bool), fastest=2.0)


def test_too_few_samples_are_refused():
    with pytest.raises(EstimationError, match="good samples in a row"):
        noise_level(np.arange(10.0), np.ones(10, bool))


@pytest.mark.parametrize("known", [False, True])
def test_forcing_far_below_resonance_hides_neither_a_known_stop_nor_its_side(known):
    # the longest window contains several flights: its kinks are on the other side
    one = drawn(213, 101)
    stop = one.truth["stop_position"]
    found = segment(
        one.time,
        one.values,
        np.ones(len(one.time), bool),
        fastest=one.truth["angular_frequency"],
        stop_position=stop if known else None,
    )
    assert found.signal.side == "upper"
    assert found.stop_position == pytest.approx(stop, abs=0.02 * found.signal.range)
    assert len(found.impacts) == pytest.approx(one.impacts, abs=3)
    assert not found.passed


@pytest.mark.parametrize("pole", [0.7, 0.9])
def test_coloured_noise_has_no_second_stop(pole):
    record = record_of(CHAOTIC, periods=40)
    noise = lfilter([1.0], [1.0, -pole], np.random.default_rng(5).standard_normal(len(record.values)))
    values = record.values + 0.01 * record.peak * noise / np.std(noise)
    found = segment(record.time, values, np.ones(len(values), bool), fastest=CHAOTIC.angular_frequency)
    assert found.opposite < 3
