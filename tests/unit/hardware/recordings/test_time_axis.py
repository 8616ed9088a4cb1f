"""Instants of samples, against the clocks that each test makes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.table import Column, Floats, Table
from vibroimpact.hardware.recordings.gaps import gaps_in
from vibroimpact.hardware.recordings.printed_grid import common_step, decimal_step
from vibroimpact.hardware.recordings.segments import split_at_restarts
from vibroimpact.hardware.recordings.time_axis import Placement, place

RANDOM = np.random.default_rng(4)


def placed(instants: Floats, interval: float | None = None, rate: float | None = None) -> Placement:
    values = np.arange(len(instants), dtype=float)
    column = Column("force", values, interval=interval)
    return place(Table([column], Column("time", instants)), column, rate)


@settings(max_examples=50)
@given(
    interval=st.floats(1e-6, 10.0),
    begin=st.floats(-100.0, 100.0),
    count=st.integers(70, 400),
    lost=st.sets(st.integers(1, 68), max_size=6),
)
@example(interval=1.0, begin=0.0, count=70, lost={2})
def test_samples_that_are_missing_on_an_even_grid_are_put_back_as_missing(
    interval: float, begin: float, count: int, lost: set[int]
) -> None:
    whole = begin + interval * np.arange(count)
    kept = np.setdiff1d(np.arange(count), list(lost))
    placement = placed(whole[kept])
    assert len(placement.axis.time) == count
    assert placement.missing == len(lost)
    np.testing.assert_array_equal(np.flatnonzero(placement.row >= 0), kept)
    assert placement.axis.interval == pytest.approx(interval, rel=1e-6)
    np.testing.assert_allclose(placement.axis.time, whole, rtol=0.0, atol=1e-3 * interval)


@pytest.mark.parametrize("digits", [3, 4, 5, 6])
def test_even_instants_are_recognized_behind_their_rounding(digits: int) -> None:
    """20 kHz: with three digits twenty rows share an instant."""
    exact = np.arange(8000) * 5e-5
    placement = placed(np.round(exact, digits))
    assert placement.axis.interval == pytest.approx(5e-5, rel=1e-3 * 10.0 ** (3 - digits))
    np.testing.assert_allclose(placement.axis.time, exact, rtol=0.0, atol=0.6 * 10.0**-digits)


def test_a_clock_that_jitters_is_kept_as_it_is() -> None:
    instants = np.cumsum(RANDOM.uniform(0.04, 0.06, 300))
    placement = placed(instants)
    assert placement.axis.interval is None
    np.testing.assert_array_equal(placement.axis.time, instants)
    assert "not evenly spaced" in placement.remarks[-1]


def test_repeated_and_swapped_rows_are_put_right_and_marked() -> None:
    instants = np.arange(100) * 0.1
    instants[[40, 41]] = instants[[41, 40]]
    instants = np.insert(instants, 70, instants[70])
    placement = placed(instants)
    np.testing.assert_allclose(placement.axis.time, np.arange(100) * 0.1, atol=1e-12)
    assert np.flatnonzero(placement.suspect).tolist() == [40, 41, 70]
    assert placement.row[[40, 41, 70, 71]].tolist() == [41, 40, 70, 72]
    assert "go back 1 times" in placement.remarks[0]
    assert "1 rows repeat an instant" in placement.remarks[1]


def test_instants_in_plain_disorder_are_refused() -> None:
    with pytest.raises(DatasetError, match="steps back"):
        placed(RANDOM.uniform(0.0, 9.0, 200))
    with pytest.raises(DatasetError, match="expected numbers, got none"):
        placed(np.full(9, np.nan))


def test_rows_without_an_instant_are_counted_on() -> None:
    instants = np.arange(50) * 0.25
    instants[[10, 11, 30]] = np.nan
    placement = placed(instants)
    np.testing.assert_allclose(placement.axis.time, np.arange(50) * 0.25, atol=1e-12)
    assert np.flatnonzero(placement.suspect).tolist() == [10, 11, 30]


def test_the_uncertainty_of_contradicting_intervals_is_their_whole_spread() -> None:
    """Values of the shaker's file: .000606 and .000586 s in the header, .000605 s in the column."""
    values = np.zeros(2000)
    time = Column("time", np.arange(2000) * 0.000605)
    columns = [Column("command", values, interval=0.000606), Column("base", values[:1900], interval=0.000586)]
    table = Table(columns, time)
    for column in columns:
        placement = place(table, column)
        assert placement.axis.interval == pytest.approx(0.000605, rel=1e-9)
        assert placement.axis.interval_uncertainty == pytest.approx(
            (0.000606 - 0.000586) / 0.000605, rel=1e-9
        )
        assert len(placement.axis.time) == len(column.values)


def test_the_rate_of_the_user_is_used_and_what_contradicts_it_is_told() -> None:
    placement = placed(np.arange(40) * 0.01, interval=0.02, rate=1000.0)
    assert placement.axis.interval == 0.001
    assert len(placement.remarks) == 2


@pytest.mark.parametrize("lost", [1, 200])
@pytest.mark.parametrize("digits", [4, 6, 12])
def test_a_gap_stays_a_gap_under_the_rate_of_the_user(digits: int, lost: int) -> None:
    """With four digits at 5120 Hz the rounding of an instant reaches half an interval."""
    whole = 2.0 + np.arange(3000) / 5120.0
    kept = np.delete(np.arange(3000), np.arange(900, 900 + lost))
    placement = placed(np.round(whole[kept], digits), rate=5120.0)
    np.testing.assert_array_equal(np.flatnonzero(placement.row >= 0), kept)
    np.testing.assert_allclose(placement.axis.time, whole, rtol=0.0, atol=0.6 * 10.0**-digits)
    (told,) = placement.remarks
    assert told.startswith(f"{lost} sample")
    assert "missing in 1 gap" in told


def test_a_gap_in_instants_that_a_rate_contradicts_stays_a_gap_too() -> None:
    kept = np.delete(np.arange(60), [20, 21, 22])
    placement = placed(kept * 0.01, rate=1000.0)
    np.testing.assert_array_equal(np.flatnonzero(placement.row < 0), [20, 21, 22])
    assert placement.axis.interval == 0.001
    assert ["0.01 s apart" in placement.remarks[0], "3 samples are missing" in placement.remarks[1]] == [
        True
    ] * 2


def test_a_gap_of_thousands_of_samples_between_rounded_instants_is_counted_exactly() -> None:
    """1.8 s at 5120 Hz with six digits: one step of .000195 s determines the count only to 15 samples."""
    kept = np.append(np.arange(1000), np.arange(10240, 11240))
    for rate in (None, 5120.0):
        placement = placed(np.round(kept / 5120.0, 6), rate=rate)
        np.testing.assert_array_equal(np.flatnonzero(placement.row >= 0), kept)
        assert placement.axis.interval == pytest.approx(1.0 / 5120.0, rel=1e-6)


@pytest.mark.parametrize(
    "instants",
    [
        np.cumsum(np.append(RANDOM.uniform(0.02, 0.06, 300), 9.0)),
        np.concatenate([np.arange(50) * 1e-3, [1e6, 1e6 + 1e-3]]),
    ],
    ids=["jitter", "too long"],
)
def test_a_gap_that_the_rate_of_the_user_closes_is_said(instants: Floats) -> None:
    placement = placed(instants, rate=1000.0)
    assert len(placement.axis.time) == len(instants)
    assert "one after the other, and closes" in placement.remarks[-1]


@pytest.mark.parametrize("step", [0.01, 1 / 3, 5e-5])
def test_a_clock_without_gaps_says_nothing_of_gaps_under_its_own_rate(step: float) -> None:
    for digits in (2, 3, 5, 12):
        instants = np.round(np.arange(2000) * step + RANDOM.normal(0.0, 1e-3 * step, 2000), digits)
        placement = placed(instants, rate=1.0 / step)
        assert placement.missing == 0
        assert placement.remarks == ()


def test_instants_since_1970_are_even_within_their_digits() -> None:
    """Six decimals of some 1.8e9 s at 5120 Hz; the binary number loses a quarter of the last one."""
    placement = placed(np.round(1795255200.0 + np.arange(4000) / 5120.0, 6))
    assert placement.axis.interval == pytest.approx(1.0 / 5120.0, rel=1e-6)


def test_a_record_far_longer_than_its_rows_is_not_filled() -> None:
    instants = np.concatenate([np.arange(50) * 1e-3, [1e6, 1e6 + 1e-3]])
    placement = placed(instants)
    assert placement.missing == 0
    assert len(placement.axis.time) == 52


def test_a_clock_that_begins_again_makes_two_records() -> None:
    one, two = np.arange(30) * 0.1, np.arange(20) * 0.1
    column = Column("force", np.arange(50.0))
    tables, told = split_at_restarts(Table([column], Column("time", np.append(one, two))))
    assert [len(table.columns[0].values) for table in tables] == [30, 20]
    assert "begin again 1 times" in told[0]
    assert tables[1].columns[0].values[0] == 30.0


@settings(max_examples=50)
@given(digits=st.integers(0, 6), seed=st.integers(0, 10**6))
def test_the_weight_of_the_last_printed_digit_is_found(digits: int, seed: int) -> None:
    values = np.round(np.random.default_rng(seed).uniform(1.0, 1000.0, 400), digits)
    assert decimal_step(values) == pytest.approx(10.0**-digits, rel=1e-12)
    assert decimal_step(np.round(1.7e9 + values, digits)) == pytest.approx(10.0**-digits, rel=1e-12)


@pytest.mark.parametrize("step", [1024 / 44100, 1 / 50, 1 / 29.97])
def test_the_frames_behind_rounded_intervals_are_found(step: float) -> None:
    intervals = np.round(RANDOM.integers(12, 22, 4000) * step, 3)
    assert common_step(intervals, 1e-3) == pytest.approx(step, rel=2e-4)


def test_intervals_on_no_coarser_grid_have_none() -> None:
    intervals = np.round(RANDOM.exponential(0.04, 4000), 3)
    assert common_step(intervals[intervals > 0.0], 1e-3) == 0.0


@pytest.mark.parametrize("last", [1e9, 1e300, 1.7e308])
def test_steps_that_differ_by_any_factor_give_no_warning(last: float) -> None:
    found = gaps_in(np.arange(5), np.array([0.0, 1e-300, 2e-300, 3e-300, last]))
    assert found is None or found.missing >= 0
