"""Clipping, and event trains: found in generated signals that have them, and only there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.table import Column
from vibroimpact.hardware.recordings.events import event_train, looks_like_events
from vibroimpact.hardware.recordings.sample_quality import clipped_samples

RANDOM = np.random.default_rng(5)
TIME = np.linspace(0.0, 1.0, 2000)
RING = 600.0 * np.exp(-6.0 * TIME) * np.sin(2.0 * np.pi * 30.0 * TIME)


@settings(max_examples=40)
@given(limit=st.floats(150.0, 500.0), digits=st.integers(1, 9), sign=st.sampled_from([-1.0, 1.0]))
def test_every_sample_beyond_the_limit_of_the_chain_is_found_and_no_other(
    limit: float, digits: int, sign: float
) -> None:
    measured = np.round(sign * np.minimum(RING, limit), digits)
    beyond = np.round(sign * RING, digits) * sign >= np.round(limit, digits)
    np.testing.assert_array_equal(clipped_samples(measured), beyond)


@pytest.mark.parametrize(
    "signal",
    [
        np.sin(20.0 * TIME),
        np.round(100.0 * np.sin(20.0 * TIME)),
        np.round(40.0 * np.exp(-TIME) * np.sin(50.0 * TIME)),
        np.sin(2.0 * np.pi * np.arange(2000) / 10.0 + 0.1).round(6),
        np.sin(2.0 * np.pi * (np.arange(2000) + 0.5) / 10.0).round(6),
        np.where(np.sin(20.0 * TIME) > 0.0, 5.0, 0.0),
        np.where(TIME < 0.5, 0.0, np.sin(40.0 * (TIME - 0.5)) ** 2).round(6),
        RANDOM.normal(size=2000),
        RANDOM.normal(size=2000).round(1),
        np.zeros(2000),
        np.arange(2000.0),
    ],
    ids=[
        "sine",
        "converter",
        "decay",
        "periodic",
        "symmetric",
        "switch",
        "rest",
        "noise",
        "coarse_noise",
        "zero",
        "ramp",
    ],
)
def test_smooth_tops_switches_rest_and_noise_are_not_called_clipped(signal: np.ndarray) -> None:
    assert not clipped_samples(signal).any()


def test_a_value_at_a_known_rail_is_clipped_even_once() -> None:
    values = np.where(np.arange(50) == 7, 10.0, np.sin(np.arange(50)))
    assert np.flatnonzero(clipped_samples(values, (-10.0, 10.0))).tolist() == [7]
    assert not clipped_samples(values).any()


def train_of(values: np.ndarray, label: str = "spikes", unit: str = "") -> Column:
    return Column(label, np.asarray(values, dtype=float), unit)


def test_ascending_uneven_numbers_look_like_events_and_others_do_not() -> None:
    instants = np.cumsum(RANDOM.exponential(1.0, 50))
    assert looks_like_events(train_of(instants))
    assert looks_like_events(train_of(instants, unit="ms"))
    assert not looks_like_events(train_of(instants, unit="N"))
    assert not looks_like_events(train_of(np.arange(50) * 0.1))
    assert not looks_like_events(train_of(np.round(np.arange(50) * 0.0333, 3)))
    assert not looks_like_events(train_of(np.cumsum(RANDOM.integers(1, 9, 50))))
    assert not looks_like_events(train_of(RANDOM.normal(size=50)))


def test_events_keep_their_order_window_mask_and_grid() -> None:
    instants = np.round(np.cumsum(RANDOM.uniform(0.2, 0.5, 300)), 3)
    train, told = event_train("beats", train_of(instants), (0.0, 200.0), ((10.0, 12.0), (50.0, 51.0)))
    np.testing.assert_array_equal(train.times, instants)
    assert (train.window, train.resolution) == ((0.0, 200.0), 0.001)
    assert train.attrs["masked"].tolist() == [10.0, 12.0, 50.0, 51.0]
    assert not any("not known" in line for line in told)


def test_disorder_repetition_and_holes_among_events_are_told() -> None:
    train, told = event_train("beats", train_of([0.5, np.nan, 2.25, 1.125, 2.25]))
    assert train.times.tolist() == [0.5, 1.125, 2.25, 2.25]
    said = "\n".join(told)
    assert all(
        words in said for words in ("1 cells hold no instant", "go back 1 times", "1 events have", "window")
    )


def test_events_outside_their_window_are_refused() -> None:
    with pytest.raises(DatasetError, match="the window"):
        event_train("beats", train_of([0.5, 1.5, 31.0]), (0.0, 30.0))
