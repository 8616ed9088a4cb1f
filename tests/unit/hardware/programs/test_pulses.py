"""Every pulse of a stream is kept once, with all of its presamples, for any division into blocks."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.hardware.programs.pulses import PulseFinder
from vibroimpact.hardware.rig.acquisition import Block
from vibroimpact.hardware.rig.calibration import Calibration
from vibroimpact.hardware.rig.measurement import MeasuredInput, Measurement, PulseRule


def measurement(calibration: Calibration | None = None, **rule: Any) -> Measurement:
    given_rule = {"channel": "cell", "threshold": 1.0, "hysteresis": 0.5, "before": 5, "after": 3, "dead": 0}
    inputs = [
        MeasuredInput(
            name=name, terminal=f"Dev1/ai{n}", highest=5.0, low=-5.0, high=5.0, step=1e-4, calibration=using
        )
        for n, (name, using) in enumerate([("tip", None), ("cell", calibration)])
    ]
    return Measurement(
        program="spikes",
        rig="test",
        device="Dev1",
        product="X",
        rate=1000.0,
        skew=0.0,
        inputs=tuple(inputs),
        pulses=PulseRule(**(given_rule | rule)),
    )


def stream(cell: np.ndarray, first: int = 0) -> np.ndarray:
    return np.vstack([first + np.arange(len(cell), dtype=float), cell])


def kept(finder: PulseFinder, volts: np.ndarray, cuts: list[int]) -> tuple[list[int], np.ndarray]:
    """Feed a stream in blocks; return the kept samples and their numbers."""
    edges = sorted({0, volts.shape[1], *(cut % (volts.shape[1] + 1) for cut in cuts)})
    pieces = []
    for begin, end in pairwise(edges):
        pieces += finder.feed(Block(begin, volts[:, begin:end]))
    pieces += finder.finish()
    numbers = [number for piece in pieces for number in range(piece.first, piece.end)]
    return numbers, np.concatenate([np.empty((2, 0)), *(piece.volts for piece in pieces)], axis=1)


def sample_by_sample(cell: np.ndarray, rule: PulseRule) -> tuple[list[int], set[int]]:
    """Return the starts of pulses and the samples to keep, by the rule in its simplest form."""
    starts, keep, up, last = [], set(), False, -(10**9)
    for number, value in enumerate(np.sign(rule.threshold) * cell):
        before = up
        if value >= abs(rule.threshold):
            up = True
        elif value < rule.hysteresis * abs(rule.threshold):
            up = False
        if up and not before:
            keep |= set(range(number - rule.before, number))
            if number - last >= rule.dead:
                starts.append(number)
                last = number
        if up:
            keep |= set(range(number, number + rule.after + 1))
        if number - last < rule.dead:
            keep.add(number)
    return starts, {number for number in keep if 0 <= number < len(cell)}


@given(
    seed=st.integers(0, 2**32 - 1),
    length=st.integers(1, 400),
    smooth=st.integers(1, 12),
    sign=st.sampled_from([1.0, -1.0]),
    hysteresis=st.floats(0.1, 1.0),
    before=st.integers(0, 40),
    after=st.integers(0, 20),
    dead=st.integers(0, 60) | st.just(1000),
    cuts=st.lists(st.integers(0, 400), max_size=30),
)
@settings(max_examples=300, deadline=None)
def test_each_pulse_is_kept_once_with_its_presamples_however_blocks_are_cut(
    seed: int,
    length: int,
    smooth: int,
    sign: float,
    hysteresis: float,
    before: int,
    after: int,
    dead: int,
    cuts: list[int],
) -> None:
    chance = np.random.default_rng(seed)
    cell = np.convolve(chance.normal(size=length + smooth - 1), np.ones(smooth) / np.sqrt(smooth), "valid")
    what = measurement(threshold=1.2 * sign, hysteresis=hysteresis, before=before, after=after, dead=dead)
    assert what.pulses is not None
    finder = PulseFinder(what)
    numbers, samples = kept(finder, stream(cell), cuts)
    starts, expected = sample_by_sample(cell, what.pulses)
    assert finder.starts == starts
    assert numbers == sorted(expected)
    np.testing.assert_array_equal(samples, stream(cell)[:, numbers])


@given(
    ends=st.lists(st.floats(0.95, 1.05) | st.just(1.0), min_size=2, max_size=2),
    noise=st.lists(st.sampled_from([0.0, 0.45, 0.5, 0.999999, 1.0, 1.000001, 4.0]), max_size=60),
    sign=st.sampled_from([1.0, -1.0]),
    hysteresis=st.sampled_from([0.5, 1.0]),
    dead=st.integers(0, 8) | st.just(1000),
    cuts=st.lists(st.integers(0, 62), max_size=20),
)
@settings(max_examples=300, deadline=None)
def test_values_at_the_threshold_and_pulses_at_both_ends_are_kept_once(
    ends: list[float], noise: list[float], sign: float, hysteresis: float, dead: int, cuts: list[int]
) -> None:
    cell = sign * np.array([ends[0], *noise, ends[1]])
    what = measurement(threshold=sign, hysteresis=hysteresis, dead=dead)
    assert what.pulses is not None
    finder = PulseFinder(what)
    numbers, samples = kept(finder, stream(cell), cuts)
    starts, expected = sample_by_sample(cell, what.pulses)
    assert finder.starts == starts
    assert numbers == sorted(expected)
    np.testing.assert_array_equal(samples, stream(cell)[:, numbers])


@given(
    seed=st.integers(0, 2**32 - 1),
    most=st.integers(1, 6),
    cuts=st.lists(st.integers(0, 300), max_size=20),
)
@settings(max_examples=100, deadline=None)
def test_it_is_done_when_the_last_pulse_that_is_wanted_is_whole_wherever_blocks_end(
    seed: int, most: int, cuts: list[int]
) -> None:
    cell = np.zeros(300)
    for at in np.random.default_rng(seed).choice(290, 12, replace=False):
        cell[at : at + 4] = 2.0
    whole = PulseFinder(measurement(), most)
    expected = kept(whole, stream(cell), [])
    cut = PulseFinder(measurement(), most)
    found = kept(cut, stream(cell), cuts)
    assert cut.starts == whole.starts
    assert (cut.done, whole.done) == (True, True) or not whole.done
    assert found[0] == expected[0]
    everything = kept(PulseFinder(measurement()), stream(cell), [])[0]
    assert expected[0] == everything[: len(expected[0])]


@given(seed=st.integers(0, 2**32 - 1), before=st.integers(0, 30), dead=st.integers(0, 40))
@settings(max_examples=100, deadline=None)
def test_pulses_are_found_again_in_what_was_kept_of_them(seed: int, before: int, dead: int) -> None:
    cell = np.convolve(np.random.default_rng(seed).normal(size=500), np.ones(4) / 2.0, "valid")
    what = measurement(before=before, dead=dead)
    first, again = PulseFinder(what), PulseFinder(what)
    pieces = [*first.feed(Block(0, stream(cell))), *first.finish()]
    for piece in pieces:
        again.feed(piece)
    assert again.starts == first.starts


def test_noise_on_the_flank_does_not_split_a_pulse() -> None:
    cell = np.array([0.0, 0.9, 1.1, 0.8, 1.2, 3.0, 1.1, 0.9, 1.05, 0.6, 0.4, 0.0] + [0.0] * 10)
    finder = PulseFinder(measurement())
    kept(finder, stream(cell), [3, 7])
    assert finder.starts == [2]


def test_ringing_within_the_dead_time_belongs_to_its_pulse() -> None:
    cell = np.zeros(200)
    cell[[50, 60, 70]] = [3.0, 2.0, 1.5]
    assert_starts(cell, {"dead": 0}, [50, 60, 70])
    assert_starts(cell, {"dead": 15}, [50, 70])
    assert_starts(cell, {"dead": 25}, [50])


def assert_starts(cell: np.ndarray, rule: dict[str, int], starts: list[int]) -> None:
    finder = PulseFinder(measurement(**rule))
    kept(finder, stream(cell), [])
    assert finder.starts == starts


def test_a_pulse_in_which_samples_are_lost_begins_anew_after_them() -> None:
    finder = PulseFinder(measurement())
    volts = stream(np.full(10, 2.0))
    first = finder.feed(Block(0, volts))
    second = [*finder.feed(Block(100, volts)), *finder.finish()]
    assert finder.starts == [0, 100]
    assert sum(piece.volts.shape[1] for piece in [*first, *second]) == 20


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_threshold_is_in_the_unit_of_the_calibration(sign: float) -> None:
    cell = Calibration(unit="N", sensitivity=sign * 0.02, offset=0.5, drift=0.1, how="-", when="-")
    force = np.zeros(1000)
    force[500:504] = 12.0
    volts = cell.sensitivity * force + cell.offset + cell.drift * np.arange(1000) / 1000.0
    finder = PulseFinder(measurement(cell, threshold=10.0))
    kept(finder, stream(volts), [501])
    assert finder.starts == [500]
