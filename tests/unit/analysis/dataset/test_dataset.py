"""A dataset that is written is read as it was, with the names, units and types of the schema."""

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
    coupled_dataset,
    coupled_record,
    dataset_of,
    everything,
    failed,
    record,
    up_down,
    written,
)
from support.places import ROOT

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import (
    RULES,
    Outcome,
    build_dataset,
    check,
    read_flat,
    read_part,
    write_dataset,
)
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
        # curves of bifurcations have points without runs: tests/unit/orchestrator/orbits/test_isolas.py
        assert {name for name, rule in RULES.items() if rule.dims != ("curve_point",)} <= set(file.variables)
        for name, variable in file.variables.items():
            assert variable.units
            assert variable.long_name
            if name in RULES:
                assert variable.dimensions == RULES[name].dims
                assert variable.dtype == (str if RULES[name].dtype is object else np.dtype(RULES[name].dtype))


def test_outcomes_are_flags_with_their_meanings(tmp_path: Path) -> None:
    with netCDF4.Dataset(written(dataset_of([record(1.0)]), tmp_path)) as file:
        outcome = file["outcome"]
        assert outcome.flag_meanings == "ok stuck impact_limit error crash timeout unbounded"
        assert outcome.flag_values.tolist() == [0, 1, 2, 3, 4, 5, 6]
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
