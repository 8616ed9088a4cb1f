import numpy as np
import pytest

from vibroimpact.analysis.intervals import interval_train, seams
from vibroimpact.analysis.intervals.variability import (
    bin_counts,
    coefficient_of_variation,
    fano_curve,
    fano_factor,
    rate,
)
from vibroimpact.fmus.errors import EstimationError, UsageError


def test_an_interval_with_a_masked_instant_in_it_does_not_count() -> None:
    train = interval_train(np.array([0.0, 1.0, 2.0, 4.5, 5.5, 6.5]), masked=[(3.0, 3.0), (5.5, 5.5)])
    # the seam at 3 s lies in one interval; the seam at the event of 5.5 s touches both neighbours
    assert train.kept.tolist() == [True, True, False, False, False]
    assert train.intervals.tolist() == [1.0, 1.0]


def test_masked_spans_are_no_time_of_observation_and_their_events_are_left_out() -> None:
    times = np.arange(0.0, 10.5, 0.5)
    train = interval_train(times, window=(0.0, 10.0), masked=[(4.2, 5.2), (5.0, 6.2)])
    assert train.duration == pytest.approx(8.0)
    assert np.all((train.times < 4.2) | (train.times > 6.2))
    assert np.allclose(train.intervals, 0.5)


def test_seams_are_the_multiples_of_their_period_inside_the_window() -> None:
    assert seams(10.0, (0.0, 30.0), 0.5) == ((9.5, 10.5), (19.5, 20.5))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"times": np.array([0.0, 2.0, 1.0])}, "ascending order"),
        ({"times": np.array([0.0, np.nan, 1.0])}, "finite instants"),
        ({"times": np.arange(5.0), "window": (1.0, 9.0)}, "around all events"),
        ({"times": np.arange(5.0), "masked": [(3.0, 2.0)]}, "spans \\(start, end\\)"),
        ({"times": np.arange(5.0), "resolution": -1.0}, "resolution"),
    ],
)
def test_a_train_that_is_none_is_refused(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        interval_train(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("times", [[0.0, 1.0], [], [2.0, 2.0, 2.0]])
def test_too_few_events_have_no_intervals_to_speak_of(times: list[float]) -> None:
    with pytest.raises(EstimationError, match="expected"):
        interval_train(np.array(times))


def test_a_poisson_train_has_fano_factor_and_variation_1_and_its_rate_within_its_error() -> None:
    # 20 trains of rate 40 Hz over 50 s; the mean of 20 Fano factors of 1000 bins scatters by .01
    rng = np.random.default_rng(1)
    values = []
    for _ in range(20):
        times = np.sort(rng.uniform(0.0, 50.0, rng.poisson(2000)))
        train = interval_train(times, window=(0.0, 50.0))
        found, error = rate(train)
        values.append(
            (
                (found - 40.0) / error,
                fano_factor(train, 0.05).value,
                coefficient_of_variation(train),
            )
        )
    scores, fano, variation = np.array(values).T
    assert fano.mean() == pytest.approx(1.0, abs=0.04)
    assert variation.mean() == pytest.approx(1.0, abs=0.02)
    # Student's t of 19 degrees of freedom has the standard deviation 1.06; that of 20 scores lies in .6 to 1.6
    assert 0.6 < scores.std() < 1.6


def test_a_clock_has_no_variance_at_its_own_bins_and_says_how_the_offset_matters() -> None:
    train = interval_train(np.arange(0.0, 100.0), window=(0.0, 100.0))
    whole = fano_factor(train, 2.0)
    assert (whole.value, whole.highest) == (0.0, 0.0)
    # bins of 1.5 s alternate between one event and two: variance 1/4 over mean 3/2
    assert fano_factor(train, 1.5).value == pytest.approx(1.0 / 6.0, rel=0.02)


def test_an_event_at_an_edge_belongs_to_the_bin_that_begins_there() -> None:
    # .1 * 3 is slightly more than .3, and .1 * 6 slightly more than .6
    train = interval_train(np.arange(40) * 0.1, window=(0.0, 4.0))
    assert bin_counts(train, 0.3)[:13].tolist() == [3.0] * 13


def test_bins_that_touch_a_masked_span_do_not_count() -> None:
    train = interval_train(np.arange(0.25, 30.0, 0.5), window=(0.0, 30.0), masked=[(4.3, 4.4), (10.0, 12.0)])
    counts = bin_counts(train, 1.0)
    assert len(counts) == 30 - 3
    assert set(counts.tolist()) == {2.0}


def test_the_fano_curve_ends_where_bins_become_too_few() -> None:
    curve = fano_curve(interval_train(np.arange(0.0, 101.0)))
    assert [round(f.width, 9) for f in curve] == [0.5, 1.0, 2.0, 5.0, 10.0]


def test_a_train_too_short_for_bins_has_no_fano_factor_rather_than_a_wrong_one() -> None:
    fano = fano_factor(interval_train(np.arange(5.0)), 1.0)
    assert np.isnan(fano.value)
    assert np.isnan(fano.highest)
