"""The output course from the first sample to rest: no waveform exceeds the limits of the output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.rig.course import FADE, Course
from vibroimpact.hardware.rig.limits import Floats, Limits
from vibroimpact.hardware.rig.waveforms import Sine, Waveform

RATE = 1000.0
NASTY = st.sampled_from([np.nan, np.inf, -np.inf, 1e308, -3.0, 5e-324])


@dataclass
class Table:
    """A waveform of given samples."""

    table: Floats
    samples: int | None

    def volts(self, first: int, count: int) -> Floats:
        return self.table[first : first + count] if self.samples is not None else np.resize(self.table, count)


def driven(waveform: Waveform, limits: Limits, stop_at: int, piece: int) -> tuple[Course, Floats]:
    """Return the whole output until rest, stopped at the first block at or after a sample number."""
    course, blocks = Course(waveform, limits, RATE), []
    while course.rest is None:
        if course.next >= stop_at:
            course.stop()
        blocks.append(course.block(piece))
        assert blocks[-1].size == piece
    return course, np.concatenate(blocks)


@st.composite
def tables(draw: st.DrawFn) -> Table:
    steps = draw(st.lists(st.floats(-0.2, 0.2) | NASTY, min_size=1, max_size=300))
    smooth = draw(st.booleans())
    table = np.cumsum(np.clip(np.nan_to_num(steps), -0.2, 0.2)) if smooth else np.array(steps)
    return Table(table, draw(st.sampled_from([table.size, None, table.size + 5])))


@given(
    waveform=tables(),
    slew=st.floats(5.0, 300.0),
    stop_at=st.integers(0, 400),
    piece=st.integers(1, 90),
)
def test_no_waveform_takes_the_output_beyond_its_limits(
    waveform: Table, slew: float, stop_at: int, piece: int
) -> None:
    limits = Limits(1.5, slew)
    course, volts = driven(waveform, limits, stop_at, piece)
    limits.check(volts, 0.0, RATE)
    assert course.rest is not None
    assert not volts[max(course.rest - 1, 0) :].any()


def test_a_stop_fades_from_the_sample_that_is_next() -> None:
    sine = Sine(5.0, 1.0, RATE, 0.1)
    course, volts = driven(sine, Limits(1.0, 200.0), 700, 50)
    np.testing.assert_array_equal(volts[:700], sine.volts(0, 700))
    assert course.rest == 700 + FADE * RATE
    assert np.abs(np.diff(volts[690:])).max() * RATE < 1.5 * 2.0 * np.pi * 5.0


def test_a_waveform_that_ends_at_a_voltage_falls_from_it() -> None:
    course, volts = driven(Table(np.linspace(0.0, 1.0, 101), 101), Limits(1.0, 100.0), 10**9, 40)
    assert volts[100] == 1.0
    assert course.rest == 101 + 50
    assert (np.diff(volts[100:]) <= 0.0).all()
    assert course.failure is None


def test_a_waveform_that_fails_is_left_where_it_was_and_its_error_kept() -> None:
    table = np.linspace(0.0, 1.0, 200)
    table[150] = np.nan
    course, volts = driven(Table(table, 200), Limits(1.0, 100.0), 10**9, 30)
    assert isinstance(course.failure, UsageError)
    assert "got nan at sample 150" in str(course.failure)
    assert volts[149] == pytest.approx(table[149])
    limits_of_fall = np.abs(np.diff(volts[149:]))
    assert limits_of_fall.max() <= 0.1


def test_a_waveform_of_another_length_than_it_says_is_left() -> None:
    course, volts = driven(Table(np.zeros(5), 50), Limits(), 10**9, 20)
    assert "expected a waveform of 20 samples, got shape (5,)" in str(course.failure)
    assert not volts.any()
