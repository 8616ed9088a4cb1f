import numpy as np

from vibroimpact.analysis.intervals import interval_train
from vibroimpact.analysis.intervals.gaps import find_gaps, local_median


def test_every_gap_is_found_where_the_rate_drifts_threefold() -> None:
    # from 1 to 3 beats per second, each with 3 % jitter: a gap at the end is shorter than a beat at the start
    rng = np.random.default_rng(1)
    intervals = np.linspace(1.0, 1.0 / 3.0, 2000) * (1.0 + 0.03 * rng.normal(size=2000))
    times = np.concatenate([[0.0], np.cumsum(intervals)])
    gone = np.sort(rng.choice(np.arange(1, 2000), 60, replace=False))
    kept = np.delete(np.arange(2001), gone)
    gaps = find_gaps(interval_train(times[kept]))
    steps = np.diff(kept)
    assert np.array_equal(gaps.place, np.flatnonzero(steps > 1))
    assert np.array_equal(gaps.missing, steps[steps > 1] - 1)


def test_a_masked_interval_is_no_gap() -> None:
    times = np.delete(np.arange(60.0), [20, 21, 40])
    gaps = find_gaps(interval_train(times, masked=[(20.5, 20.5)]))
    assert np.arange(60.0)[[39]].tolist() == times[gaps.place].tolist()


def test_gaps_are_not_looked_for_in_a_train_that_is_not_nearly_periodic() -> None:
    times = np.cumsum(np.random.default_rng(2).exponential(size=500))
    gaps = find_gaps(interval_train(times))
    assert "not nearly periodic" in gaps.reason
    assert not len(gaps.place)


def test_a_few_intervals_are_refused_with_their_number() -> None:
    assert "got 4" in find_gaps(interval_train(np.arange(5.0))).reason


def test_an_interval_is_not_measured_against_itself() -> None:
    values = np.ones(9)
    values[4] = 100.0
    assert local_median(values)[4] == 1.0
    assert np.array_equal(local_median(np.arange(3.0)), [1.0, 1.0, 1.0])
