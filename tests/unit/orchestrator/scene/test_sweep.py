"""Sweeps expand into branches and points in one documented order."""

from __future__ import annotations

import math
import pickle
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.run.points import columns_of_points
from vibroimpact.orchestrator.scene import parse_scene
from vibroimpact.orchestrator.scene.sweep import (
    Branch,
    SpacedValues,
    SweepAxis,
    SweepPath,
    axis_of_range,
    expand,
    first_runs,
    log_axis,
    run_count,
)

FREQUENCY = "forcing.angular_frequency"
POSITION = "stop[1].position"
MASS = "body.mass"


@dataclass(frozen=True)
class Swept:
    """The part of a scene that `expand` reads."""

    sweep: tuple[SweepAxis, ...] = ()


def frequencies(branch: Branch) -> list[float]:
    return [point.values[FREQUENCY] for point in branch.points]


def indices(branches: Sequence[Branch]) -> list[int]:
    return [point.index for branch in branches for point in branch.points]


def test_a_scene_without_a_sweep_is_one_point() -> None:
    (branch,) = expand(Swept())
    assert branch.direction == "independent"
    assert [(point.index, dict(point.values)) for point in branch.points] == [(0, {})]


def test_independent_axes_make_one_flat_branch_with_the_last_key_fastest() -> None:
    (branch,) = expand(Swept((SweepAxis(MASS, (1.0, 2.0)), SweepAxis(FREQUENCY, (0.6, 0.7, 0.8)))))
    assert branch.direction == "independent"
    assert branch.fixed == {}
    expected = [(mass, frequency) for mass in (1.0, 2.0) for frequency in (0.6, 0.7, 0.8)]
    assert [(point.values[MASS], point.values[FREQUENCY]) for point in branch.points] == expected
    assert indices((branch,)) == list(range(6))


@pytest.mark.parametrize(("path", "travelled"), [("up", [0.6, 0.7, 0.8]), ("down", [0.8, 0.7, 0.6])])
def test_a_path_is_travelled_in_its_direction(path: str, travelled: list[float]) -> None:
    (branch,) = expand(Swept((SweepAxis(FREQUENCY, (0.6, 0.7, 0.8), path),)))  # type: ignore[arg-type]
    assert branch.direction == path
    assert frequencies(branch) == travelled
    assert indices((branch,)) == [0, 1, 2]


def test_up_down_is_an_up_branch_and_a_down_branch_that_starts_at_the_top() -> None:
    up, down = expand(Swept((SweepAxis(FREQUENCY, (0.6, 0.7, 0.8), "up-down"),)))
    assert (up.direction, frequencies(up)) == ("up", [0.6, 0.7, 0.8])
    assert (down.direction, frequencies(down)) == ("down", [0.8, 0.7, 0.6])
    assert indices((up, down)) == list(range(6))


def test_other_keys_span_the_branches_of_a_continuation_wherever_it_stands_in_the_file() -> None:
    carried = SweepAxis(FREQUENCY, (0.6, 0.7), "up-down")
    branches = expand(Swept((carried, SweepAxis(MASS, (1.0, 2.0)), SweepAxis(POSITION, (0.0, 0.5)))))
    assert [(branch.fixed[MASS], branch.fixed[POSITION], branch.direction) for branch in branches] == [
        (mass, position, direction)
        for mass in (1.0, 2.0)
        for position in (0.0, 0.5)
        for direction in ("up", "down")
    ]
    assert indices(branches) == list(range(16))
    assert all(point.values.keys() == {FREQUENCY, MASS, POSITION} for point in branches[0].points)


def test_points_are_a_sequence_that_can_be_cut_into_chunks() -> None:
    (branch,) = expand(Swept((SweepAxis(MASS, (1.0, 2.0)), SweepAxis(FREQUENCY, (0.6, 0.7, 0.8)))))
    assert tuple(branch.points) == branch.points[:]
    assert branch.points[2:4] == (branch.points[2], branch.points[3])
    assert branch.points[-1].index == 5
    with pytest.raises(IndexError):
        branch.points[6]


def test_a_hundred_million_points_are_not_held_in_memory() -> None:
    axis = tuple(float(value) for value in range(10_000))
    (branch,) = expand(Swept((SweepAxis(MASS, axis), SweepAxis(FREQUENCY, axis))))
    assert len(branch.points) == 10**8
    assert branch.points[10**8 - 1].values == {MASS: 9999.0, FREQUENCY: 9999.0}


def test_run_count_counts_both_ways_of_up_down() -> None:
    assert run_count(()) == 1
    assert run_count((SweepAxis(MASS, (1.0, 2.0)), SweepAxis(FREQUENCY, (0.6, 0.7, 0.8), "up-down"))) == 12


def test_branches_travel_to_workers() -> None:
    branches = expand(Swept((SweepAxis(FREQUENCY, (0.6, 0.7), "up-down"),)))
    assert pickle.loads(pickle.dumps(branches)) == branches


@pytest.mark.parametrize("path", ["independent", "up"])
def test_a_range_of_a_million_values_is_a_short_message_to_a_worker(path: SweepPath) -> None:
    axis = axis_of_range("body.mass", 1.0, 2.0, 10**6, path)
    message = pickle.dumps(axis)
    assert len(message) < 200
    axis_of_range.cache_clear()
    assert pickle.loads(message) == axis


@given(st.floats(1e-300, 1e300), st.floats(1e-300, 1e300), st.integers(2, 50), st.sampled_from([1.0, -1.0]))
def test_values_of_a_logarithmic_range_keep_one_ratio_and_both_ends(
    start: float, stop: float, points: int, sign: float
) -> None:
    axis = log_axis("body.stiffness", sign * start, sign * stop, points, "independent")
    assert (axis.values[0], axis.values[-1]) == (sign * start, sign * stop)
    logarithms = np.log(np.abs(axis.values))
    assert np.diff(logarithms) == pytest.approx(
        (math.log(stop) - math.log(start)) / (points - 1), rel=1e-9, abs=1e-12
    )


def test_a_logarithmic_range_in_a_scene_and_what_is_none() -> None:
    text = "[body]\nmass = 1\nstiffness = 1\n[record]\nrecorded_time = 1\n[sweep]\n"
    scene = parse_scene(text + '"body.stiffness" = {start = 1, stop = 1e6, points = 7, spacing = "log"}', "a")
    assert scene.sweep[0].values == (1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6)
    for entry, message in (
        (
            '{start = -1, stop = 1, points = 3, spacing = "log"}',
            "expected ends that are both > 0, or both < 0",
        ),
        (
            '{start = 0, stop = 1, points = 3, spacing = "log"}',
            "expected ends that are both > 0, or both < 0",
        ),
        ('{values = [1.0, 2.0], spacing = "log"}', "expected a range beside spacing, got values"),
        ('{start = 1, stop = 2, points = 3, spacing = "cubic"}', 'got "cubic"'),
    ):
        with pytest.raises(SceneError, match=re.escape(message)):
            parse_scene(f'{text}"body.velocity_start" = {entry}', "a")


numbers = st.floats(-1e300, 1e300)


@given(start=numbers, stop=numbers, points=st.integers(2, 40))
def test_values_on_access_have_the_bits_of_listed_ones(start: float, stop: float, points: int) -> None:
    listed = axis_of_range(MASS, start, stop, points, "independent").values
    spaced = SpacedValues(start, stop, points)
    assert np.array(list(spaced)).tobytes() == np.array(listed).tobytes()
    assert list(spaced[::-1]) == list(listed)[::-1]
    assert [spaced[place] for place in range(-points, points)] == [*listed, *listed]
    assert spaced[1:-1] == listed[1:-1]
    assert spaced.differ == (len(set(listed)) == points)
    with pytest.raises(IndexError):
        spaced[points]


def test_a_range_of_a_hundred_million_values_is_not_held_in_memory() -> None:
    axis = axis_of_range(MASS, 2.0, 1.0, 10**8, "up-down")
    up, down = expand(Swept((axis,)))
    assert (up.points[0].values, down.points[0].values) == ({MASS: 1.0}, {MASS: 2.0})
    assert (axis.lowest, axis.highest, down.points.first_index) == (1.0, 2.0, 10**8)
    assert pickle.loads(pickle.dumps(axis)) == axis
    assert len(pickle.dumps(axis)) < 1000


lists = st.lists(st.floats(-9, 9), min_size=1, max_size=4).map(tuple)


@given(st.data(), lists, lists, lists, st.sampled_from(["up", "down", "up-down"]))
def test_columns_of_many_branches_are_those_of_each_branch(
    data: st.DataObject, masses: Any, frequencies: Any, positions: Any, path: SweepPath
) -> None:
    axes = (SweepAxis(MASS, masses), SweepAxis(FREQUENCY, frequencies, path), SweepAxis(POSITION, positions))
    branches, runs = expand(Swept(axes)), run_count(axes)
    first = data.draw(st.integers(0, runs - 1))
    stop = data.draw(st.integers(first + 1, runs))
    together, one_by_one = (columns_of_points(each, first, stop) for each in (branches, tuple(branches)))
    assert {key: column.tolist() for key, column in together.values.items()} == {
        key: column.tolist() for key, column in one_by_one.values.items()
    }
    for name in ("direction", "index", "first"):
        np.testing.assert_array_equal(getattr(together, name), getattr(one_by_one, name))
    assert list(first_runs(branches)) == first_runs(tuple(branches))
