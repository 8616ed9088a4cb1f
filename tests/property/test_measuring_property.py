"""Laws of the measuring chain: no cut of time changes it, impulses are conserved, steps bound a converter's error."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from vibroimpact.fmus.core.measuring import LoadCell, digitised, exciter_force, gaussian, sensor_reading

Array = NDArray[np.float64]

cells = st.tuples(
    st.floats(1e-3, 1e3),  # sensitivity
    st.sampled_from([0.0, 3.0, 50.0, 500.0, 1e4]) | st.floats(1.0, 1e5),  # natural frequency
    st.sampled_from([0.0, 1.0]) | st.floats(0.0, 5.0),  # damping ratio
    st.floats(-1.0, 1.0),  # offset
    st.floats(-1.0, 1.0),  # drift
    st.sampled_from([1e-3, 1e-2]) | st.floats(1e-5, 0.1),  # contact duration
)
forces = arrays(np.float64, 30, elements=st.floats(-100.0, 100.0, allow_subnormal=False))
hits = st.lists(st.tuples(st.floats(0.0, 0.29), st.floats(-1.0, 1.0)), max_size=12).map(sorted)
close_hits = st.lists(st.tuples(st.floats(0.0, 0.03), st.floats(-1.0, 1.0)), max_size=12).map(sorted)


def arranged(found: list[tuple[float, float]]) -> tuple[Array, Array]:
    return np.array([time for time, _ in found]), np.array([impulse for _, impulse in found])


@settings(max_examples=150, deadline=None)
@given(cells, forces, hits, st.lists(st.floats(0.0, 0.29), max_size=20))
def test_no_cut_of_the_time_changes_what_a_load_cell_says(
    cell: tuple[float, ...], force: Array, found: list[tuple[float, float]], cuts: list[float]
) -> None:
    times = 0.01 * np.arange(len(force))
    at, impulses = arranged(found)
    whole = LoadCell(*cell).follow(times, force, at, impulses)
    fine = np.unique([*times, *cuts])
    inside, divided, begin = LoadCell(*cell), [], -1.0
    for block in np.array_split(fine, 5):
        now = (at > begin) & (at <= block[-1])
        divided.append(inside.follow(block, np.interp(block, times, force), at[now], impulses[now]))
        begin = block[-1]
    together = np.concatenate(divided)[np.searchsorted(fine, times)]
    load = np.abs(force).max() + np.sum(np.abs(impulses)) / cell[5]
    # resonance amplifies both alike
    size = cell[0] * (load * 10.0) * (1.0 + cell[1] * 0.3) + 1.0
    np.testing.assert_allclose(together, whole, rtol=0.0, atol=1e-12 * size)


@settings(max_examples=60, deadline=None)
@given(st.floats(20.0, 5e3), st.floats(0.05, 3.0), st.floats(1e-4, 0.02), close_hits)
def test_a_load_cell_shows_the_impulse_that_it_was_given(
    natural: float, ratio: float, duration: float, found: list[tuple[float, float]]
) -> None:
    at, impulses = arranged(found)
    w = 2.0 * np.pi * natural
    cell = LoadCell(2.0, natural, ratio, contact_duration=duration)
    # from y'' + 2 ratio w y' + w^2 y = w^2 F: y and F have the same integral once y is at rest again
    slowest = w * (ratio - np.sqrt(ratio * ratio - 1.0)) if ratio > 1.0 else ratio * w
    end = 0.03 + duration + 60.0 / slowest
    integral = seen_integral(cell, at, impulses, end, w)
    assert abs(integral - np.sum(impulses)) <= 1e-11 * (1e-3 + np.sum(np.abs(impulses)))


def seen_integral(cell: LoadCell, at: Array, impulses: Array, end: float, w: float) -> float:
    """Return the integral of output / sensitivity until rest, by Gauss-Legendre points between all edges of pulses."""
    duration = cell._settings.contact_duration
    edges = np.unique([0.0, *at, *(at + duration), end])
    nodes, weights = np.polynomial.legendre.leggauss(20)
    points, shares = [], []
    for begin, stop in pairwise(edges):
        parts = max(1, int(np.ceil((stop - begin) * max(w, 1.0 / duration))))
        width = (stop - begin) / parts
        middle = begin + width * (np.arange(parts) + 0.5)
        points.append((middle[:, None] + 0.5 * width * nodes).ravel())
        shares.append(np.tile(0.5 * width * weights, parts))
    times = np.concatenate(points)
    volts = cell.follow(times, np.zeros_like(times), at, impulses)
    return float(np.dot(np.concatenate(shares), volts)) / cell._settings.sensitivity


@given(
    arrays(np.float64, 20, elements=st.floats(-30.0, 30.0)), st.floats(1e-3, 20.0), st.integers(1, 32)
)  # fmt: skip
def test_a_converter_is_wrong_by_half_a_step_at_most_or_clips(
    volts: Array, highest: float, bits: int
) -> None:
    step = 2.0 * highest / 2.0**bits
    levels = digitised(volts, highest, bits)
    inside = (volts >= -highest) & (volts <= highest - step)
    room = 1e-15 * highest
    assert np.all(np.abs(levels - volts)[inside] <= 0.5 * step + room)
    assert np.all(levels[volts > highest - step] == highest - step)
    assert np.all(levels[volts < -highest] == -highest)
    assert np.array_equal(digitised(levels, highest, bits), levels)


@given(
    st.integers(0, 2**64 - 1), st.integers(0, 2**64 - 1), st.integers(0, 2**63), st.lists(st.integers(0, 40))
)
def test_no_cut_changes_a_bit_of_the_noise(seed: int, channel: int, first: int, cuts: list[int]) -> None:
    whole = gaussian(seed, channel, first, 40)
    edges = sorted({0, 40, *cuts})
    parts = [gaussian(seed, channel, first + a, b - a) for a, b in pairwise(edges)]
    assert np.array_equal(np.concatenate(parts), whole)
    assert np.all(np.abs(whole) < 8.4)


@given(
    arrays(np.float64, 10, elements=st.floats(-1e3, 1e3)),
    st.floats(-1e3, 1e3), st.floats(-10.0, 10.0), st.floats(0.0, 10.0),
)  # fmt: skip
def test_a_reading_is_in_its_range_and_linear_inside(
    values: Array, gain: float, offset: float, highest: float
) -> None:
    volts = sensor_reading(values, gain, offset, highest)
    plain = gain * values + offset
    assert np.array_equal(volts, np.clip(plain, -highest, highest) if highest > 0.0 else plain)


@given(
    arrays(np.float64, 10, elements=st.floats(-0.9e-3, 0.9e-3)), st.floats(-10.0, 10.0), st.floats(-1.0, 1.0)
)  # fmt: skip
def test_an_exciter_above_is_one_below_turned_over(place: Array, gain: float, offset: float) -> None:
    volts = np.linspace(-1.0, 1.0, 10)
    below = exciter_force(volts, place, gain, offset, 1e-3, "lower")
    assert np.array_equal(below, exciter_force(volts, -place, gain, offset, 1e-3, "upper"))
