"""Points are added where a response jumps, down to the tolerance and not below, for any response."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from vibroimpact.analysis.jumps import RunClasses
from vibroimpact.orchestrator.campaign.refinement import Known, Refined, cut_cells, halved_intervals

Response = Callable[[NDArray[np.float64]], tuple[NDArray[np.int64], NDArray[np.float64]]]


def known(values: NDArray[np.float64], response: Response) -> Known:
    label, extent = response(values)
    classes = RunClasses(np.repeat(label[:, None], 3, axis=1), extent)
    return Known(values, np.zeros(len(values), dtype=np.int64), classes)


def refined(
    start: NDArray[np.float64], response: Response, step: Callable[[Known], Refined]
) -> tuple[Known, Refined]:
    """Return all points of the finished refinement, and the last round."""
    points = known(start, response)
    while len((more := step(points)).values):
        points = known(np.concatenate([points.values, more.values]), response)
    return points, more


def steps_at(places: list[float]) -> Response:
    return lambda values: (np.searchsorted(places, values[:, 0]), np.zeros(len(values)))


places_of_steps = st.lists(st.floats(0.001, 0.999), min_size=1, max_size=6, unique=True).map(sorted)


@given(places_of_steps, st.integers(2, 30), st.floats(1e-9, 1e-2))
def test_every_step_is_bracketed_to_the_tolerance_and_not_below(
    places: list[float], points: int, tolerance: float
) -> None:
    start = np.linspace(0.0, 1.0, points)[:, None]
    found, last = refined(start, steps_at(places), lambda k: halved_intervals(k, 0, tolerance, 1.0, 10**6))
    values = np.sort(found.values[:, 0])
    jumps = np.diff(np.searchsorted(places, values)) > 0
    assert np.diff(values)[jumps].max(initial=0.0) <= tolerance
    assert jumps.any()
    assert np.diff(values).min() > 0.5 * min(tolerance, 1.0 / (points - 1)) * (1.0 - 1e-6)
    halvings = np.ceil(np.log2(1.0 / ((points - 1) * tolerance))) if tolerance < 1.0 / (points - 1) else 0
    assert len(values) <= points + len(places) * halvings
    assert last.left == 0


@given(st.floats(0.01, 0.99), st.floats(1e-6, 1e-2))
def test_a_steep_slope_is_no_jump_once_its_points_are_near_enough(place: float, width: float) -> None:
    def slope(values: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        return np.zeros(len(values), dtype=np.int64), np.clip((values[:, 0] - place) / width, 0.0, 1.0)

    start = np.linspace(0.0, 1.0, 11)[:, None]
    found, _ = refined(start, slope, lambda k: halved_intervals(k, 0, 1e-12, 0.05, 10**6))
    assert np.abs(np.diff(np.sort(found.classes.extent))).max() <= 0.05
    assert len(found.values) < 200


@given(places_of_steps, st.integers(0, 40))
def test_no_more_points_come_than_there_is_room_for(places: list[float], room: int) -> None:
    points = known(np.linspace(0.0, 1.0, 7)[:, None], steps_at(places))
    more = halved_intervals(points, 0, 1e-6, 1.0, room)
    unlimited = halved_intervals(points, 0, 1e-6, 1.0, 10**6)
    assert len(more.values) == min(room, len(unlimited.values))
    assert more.left == len(unlimited.values) - len(more.values)


@given(st.permutations(range(12)), places_of_steps)
def test_the_next_points_do_not_depend_on_the_order_of_the_rows(
    order: list[int], places: list[float]
) -> None:
    start = np.linspace(0.0, 1.0, 12)[:, None]
    one, other = (
        halved_intervals(known(values, steps_at(places)), 0, 1e-3, 1.0, 5) for values in (start, start[order])
    )
    assert (one.values == other.values).all()


def test_what_is_not_compared_is_no_jump() -> None:
    aperiodic = lambda values: (np.zeros(len(values), dtype=np.int64), np.full(len(values), np.nan))  # noqa: E731
    points = known(np.linspace(0.0, 1.0, 9)[:, None], aperiodic)
    assert len(halved_intervals(points, 0, 1e-3, 0.0, 100).values) == 0


@given(st.floats(0.2, 0.8), st.floats(0.2, 0.8), st.floats(0.15, 0.6), st.floats(0.4, 2.0))
def test_the_border_of_a_region_lies_in_cells_no_larger_than_the_tolerance(
    x: float, y: float, radius: float, ratio: float
) -> None:
    def inside(values: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        distance = np.hypot(values[:, 0] - x, (values[:, 1] - y) * ratio)
        return (distance < radius).astype(np.int64), np.zeros(len(values))

    axis = np.linspace(0.0, 1.0, 9).tolist()
    tolerance = (1.0 / 64.0, 1.0 / 32.0)
    start = np.array([(a, b) for a in axis for b in axis])
    found, last = refined(start, inside, lambda k: cut_cells(k, (axis, axis), tolerance, 1.0, 10**6))
    # on each line of the finest lattice, gaps between two classes are at most as wide as the tolerance
    for line in axis:
        along = found.values[:, 1] == line
        order = np.argsort(found.values[along, 0])
        label = found.classes.label[along, 0][order]
        gaps = np.diff(found.values[along, 0][order])
        assert (gaps[np.diff(label) != 0] <= tolerance[0]).all()
    assert len(found.values) < 0.7 * 65 * 33
    assert last.left == 0
