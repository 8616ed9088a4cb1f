"""Scores of a replay. References: closed forms of sines and rings, stated with each number."""

from __future__ import annotations

import numpy as np
import pytest
from support.replay_signals import FREQUENCY, HIT, INTERVAL, channel, clock, ring

from vibroimpact.analysis.replay import (
    compare,
    compare_peaks,
    dominant_frequency,
    held_over,
    match_events,
    naive_variance,
    running_windows,
    trust,
    variance_accounted_for,
    windowed_variance,
)
from vibroimpact.fmus.errors import EstimationError

TIME = clock()
MODEL = ring(TIME - HIT)
EVERY = np.ones(len(TIME), dtype=bool)


def between(start: float, stop: float) -> slice:
    """Return the rows from `start` (included) to `stop` (excluded)."""
    return slice(*np.searchsorted(TIME, [start, stop]).tolist())


def test_a_tenth_too_little_scores_99_percent() -> None:
    tone = np.sin(2.0 * np.pi * FREQUENCY * TIME)
    assert variance_accounted_for(tone, 0.9 * tone) == pytest.approx(99.0, abs=1e-9)


def test_a_constant_error_costs_and_a_shared_constant_flatters_nobody() -> None:
    tone = np.sin(2.0 * np.pi * FREQUENCY * TIME)
    # an offset of .1 against a mean square of 1/2
    assert variance_accounted_for(tone, tone + 0.1) == pytest.approx(98.0, abs=1e-9)
    assert variance_accounted_for(tone + 400.0, 0.9 * tone + 400.0) == pytest.approx(99.0, abs=1e-6)
    assert variance_accounted_for(tone + 400.0, np.full(len(TIME), 400.0)) == pytest.approx(0.0, abs=1e-6)


def test_scores_of_windows_make_up_that_of_the_whole() -> None:
    measured = MODEL + 0.02 * np.random.default_rng(2).normal(size=len(TIME))
    edges = running_windows(0.0, float(TIME[-1]) + INTERVAL, 0.03)
    lost = 1.0 - windowed_variance(TIME, measured, MODEL, EVERY, edges) / 100.0
    mean = np.mean(measured)
    energies = [np.sum((measured[between(*span)] - mean) ** 2) for span in edges]
    whole = 1.0 - variance_accounted_for(measured, MODEL) / 100.0
    assert np.sum(lost * energies) / np.sum(energies) == pytest.approx(whole, rel=1e-9)


def test_where_nothing_can_be_scored_there_is_no_score() -> None:
    assert np.isnan(variance_accounted_for(np.ones(5), np.ones(5)))
    assert np.isnan(variance_accounted_for(MODEL, MODEL, ~EVERY))
    assert np.isnan(windowed_variance(TIME, MODEL, MODEL, EVERY, [(9.0, 10.0)])[0])


def test_clipped_and_missing_samples_are_counted_and_not_scored() -> None:
    values = MODEL.copy()
    values[1000:1010] = np.nan
    record = channel(values, limit=0.9)
    comparison = compare(TIME, MODEL, record, lag=0.0, polarity=1)
    clipped = int(np.count_nonzero(np.abs(MODEL) >= 0.9))
    assert clipped > 0
    assert comparison.counts == {
        "scored": len(TIME) - clipped - 10,
        "clipped": clipped,
        "missing": 10,
        "not_simulated": 0,
    }
    assert comparison.variance == pytest.approx(100.0, abs=1e-9)
    assert any("clipped, missing" in remark for remark in comparison.remarks)


def test_the_end_of_the_record_after_the_simulation_is_not_scored() -> None:
    comparison = compare(TIME[:3000], MODEL[:3000], channel(MODEL), lag=0.0, polarity=1)
    assert comparison.counts["not_simulated"] == 1000
    assert np.all(np.isnan(comparison.residual[3000:]))
    assert comparison.variance == pytest.approx(100.0, abs=1e-9)


def test_a_simulation_that_misses_the_record_is_refused() -> None:
    with pytest.raises(EstimationError, match=r"overlaps the recording.*Simulate this stretch"):
        compare(TIME + 5.0, MODEL, channel(MODEL), lag=0.0, polarity=1)


def test_a_simulation_on_its_own_clock_compared_with_itself_is_perfect() -> None:
    comparison = compare(TIME, MODEL, channel(MODEL), most_lag=0.01)
    assert comparison.variance > 99.999999
    assert abs(comparison.alignment.lag) < 1e-6 * INTERVAL


def test_offset_is_removed_as_asked() -> None:
    record = channel(0.7 + MODEL)
    for offset, removed in (("before", 0.7), ("none", 0.0), (0.25, 0.25), ("level", 0.7)):
        comparison = compare(TIME, MODEL, record, lag=0.0, polarity=1, offset=offset)
        assert comparison.offset == pytest.approx(removed, abs=1e-9)
        assert comparison.values[0] == pytest.approx(0.7 - removed, abs=1e-9)


def test_a_record_that_begins_in_motion_says_that_its_offset_was_left() -> None:
    swing = 2.0 + np.cos(2.0 * np.pi * 20.0 * TIME)
    comparison = compare(TIME, swing, channel(swing), lag=0.0, polarity=1)
    assert comparison.offset == 0.0
    assert any("does not begin quietly" in remark for remark in comparison.remarks)


def test_noise_of_one_tenth_bounds_the_score_of_a_perfect_model() -> None:
    drawn = np.random.default_rng(5).normal(0.0, 0.1, len(TIME))
    comparison = compare(TIME, MODEL, channel(MODEL + drawn), lag=0.0, polarity=1, offset=0.0)
    assert comparison.variance == pytest.approx(comparison.noise_ceiling, abs=1.5)
    assert comparison.variance < 95.0


def test_gain_is_what_the_size_of_the_model_lacks() -> None:
    comparison = compare(TIME, 0.8 * MODEL, channel(MODEL), lag=0.0, polarity=1)
    assert comparison.gain == pytest.approx(1.25, rel=1e-9)


def test_frequency_of_a_tone_is_known_far_better_than_the_resolution() -> None:
    tone = np.sin(2.0 * np.pi * 123.456 * TIME)
    line = dominant_frequency(TIME, tone, interval_uncertainty=0.033)
    assert line.resolution == pytest.approx(5.0, rel=1e-3)
    assert abs(line.frequency - 123.456) < 2e-3 * line.resolution
    assert line.uncertainty == pytest.approx(0.033 * 123.456, rel=1e-4)


def test_gaps_and_a_constant_do_not_move_a_frequency() -> None:
    tone = 50.0 + np.sin(2.0 * np.pi * 123.456 * TIME)
    tone[1500:1510] = np.nan
    assert dominant_frequency(TIME, tone).frequency == pytest.approx(123.456, abs=0.02)


def test_a_constant_has_no_frequency() -> None:
    assert np.isnan(dominant_frequency(TIME, np.full(len(TIME), 3.0)).frequency)
    assert np.isnan(dominant_frequency(TIME[:5], MODEL[:5]).frequency)


def test_conflicting_time_axes_make_both_frequencies_uncertain() -> None:
    comparison = compare(TIME, MODEL, channel(MODEL, uncertainty=0.033), lag=0.0, polarity=1)
    for line in (comparison.measured_frequency, comparison.simulated_frequency):
        assert line.uncertainty == pytest.approx(0.033 * FREQUENCY, rel=0.01)
    assert any("3.3 %" in remark for remark in comparison.remarks)


def test_peaks_of_a_model_3_percent_small_err_by_3_percent() -> None:
    window = (HIT + 0.02, HIT + 0.045)
    peaks = compare_peaks(TIME, MODEL, 0.97 * MODEL, EVERY, window, 1.0 / FREQUENCY)
    # ten half periods of 2.5 ms
    assert len(peaks.time) == 10
    assert np.allclose(peaks.relative_error, -0.03, atol=1e-9)
    assert np.allclose(peaks.delay, 0.0, atol=1e-9)
    assert np.all(np.sign(peaks.measured[1:]) == -np.sign(peaks.measured[:-1]))


def test_peaks_of_a_swing_about_400_are_heights_above_its_mean() -> None:
    swing = 10.0 * np.cos(2.0 * np.pi * 20.0 * TIME)
    record = channel(400.0 + swing)
    comparison = compare(TIME, 400.0 + 0.9 * swing, record, lag=0.0, polarity=1, peak_window=(0.02, 0.18))
    assert comparison.peaks is not None
    # maxima every 50 ms from 50 ms, minima between them, from 25 ms
    assert len(comparison.peaks.time) == 7
    assert np.allclose(comparison.peaks.relative_error, -0.1, atol=1e-3)


def test_ripple_on_a_peak_does_not_pass_for_height() -> None:
    ripple = 0.05 * np.sin(2.0 * np.pi * 23.0 * FREQUENCY * TIME)
    window = (HIT + 0.02, HIT + 0.045)
    peaks = compare_peaks(TIME, MODEL + ripple, MODEL, EVERY, window, 1.0 / FREQUENCY)
    largest, plain = (np.max(np.abs(signal[between(*window)])) for signal in (MODEL + ripple, MODEL))
    assert peaks.worst < 0.35 * (largest / plain - 1.0)


def test_a_clipped_peak_has_no_height() -> None:
    good = np.abs(MODEL) < 0.8
    peaks = compare_peaks(TIME, MODEL, MODEL, good, (HIT, HIT + 0.05), 1.0 / FREQUENCY)
    every = compare_peaks(TIME, MODEL, MODEL, EVERY, (HIT, HIT + 0.05), 1.0 / FREQUENCY)
    assert 0 < len(peaks.time) < len(every.time)
    assert np.max(np.abs(peaks.measured)) < 0.8


def test_peaks_without_a_partner_are_counted() -> None:
    peaks = compare_peaks(TIME, MODEL, 0.0 * MODEL, EVERY, (HIT, HIT + 0.02), 1.0 / FREQUENCY)
    assert len(peaks.time) == 0
    assert peaks.unpaired >= 7
    assert np.isnan(peaks.worst)


def test_impacts_are_paired_missed_or_extra() -> None:
    measured, simulated = np.array([0.10, 0.20, 0.30]), np.array([0.101, 0.3005, 0.35])
    match = match_events(measured, simulated, 0.01)
    assert match.measured.tolist() == [0.10, 0.30]
    assert match.delay == pytest.approx([0.001, 0.0005], abs=1e-12)
    assert match.missed.tolist() == [0.20]
    assert match.extra.tolist() == [0.35]
    alone = match_events(np.empty(0), simulated, 0.01)
    assert len(alone.measured) == 0
    assert len(alone.extra) == 3


def test_simulated_impacts_are_brought_to_the_measured_clock() -> None:
    lag = 0.01
    record = channel(-ring(TIME - HIT - lag))
    comparison = compare(
        TIME,
        MODEL,
        record,
        most_lag=0.02,
        measured_events=np.array([0.05]),
        simulated_events=np.array([0.04, 0.1]),
    )
    assert comparison.events is not None
    assert abs(float(comparison.events.delay[0])) < 1e-3 * INTERVAL
    assert comparison.events.extra == pytest.approx([0.11], abs=1e-6)


def test_a_drive_that_looks_unlike_its_response_predicts_little() -> None:
    pulse = np.where((TIME > HIT) & (TIME < HIT + 0.002), 1.0, 0.0)
    assert naive_variance(TIME, pulse, channel(MODEL), most_lag=0.01) < 20.0
    assert naive_variance(TIME, MODEL, channel(-3.0 * MODEL), most_lag=0.01) == pytest.approx(100.0, abs=1e-6)


def test_a_linear_replay_of_an_impacting_board_is_not_to_be_trusted() -> None:
    """Scores as found on smd_repeated_5kg: 73 to 78 % on the fitted record, nothing on the other."""
    verdict = trust({"05": 78.0}, {"00": np.nan})
    assert not verdict.trusted
    assert verdict.words.startswith("Do not trust")
    assert any("not fitted on" in reason for reason in verdict.reasons)
    assert not trust({"05": 78.0}, {"06": 60.0}).trusted


def test_a_replay_that_predicts_another_trial_is_to_be_trusted() -> None:
    """Scores as found on pcb_repeated_shock: 98.8 % on a trial that was not fitted."""
    verdict = trust({"a0": 98.9}, {"a1": 98.8}, {"a1": 4.0})
    assert verdict.trusted
    assert "a1" in verdict.words
    assert verdict.reasons == ()


def test_good_scores_on_its_own_record_alone_earn_no_trust() -> None:
    assert not trust({"a0": 99.9}).trusted


def test_no_trust_where_no_dynamics_does_as_well() -> None:
    verdict = trust({"a": 99.0}, {"b": 98.0}, {"b": 97.0})
    assert not verdict.trusted
    assert "without dynamics" in verdict.words


def test_a_fit_that_has_learnt_its_record_is_told() -> None:
    verdict = trust({"a": 99.9}, {"b": 96.0})
    assert verdict.trusted
    assert "learnt its record" in verdict.reasons[0]
    # one in ten thousand of the variance is no loss, however small the residual on its own record is
    assert trust({"a": 99.9999}, {"b": 99.99}).reasons == ()


def test_a_score_that_is_not_a_number_earns_no_trust() -> None:
    assert not trust({"a": float("nan")}, {"b": 99.0}).trusted


def test_a_replay_holds_to_where_it_gets_out_of_step() -> None:
    # two rings 1 % apart differ by 2 sin(pi .01 n) of their size after n of its 5 ms periods: by 25 % after 4
    comparison = compare(TIME, ring(TIME - HIT, 1.01 * FREQUENCY), channel(MODEL), lag=0.0, polarity=1)
    ((start, stop),) = comparison.held.spans
    assert start == 0.0
    assert 0.01 <= stop <= 0.03
    assert comparison.held.broken is not None
    assert comparison.held.broken[0] == stop
    assert comparison.held.words == f"to {1e3 * stop:.4g} ms after the onset"


def test_what_is_lost_in_noise_neither_holds_nor_fails() -> None:
    drawn = np.random.default_rng(8).normal(0.0, 0.05, len(TIME))
    perfect = compare(TIME, MODEL, channel(MODEL + drawn), lag=0.0, polarity=1)
    # 100 ms after the hit the ring has decayed to e^(-1.26), with a mean square of 16 times that of the noise
    assert perfect.running_variance[-1] < 75.0
    assert perfect.held.broken is None
    assert perfect.held.words == "to 107.8 ms after the onset (noise hides the rest)"
    # a model that still rings in that noise fails
    on = compare(TIME, ring(TIME - HIT, damping_ratio=0.004), channel(MODEL + drawn), lag=0.0, polarity=1)
    assert on.held.broken is not None


def test_a_window_without_samples_does_not_end_what_holds_around_it() -> None:
    windows = running_windows(0.0, 5.0, 1.0)
    held = held_over(windows, np.array([99.0, np.nan, 99.0, 20.0, 99.0]), np.full(5, np.nan))
    assert held.spans == ((0.0, 3.0), (4.0, 5.0))
    assert held.broken == (3.0, 4.0, 20.0)
    assert held.words == "to 3 s, from 4 s to 5 s after the onset"
    assert held_over(windows, np.full(5, 99.0), np.full(5, 100.0)).words == "over the whole record (5 s)"
    assert held_over(windows, np.full(5, 9.0), np.full(5, 100.0)).words == "nowhere"


def test_the_verdict_says_over_which_span_it_holds_of_the_record_that_breaks_first() -> None:
    windows, ceiling = running_windows(0.0, 0.03, 0.01), np.full(3, 100.0)
    whole, early = (held_over(windows, np.array(scores), ceiling) for scores in ((99, 98, 97), (99, 60, 20)))
    assert trust({"a": 98.0}, {"b": 97.0}, held={"a": whole, "b": whole}).words == (
        "This linear replay is to be trusted for events like these, over the whole record (30 ms): "
        "on b, which it was not fitted on, it errs by 17 % (VAF 97.0 %)."
    )
    verdict = trust({"a": 98.0}, {"b": 97.0, "c": 98.0}, held={"a": whole, "b": whole, "c": early})
    assert "for events like these, to 10 ms after the onset: on b" in verdict.words
    assert verdict.beside == (
        "on c it does not hold from 10 ms after the onset on: there it errs by 63 % (VAF 60.0 %)",
    )
    refused = trust({"a": 90.0}, {"b": 80.0}, held={"a": whole, "b": early})
    assert refused.beside[-1] == "on b it errs by at most 25 % only to 10 ms after the onset"


def test_a_replay_that_was_not_fitted_is_trusted_on_a_condition() -> None:
    verdict = trust({}, {"a": 99.0})
    assert verdict.trusted
    assert verdict.words == (
        "This linear replay is to be trusted for events like these, if its numbers do not come from this record: "
        "on a it errs by 10 % (VAF 99.0 %)."
    )
    assert (
        trust({}, {"a": 60.0}).words == "Do not trust this linear replay: on a it errs by 63 % (VAF 60.0 %)."
    )
    assert trust({}, {"a": float("nan")}).words.endswith("there is no record with an event to be scored.")


def test_a_replay_that_is_not_linear_is_not_called_so() -> None:
    for scores in ({"b": 99.0}, {"b": 60.0}):
        assert "linear" not in trust({"a": 99.0}, scores, linear=False).words


def test_what_should_be_known_beside_trust_is_told_whole() -> None:
    assert trust({"a": 99.9}, {"b": 96.0}).beside == trust({"a": 99.9}, {"b": 96.0}).reasons != ()
    assert trust({"a": 70.0}, {"b": 60.0}).beside == trust({"a": 70.0}, {"b": 60.0}).reasons[1:] != ()
