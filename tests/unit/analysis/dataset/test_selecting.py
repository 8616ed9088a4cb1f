"""Runs of an opened dataset are selected by the values of their sweep, and keep their rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.dataset_examples import (
    COMPARED,
    CONNECTIONS,
    coupled_dataset,
    coupled_record,
    dataset_of,
    everything,
    impact_rows,
    record,
    up_down,
    written,
)

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import (
    Direction,
    Outcome,
    RunRecord,
)
from vibroimpact.analysis.figures import draw
from vibroimpact.fmus.errors import DatasetError


def test_an_up_down_sweep_is_selected_by_direction_and_nearest_frequency(tmp_path: Path) -> None:
    with open_dataset(written(up_down(), tmp_path)) as opened:
        assert opened.displacement_range.dims == ("direction", "angular_frequency")
        found = opened.displacement_max.sel(direction="down").sel(angular_frequency=1.9, method="nearest")
        # On the way down, frequency 2 comes first: position 3 of the file.
        assert found.values.tolist() == [4.0, 4.0, 4.0]
        assert int(opened.run_id.sel(direction="down", angular_frequency=0.0)) == 5


def test_a_dataset_opened_by_xarray_alone_is_one_dimensional_with_the_sweep_as_coordinates(
    tmp_path: Path,
) -> None:
    with xr.open_dataset(written(up_down(), tmp_path)) as plain:
        assert plain.displacement_max.dims == ("run", "period")
        assert {"angular_frequency", "direction", "run_index"} <= set(plain.coords)
        assert plain.impact_time.dtype == np.float64


def test_a_campaign_folder_opens_as_its_dataset(tmp_path: Path) -> None:
    written(up_down(), tmp_path, "dataset.nc")
    with open_dataset(tmp_path) as opened:
        assert opened.sizes["angular_frequency"] == 3


def test_a_branch_in_one_direction_keeps_its_direction_as_a_dimension(tmp_path: Path) -> None:
    path = written(dataset_of([record(0.0), record(1.0)], direction=[Direction.up] * 2), tmp_path)
    with open_dataset(path) as opened:
        assert opened.displacement_range.sel(direction="up").dims == ("angular_frequency",)


def test_points_that_no_run_covers_are_missing(tmp_path: Path) -> None:
    runs = [record(float(k), impacts=1) for k in range(3)]
    grid = {"angular_frequency": np.array([1.0, 1.0, 2.0]), "position": np.array([0.1, 0.2, 0.1])}
    with open_dataset(written(dataset_of(runs, coordinates=grid), tmp_path)) as opened:
        hole = opened.sel(angular_frequency=2.0, position=0.2)
        assert int(hole.run_id) == -1
        assert int(hole.outcome) == -1
        assert int(hole.impact_count) == -1
        assert str(hole.message.values) == ""
        assert np.isnan(hole.displacement_range)
        with pytest.raises(DatasetError, match="expected one run, got none"):
            opened.vibroimpact.impacts(angular_frequency=2.0, position=0.2, exact=True)


def test_scattered_points_stay_along_run(tmp_path: Path) -> None:
    number = 50
    places = {"mass": np.linspace(1, 2, number), "position": np.linspace(3, 4, number)}
    path = written(
        dataset_of([record(float(k), impacts=1) for k in range(number)], coordinates=places), tmp_path
    )
    with open_dataset(path) as opened:
        assert opened.displacement_range.dims == ("run",)
        assert opened.vibroimpact.impacts(mass=2.0, position=4.0).impact_time.values.tolist() == [49.0]


def test_impacts_stay_with_their_run_under_any_selection(tmp_path: Path) -> None:
    with open_dataset(written(up_down(), tmp_path)) as opened:
        part = opened.sel(direction="down").isel(angular_frequency=slice(None, None, -1))
        # Frequency 1 on the way down is position 4 of the file, with 5 impacts from time 4 on.
        hits = part.vibroimpact.impacts(angular_frequency=1.1)
        np.testing.assert_array_equal(hits.impact_time, impact_rows(5, 4.0)[:, 0])
        np.testing.assert_array_equal(hits.impact_velocity, impact_rows(5, 4.0)[:, 2])
        assert float(hits.angular_frequency) == 1.0
        assert str(hits.direction.values) == "down"
        late = opened.isel(impact=opened.impact_time.values > 5.5)
        assert late.vibroimpact.impacts(direction="down", angular_frequency=1.0).impact_time.min() == 6.0


def test_sticks_and_samples_are_given_like_impacts(tmp_path: Path) -> None:
    with open_dataset(written(up_down(), tmp_path)) as opened:
        assert opened.vibroimpact.sticks(run_index=3).stick_end.values.tolist() == [3.5]
        assert opened.vibroimpact.samples(run_index=2).displacement.values.tolist() == [2.0, 2.0]


@pytest.mark.parametrize("selection", [{}, {"direction": "down"}, {"angular_frequency": slice(0.5, 2.5)}])
def test_what_is_saved_of_an_opened_dataset_opens_again(tmp_path: Path, selection: dict[str, object]) -> None:
    with open_dataset(written(up_down(), tmp_path)) as opened:
        chosen = opened.sel(selection)
        chosen.to_netcdf(tmp_path / "again.nc")
        with open_dataset(tmp_path / "again.nc") as again:
            xr.testing.assert_equal(again.load(), chosen.load())
            assert again.displacement_range.attrs == chosen.displacement_range.attrs
            hits = again.vibroimpact.impacts(direction="down", angular_frequency=1.0)
            assert hits.impact_time.min() == 4.0
            assert draw(again).axes


def test_samples_are_along_their_time(tmp_path: Path) -> None:
    with open_dataset(written(up_down(), tmp_path)) as opened:
        samples = opened.vibroimpact.samples(run_index=2)
        assert samples.displacement.dims == ("time",)
        assert samples.time.attrs["units"] == "s"
        first = float(samples.time[0])
        assert float(samples.displacement.sel(time=first)) == 2.0
        assert samples.displacement.plot(x="time") is not None


@pytest.mark.parametrize(
    ("value", "found"),
    [(0.4, 0.0), (-0.49, 0.0), (1.6, 2.0), (2.49, 2.0), (2.51, None), (-0.6, None), (99.0, None)],
)
def test_a_value_far_from_all_that_were_computed_names_no_run(value: float, found: float | None) -> None:
    selection = up_down().vibroimpact
    if found is None:
        with pytest.raises(DatasetError, match=f"expected a value of 0 to 2, got {value:g}. Give a value"):
            selection.impacts(direction="up", angular_frequency=value)
    else:
        assert float(selection.impacts(direction="up", angular_frequency=value).angular_frequency) == found


def test_a_parameter_with_one_value_is_asked_for_by_that_value() -> None:
    dataset = dataset_of([record(1.0, impacts=1)], coordinates={"mass": np.array([0.7])})
    assert float(dataset.vibroimpact.impacts(mass=0.7 * (1.0 + 1e-9)).mass) == 0.7
    with pytest.raises(DatasetError, match=r"mass: expected 0\.7, the only value there is, got 0\.8"):
        dataset.vibroimpact.impacts(mass=0.8)


def test_events_are_given_run_by_run_with_their_component_and_superdense_index(tmp_path: Path) -> None:
    runs = [coupled_record(float(k), events=k) for k in range(5)]
    with open_dataset(written(coupled_dataset(runs), tmp_path)) as opened:
        found = opened.vibroimpact.events(mass=2.9)
        assert found.event_time.values.tolist() == [3.0, 3.0, 4.0]
        assert found.event_index.values.tolist() == [0, 1, 0]
        assert found.event_component.values.tolist() == [1, 2, 1]
        assert found.event_component.attrs["flag_meanings"] == "body stop"
        assert float(found.mass) == 3.0
        part = opened.isel(mass=slice(None, None, -1), event=opened.event_index.values == 0)
        assert part.vibroimpact.events(mass=4.0).event_time.values.tolist() == [4.0, 5.0]
        assert opened.vibroimpact.events(mass=0.0).sizes["event"] == 0


def test_scores_of_replays_are_selected_by_what_was_compared(tmp_path: Path) -> None:
    opened = open_dataset(written(everything(), tmp_path))
    assert opened.variance_accounted_for.dims[-1] == "compared"
    assert opened.compared.values.tolist() == COMPARED
    assert opened.lag.sel(compared=COMPARED[0]).values[0] == 8.3e-3
    assert np.isnan(opened.polarity.sel(compared=COMPARED[1]).values[1])


def test_energy_residuals_are_selected_by_the_name_of_their_connection(tmp_path: Path) -> None:
    runs = [coupled_record(float(k)) for k in range(3)]
    runs[1] = RunRecord(Outcome.crash, "gone", *[None] * 3, runs[1].samples, *[np.nan] * 3, 0.0)
    with open_dataset(written(coupled_dataset(runs), tmp_path)) as opened:
        assert opened.energy_residual.dims == ("mass", "connection")
        assert opened.connection.values.tolist() == CONNECTIONS
        lost = opened.energy_residual.sel(connection=CONNECTIONS[1])
        np.testing.assert_array_equal(lost, [0.0, np.nan, -2e-9])
        np.testing.assert_array_equal(opened.loop_residual, [0.0, np.nan, 2e-12])
        assert opened.sel(connection=CONNECTIONS[0]).vibroimpact.samples(mass=2.0).sizes["time"] == 0
        assert opened.vibroimpact.runs.energy_residual.dims == ("run", "connection")


def test_the_accessor_serves_a_dataset_that_was_never_written() -> None:
    hits = up_down().vibroimpact.impacts(direction="up", angular_frequency=1.0)
    assert hits.impact_time.values.tolist() == [1.0, 2.0]


def test_runs_are_one_dimensional_in_file_order(tmp_path: Path) -> None:
    with open_dataset(written(up_down(), tmp_path)) as opened:
        runs = opened.vibroimpact.runs
        assert runs.displacement_max.dims == ("run", "period")
        assert runs.run_index.values.tolist() == list(range(6))
        assert runs.angular_frequency.values.tolist() == [0, 1, 2, 2, 1, 0]


@pytest.mark.parametrize(
    ("selection", "message"),
    [
        ({}, "got 6 for none. Give a value for direction, angular_frequency too"),
        ({"direction": "up"}, "got 3 for direction='up'. Give a value for angular_frequency too"),
        (
            {"frequency": 1.0},
            "expected names among angular_frequency, direction, run_id, run_index, got frequency",
        ),
        ({"direction": "up", "angular_frequency": 1.1, "exact": True}, "expected one run, got none"),
        ({"direction": "up", "angular_frequency": float("nan")}, "expected a number, got nan"),
    ],
)
def test_a_selection_that_is_not_one_run_says_what_is_needed(
    selection: dict[str, object], message: str
) -> None:
    with pytest.raises(DatasetError, match=message.replace("(", r"\(")):
        up_down().vibroimpact.impacts(**selection)


def test_asking_for_what_was_not_recorded_names_the_setting() -> None:
    run = record(1.0)
    run.samples = None
    with pytest.raises(DatasetError, match="Set time_series "):
        dataset_of([run]).vibroimpact.samples()


def test_asking_for_events_that_were_not_recorded_names_the_setting() -> None:
    dataset = dataset_of([record(1.0)])
    assert {"event_count", "energy_residual", "connection", "loop_residual"}.isdisjoint(dataset.variables)
    with pytest.raises(DatasetError, match="Set events = true under"):
        dataset.vibroimpact.events()
