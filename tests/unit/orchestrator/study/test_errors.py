"""Errors of a way against a reference: equal impacts, missed impacts, and impacts hidden at the edges."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.orchestrator.study.errors import Scales, errors_of, matched
from vibroimpact.orchestrator.study.observation import Observation

SCALES = Scales(1.0, (0.0, 10.0))


def train(*rows: tuple[float, float]) -> Any:
    return np.array([(time, speed, 1.0) for time, speed in rows]).reshape(-1, 3)


def regular(count: int = 9, shift: float = 0.0) -> Any:
    return train(*((k + 0.5 + shift, 1.0 + 0.1 * k) for k in range(count)))


def test_the_largest_error_over_the_period_and_over_the_fastest_speed() -> None:
    late = regular()
    late[4, 0] += 1e-3
    late[7, 1] -= 0.018
    found = errors_of(Observation(late), Observation(regular()), SCALES)
    assert found.failure == ""
    assert found.of["impact_time"] == pytest.approx(1e-3)
    assert found.of["impact_velocity"] == pytest.approx(0.01)
    assert found.worst() == pytest.approx(0.01)
    assert math.isnan(found.of["displacement_range"])


def test_an_impact_that_is_missed_and_one_that_is_none_are_told() -> None:
    without, more = np.delete(regular(), 3, axis=0), np.insert(regular(), 4, (4.2, 1.0, 1.0), axis=0)
    assert errors_of(Observation(without), Observation(regular()), SCALES).failure == "missed 1 of 9 impacts"
    assert errors_of(Observation(more), Observation(regular()), SCALES).failure == "1 impact that is none"
    nothing = errors_of(Observation(), Observation(regular()), SCALES)
    assert nothing.failure == "missed 9 of 9 impacts"
    assert math.isnan(nothing.worst())


def test_an_impact_at_the_edge_of_the_recording_may_be_in_one_and_not_in_the_other() -> None:
    edge = train((1.0, 1.0), (5.0, 1.0), (9.9999, 1.0))
    early = train((0.999, 1.0), (4.999, 1.0))
    assert errors_of(Observation(early), Observation(edge), SCALES).failure == ""
    assert errors_of(
        Observation(early), Observation(train((1.0, 1.0), (5.0, 1.0), (9.0, 1.0))), SCALES
    ).failure


def test_the_ends_of_a_chatter_are_not_compared() -> None:
    long = train(*((1.0 + 0.5**k, 0.5**k) for k in range(40)))[::-1]
    short = long[np.abs(long[:, 1]) > 1e-4]
    assert errors_of(Observation(short), Observation(long), SCALES).failure == ""


def test_another_contact_is_another_impact() -> None:
    other = regular()
    other[2, 2] = 2.0
    assert "missed 1" in errors_of(Observation(other), Observation(regular()), SCALES).failure


@given(
    st.lists(st.floats(0.05, 9.95), min_size=2, max_size=30, unique_by=lambda t: round(t, 3)),
    st.floats(-1e-4, 1e-4),
)
def test_any_train_shifted_by_less_than_its_shortest_interval_is_the_same_train(
    times: list[float], shift: float
) -> None:
    ordered = np.sort(times)
    if np.diff(ordered).min() < 4e-4:
        return
    rows = train(*((t, 1.0) for t in ordered))
    moved = rows + np.array([shift, 0.0, 0.0])
    pairs, failure = matched(moved, rows, SCALES)
    assert failure == ""
    assert np.array_equal(pairs[:, 0], pairs[:, 1])
    assert len(pairs) == len(rows)
