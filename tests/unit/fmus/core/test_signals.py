"""Signals of time in the C core against 40 digits, other splines and laws of random numbers, and their refusals."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.interpolate import CubicSpline

from vibroimpact.fmus.core.signals import Pieces, Signal, SignalKind
from vibroimpact.fmus.errors import UsageError

Array = NDArray[np.float64]
HIGH = 100.0
INTERVAL = 2.0 * math.pi / (8.0 * HIGH)
#: Values of a random signal up to HIGH under seed 7, at the times 0, INTERVAL and 7.25.
RANDOM_BITS = ["-0x1.76d7fd2bcb31dp-1", "-0x1.fed1d28127ff0p-1", "0x1.5c912f3b8fda2p+0"]

CHIRPS = {
    "linear": (SignalKind.chirp_linear, 0.3, 3.0, 500.0, 100.0),
    "linear, down to rest": (SignalKind.chirp_linear, -1.0, 50.0, 0.0, 7.0),
    "linear, fast": (SignalKind.chirp_linear, 1.0, 1e5, 1e6, 1e4),
    "logarithmic": (SignalKind.chirp_logarithmic, 0.3, 3.0, 500.0, 100.0),
    "logarithmic, long and down": (SignalKind.chirp_logarithmic, 10.0, 500.0, 2.0, 1e5),
    "logarithmic, of one frequency": (SignalKind.chirp_logarithmic, 0.0, 2.0, 2.0, 10.0),
    "logarithmic, hardly": (SignalKind.chirp_logarithmic, 0.0, 2.0, 2.0 + 1e-12, 10.0),
}


def chirp_value(given: tuple[Any, ...], at: Any) -> Any:
    """Return cos(phase + 1/2) of a chirp with 40 digits."""
    kind, begin, first, last, duration = given
    since, w, end, span = (mpmath.mpf(number) for number in (at - begin, first, last, duration))
    if kind is SignalKind.chirp_linear:
        phase = w * since + (end - w) / span * since**2 / 2
    else:
        rate = mpmath.log(end / w) / span
        phase = w * mpmath.expm1(rate * since) / rate if rate else w * since
    return mpmath.cos(phase + mpmath.mpf(0.5))


def chirp(kind: SignalKind, begin: float, first: float, last: float, duration: float) -> Signal:
    return Signal(
        kind, start=begin, duration=duration, angular_frequency=first, end_angular_frequency=last, phase=0.5
    )


def value(pieces: Pieces, k: int, u: float) -> float:
    return float(np.polynomial.polynomial.polyval(u, pieces.coefficient[k]))


@pytest.mark.parametrize("given", CHIRPS.values(), ids=CHIRPS)
def test_a_chirp_is_that_of_forty_digits_also_at_its_end(given: tuple[Any, ...]) -> None:
    signal, (_, begin, *_, duration) = chirp(*given), given
    with mpmath.workdps(40):
        for part in (0.0, 0.1, 0.7, 0.999999):
            at = begin + part * duration
            got = signal.values([at])[0]
            assert abs(got - chirp_value(given, mpmath.mpf(at))) < 4e-16
        # pieces from a late place, where a phase of one number would have lost its digits
        pieces = signal.pieces(begin + 0.7 * duration, begin + duration, most=20)
        for k in range(len(pieces.length)):
            start = mpmath.mpf(pieces.start[k, 0]) + mpmath.mpf(pieces.start[k, 1])
            for u in (0.5 * pieces.length[k], pieces.length[k]):
                assert abs(value(pieces, k, u) - chirp_value(given, start + mpmath.mpf(u))) < 1.05e-13


def test_a_half_sine_is_exact_and_zero_outside() -> None:
    pulse = Signal(SignalKind.half_sine, start=0.1, duration=0.3)
    times = np.linspace(0.0, 0.5, 101)
    expected = np.where((times > 0.1) & (times < 0.4), np.sin(np.pi * (times - 0.1) / 0.3), 0.0)
    assert np.max(np.abs(pulse.values(times) - expected)) < 1e-15
    pieces = pulse.pieces(0.0, 1.0)
    assert pieces.length[0] == 0.1
    assert pieces.length[-1] == math.inf
    assert len(pieces.length) == 5
    assert pieces.start[-1].sum() == pytest.approx(0.4, abs=1e-16)


@pytest.mark.parametrize(
    ("kind", "rise", "knots"),
    [
        (SignalKind.triangle, 0.0, [(0.0, 0.0), (0.5, 1.0), (1.0, 0.0)]),
        (SignalKind.trapezoid, 0.25, [(0.0, 0.0), (0.25, 1.0), (0.75, 1.0), (1.0, 0.0)]),
        (SignalKind.trapezoid, 0.5, [(0.0, 0.0), (0.5, 1.0), (1.0, 0.0)]),
        (SignalKind.trapezoid, 0.0, [(0.0, 1.0), (1.0, 1.0)]),
    ],
)
def test_a_pulse_is_linear_between_its_kinks(
    kind: SignalKind, rise: float, knots: list[tuple[float, float]]
) -> None:
    pulse = Signal(kind, start=2.0, duration=1.0, rise=rise)
    at, height = np.transpose(knots)
    times = np.linspace(0.0, 4.0, 401)
    expected = np.interp(times - 2.0, at, height, left=0.0, right=0.0)
    expected[times >= 3.0] = 0.0
    assert np.max(np.abs(pulse.values(times) - expected)) < 1e-13
    assert pulse.pieces(0.0, 4.0).start[1:, 0].tolist() == [2.0 + place for place, _ in knots]


def test_a_cubic_table_is_the_natural_spline() -> None:
    rng = np.random.default_rng(3)
    times, values = np.cumsum(rng.uniform(1e-3, 1.0, 300)), rng.normal(size=300)
    at = rng.uniform(times[0], times[-1], 500)
    spline = CubicSpline(times, values, bc_type="natural")
    signal = Signal(SignalKind.table_cubic, start=5.0, places=times, values=values)
    assert np.max(np.abs(signal.values(at + 5.0) - spline((at + 5.0) - 5.0))) < 1e-9 * np.max(
        np.abs(spline(at))
    )
    pieces = signal.pieces(5.0 + times[0], 5.0 + times[-1])
    assert len(pieces.length) == 299
    slopes = pieces.coefficient[1:, 1] - spline(times[1:-1], 1)
    assert np.max(np.abs(slopes)) < 1e-9 * np.max(np.abs(spline(times, 1)))


def test_two_instants_make_a_straight_cubic_table() -> None:
    signal = Signal(SignalKind.table_cubic, places=[0.0, 2.0], values=[1.0, 5.0])
    assert signal.values([0.0, 0.5, 1.5]).tolist() == [1.0, 2.0, 4.0]


def test_pieces_pass_kinks_that_no_double_meets() -> None:
    at = [0.1 * k for k in range(1, 60)]
    signal = Signal(SignalKind.table, start=1e6, places=at, values=np.arange(59.0) % 3)
    pieces = signal.pieces(1e6, 1e6 + 7.0)
    assert len(pieces.length) == 60  # before, 58 intervals, after
    assert np.all(pieces.length > 0.09)


def random_signal(seed: int = 7, low: float = 0.0, **density: Any) -> Signal:
    return Signal(SignalKind.random, seed=seed, angular_frequency=low, end_angular_frequency=HIGH, **density)


def densities(signal: Signal, count: int, size: int) -> tuple[NDArray[np.floating[Any]], Array]:
    """Return the bins of size `size`, rad/s, and estimates of the one-sided density from `count` separate blocks."""
    values = signal.values(np.arange(count * size) * INTERVAL).reshape(count, size)
    window = np.hanning(size)
    spectrum = np.fft.rfft(values * window, axis=1)
    power: Array = np.abs(spectrum) ** 2 * INTERVAL / (np.pi * np.sum(window**2))
    return 2.0 * np.pi * np.fft.rfftfreq(size, INTERVAL), power


def test_a_density_lies_within_its_chi_square_interval_in_each_band() -> None:
    places, values = [0.0, 20.0, 60.0, 100.0], [1.0, 3.0, 0.5, 2.0]
    w, power = densities(random_signal(places=places, values=values), 244, 4096)
    expected = np.interp(w, places, values)
    for low in range(4, 96, 4):
        chosen = (w >= low) & (w < low + 4)
        ratio = power[:, chosen].mean() / expected[chosen].mean()
        # Hann's window: neighbouring bins count 1.94 times
        freedom = 2.0 * 244 * chosen.sum() / 1.94
        interval = stats.chi2.ppf([1e-4, 1.0 - 1e-4], freedom) / freedom
        assert interval[0] < ratio < interval[1]
    assert power[:, w > 1.05 * HIGH].mean() < 1e-5


def test_the_variance_is_the_integral_of_the_density_and_the_edges_are_sharp() -> None:
    signal = random_signal(low=40.0)
    values = signal.values(np.arange(400_000) * INTERVAL)
    assert np.var(values) == pytest.approx(1.0, rel=0.01)
    w, power = densities(signal, 90, 4096)
    assert power[:, w < 37.0].mean() < 1e-6 * power[:, (w > 42.0) & (w < 98.0)].mean()


def test_values_are_gaussian_also_across_the_seams_of_blocks() -> None:
    signal = random_signal()
    values = signal.values(np.arange(0, 200_000, 20) * INTERVAL * 0.997)
    assert stats.kstest(values, "norm").pvalue > 1e-3
    seam = 4092  # intervals of a block
    ends = np.arange(1, 120) * seam
    before, after = (signal.values((ends + shift) * INTERVAL) for shift in (-1, 1))
    inside, inside_after = (signal.values((ends + seam // 2 + shift) * INTERVAL) for shift in (-1, 1))
    expected = np.sin(2.0 * HIGH * INTERVAL) / (2.0 * HIGH * INTERVAL)
    for first, second in ((before, after), (inside, inside_after)):
        assert np.mean(first * second) == pytest.approx(expected, abs=4.0 / np.sqrt(119))
    # the spline has one value, slope and curvature from both sides of a seam
    pieces = signal.pieces((seam - 1) * INTERVAL, (seam + 1) * INTERVAL)
    left = np.polynomial.Polynomial(pieces.coefficient[0])
    for order in range(3):
        derivative = left.deriv(order) if order else left
        right = pieces.coefficient[1, order] * math.factorial(order)
        assert derivative(pieces.length[0]) == pytest.approx(right, rel=1e-10, abs=1e-10 * HIGH**order)


def test_any_instant_is_found_without_those_before_it() -> None:
    times = np.array([3e6, 10.0, 1e9, 3e6, 0.0, 10.0]) * INTERVAL * 1.1
    together = random_signal().values(times)
    alone = [random_signal().values([time])[0] for time in times]
    assert together.tolist() == alone
    assert not np.allclose(together, random_signal(seed=8).values(times))


def test_a_random_signal_has_the_same_bits_on_every_machine() -> None:
    values = random_signal().values([0.0, INTERVAL, 7.25])
    assert [number.hex() for number in values.tolist()] == RANDOM_BITS


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"kind": SignalKind.table, "places": [0, 1, 1], "values": [1, 2, 3]}, "ascend, got 1 as number 3"),
        ({"kind": SignalKind.table, "places": [0], "values": [1]}, "expected 2 to 8192 instants, got 1"),
        ({"kind": SignalKind.table, "places": [0, 1], "values": [1, math.nan]}, "got nan as number 2"),
        ({"kind": SignalKind.half_sine}, "signal.duration: expected a finite number > 0, got 0"),
        ({"kind": SignalKind.trapezoid, "duration": 1.0, "rise": 0.6}, "expected 0 to half of the duration"),
        (
            {"kind": SignalKind.chirp_logarithmic, "duration": 1.0, "end_angular_frequency": 1.0},
            "angular_frequency",
        ),
        ({"kind": SignalKind.random, "end_angular_frequency": 0.0}, "end_angular_frequency"),
        ({"kind": SignalKind.random, "angular_frequency": 99.9, "end_angular_frequency": 100.0}, "1/256"),
        (
            {"kind": SignalKind.random, "places": [0, 1], "values": [1, -1]},
            "finite values >= 0, got -1 as number 2",
        ),
        ({"kind": SignalKind.random, "places": [0, 1], "values": [0, 0]}, "finite variance > 0"),
        (
            {"kind": SignalKind.random, "end_angular_frequency": 2.0, "places": [0, 1], "values": [1, 1]},
            "a density over all the band, 0 to 2 rad/s",
        ),
    ],
)
def test_a_signal_that_is_none_is_refused_by_one_line(given: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as error:
        Signal(**given)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
