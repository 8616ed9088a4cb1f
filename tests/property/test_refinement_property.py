"""Points of adaptive sweeps for random motions: classes that change at random places."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vibroimpact.analysis.jumps import RunClasses
from vibroimpact.orchestrator.campaign.refinement import Known, Refined, cut_cells, halved_intervals

Floats = NDArray[np.float64]
Motion = Callable[[Floats], NDArray[np.int64]]
"""Function from points to the class of their motion, shape (point, axis)."""

STEP = 1.0
unit = st.floats(0.0, 1.0)


def known(values: Floats, motion: Motion, direction: NDArray[np.int64] | None = None) -> Known:
    label = np.zeros((len(values), 3), dtype=np.int64)
    label[:, 2] = motion(values)
    along = np.zeros(len(values), dtype=np.int64) if direction is None else direction
    return Known(values, along, RunClasses(label, np.full(len(values), np.nan)))


def rounds(
    start: Floats, motion: Motion, refine: Callable[[Known, int], Refined], at_most: int
) -> tuple[Floats, int]:
    """Return all points of an adaptive sweep, and the number of places without room for a point."""
    values = start
    while True:
        refined = refine(known(values, motion), at_most - len(values))
        if not len(refined.values):
            return values, refined.left
        values = np.concatenate([values, refined.values])


def steps_at(places: list[float]) -> Motion:
    return lambda values: np.searchsorted(np.sort(places), values[:, 0]).astype(np.int64)


@given(
    places=st.lists(unit, max_size=6),
    first=st.integers(2, 20),
    power=st.integers(2, 30),
    at_most=st.integers(2, 400),
)
def test_jumps_are_bracketed_down_to_the_tolerance_and_not_below(
    places: list[float], first: int, power: int, at_most: int
) -> None:
    tolerance, motion = 2.0**-power, steps_at(places)
    start = np.linspace(0.0, 1.0, first)[:, None]
    values, left = rounds(
        start,
        motion,
        lambda there, room: halved_intervals(there, 0, tolerance, STEP, room),
        max(at_most, first),
    )
    ordered = np.sort(values[:, 0])[:, None]
    width, jumps = np.diff(ordered[:, 0]), np.diff(motion(ordered)) != 0
    assert len(np.unique(ordered)) == len(values) <= max(at_most, first)
    assert np.sum(jumps & (width > tolerance)) == left
    assert width.min() > 0.5 * min(tolerance, 1.0 / (first - 1)) * (1.0 - 1e-9)
    # each jump costs no more than its halvings
    halvings = max(0, math.ceil(math.log2(1.0 / (first - 1) / tolerance) + 1e-9))
    assert len(values) <= first + halvings * len(set(places))


@given(
    places=st.lists(unit, min_size=1, max_size=6),
    first=st.integers(3, 12),
    seed=st.integers(0, 99),
    room=st.integers(0, 9),
)
def test_the_next_round_does_not_depend_on_the_order_in_which_points_are_known(
    places: list[float], first: int, seed: int, room: int
) -> None:
    source = np.random.default_rng(seed)
    lines = np.array([[x, other] for other in (0.0, 1.0) for x in np.linspace(0.0, 1.0, first)])
    values, direction = np.concatenate([lines, lines]), np.repeat([1, 2], len(lines))
    mixed = source.permutation(len(values))
    one, other = (
        halved_intervals(known(values[order], steps_at(places), direction[order]), 0, 1e-3, STEP, room)
        for order in (np.arange(len(values)), mixed)
    )
    assert np.array_equal(one.values, other.values)
    assert np.array_equal(one.direction, other.direction)
    assert one.left == other.left
    assert np.array_equal(mixed[other.below], one.below)
    assert np.array_equal(mixed[other.above], one.above)


def half_planes_and_discs(
    lines: list[tuple[float, float]], discs: list[tuple[float, float, float]]
) -> Motion:
    def motion(values: Floats) -> NDArray[np.int64]:
        x, y = values.T
        found = np.zeros(len(values), dtype=np.int64)
        for bit, (angle, offset) in enumerate(lines):
            found += (math.cos(angle) * (x - 0.5) + math.sin(angle) * (y - 0.5) > offset - 0.5).astype(
                np.int64
            ) << bit
        for bit, (across, along, radius) in enumerate(discs, start=len(lines)):
            found += (np.hypot(x - across, y - along) < radius).astype(np.int64) << bit
        return found

    return motion


@settings(max_examples=30)
@given(
    lines=st.lists(st.tuples(st.floats(0.0, 6.28), unit), max_size=2),
    discs=st.lists(st.tuples(unit, unit, st.floats(0.36, 0.6)), max_size=2),
)
def test_the_border_of_each_region_that_first_values_see_is_found_all_along(
    lines: list[tuple[float, float]], discs: list[tuple[float, float, float]]
) -> None:
    """Half planes and discs larger than a diagonal of a first cell: no island lies between first values."""
    motion, cells, cuts = half_planes_and_discs(lines, discs), 2, 4
    finest = np.linspace(0.0, 1.0, cells * 2**cuts + 1)
    first = finest[:: 2**cuts].tolist()
    tolerance = (1.01 * float(finest[1]),) * 2
    start = np.array([(x, y) for x in first for y in first])
    values, left = rounds(
        start, motion, lambda there, room: cut_cells(there, (first, first), tolerance, STEP, room), 10**6
    )
    there = set(map(tuple, values.tolist()))
    assert left == 0
    assert len(there) == len(values) <= finest.size**2
    grid = np.array([(x, y) for x in finest for y in finest])
    label = motion(grid).reshape(finest.size, finest.size)
    missed = [
        ((x, y), (finest[i + right], finest[j + up]))
        for i, x in enumerate(finest.tolist())
        for j, y in enumerate(finest.tolist())
        for right, up in ((1, 0), (0, 1))
        if i + right < finest.size and j + up < finest.size and label[i, j] != label[i + right, j + up]
        if not {(x, y), (float(finest[i + right]), float(finest[j + up]))} <= there
    ]
    assert not missed


@given(at_most=st.integers(9, 60), angle=st.floats(0.0, 6.28))
def test_a_plane_never_has_more_points_than_it_may_have(at_most: int, angle: float) -> None:
    first = [0.0, 0.5, 1.0]
    start = np.array([(x, y) for x in first for y in first])
    motion = half_planes_and_discs([(angle, 0.5)], [])
    values, left = rounds(
        start, motion, lambda there, room: cut_cells(there, (first, first), (1e-3, 1e-3), STEP, room), at_most
    )
    assert len(values) <= at_most
    assert left > 0
    assert all(low < high for low, high in pairwise(sorted(map(tuple, values.tolist()))))
