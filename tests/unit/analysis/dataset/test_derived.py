"""Each derived quantity of a run is the extreme, or the mean, of that run's rows alone."""

from __future__ import annotations

import numpy as np
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.analysis.dataset.derived import (
    DERIVED,
    largest_impact_velocity,
    largest_of_runs,
    mean_of_periods,
    range_over_periods,
)

VELOCITIES = st.lists(st.lists(st.floats(0.0, 1e6), max_size=4), max_size=5)


@given(VELOCITIES)
def test_the_largest_impact_is_that_of_the_run_itself(velocities: list[list[float]]) -> None:
    owner = np.repeat(np.arange(len(velocities)), [len(each) for each in velocities])
    found = largest_of_runs(owner, np.concatenate([[], *velocities]), len(velocities))
    np.testing.assert_array_equal(found, [max(each, default=np.nan) for each in velocities])


@given(VELOCITIES, st.data())
def test_selected_runs_keep_their_largest_impact_wherever_they_stand(
    velocities: list[list[float]], data: st.DataObject
) -> None:
    # a selection keeps all rows of impacts, and -1 is a point of the grid without a run
    chosen = data.draw(st.lists(st.integers(-1, len(velocities) - 1), max_size=6))
    dataset = xr.Dataset(
        {
            "run_id": ("mass", np.array(chosen, dtype=np.int32)),
            "impact_run": (
                "impact",
                np.repeat(np.arange(len(velocities)), [len(each) for each in velocities]),
            ),
            "impact_velocity": ("impact", np.concatenate([[], *velocities])),
        }
    )
    found = largest_impact_velocity(dataset)
    assert found.dims == ("mass",)
    expected = [np.nan if run < 0 else max(velocities[run], default=np.nan) for run in chosen]
    np.testing.assert_array_equal(found, expected)


def test_periods_without_values_count_neither_for_the_mean_nor_for_the_range() -> None:
    impacts = np.array([[2.0, np.nan, 1.0], [0.0, 0.0, 0.0], [np.nan, np.nan, np.nan]])
    np.testing.assert_array_equal(mean_of_periods(impacts), [1.5, np.nan, np.nan])
    highest, lowest = np.array([[1.0, np.nan], [np.nan, np.nan]]), np.array([[-1.0, -2.0], [np.nan, np.nan]])
    np.testing.assert_array_equal(range_over_periods(highest, lowest), [3.0, np.nan])


def test_a_quantity_needs_all_its_sources_and_has_a_value_for_each_run() -> None:
    columns = {
        "displacement_max": np.array([[1.0, 3.0], [0.0, 0.0]]),
        "displacement_min": np.array([[-1.0, 0.0], [0.0, 0.0]]),
        "impact_count": np.array([2, 0]),
        "impact_velocity": np.array([0.5, 0.25]),
        "impacts_per_period": np.array([[2.0, 0.0], [0.0, 0.0]]),
    }
    expected = ([4.0, 0.0], [0.5, np.nan], [1.0, np.nan])
    for quantity, values in zip(DERIVED, expected, strict=True):
        assert quantity.is_from(columns)
        np.testing.assert_array_equal(quantity.values(columns), values)
        for source in quantity.sources:
            assert not quantity.is_from(columns.keys() - {source})
