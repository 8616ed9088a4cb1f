"""Parts of a campaign merge into the order of its runs, or are refused."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.dataset_examples import (
    CONNECTIONS,
    coupled_dataset,
    coupled_record,
    dataset_of,
    failed,
    record,
    up_down,
    written,
)

from vibroimpact.analysis.dataset import (
    check,
    join_files,
    merge_datasets,
    read_flat,
    read_part,
)
from vibroimpact.fmus.errors import DatasetError


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
