"""Datasets that break the schema are refused or marked, with every problem named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.dataset_examples import (
    CONNECTIONS,
    coupled_dataset,
    coupled_record,
    dataset_of,
    record,
    up_down,
    written,
)

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import (
    Outcome,
    check,
    file_name_of,
    file_names,
    marked,
    merge_datasets,
    read_flat,
    write_dataset,
)
from vibroimpact.fmus.errors import DatasetError


def test_check_reports_all_problems_at_once() -> None:
    dataset = up_down()
    dataset["outcome"][0] = 9
    dataset["impact_count"][0] = 7
    dataset["run_index"][1] = 0
    with pytest.raises(DatasetError) as caught:
        check(dataset)
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    assert "outcome: expected 0 to 6, got 0 to 9." in lines[0]
    assert "run_index" in lines[1]
    assert "impact_count: expected counts that sum to the 21 rows of impact, got 27." in lines[2]


def test_check_finds_a_lost_variable_a_wrong_type_and_lost_units() -> None:
    dataset = up_down().drop_vars("impact_phase")
    dataset["impact_time"] = dataset["impact_time"].astype(np.float32)
    dataset["final_phase"].attrs.pop("units")
    with pytest.raises(DatasetError) as caught:
        check(dataset)
    text = str(caught.value)
    assert "impact_phase: expected this variable, got none." in text
    assert "impact_time: expected float64, got float32." in text
    assert "final_phase: expected the attribute units, got none." in text


@pytest.mark.parametrize(
    ("name", "row", "value", "message"),
    [
        ("impact_time", 2, -1.0, "do not decrease in a run"),
        ("impact_time", 2, np.nan, "expected finite times"),
        ("impact_phase", 0, 6.3, "expected 0 <= phase < 2 pi"),
        ("impact_velocity", 0, -0.1, "expected a speed of approach"),
        ("impact_contact", 0, 0, "expected stops numbered from 1"),
        ("stick_end", 0, 0.1, "not before its start"),
        ("time", 1, -1.0, "do not decrease in a run"),
        ("direction", 0, 3, "direction: expected 0 to 2"),
        ("angular_frequency", 0, np.inf, "expected finite values of a parameter"),
    ],
)
def test_check_refuses_impossible_contents(name: str, row: int, value: float, message: str) -> None:
    dataset = up_down()
    values = dataset[name].values
    values[row] = value
    with pytest.raises(DatasetError, match=message):
        check(dataset)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("event_time", -1.0, "event_time: expected times that do not decrease in a run"),
        ("event_index", -1, "event_index: expected events at the same time numbered from 0"),
        ("event_component", 3, "event_component: expected components numbered 1 to 2"),
        ("event_count", 1, "event_count: expected counts that sum to the 4 rows of event, got 3"),
        ("loop_residual", -1.0, "loop_residual: expected a residual >= 0"),
    ],
)
def test_check_refuses_impossible_events_and_residuals(name: str, value: float, message: str) -> None:
    dataset = coupled_dataset([coupled_record(1.0, events=2), coupled_record(1.0, events=2)])
    check(dataset)
    dataset[name].values[1] = value
    with pytest.raises(DatasetError, match=message):
        check(dataset)


@pytest.mark.parametrize(
    ("name", "row", "value", "told"),
    [
        (
            "impact_time",
            2,
            -1.0,
            "impact_time: expected times that do not decrease in a run, got -1.0 of impact 2",
        ),
        ("impact_time", 2, np.nan, "impact_time: expected finite times, got nan of impact 2"),
        (
            "impact_velocity",
            2,
            np.nan,
            "impact_velocity: expected a speed of approach >= 0, got nan of impact 2",
        ),
        ("impact_contact", 2, 0, "impact_contact: expected stops numbered from 1, got 0 of impact 2"),
        ("stick_end", 0, 0.1, "stick_end: expected an end that is not before its start, got 0.1 of stick 1"),
        ("time", 3, -1.0, "time: expected times that do not decrease in a run, got -1.0 of sample 2"),
    ],
)
def test_a_run_with_an_impossible_value_is_marked_and_everything_is_written(
    name: str, row: int, value: float, told: str, tmp_path: Path
) -> None:
    dataset = up_down()
    dataset[name].values[row] = value
    stored = read_flat(written(dataset, tmp_path))
    assert stored.outcome.values.tolist() == [0, Outcome.error, 0, 0, 0, 0]
    assert stored.message.values[1] == f"check: {told}."
    xr.testing.assert_identical(
        stored.drop_vars(["outcome", "message"]), dataset.drop_vars(["outcome", "message"])
    )
    # Merging with other parts leaves the run as it was: it is not marked twice, and the whole is not refused.
    again = read_flat(written(merge_datasets([tmp_path / "runs.nc"]), tmp_path, "again.nc"))
    xr.testing.assert_identical(again, stored)
    check(stored)


def test_what_a_marked_run_said_before_is_kept_and_the_dataset_given_is_not_changed() -> None:
    dataset = coupled_dataset([coupled_record(1.0, events=2), coupled_record(1.0, events=2)])
    dataset["loop_residual"].values[1] = -1.0
    dataset["event_index"].values[2] = -3
    dataset["message"].values[1] = "slow"
    found = marked(dataset).message.values
    assert found[0] == ""
    assert found[1] == (
        "slow; check: event_index: expected events at the same time numbered from 0, got -3 of event 1.; "
        "check: loop_residual: expected a residual >= 0 or NaN, got -1.0."
    )
    assert dataset.message.values.tolist() == ["", "slow"]
    assert dataset.outcome.values.tolist() == [0, 0]


def test_check_refuses_events_whose_components_have_no_names_and_a_connection_given_twice() -> None:
    dataset = coupled_dataset([coupled_record(1.0, events=2)])
    dataset["event_component"].attrs.pop("flag_values")
    with pytest.raises(DatasetError, match="event_component: expected flag_values 1 to 2"):
        check(dataset)
    dataset["event_component"].attrs.pop("flag_meanings")
    with pytest.raises(DatasetError, match="expected the attribute flag_meanings, got none"):
        check(dataset.drop_vars("event_index"))
    with pytest.raises(DatasetError, match="connection: expected each connection once"):
        check(coupled_dataset([coupled_record(1.0)], connections=CONNECTIONS[:1] * 2))


def test_residuals_and_events_need_the_names_of_what_they_belong_to() -> None:
    with pytest.raises(DatasetError, match=r"energy_residual: expected .* 1 connections .*, got 2"):
        coupled_dataset([coupled_record(1.0)], connections=CONNECTIONS[:1])
    with pytest.raises(DatasetError, match="event_components: expected the names"):
        coupled_dataset([coupled_record(1.0)], event_components=())


def test_time_may_start_again_with_the_next_run_even_after_runs_without_impacts() -> None:
    runs = [record(5.0, impacts=2), record(0.0), record(0.0), record(1.0, impacts=2), record(0.0)]
    dataset = dataset_of(runs)
    check(dataset)
    assert (np.diff(dataset["impact_time"].values) < 0.0).any()


def test_a_stick_that_does_not_end_and_an_unforced_impact_are_legal() -> None:
    run = record(1.0, impacts=1, sticks=1)
    assert run.sticks is not None
    assert run.impacts is not None
    run.sticks[0, 1] = np.nan
    run.impacts[0, 1] = np.nan
    check(dataset_of([run]))


def test_per_run_arrays_of_other_lengths_are_refused() -> None:
    with pytest.raises(DatasetError, match="angular_frequency: expected one value for each of 1 runs, got 2"):
        dataset_of([record(1.0)], coordinates={"angular_frequency": np.array([1.0, 2.0])})


def test_a_quantity_of_unknown_unit_needs_one() -> None:
    places = {"colour": np.array([1.0])}
    with pytest.raises(DatasetError, match="colour: expected a quantity whose unit is known"):
        dataset_of([record(1.0)], coordinates=places)
    dataset = dataset_of([record(1.0)], coordinates=places, unit_of={"colour": "K"})
    assert dataset["colour"].attrs["units"] == "K"


def test_variables_of_a_component_get_names_that_cf_allows() -> None:
    assert file_name_of("contact[1].force") == "contact_1_force"
    assert file_name_of("damping_ratio[2]") == "damping_ratio_2"
    places = {"damping_ratio_2": np.array([1.0])}
    assert dataset_of([record(1.0)], coordinates=places)["damping_ratio_2"].attrs["units"] == "1"


def test_sampled_variables_of_components_keep_their_own_names_as_attributes() -> None:
    dataset = coupled_dataset([coupled_record(1.0, samples=1)])
    assert dataset["body_velocity"].attrs == {
        "long_name": "body.velocity",
        "component_variable": "body.velocity",
        "units": "m/s",
    }
    # Only the component knows the unit of its variable, whatever the variable's name.
    unknown = coupled_dataset([coupled_record(1.0, samples=1)], unit_of={})
    assert unknown["body_velocity"].attrs["units"] == "1"
    assert unknown["stop_contact_1_law"].attrs["units"] == "1"


def test_names_that_would_clash_in_a_file_are_numbered_and_all_their_values_kept(tmp_path: Path) -> None:
    names = ["body.x[1]", "body.x.1", "Body.X_1"]
    run = coupled_record(1.0, samples=1)
    with open_dataset(written(coupled_dataset([run], sample_variables=names), tmp_path)) as opened:
        found = {
            variable.attrs["component_variable"]: (str(name), float(variable[0]))
            for name, variable in opened.data_vars.items()
            if "component_variable" in variable.attrs
        }
    assert found == {
        "body.x[1]": ("body_x_1", 1.0),
        "body.x.1": ("body_x_1_2", 2.0),
        "Body.X_1": ("Body_X_1_3", 3.0),
    }


def test_sampled_variables_take_no_name_of_the_schema_or_of_a_swept_parameter() -> None:
    names = ["impact.time", "body.mass", "event.run"]
    dataset = coupled_dataset(
        [coupled_record(1.0, samples=1)],
        sample_variables=names,
        coordinates={"body_mass": np.array([7.0])},
    )
    assert [float(dataset[name][0]) for name in ("impact_time_2", "body_mass_2", "event_run_2")] == [1, 2, 3]
    assert dataset["body_mass"].dims == ("run",)


def test_a_variable_sampled_twice_is_refused() -> None:
    with pytest.raises(DatasetError, match=r"body\.x: expected each quantity once, got it twice"):
        file_names(["body.x", "body.y", "body.x"])


@pytest.mark.parametrize("name", ["run_id", "period", "connection", "impact_run"])
def test_a_swept_parameter_with_a_name_of_the_schema_is_refused(name: str) -> None:
    with pytest.raises(DatasetError, match="expected a swept parameter with a name of its own"):
        dataset_of([record(1.0)], coordinates={name: np.array([1.0])})


def test_a_dataset_that_breaks_the_schema_is_not_written(tmp_path: Path) -> None:
    dataset = up_down()
    dataset["outcome"][0] = 9
    with pytest.raises(DatasetError):
        write_dataset(dataset, tmp_path / "runs.nc")
    assert list(tmp_path.iterdir()) == []
