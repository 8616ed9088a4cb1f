from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import netCDF4
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
    failed,
    impact_rows,
    record,
    up_down,
    written,
)
from support.places import ROOT

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import (
    RULES,
    Direction,
    Outcome,
    RunRecord,
    build_dataset,
    check,
    file_name_of,
    file_names,
    join_files,
    marked,
    merge_datasets,
    read_flat,
    read_part,
    write_dataset,
)
from vibroimpact.analysis.figures import draw
from vibroimpact.analysis.files import atomic
from vibroimpact.analysis.files.fingerprints import LINE_LENGTH
from vibroimpact.fmus.errors import DatasetError

CF_CHECK = """
import json, sys
from compliance_checker.runner import CheckSuite, ComplianceChecker
CheckSuite.load_all_available_checkers()
passed, errors = ComplianceChecker.run_checker(
    sys.argv[1], ["cf:1.11"], 0, "strict", output_filename=sys.argv[2], output_format="json"
)
sys.exit(0 if passed and not errors else 1)
"""


@pytest.mark.parametrize("units", ["SI", "nondimensional"])
def test_a_dataset_with_every_variable_has_nothing_for_the_cf_checker_to_say(
    units: str, tmp_path: Path
) -> None:
    path = written(everything(units=units), tmp_path)
    report = tmp_path / "report.json"
    # In a process of its own: the checker's own warnings are not ours.
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", CF_CHECK, path, report], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(report.read_text())["cf:1.11"]
    spoken = {
        check["name"]: check["msgs"]
        for priority in ("high_priorities", "medium_priorities", "low_priorities")
        for check in found[priority]
        if check["msgs"]
    }
    assert spoken == {}


def test_every_variable_of_the_schema_is_stored_with_its_dimensions_type_units_and_long_name(
    tmp_path: Path,
) -> None:
    with netCDF4.Dataset(written(everything(), tmp_path)) as file:
        assert set(RULES) <= set(file.variables)
        for name, variable in file.variables.items():
            assert variable.units
            assert variable.long_name
            if name in RULES:
                assert variable.dimensions == RULES[name].dims
                assert variable.dtype == (str if RULES[name].dtype is object else np.dtype(RULES[name].dtype))


def test_outcomes_are_flags_with_the_six_meanings(tmp_path: Path) -> None:
    with netCDF4.Dataset(written(dataset_of([record(1.0)]), tmp_path)) as file:
        outcome = file["outcome"]
        assert outcome.flag_meanings == "ok stuck impact_limit error crash timeout"
        assert outcome.flag_values.tolist() == [0, 1, 2, 3, 4, 5]
        assert file["impact_count"].sample_dimension == "impact"
        assert file["stick_count"].sample_dimension == "stick"
        assert file["sample_count"].sample_dimension == "sample"


def test_event_components_are_flags_with_the_names_of_the_components(tmp_path: Path) -> None:
    run = coupled_record(1.0, events=2)
    path = written(coupled_dataset([run], event_components=["left mass", "stop"]), tmp_path)
    with netCDF4.Dataset(path) as file:
        component = file["event_component"]
        assert component.flag_values.tolist() == [1, 2]
        assert component.flag_values.dtype == component.dtype
        assert component.flag_meanings == "left_mass stop"
        assert component[:].tolist() == [1, 2]
        assert file["event_count"].sample_dimension == "event"


@pytest.mark.parametrize(
    ("system", "expected"),
    [
        ("SI", {"impact_velocity": "m s-1", "impact_impulse": "N s", "angular_frequency": "rad s-1"}),
        ("nondimensional", {"impact_velocity": "1", "impact_impulse": "1", "angular_frequency": "1"}),
    ],
)
def test_units_follow_the_scene_and_phases_stay_in_radians(system: str, expected: dict[str, str]) -> None:
    dataset = dataset_of([record(1.0, impacts=1)], units=system)
    assert {name: dataset[name].attrs["units"] for name in expected} == expected
    assert dataset["impact_phase"].attrs["units"] == "rad"
    assert dataset["point_seconds"].attrs["units"] == "s"


def test_the_documentation_names_every_variable_with_its_unit() -> None:
    text = (ROOT / "docs" / "dataset.md").read_text()
    rows = {
        cells[1].strip(" `"): cells[3].strip()
        for line in text.splitlines()
        if len(cells := line.split("|")) > 4
    }
    assert {name: rows.get(name) for name in RULES} == {name: rule.unit for name, rule in RULES.items()}


def test_what_is_written_is_what_is_read(tmp_path: Path) -> None:
    dataset = up_down()
    xr.testing.assert_identical(read_flat(written(dataset, tmp_path)), dataset)


def test_a_scene_above_64_kib_is_written_and_read(tmp_path: Path) -> None:
    """The library before its version 4.10 writes no such attribute into a file in memory."""
    dataset = up_down().assign_attrs(scene="# a long sweep\n" * 10_000)
    xr.testing.assert_identical(read_flat(written(dataset, tmp_path)), dataset)


def test_what_is_written_of_a_coupled_scene_is_what_is_read(tmp_path: Path) -> None:
    dataset = coupled_dataset([coupled_record(float(k), events=k, samples=2) for k in range(4)])
    xr.testing.assert_identical(read_flat(written(dataset, tmp_path)), dataset)
    whole = everything()
    xr.testing.assert_identical(read_flat(written(whole, tmp_path)), whole)


def test_compression_changes_the_size_and_nothing_else(tmp_path: Path) -> None:
    dataset = dataset_of([record(1.0, impacts=5000)])
    write_dataset(dataset, tmp_path / "plain.nc")
    write_dataset(dataset, tmp_path / "small.nc", compression=1)
    xr.testing.assert_identical(read_flat(tmp_path / "small.nc"), dataset)
    assert (tmp_path / "small.nc").stat().st_size < 0.7 * (tmp_path / "plain.nc").stat().st_size


def test_groups_that_a_scene_does_not_record_are_not_stored(tmp_path: Path) -> None:
    run = record(1.0)
    run.periods = run.impacts = run.sticks = run.samples = None
    with open_dataset(written(dataset_of([run], coordinates={}), tmp_path)) as opened:
        assert set(opened.dims) == set()
        assert "displacement_range" not in opened
        assert float(opened.final_displacement) == 1.0


def test_strobe_points_can_be_left_out_alone() -> None:
    dataset = dataset_of([record(1.0)], omit=("strobe_displacement", "strobe_velocity"))
    check(dataset)
    assert "strobe_velocity" not in dataset
    assert "displacement_max" in dataset


def test_one_value_can_stand_for_all_periods(tmp_path: Path) -> None:
    runs = [record(float(value)) for value in range(3)]
    for run in runs:
        assert run.periods is not None
        run.periods += np.arange(run.periods.size).reshape(run.periods.shape) % 7
    cut_short, fell_over = record(4.0), failed("fell over")
    assert cut_short.periods is not None
    cut_short.periods = cut_short.periods[:1]
    each, all_together = (
        dataset_of([*runs, cut_short, fell_over], each_period=each_period) for each_period in (True, False)
    )
    assert all_together.sizes["period"] == 1
    for name, expected in {
        "displacement_max": each.displacement_max.max("period"),
        "displacement_min": each.displacement_min.min("period"),
        "strobe_velocity": [*each.strobe_velocity[:3, -1], each.strobe_velocity[3, 0], np.nan],
        "impacts_per_period": each.impacts_per_period.mean("period"),
    }.items():
        np.testing.assert_allclose(all_together[name][:, 0], expected, rtol=1e-15)
    assert "all recorded periods" in all_together.displacement_max.long_name
    write_dataset(all_together, tmp_path / "all.nc")
    write_dataset(each, tmp_path / "each.nc")
    with open_dataset(tmp_path / "all.nc") as one, open_dataset(tmp_path / "each.nc") as many:
        np.testing.assert_array_equal(one.displacement_range, many.displacement_range)


def test_texts_come_back_wherever_they_are_among_empty_ones(tmp_path: Path) -> None:
    dataset = dataset_of([record(1.0)] * 9000)
    texts = np.full(9000, "", dtype=object)
    texts[[0, 1, 4095, 4096, 8999]] = ["first", "two\nlines", "\u00e4", "x" * 3000, "last"]
    dataset["message"] = ("run", texts, dataset.message.attrs)
    write_dataset(dataset, tmp_path / "texts.nc")
    with open_dataset(tmp_path / "texts.nc") as opened:
        assert opened.vibroimpact.runs.message.values.tolist() == texts.tolist()


def test_a_run_without_any_impact_opens_with_empty_ragged_dimensions(tmp_path: Path) -> None:
    path = written(dataset_of([record(1.0)], coordinates={}), tmp_path)
    with open_dataset(path) as opened:
        assert opened.sizes["impact"] == 0
        assert opened.vibroimpact.impacts().sizes["impact"] == 0
        assert opened.displacement_range.dims == ()
        assert float(opened.displacement_range) == 2.0
        assert str(opened.direction.values) == "independent"


def test_a_failed_run_is_a_row_with_its_message_and_missing_periods(tmp_path: Path) -> None:
    path = written(dataset_of([record(1.0, impacts=2), failed("diverged"), record(3.0, impacts=1)]), tmp_path)
    with open_dataset(path) as opened:
        row = opened.sel(angular_frequency=1.0)
        assert int(row.outcome) == Outcome.error
        assert str(row.message.values) == "diverged"
        assert np.isnan(row.displacement_max.values).all()
        assert np.isnan(row.displacement_range)
        assert opened.vibroimpact.impacts(angular_frequency=1.0).sizes["impact"] == 0
        assert opened.vibroimpact.impacts(angular_frequency=2.0).impact_time.values.tolist() == [3.0]


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


def test_parts_merge_into_the_order_of_the_campaign(tmp_path: Path) -> None:
    runs = [record(float(k), impacts=k, samples=1) for k in range(4)]
    whole = dataset_of(runs)
    late = dataset_of(runs[2:], run_index=[2, 3], coordinates={"angular_frequency": np.array([2.0, 3.0])})
    # A part may have its runs in any order, too.
    early = dataset_of(runs[1::-1], run_index=[1, 0], coordinates={"angular_frequency": np.array([1.0, 0.0])})
    merged = merge_datasets([written(late, tmp_path, "late.nc"), written(early, tmp_path, "early.nc")])
    xr.testing.assert_identical(merged, whole)


def test_parts_of_a_coupled_scene_merge_with_their_connections_once(tmp_path: Path) -> None:
    runs = [coupled_record(float(k), events=k + 1, samples=1) for k in range(4)]
    paths = []
    for chosen in ([3, 2], [1], [0]):
        places = {"mass": np.array(chosen, dtype=np.float64)}
        part = coupled_dataset([runs[k] for k in chosen], run_index=chosen, coordinates=places)
        paths.append(written(part, tmp_path, f"{chosen[0]}.nc"))
    xr.testing.assert_identical(merge_datasets(paths), coupled_dataset(runs))


def test_parts_of_a_scene_with_one_component_merge_and_can_be_written(tmp_path: Path) -> None:
    runs = [coupled_record(float(k), events=1) for k in range(2)]
    paths = []
    for k in range(2):
        place = {"mass": np.array([float(k)])}
        part = coupled_dataset([runs[k]], run_index=[k], coordinates=place, event_components=["ball"])
        paths.append(written(part, tmp_path, f"{k}.nc"))
    again = read_flat(written(merge_datasets(paths), tmp_path))
    check(again)
    assert again.event_component.attrs["flag_values"] == 1
    xr.testing.assert_equal(again, coupled_dataset(runs, event_components=["ball"]))


def test_a_flag_value_of_another_component_is_refused() -> None:
    dataset = coupled_dataset([coupled_record(0.0, events=1)], event_components=["ball"])
    dataset.event_component.attrs["flag_values"] = 2
    with pytest.raises(DatasetError, match="expected flag_values 1 to 1"):
        check(dataset)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"event_components": ["stop", "body"]}, "flag_meanings 'body stop' as in .*, got 'stop body'"),
        ({"connections": CONNECTIONS[::-1]}, "connection: expected those of"),
        (
            {"sample_variables": ["body_displacement", "body.velocity", "stop.contact[1].law"]},
            "body_displacement: expected component_variable 'body.displacement'",
        ),
        ({"units": "nondimensional"}, "expected units 'm' as in .*, got '1'"),
    ],
)
def test_merging_parts_in_which_the_same_number_means_something_else_is_refused(
    changes: dict[str, object], message: str, tmp_path: Path
) -> None:
    first = written(coupled_dataset([coupled_record(1.0, events=2)]), tmp_path, "a.nc")
    other = coupled_dataset([coupled_record(2.0, events=2)], run_index=[1], **changes)
    with pytest.raises(DatasetError, match=message):
        merge_datasets([first, written(other, tmp_path, "b.nc")])


def test_a_part_of_failed_runs_merges_with_the_others(tmp_path: Path) -> None:
    good = written(dataset_of([record(0.0, impacts=1)]), tmp_path, "a.nc")
    at_one = {"angular_frequency": np.array([1.0])}
    bad = written(dataset_of([failed("no")], run_index=[1], coordinates=at_one), tmp_path, "b.nc")
    merged = merge_datasets([bad, good])
    check(merged)
    assert np.isnan(merged.displacement_max.values[1]).all()
    assert merged.displacement_max.shape == (2, 3)


def test_merging_the_same_run_twice_is_refused(tmp_path: Path) -> None:
    path = written(up_down(), tmp_path)
    with pytest.raises(DatasetError, match="run_index twice"):
        merge_datasets([path, path])


def test_merging_files_with_different_variables_is_refused(tmp_path: Path) -> None:
    run = record(1.0)
    run.sticks = None
    other = written(dataset_of([run], run_index=[9]), tmp_path, "other.nc")
    with pytest.raises(DatasetError, match="stick_count"):
        merge_datasets([written(up_down(), tmp_path), other])


def test_a_part_gives_what_resuming_needs(tmp_path: Path) -> None:
    part = read_part(written(up_down(), tmp_path))
    assert part.run_index.tolist() == list(range(6))
    assert part.attrs["title"] == "example"


def test_check_reports_all_problems_at_once() -> None:
    dataset = up_down()
    dataset["outcome"][0] = 9
    dataset["impact_count"][0] = 7
    dataset["run_index"][1] = 0
    with pytest.raises(DatasetError) as caught:
        check(dataset)
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    assert "outcome: expected 0 to 5, got 0 to 9." in lines[0]
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


def test_parts_of_runs_without_loops_or_durations_merge_with_those_that_have_them(tmp_path: Path) -> None:
    good = coupled_record(1.0, events=1)
    lost = coupled_record(2.0)
    lost.loop_residual = None
    paths = [
        written(coupled_dataset([lost]), tmp_path, "a.nc"),
        written(coupled_dataset([good], run_index=[1]), tmp_path, "b.nc"),
    ]
    merged = merge_datasets(paths)
    assert merged.loop_residual.values.tolist()[1] == 1e-12
    assert np.isnan(merged.loop_residual.values[0])
    old = dataset_of([record(1.0, impacts=2)]).drop_vars(["impact_restitution", "impact_duration"])
    new = dataset_of([record(3.0, impacts=1)], run_index=[1])
    merged = merge_datasets([written(old, tmp_path, "old.nc"), written(new, tmp_path, "new.nc")])
    assert merged.impact_restitution.values.tolist()[2] == 0.7
    assert np.isnan(merged.impact_restitution.values[:2]).all()


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


def test_a_full_disk_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(up_down(), tmp_path)
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(atomic.os, "fsync", full)
    with pytest.raises(OSError, match="No space left on device") as caught:
        write_dataset(up_down(4), path)
    assert caught.value.errno == errno.ENOSPC
    assert caught.value.filename == str(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_is_not_there_is_an_operating_system_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write_dataset(up_down(), tmp_path / "missing" / "runs.nc")


@pytest.mark.parametrize("read", [open_dataset, read_flat, read_part])
def test_files_that_are_missing_damaged_or_foreign_are_one_clear_error(read: object, tmp_path: Path) -> None:
    assert callable(read)
    with pytest.raises(DatasetError, match="got no such file"):
        read(tmp_path / "none.nc")
    path = written(up_down(), tmp_path)
    content = path.read_bytes()
    for damaged in (b"", b"not a dataset", content[: len(content) // 2]):
        path.write_bytes(damaged)
        with pytest.raises(DatasetError, match="damaged or of another kind"):
            read(path)
    xr.Dataset({"temperature": ("x", np.zeros(2))}).to_netcdf(tmp_path / "foreign.nc")
    with pytest.raises(DatasetError, match="expected a dataset written by vibroimpact"):
        read(tmp_path / "foreign.nc")


@pytest.mark.parametrize("read", [open_dataset, read_flat])
def test_damaged_counts_are_an_error_before_rows_are_made_of_them(read: object, tmp_path: Path) -> None:
    assert callable(read)
    path = written(up_down(), tmp_path)
    content = path.read_bytes()[:-LINE_LENGTH]  # as a file of version 0.1, without its hash
    counts = up_down()["impact_count"].values.tobytes()
    assert content.count(counts) == 1
    damaged = np.full(up_down().sizes["run"], 2_000_000_000, dtype=np.int32)
    path.write_bytes(content.replace(counts, damaged.tobytes()))
    with pytest.raises(DatasetError, match="impact_count: expected counts that sum to the 21 rows of impact"):
        read(path)


def test_a_dataset_of_a_newer_schema_is_refused(tmp_path: Path) -> None:
    path = written(up_down().assign_attrs(dataset_schema="99"), tmp_path)
    with pytest.raises(DatasetError, match="expected dataset schema 1, got 99"):
        open_dataset(path)


def test_an_opened_file_can_be_replaced_and_closed(tmp_path: Path) -> None:
    path = written(up_down(), tmp_path)
    with open_dataset(path) as opened:
        write_dataset(up_down(4), path)
        assert opened.displacement_range.shape == (2, 3)
    with open_dataset(path) as again:
        assert again.displacement_range.shape == (2, 4)


def test_a_dataset_without_runs_can_be_built_and_checked() -> None:
    dataset = build_dataset([], coordinates={}, direction=[], run_index=[])
    check(dataset)
    assert dataset.sizes["run"] == 0


def test_files_from_before_durations_of_contacts_were_stored_are_still_read(tmp_path: Path) -> None:
    older = up_down().drop_vars(["impact_duration", "impact_restitution"])
    with open_dataset(written(older, tmp_path)) as opened:
        assert opened.vibroimpact.impacts(direction="up", angular_frequency=1.0).sizes["impact"] == 2


def test_an_impact_table_without_durations_leaves_them_missing() -> None:
    run = record(1.0, impacts=2)
    assert run.impacts is not None
    run.impacts = run.impacts[:, :5]
    dataset = dataset_of([run, record(2.0, impacts=1)])
    assert np.isnan(dataset["impact_duration"].values[:2]).all()
    assert dataset["impact_duration"].values[2] == 0.0
    check(dataset)


def test_whole_states_are_stored_beside_the_runs_and_come_back_on_the_grid(tmp_path: Path) -> None:
    runs = [record(float(k)) for k in range(3)] + [failed("no convergence")]
    for k, run in enumerate(runs[:3]):
        run.final_state = np.array([k, -k, 0.5 * k, 1e-300])
    with open_dataset(written(dataset_of(runs), tmp_path)) as opened:
        assert dict(opened.final_state.sizes) == {"angular_frequency": 4, "state": 4}
        assert opened.final_state.sel(angular_frequency=2.0).values.tolist() == [2.0, -2.0, 1.0, 1e-300]
        assert np.isnan(opened.final_state.values[3]).all()
    runs[0].final_state = np.zeros(2)
    with pytest.raises(DatasetError, match="states of one size, got 2, 4"):
        dataset_of(runs)


def test_text_of_a_single_run_is_read_as_text(tmp_path: Path) -> None:
    path = written(dataset_of([record(1.0)], coordinates={}), tmp_path)
    with open_dataset(path) as opened:
        assert opened.message.values == ""


def test_sampled_elements_of_a_body_are_described_by_the_schema() -> None:
    names = ["modal_energy[12]", "energy.damping_loss"]
    dataset = dataset_of([record(1.0, samples=2)], sample_variables=names)
    assert dataset["modal_energy_12"].attrs == {"long_name": "energy of mode 12", "units": "J"}
    assert dataset["energy_damping_loss"].attrs["units"] == "J"
    check(dataset)


@pytest.mark.parametrize("reserves", [True, False])
def test_a_full_disk_while_files_are_joined_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reserves: bool
) -> None:
    resource = pytest.importorskip("resource")
    parts = [written(up_down(), tmp_path, "part.nc")]
    target = tmp_path / "joined.nc"
    target.write_bytes(b"old")
    if not reserves:
        monkeypatch.delattr(os, "posix_fallocate", raising=False)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
    try:
        with pytest.raises(OSError, match="File too large" if reserves else "HDF error") as caught:
            join_files(parts, target)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert caught.value.filename == str(target)
    assert target.read_bytes() == b"old"
    assert sorted(tmp_path.iterdir()) == [target, *parts]
