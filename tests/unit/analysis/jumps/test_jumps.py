"""The class of each run, and the intervals between runs of two classes."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from support.campaign_scenes import swept_text

import vibroimpact as vi
from vibroimpact.analysis.dataset import Outcome
from vibroimpact.analysis.jumps import RunClasses, classes_of, jumps_of

SCENE = swept_text(transient_periods=200, recorded_periods=10)


def swept(line: str) -> xr.Dataset:
    return vi.run(vi.Scene.from_text(SCENE + line), progress=False)


@pytest.fixture(scope="module")
def dataset() -> xr.Dataset:
    """Return a sweep of runs from rest: no impact, P(2,2), P(1,2), P(1,1), no impact."""
    return swept('"forcing.angular_frequency" = { values = [1.5, 0.6, 0.78, 0.9, 1.1] }')


def classes(each: NDArray[np.float64], impacts: NDArray[np.float64] | None = None) -> RunClasses:
    """Return the classes of runs with these largest displacements and impacts in each period."""
    runs = {"outcome": ("run", np.zeros(len(each), dtype=np.int8))}
    periods = {"displacement_max": each, "displacement_min": -1.0 + 0.0 * each}
    periods |= {} if impacts is None else {"impacts_per_period": impacts}
    return classes_of(xr.Dataset(runs | {name: (("run", "period"), x) for name, x in periods.items()}))


def test_neighbours_of_two_motions_are_brackets_with_the_motion_on_each_side(dataset: xr.Dataset) -> None:
    jumps = jumps_of(dataset)
    assert jumps.below.values.tolist() == [0.6, 0.78, 0.9, 1.1]
    assert jumps.above.values.tolist() == [0.78, 0.9, 1.1, 1.5]
    assert jumps.period.values.tolist() == [[1, 2], [2, 2], [2, 1], [1, 1]]
    assert jumps.impacts.values.tolist() == [[0, 2], [2, 1], [1, 1], [1, 0]]
    assert set(jumps.direction.values.tolist()) == {"independent"}


def test_the_same_motion_further_along_is_no_jump_unless_its_range_is() -> None:
    found = swept('"forcing.angular_frequency" = { values = [1.0, 1.05, 1.1] }')
    assert jumps_of(found).sizes["jump"] == 0
    assert jumps_of(found, jump=0.01).sizes["jump"] == 2


def test_up_and_down_are_lines_of_their_own() -> None:
    found = swept('"forcing.angular_frequency" = { start = 1.2, stop = 1.6, points = 5, path = "up-down" }')
    jumps = jumps_of(found, jump=0.5)
    assert jumps.direction.values.tolist() == ["down", "up"]
    assert jumps.below.values == pytest.approx([1.2, 1.5])


def test_runs_that_failed_are_a_class_of_their_own(dataset: xr.Dataset) -> None:
    outcome = dataset.outcome.copy(data=dataset.outcome.values.copy())
    outcome[2] = Outcome.crash
    jumps = jumps_of(dataset.assign(outcome=outcome))
    assert jumps.period.values.tolist()[1:3] == [[2, 0], [0, 1]]


def test_one_value_for_all_periods_tells_no_motions_apart() -> None:
    text = SCENE.replace("recorded_periods = 10", "recorded_periods = 10\neach_period = false")
    line = '"forcing.angular_frequency" = { values = [0.6, 0.8] }'
    with pytest.raises(vi.VibroimpactError, match="expected values of each recorded period, got one for all"):
        jumps_of(vi.run(vi.Scene.from_text(text + line), progress=False))


def test_where_every_run_failed_there_is_no_jump() -> None:
    late = SCENE.replace("[sweep]", "[execution]\ndeadline = 1e-9\n[sweep]")
    line = '"forcing.angular_frequency" = { values = [0.6, 0.8, 1.0] }'
    found = vi.run(vi.Scene.from_text(late + line), progress=False)
    assert found.vibroimpact.runs.displacement_max.shape == (3, 0)
    assert jumps_of(found).sizes["jump"] == 0


@pytest.mark.parametrize(
    ("keys", "got"), [((), "none"), (("body.damping_ratio", "stop[1].position"), "damping_ratio, position")]
)
def test_another_number_of_swept_parameters_is_refused(keys: tuple[str, ...], got: str) -> None:
    found = swept("\n".join(f'"{key}" = {{ values = [0.5, 0.6] }}' for key in keys))
    with pytest.raises(vi.VibroimpactError, match=f"expected one swept parameter, got {got}"):
        jumps_of(found)


def test_an_orbit_has_the_shortest_period_within_half_of_what_was_recorded() -> None:
    once, twice = np.ones(6), np.tile([1.0, 1.2], 3)
    rising, thrice = np.arange(1.0, 7.0), np.tile([1.0, 1.1, 1.2], 2)
    four_times = np.array([1.0, 1.1, 1.2, 1.3, 1.0, 1.1])
    assert classes(np.stack([once, twice, thrice, four_times, rising])).label[:, 1].tolist() == [
        1,
        2,
        3,
        0,
        0,
    ]


def test_periods_that_differ_by_less_than_a_thousandth_are_the_same() -> None:
    near, far = 1.0 + np.array([[0.0, 9e-4] * 2, [0.0, 1.1e-3] * 2])
    assert classes(np.stack([near, far])).label[:, 1].tolist() == [1, 2]


def test_impacts_are_counted_over_one_round_of_the_orbit() -> None:
    twice, impacts = np.tile([1.0, 1.2], (1, 3)), np.tile([1.0, 2.0], (1, 3))
    assert classes(twice, impacts).label.tolist() == [[0, 2, 3]]
    assert classes(twice, impacts * np.inf).label.tolist() == [[0, 2, -2]]


def test_the_range_of_an_aperiodic_run_is_not_compared() -> None:
    found = classes(np.array([[1.0, 2.0, 4.0, 8.0], [1.0, 3.0, 9.0, 27.0], [2.0] * 4]))
    pairs = np.array([0, 0]), np.array([1, 2])
    assert np.isnan(found.extent).tolist() == [True, True, False]
    assert found.jump(*pairs, step=1e-3).tolist() == [False, True]


def test_what_is_not_a_number_repeats_nothing_and_warns_of_nothing() -> None:
    found = classes(np.array([[np.nan] * 4, [1.0, np.nan, 1.0, 1.0], [1.0] * 4]))
    assert found.label[:, 1].tolist() == [0, 0, 1]
