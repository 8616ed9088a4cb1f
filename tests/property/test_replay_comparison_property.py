"""Invariances of the scores, and recovered lags, for arbitrary signals."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from support.replay_signals import HIT, INTERVAL, channel, clock, ring

from vibroimpact.analysis.replay import align, match_events, running_windows, variance_accounted_for

Floats = NDArray[np.float64]

TIME = clock(2400)
SEEDS = st.integers(0, 2**32 - 1)
EXAMPLES = settings(max_examples=40)


def noise(seed: int, count: int = 200) -> Floats:
    return np.random.default_rng(seed).normal(size=count)


@given(SEEDS, st.floats(1e-6, 1e6))
@EXAMPLES
def test_a_signal_accounts_for_all_of_itself(seed: int, scale: float) -> None:
    signal = scale * noise(seed)
    assert variance_accounted_for(signal, signal) == 100.0


@given(SEEDS, st.floats(-1e3, 1e3).filter(lambda scale: abs(scale) > 1e-3), st.floats(-1e2, 1e2))
@EXAMPLES
def test_scaling_or_shifting_both_signals_changes_no_score(seed: int, scale: float, shift: float) -> None:
    measured = noise(seed)
    simulated = measured + 0.5 * noise(seed + 1)
    score = variance_accounted_for(measured, simulated)
    # (1e5)^2 roundings for a shift that much larger than the signal
    moved = variance_accounted_for(scale * measured + shift, scale * simulated + shift)
    assert abs(moved - score) < 1e-6


@given(SEEDS)
@EXAMPLES
def test_no_score_is_above_100_and_the_mean_scores_0(seed: int) -> None:
    measured, other = noise(seed), noise(seed + 1)
    assert variance_accounted_for(measured, other) < 100.0
    assert abs(variance_accounted_for(measured, np.full(len(measured), measured.mean()))) < 1e-9


@given(
    st.floats(-0.01, 0.02),
    st.sampled_from([1, -1]),
    st.lists(
        st.tuples(st.floats(0.2, 1.0), st.floats(1.2, 4.0), st.floats(0.005, 0.1)), min_size=0, max_size=2
    ),
    st.floats(120.0, 500.0),
    SEEDS,
)
@EXAMPLES
def test_lag_and_polarity_put_in_are_found(
    lag: float, polarity: int, others: list[tuple[float, float, float]], frequency: float, seed: int
) -> None:
    """A hit body of one to three modes with 2 % noise, its sensor inverted or not."""

    def motion(time: Floats) -> Floats:
        further = [0.5 * size * ring(time, ratio * frequency, damping) for size, ratio, damping in others]
        return ring(time, frequency) + sum(further, np.zeros(len(time)))

    record = channel(1.5 + polarity * motion(TIME - HIT - lag) + 0.02 * noise(seed, len(TIME)))
    found = align(TIME, motion(TIME - HIT), record, most_lag=0.03)
    assert found.polarity == polarity
    assert abs(found.lag - lag) < max(6.0 * found.lag_error, 0.02 * INTERVAL)
    assert found.lag_error < 0.05 / frequency


@given(
    arrays(np.float64, st.integers(0, 20), elements=st.floats(0.0, 10.0), unique=True),
    arrays(np.float64, st.integers(0, 20), elements=st.floats(0.0, 10.0), unique=True),
    st.floats(0.0, 3.0),
)
@EXAMPLES
def test_every_event_is_paired_once_missed_or_extra(
    measured: Floats, simulated: Floats, tolerance: float
) -> None:
    measured, simulated = np.sort(measured), np.sort(simulated)
    match = match_events(measured, simulated, tolerance)
    assert np.array_equal(np.sort(np.concatenate([match.measured, match.missed])), measured)
    assert np.array_equal(np.sort(np.concatenate([match.simulated, match.extra])), simulated)
    assert np.all(np.abs(match.delay) <= tolerance)
    assert np.all(np.diff(match.simulated) > 0.0)


@given(st.floats(0.0, 5.0), st.floats(0.01, 5.0), st.floats(1e-2, 6.0))
@EXAMPLES
def test_running_windows_cover_their_stretch_without_overlap(
    start: float, length: float, window: float
) -> None:
    spans = running_windows(start, start + length, window)
    assert spans[0][0] == start
    assert spans[-1][1] == start + length
    assert all(left[1] == right[0] for left, right in pairwise(spans))
    assert all(stop > begin for begin, stop in spans)
