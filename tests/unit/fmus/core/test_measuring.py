"""The measuring chain of the C core against independent integrators and functions, and its refusals."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal, special, stats
from scipy.integrate import solve_ivp

from vibroimpact.fmus.core.measuring import LoadCell, digitised, exciter_force, gaussian, sensor_reading
from vibroimpact.fmus.errors import UsageError

Array = NDArray[np.float64]
DURATION = 1e-3
#: Numbers 3 to 5 of channel 2 under seed 1.
GAUSSIAN_BITS = ["-0x1.050575a865c14p-2", "-0x1.aed98bd02a608p-1", "0x1.cb4a9a0dd98dbp-2"]


def seen_by_solver(natural: float, ratio: float, times: Array, hits: Array, impulses: Array) -> Array:
    """Return y of the load cell's equation by an eighth-order Runge-Kutta method, from pulse edge to pulse edge."""
    w = 2.0 * math.pi * natural
    pulses = list(zip(hits.tolist(), (impulses * np.pi / (2.0 * DURATION)).tolist(), strict=True))
    edges = np.unique([times[0], *hits, *(hits + DURATION), times[-1]])
    state, seen = np.zeros(2), np.zeros_like(times)
    for begin, end in pairwise(edges):
        middle = 0.5 * (begin + end)
        under_way = [(hit, peak) for hit, peak in pulses if hit < middle < hit + DURATION]

        def rate(t: float, y: Array, under_way: list[tuple[float, float]] = under_way) -> list[float]:
            # plain floats: the solver calls this a hundred thousand times
            load = sum(peak * math.sin(math.pi * (t - hit) / DURATION) for hit, peak in under_way)
            place, speed = y.tolist()
            return [speed, w * w * (load - place) - 2.0 * ratio * w * speed]

        run = solve_ivp(rate, (begin, end), state, "DOP853", rtol=1e-13, atol=1e-13, dense_output=True)
        inside = (times >= begin) & (times <= end)
        seen[inside] = run.sol(times[inside])[0]
        state = run.y[:, -1]
    return seen


@pytest.mark.parametrize(
    ("natural", "ratio"),
    [(4000.0, 0.02), (500.0, 0.0), (500.0, 1e-6), (501.0, 0.0), (300.0, 1.0), (2000.0, 30.0), (10.0, 0.5)],
    ids=["ringing", "resonant", "nearly resonant", "beating", "critical", "overdamped", "slow"],
)
def test_overlapping_half_sines_are_those_of_another_solver(natural: float, ratio: float) -> None:
    hits, impulses = np.array([2e-3, 2.3e-3, 2.35e-3, 6e-3]), np.array([2e-3, 1e-3, 5e-4, 1e-3])
    times = np.arange(600) / 60000.0
    cell = LoadCell(1.0, natural, ratio, contact_duration=DURATION)
    volts = cell.follow(times, np.zeros_like(times), hits, impulses)
    reference = seen_by_solver(natural, ratio, times, hits, impulses)
    assert np.max(np.abs(volts - reference)) < 1e-10 * np.max(np.abs(reference))


@pytest.mark.parametrize("ratio", [0.0, 0.01, 1.0, 5.0])
def test_a_force_that_goes_straight_between_samples_is_followed_as_lsim_does(ratio: float) -> None:
    w, times = 2.0 * np.pi * 900.0, np.arange(2000) / 20000.0
    forces = np.cumsum(gaussian(7, 0, 0, len(times)))
    forces[0] = 0.0
    cell = LoadCell(0.02, 900.0, ratio, 0.3, 0.1)
    _, seen, _ = signal.lsim(([w * w], [1.0, 2.0 * ratio * w, w * w]), forces, times)
    expected = 0.02 * seen + 0.3 + 0.1 * times
    assert np.max(np.abs(cell.follow(times, forces) - expected)) < 1e-11 * np.max(np.abs(expected))


def test_a_jump_of_the_force_over_a_picosecond_rings_as_a_step_does() -> None:
    w, ratio, jump = 2.0 * np.pi * 1000.0, 0.05, 1e-12
    after = np.linspace(1e-5, 5e-3, 300)
    volts = LoadCell(1.0, 1000.0, ratio).follow([0.0, jump, *(jump + after)], [0.0, *np.ones(301)])
    damped = w * np.sqrt(1.0 - ratio**2)
    decay = np.exp(-ratio * w * after)
    step = 1.0 - decay * (np.cos(damped * after) + ratio * w / damped * np.sin(damped * after))
    # the jump comes half of its length after its start
    assert np.max(np.abs(volts[2:] - step)) < 2.0 * w * jump


def test_a_cell_without_ring_shows_the_half_sine_itself() -> None:
    times = np.linspace(0.0, 2e-3, 401)
    volts = LoadCell(0.01, contact_duration=DURATION).follow(times, np.full(401, 3.0), [4e-4], [2e-3])
    since = times - 4e-4
    sine = np.where((since > 0) & (since < DURATION), np.pi * np.sin(np.pi * since / DURATION), 0.0)
    assert volts == pytest.approx(0.01 * (3.0 + sine), abs=1e-15)


def test_a_cell_that_has_rung_out_is_silent_and_no_slower() -> None:
    cell = LoadCell(1.0, 5000.0, 0.2, contact_duration=1e-4)
    volts = cell.follow([0.0, 1e-3, 1.0, 2.0], np.zeros(4), [0.0], [1e-3])
    assert volts[1] != 0.0
    assert volts[2:].tolist() == [0.0, 0.0]


def test_an_impact_before_the_first_sample_is_in_the_first_block() -> None:
    times = np.arange(1, 100) * 1e-4
    volts = LoadCell(1.0, contact_duration=DURATION).follow(times, np.zeros(99), [0.5e-4], [1e-3])
    assert volts[0] == pytest.approx(0.5 * np.pi * np.sin(np.pi * 0.05), rel=1e-12)


def test_2048_half_sines_may_overlap_and_no_more() -> None:
    hits = np.linspace(0.0, 0.5 * DURATION, 2049)
    cell = LoadCell(1.0, 900.0, 0.1, contact_duration=DURATION)
    volts = cell.follow([0.0, 0.01], [0.0, 0.0], hits[:2048], np.full(2048, 1e-6))
    assert np.all(np.isfinite(volts))
    with pytest.raises(UsageError, match="at most 2048 impacts within one contact_duration"):
        cell.follow([0.02, 0.03], [0.0, 0.0], 0.02 + hits, np.full(2049, 1e-6))


def test_gaussian_numbers_are_the_same_everywhere() -> None:
    # only IEEE 754 rounding is involved: other bits mean another generator
    assert [float.hex(x) for x in gaussian(1, 2, 3, 3)] == GAUSSIAN_BITS
    assert np.array_equal(gaussian(1, 2, 0, 1000)[700:], gaussian(1, 2, 700, 300))


def test_gaussian_numbers_are_normal() -> None:
    numbers = gaussian(20, 1, 0, 1_000_000)
    deviation = 1.0 / np.sqrt(len(numbers))
    assert abs(numbers.mean()) < 4.0 * deviation
    assert abs(numbers.var() - 1.0) < 4.0 * np.sqrt(2.0) * deviation
    assert abs(stats.skew(numbers)) < 4.0 * np.sqrt(6.0) * deviation
    assert abs(stats.kurtosis(numbers)) < 4.0 * np.sqrt(24.0) * deviation
    assert stats.kstest(numbers, "norm").pvalue > 1e-3
    beyond = np.array([np.count_nonzero(np.abs(numbers) > level) for level in (3.0, 4.0)])
    expected = 2.0 * special.ndtr([-3.0, -4.0]) * len(numbers)
    assert np.all(np.abs(beyond - expected) < 4.0 * np.sqrt(expected))


def test_gaussian_numbers_do_not_know_of_their_neighbours_channels_or_seeds() -> None:
    first = gaussian(5, 0, 0, 200_000)
    limit = 4.5 / np.sqrt(len(first))
    spectrum = np.abs(np.fft.rfft(first, 2 * len(first))) ** 2
    correlation = np.fft.irfft(spectrum)[1:1000] / len(first)
    assert np.max(np.abs(correlation)) < limit
    others = [
        gaussian(5, 1, 0, len(first)),
        gaussian(6, 0, 0, len(first)),
        gaussian(2**32 + 5, 0, 0, len(first)),
    ]
    others += [
        gaussian(5, 2**32, 0, len(first)),
        gaussian(5, 0, 2**32, len(first)),
        gaussian(0, 5, 0, len(first)),
    ]
    for numbers in [first, *others]:
        assert (
            np.count_nonzero(
                np.abs([np.dot(numbers, other) / len(first) for other in (first, *others)]) > limit
            )
            == 1
        )


def test_a_converter_rounds_to_its_levels_and_clips() -> None:
    volts = np.array([-11.0, -10.0, -9.9, -0.0024, 0.0, 0.0025, 9.9951, 9.9999, 11.0, np.nan])
    step = 20.0 / 4096
    expected = step * np.clip(np.round(volts / step), -2048, 2047)
    assert np.array_equal(digitised(volts, 10.0, 12), expected, equal_nan=True)


def test_a_reading_ends_at_its_range_and_only_there() -> None:
    values = np.array([-1.0, -0.003, 0.0, 0.002, 1.0, np.nan])
    plain = sensor_reading(values, 1000.0, 0.25)
    assert np.array_equal(plain, 1000.0 * values + 0.25, equal_nan=True)
    assert np.array_equal(
        sensor_reading(values, 1000.0, 0.25, 2.0), np.clip(plain, -2.0, 2.0), equal_nan=True
    )


@pytest.mark.parametrize(("side", "sign"), [("lower", 1.0), ("upper", -1.0)])
def test_an_exciter_pulls_less_at_a_distance(side: str, sign: float) -> None:
    volts, place = np.linspace(-2.0, 2.0, 21), np.linspace(-4e-3, 4e-3, 21)
    forces = exciter_force(volts, place, 0.5, 0.1, 5e-3, side)
    assert forces == pytest.approx((0.5 * volts + 0.1) / (1.0 + sign * place / 5e-3) ** 2, rel=1e-14)
    assert exciter_force(volts, place, 0.5, 0.1, 0.0, side) == pytest.approx(0.5 * volts + 0.1, rel=1e-15)


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("sensitivity: expected a finite number, got nan", lambda: LoadCell(np.nan)),
        ("natural_frequency: expected 0 or 1e-09 to 1e[+]07, got -1", lambda: LoadCell(1.0, -1.0)),
        ("contact_duration: expected 0 or 1e-09 to 1000, got inf", lambda: LoadCell(1.0, contact_duration=np.inf)),
        ("times: expected ascending", lambda: LoadCell(1.0).follow([1.0, 0.0], [0.0, 0.0])),
        ("expected finite numbers, got nan at place 1", lambda: LoadCell(1.0).follow([0.0, 1.0], [0.0, np.nan])),
        ("forces: expected as many as times", lambda: LoadCell(1.0).follow([0.0, 1.0], [0.0])),
        ("contact_duration: expected a number > 0", lambda: LoadCell(1.0).follow([0.0, 1.0], [0.0, 0.0], [0.5], [1.0])),
        (
            "impact_times: expected impacts from -inf to 1 s, got 1.5",
            lambda: LoadCell(1.0, contact_duration=1.0).follow([0.0, 1.0], [0.0, 0.0], [1.5], [1.0]),
        ),
        ("seed: expected 0 to", lambda: gaussian(-1, 0, 0, 1)),
        ("count: expected >= 0", lambda: gaussian(1, 0, 0, -1)),
        ("highest: expected a finite number > 0, got 0", lambda: digitised([1.0], 0.0, 12)),
        ("bits: expected 1 to 32, got 0", lambda: digitised([1.0], 1.0, 0)),
        ("highest: expected a finite number >= 0, got -1", lambda: sensor_reading([1.0], 1.0, 0.0, -1.0)),
        ("side: expected lower or upper, got 'left'", lambda: exciter_force([1.0], 0.0, 1.0, side="left")),
        ("does not touch .* got -0.01 m at sample 1", lambda: exciter_force([1.0, 1.0], [0.0, -0.01], 1.0, 0.0, 0.01)),
        ("numbers too large", lambda: LoadCell(1.0, 1e3).follow([0.0, 1.0], [1e308, -1e308])),
        ("displacement: expected one number or 2, got 3", lambda: exciter_force([1.0, 1.0], [0.0] * 3, 1.0)),
        ("row of numbers", lambda: digitised(np.zeros((2, 2)), 1.0, 12)),
    ],
)  # fmt: skip
def test_numbers_that_mean_nothing_are_refused(words: str, call: object) -> None:
    with pytest.raises(UsageError, match=words):
        call()  # type: ignore[operator]


def test_a_block_goes_on_where_the_last_ended() -> None:
    cell = LoadCell(1.0, contact_duration=DURATION)
    cell.follow([0.0, 1.0], [0.0, 0.0])
    assert cell.time == 1.0
    with pytest.raises(UsageError, match=r"times: expected none before 1 s, got 0\.5"):
        cell.follow([0.5], [0.0])
    with pytest.raises(UsageError, match=r"impact_times: expected impacts from 1 to 2 s, got 0\.9"):
        cell.follow([2.0], [0.0], [0.9], [1.0])
