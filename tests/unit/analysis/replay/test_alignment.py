"""Lag and polarity between channels of separate triggers. References: the lag and the sign that the records were made
with (tests/support/replay_signals.py)."""

from __future__ import annotations

import numpy as np
import pytest
from support.replay_signals import DAMPING_RATIO, FREQUENCY, HIT, INTERVAL, channel, clock, ring

from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.replay import Alignment, align, compare, find_event
from vibroimpact.fmus.errors import EstimationError

TIME = clock()
MODEL = ring(TIME - HIT)
LAG = 0.01 + 0.37 * INTERVAL


def measured(noise: float = 0.0, seed: int = 1, limit: float = np.inf, sign: float = -1.0) -> Channel:
    drawn = np.random.default_rng(seed).normal(0.0, 1.0, len(TIME))
    return channel(0.3 + sign * ring(TIME - HIT - LAG) + noise * drawn, limit=limit)


def found(record: Channel, most_lag: float = 0.02) -> Alignment:
    return align(TIME, MODEL, record, most_lag=most_lag)


def test_lag_between_samples_and_inverted_sign_are_found() -> None:
    result = found(measured())
    assert result.polarity == -1
    # the model's slope jumps at the hit, between its samples: one sample in 350 is interpolated badly
    assert abs(result.lag - LAG) < 1e-3 * INTERVAL
    assert result.remarks == ()


def test_stated_error_of_the_lag_is_that_of_many_noisy_records() -> None:
    results = [found(measured(0.05, seed)) for seed in range(40)]
    scatter = np.sqrt(np.mean([(result.lag - LAG) ** 2 for result in results]))
    stated = np.mean([result.lag_error for result in results])
    # it also contains the difference to the first half of the window, so it is on the safe side
    assert 0.4 * stated < scatter < stated


def test_a_clipped_first_swing_does_not_move_the_lag() -> None:
    record = measured(limit=0.9)
    assert np.count_nonzero(~record.good) > 100
    assert abs(found(record).lag - LAG) < 1e-3 * INTERVAL


def test_clipped_samples_taken_for_good_would_move_it() -> None:
    record = measured(limit=0.6, sign=1.0)
    unflagged = channel(record.values)
    assert abs(found(unflagged).lag - LAG) > 10.0 * abs(found(record).lag - LAG)


def test_the_lag_is_taken_from_the_start_only() -> None:
    record = measured()
    late = record.values.copy()
    end = find_event(record).onset + 4.0 / FREQUENCY
    late[np.searchsorted(TIME, end) :] = 0.3
    cut = channel(late)
    window = (-0.5 / FREQUENCY, 3.0 / FREQUENCY)
    whole, start = (align(TIME, MODEL, it, most_lag=0.02, event_window=window) for it in (record, cut))
    assert whole.lag == pytest.approx(start.lag, abs=1e-6 * INTERVAL)


def test_a_model_of_wrong_frequency_cannot_hide_in_the_lag() -> None:
    wrong = ring(TIME - HIT, 1.02 * FREQUENCY)
    comparison = compare(TIME, wrong, measured(), most_lag=0.02)
    assert comparison.alignment.correlation > 0.98
    assert comparison.variance < 60.0
    # it shifts by about the share of 2 % times the distance from onset to the centre of the window
    assert 0.0 < comparison.alignment.lag - LAG < 0.02 * 3.0 / FREQUENCY
    # and its stated error shows that the halves of the window disagree
    assert comparison.alignment.lag_error > 0.1 * (comparison.alignment.lag - LAG)


def test_an_alignment_over_the_whole_record_would_flatter_the_wrong_frequency() -> None:
    wrong = ring(TIME - HIT, 1.02 * FREQUENCY)
    start = compare(TIME, wrong, measured(), most_lag=0.02)
    whole = compare(TIME, wrong, measured(), most_lag=0.02, event_window=(-0.01, 0.17))
    assert whole.variance > start.variance + 5.0


def test_steady_vibration_is_called_ambiguous() -> None:
    tone = np.sin(2.0 * np.pi * FREQUENCY * TIME)
    noise = np.random.default_rng(3).normal(0.0, 0.02, len(TIME))
    result = align(TIME, tone, channel(tone + noise), most_lag=0.02)
    assert sum("ambiguous" in remark for remark in result.remarks) == 2
    assert abs(result.polarity_margin) < 0.01
    assert abs(result.lag_margin) < 0.01


def test_a_hit_from_rest_is_not_ambiguous_under_noise() -> None:
    result = found(measured(0.1))
    assert result.remarks == ()
    assert result.polarity_margin > 0.05
    assert result.lag_margin > 0.05


def test_a_lag_beyond_the_bound_is_said_to_be_at_the_bound() -> None:
    result = align(TIME, MODEL, measured(sign=1.0), most_lag=LAG - 0.02 / FREQUENCY, polarity=1)
    assert result.at_bound
    assert any("may be beyond" in remark for remark in result.remarks)
    assert not found(measured()).at_bound


def test_a_given_lag_is_kept_and_its_sign_judged() -> None:
    result = align(TIME, MODEL, measured(), most_lag=0.0, lag=LAG)
    assert (result.lag, result.lag_error, result.polarity) == (LAG, 0.0, -1)
    assert result.correlation == pytest.approx(1.0, abs=1e-6)
    kept = align(TIME, MODEL, measured(), most_lag=0.0, lag=LAG, polarity=1)
    assert kept.correlation == pytest.approx(-1.0, abs=1e-6)


def test_signals_that_have_nothing_in_common_are_not_relied_on() -> None:
    other = ring(TIME - HIT, 7.3 * FREQUENCY, 0.2)
    result = align(TIME, other, measured(), most_lag=0.02)
    assert any("do not rely" in remark for remark in result.remarks)


def test_a_window_without_good_samples_is_refused() -> None:
    with pytest.raises(EstimationError, match=r"expected at least 8 good samples.*Give a longer window"):
        align(TIME, MODEL, measured(), most_lag=0.02, event_window=(0.0, 3.0 * INTERVAL))


def test_onset_offset_and_period_are_those_of_the_record() -> None:
    event = find_event(measured(0.001))
    assert 0.0 <= event.onset - HIT - LAG < 0.25 / FREQUENCY
    assert event.offset == pytest.approx(0.3, abs=3 * 0.001 / np.sqrt(500))
    assert event.noise == pytest.approx(0.001, rel=0.2)
    assert 1.0 / event.period == pytest.approx(FREQUENCY, rel=0.01)


def test_a_record_that_begins_in_motion_has_no_onset_and_no_offset() -> None:
    motion = np.cos(2.0 * np.pi * 3.0 * TIME) * np.exp(-2.0 * TIME)
    event = find_event(channel(motion))
    assert (event.quiet, event.onset, event.offset) == (None, 0.0, 0.0)


def test_a_slow_precursor_is_neither_noise_nor_onset() -> None:
    ramp = 0.05 * np.clip((TIME - 0.01) / 0.02, 0.0, 1.0)
    event = find_event(channel(0.3 + ramp * (TIME < HIT + LAG) + ring(TIME - HIT - LAG)))
    assert event.offset == pytest.approx(0.3, abs=1e-12)
    assert event.quiet is not None
    assert event.quiet[1] <= 0.01 + INTERVAL
    assert event.onset > HIT + LAG


def test_a_constant_channel_has_no_event() -> None:
    with pytest.raises(EstimationError, match="not all equal"):
        find_event(channel(np.full(100, 2.0)))


def test_model_and_damping_ratio_are_those_of_a_hit_mode() -> None:
    """The reference of this file itself: two swings apart, the ratio is exp(-2 pi zeta / sqrt(1 - zeta^2))."""
    period = 1.0 / (FREQUENCY * np.sqrt(1.0 - DAMPING_RATIO**2))
    first, second = ring(np.array([0.25 * period, 1.25 * period]))
    assert second / first == pytest.approx(
        np.exp(-2.0 * np.pi * DAMPING_RATIO / np.sqrt(1 - DAMPING_RATIO**2))
    )
