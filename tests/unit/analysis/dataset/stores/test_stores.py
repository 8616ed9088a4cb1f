"""Datasets of runs as Zarr stores: the same dataset as from the NetCDF file, in any cut, and back."""

from __future__ import annotations

import itertools
import re
import sys
import tempfile
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from support.command_line import in_this_process
from support.dataset_examples import (
    coupled_dataset,
    coupled_record,
    dataset_of,
    everything,
    failed,
    grid_of_runs,
    record,
    up_down,
)

import vibroimpact as vi
from vibroimpact.analysis.dataset import (
    Direction,
    RunRecord,
    accessor,
    dataset_place,
    open_dataset,
    read_flat,
    read_runs,
    with_constants,
    write_dataset,
)
from vibroimpact.analysis.dataset.schema import RAGGED, SWEPT_ALONG
from vibroimpact.analysis.dataset.stores import grid as store_grid
from vibroimpact.analysis.dataset.stores.converting import convert, convert_dataset
from vibroimpact.analysis.dataset.stores.grid import StoreGrid
from vibroimpact.analysis.dataset.stores.store import LABELS, StoreWriter, create_store
from vibroimpact.analysis.files import stores
from vibroimpact.analysis.files.stores import system_of, zarr_package
from vibroimpact.fmus.errors import DatasetError, UsageError


def assert_same_attributes(one: xr.Dataset, other: xr.Dataset) -> None:
    """Values of attributes are compared by xarray, their types are not."""
    for holder, again in [(one, other), *((one[name], other[name]) for name in one.variables)]:
        assert holder.attrs.keys() == again.attrs.keys()
        for name, value in holder.attrs.items():
            kinds = [(type(each), getattr(each, "dtype", None)) for each in (value, again.attrs[name])]
            assert kinds[0] == kinds[1], name


def assert_there_and_back(file: Path, place: str | Path, back: Path) -> None:
    """A file, the store made of it and the file made of that have the same values, attributes and types."""
    convert_dataset(file, place)
    convert_dataset(place, back)
    with open_dataset(file) as first, open_dataset(place) as second, open_dataset(back) as third:
        expected = first.load()
        for found in (by_runs(second.load()), third.load()):
            xr.testing.assert_identical(expected, found)
            assert_same_attributes(expected, found)
            assert {n: v.dtype for n, v in found.variables.items()} == {
                n: v.dtype for n, v in expected.variables.items()
            }
    assert_same_runs(read_flat(back), read_flat(file))


def assert_same_runs(found: xr.Dataset, expected: xr.Dataset) -> None:
    xr.testing.assert_identical(expected, found)
    assert_same_attributes(expected, found)
    order = [[n for n in one.coords if n not in LABELS.values()] for one in (found, expected)]
    assert order[0] == order[1]


def by_runs(opened: xr.Dataset) -> xr.Dataset:
    """Rows of shards whose runs lie between one another are in the order of shards."""
    owners = {dim: opened[f"{dim}_run"].values for dim in RAGGED if f"{dim}_run" in opened}
    return opened.isel({dim: np.argsort(owner, kind="stable") for dim, owner in owners.items()})


@pytest.fixture
def small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut stores into chunks of 2 and shards of about 6 points."""
    monkeypatch.setattr(store_grid, "CHUNK_POINTS", 2)
    monkeypatch.setattr(store_grid, "SHARD_POINTS", 6)


def along_one_dimension() -> xr.Dataset:
    drawn = dataset_of(
        [record(float(k), impacts=1) for k in range(5)],
        coordinates={"mass": np.array([3.0, 1.0, 2.0, 5.0, 4.0]), "restitution": np.linspace(0, 1, 5)},
    )
    for name in ("mass", "restitution"):
        drawn[name].attrs[SWEPT_ALONG] = "size"
    return drawn


DATASETS: dict[str, Callable[[], xr.Dataset]] = {
    "everything": everything,
    "up and down": up_down,
    "grid": grid_of_runs,
    "shared dimension": along_one_dimension,
    "scattered": lambda: dataset_of(
        [record(float(k), impacts=k) for k in range(10)],
        coordinates={"mass": np.arange(10.0) // 2, "restitution": np.arange(10.0) // 2},
    ),
    "one run": lambda: with_constants(
        dataset_of([record(1.0, impacts=3)], coordinates={}), {"mass": 2.0}, unit_of={"mass": "kg"}
    ),
    "components": lambda: coupled_dataset([coupled_record(float(k), k, 1) for k in range(6)]),
    "attributes": lambda: dataset_of(
        [record(1.0)],
        attrs={"estimated_error": np.float64("nan"), "big": np.arange(3, dtype=np.int16), "one": np.int64(7)},
    ),
}


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=pytest.mark.long if kind in ("up and down", "grid") else ())
        for kind in DATASETS
    ],
)
def test_a_file_and_its_store_are_the_same_dataset(kind: str, small_shards: None, tmp_path: Path) -> None:
    write_dataset(DATASETS[kind](), tmp_path / "a.nc")
    assert_there_and_back(tmp_path / "a.nc", tmp_path / "a.zarr", tmp_path / "b.nc")


def test_a_shard_may_have_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_grid, "CHUNK_POINTS", 1)
    monkeypatch.setattr(store_grid, "SHARD_POINTS", 3)
    points = {"mass": np.arange(4.0), "restitution": np.array([0.0, 1.0, 2.0, 3.0])}
    runs = dataset_of([record(float(k), impacts=k) for k in range(4)], coordinates=points)
    write_dataset(runs, tmp_path / "a.nc")
    with open_dataset(tmp_path / "a.nc") as opened:
        assert opened["run_id"].shape == (4, 4)
    assert_there_and_back(tmp_path / "a.nc", tmp_path / "a.zarr", tmp_path / "b.nc")


def test_a_store_without_small_shards_is_the_same_dataset_too(tmp_path: Path) -> None:
    write_dataset(grid_of_runs(), tmp_path / "a.nc")
    assert_there_and_back(tmp_path / "a.nc", tmp_path / "a.zarr", tmp_path / "b.nc")


@settings(max_examples=1)
@given(st.data())
def test_any_sweep_is_the_same_in_any_cut(data: st.DataObject) -> None:
    check_any_sweep(data)


@pytest.mark.long
@settings(max_examples=100)
@given(st.data())
def test_many_sweeps_are_the_same_in_any_cut(data: st.DataObject) -> None:
    check_any_sweep(data)


def check_any_sweep(data: st.DataObject) -> None:
    chunk = data.draw(st.integers(1, 5))
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.setattr(store_grid, "CHUNK_POINTS", chunk)
        patch.setattr(store_grid, "SHARD_POINTS", chunk * data.draw(st.integers(1, 4)))
        places = [Path(folder, name) for name in ("a.nc", "a.zarr", "b.nc")]
        write_dataset(any_sweep(data), places[0])
        assert_there_and_back(*places)


def any_sweep(data: st.DataObject) -> xr.Dataset:
    """A sweep with gaps, failed runs and rows; runs are in any order of the values, and of some directions."""
    names = data.draw(st.permutations(["mass", "restitution", "position"]))[: data.draw(st.integers(1, 3))]
    axes = [data.draw(st.permutations(range(data.draw(st.integers(1, 4))))) for _ in names]
    points = np.array(list(itertools.product(*axes)), dtype=np.float64)
    there = np.flatnonzero(data.draw(st.lists(st.booleans(), min_size=len(points), max_size=len(points))))
    points = points[there if there.size else [0]]
    runs: list[RunRecord] = []
    for k in range(len(points)):
        is_bad = data.draw(st.integers(0, 5)) == 0
        rows = data.draw(st.tuples(*(st.integers(0, 3),) * 3))
        runs.append(failed(f"no {k}") if is_bad and k else record(float(k), *rows))
    index = np.cumsum(data.draw(st.lists(st.integers(1, 3), min_size=len(runs), max_size=len(runs))))
    return dataset_of(
        runs,
        coordinates={name: points[:, k] for k, name in enumerate(names)},
        run_index=index,
        direction=[data.draw(st.sampled_from(list(Direction)))] * len(runs),
    )


@settings(max_examples=30)
@given(st.lists(st.integers(1, 3000), max_size=2), st.lists(st.integers(1, 40), max_size=2))
def test_shards_are_whole_chunks_that_cover_each_point_once(shape: list[int], further: list[int]) -> None:
    grid = StoreGrid.cut(tuple("abc"[: len(shape)]), tuple(shape))
    assert all(n % c == 0 for n, c in zip(grid.shard, grid.chunk, strict=True))
    covered = sum(
        int(np.prod([cells.stop - cells.start for cells in block], initial=1)) for block in grid.blocks()
    )
    assert covered == grid.points
    assert [grid.number(block) for block in grid.blocks()] == list(range(grid.shards))
    assert grid.shards == 1 or np.prod(grid.shard, dtype=np.int64) <= 2.2 * store_grid.SHARD_POINTS
    chunk, shard = grid.chunks_of(tuple(further))
    assert all(n % c == 0 for n, c in zip(shard, chunk, strict=True))
    assert np.prod(chunk, dtype=np.int64) <= max(store_grid.CHUNK_VALUES, 2 * store_grid.CHUNK_POINTS)


def test_a_map_of_a_hundred_million_points_has_under_two_thousand_files() -> None:
    assert 20 * StoreGrid.cut(("a", "b"), (10_000, 10_000)).shards < 2_000


def test_a_large_variable_is_in_chunks_of_dask_and_a_small_one_is_not(
    small_shards: None, tmp_path: Path
) -> None:
    write_dataset(grid_of_runs(), tmp_path / "a.nc")
    with convert(tmp_path / "a.nc", tmp_path / "a.zarr") as opened:
        assert opened["outcome"].chunks is not None
        assert opened["mass"].chunks is None
        assert opened["outcome"].values[::-1, 1].tolist() == opened["outcome"][::-1, 1].values.tolist()
        rows = opened["impact_time"]
        np.testing.assert_array_equal(rows[5:1:-2], rows.values[5:1:-2])
        for run in range(3):
            hits = opened.vibroimpact.impacts(run_id=run)
            assert hits.sizes["impact"] == run % 3


def test_xarray_alone_opens_a_store_with_its_coordinates(tmp_path: Path) -> None:
    write_dataset(grid_of_runs(), tmp_path / "a.nc")
    with convert(tmp_path / "a.nc", tmp_path / "a.zarr") as ours, xr.open_zarr(tmp_path / "a.zarr") as plain:
        assert set(map(str, ours.coords)) == set(map(str, plain.coords))
        np.testing.assert_array_equal(plain["displacement_range"], ours["displacement_range"])
        assert plain["outcome"].attrs["flag_meanings"] == ours["outcome"].attrs["flag_meanings"]


def first_object(made: Path, name: str) -> Path:
    return sorted(path for path in (made / name / "c").rglob("*") if path.is_file())[0]


# ---- writing ----


def test_a_store_is_no_dataset_until_it_is_finished(small_shards: None, tmp_path: Path) -> None:
    flat = up_down()
    write_dataset(flat, tmp_path / "a.nc")
    with open_dataset(tmp_path / "a.nc") as opened:
        axes = {name: opened[name].variable for name in ("direction", "angular_frequency")}
        grid, cells = (
            StoreGrid.cut(tuple(map(str, opened["run_id"].dims)), opened["run_id"].shape),
            opened["run_id"].values,
        )
    create_store(tmp_path / "a.zarr", flat, grid, axes)
    writer = StoreWriter(tmp_path / "a.zarr")
    whole = read_flat(tmp_path / "a.nc")
    for block in grid.blocks():
        ids = cells[block].ravel()
        rows = whole.isel(run=ids).drop_dims(["impact", "stick", "sample"])
        rows["impact_count"] = rows["stick_count"] = rows["sample_count"] = (
            "run",
            np.zeros(ids.size, np.int32),
        )
        with pytest.raises(DatasetError, match="expected a finished store, got one without consolidated"):
            open_dataset(tmp_path / "a.zarr")
        written = writer.write_shard(block, rows, run_ids=ids)
        stored = {key: sha256((tmp_path / "a.zarr" / key).read_bytes()).hexdigest() for key in written}
        assert written == stored
        assert not any(key.startswith("impact_velocity") for key in written)
    writer.finish()
    with open_dataset(tmp_path / "a.zarr") as opened:
        assert opened.sizes["impact"] == 0
        np.testing.assert_array_equal(opened["run_id"], cells)


def test_a_damaged_shard_is_one_error_and_is_written_again(made: Path) -> None:
    path = first_object(made, "displacement_max")
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 0xFF
    path.write_bytes(content)
    with open_dataset(made) as opened:
        with pytest.raises(DatasetError, match=r"a\.zarr: expected a Zarr store .* checksum") as problem:
            opened["displacement_max"].load()
        assert "\n" not in str(problem.value)
        assert opened["displacement_min"].notnull().any()
    writer, whole = StoreWriter(made), read_flat(made.parent / "a.nc")
    block = next(iter(writer.grid.blocks()))
    with open_dataset(made.parent / "a.nc") as file:
        ids = file["run_id"].values[block].ravel()
        expected = file.load()
    one = whole.isel(run=ids)
    rows = {
        dim: np.flatnonzero(np.isin(expected[f"{dim}_run"], ids)) for dim in ("impact", "stick", "sample")
    }
    ordered = {
        dim: at[np.argsort(np.argsort(ids)[np.searchsorted(np.sort(ids), expected[f"{dim}_run"][at])])]
        for dim, at in rows.items()
    }
    writer.write_shard(block, one.isel(ordered), run_ids=ids)
    writer.finish()
    with open_dataset(made) as opened:
        np.testing.assert_array_equal(opened["displacement_max"], expected["displacement_max"])


def test_a_thread_that_leaves_the_settings_of_zarr_takes_them_from_no_other() -> None:
    entered, left = threading.Event(), threading.Event()

    def other() -> bool:
        with stores._settings():
            entered.set()
            left.wait(60)
            return bool(zarr_package().config.get("array.write_empty_chunks"))

    with ThreadPoolExecutor(1) as threads:
        with stores._settings():
            found = threads.submit(other)
            entered.wait(0.2)
        left.set()
        assert found.result()


@pytest.mark.parametrize("name", DATASETS)
@pytest.mark.usefixtures("small_shards")
def test_columns_in_blocks_are_those_of_all_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_dataset(DATASETS[name](), tmp_path / "a.nc")
    convert_dataset(tmp_path / "a.nc", tmp_path / "a.zarr")
    with open_dataset(tmp_path / "a.zarr") as opened, open_dataset(tmp_path / "a.nc") as file:
        names = [each for each in ("displacement_max", "outcome", "message") if each in opened]
        for one, most in itertools.product((opened, file), (40, 1 << 22)):
            monkeypatch.setattr(accessor, "BLOCK_VALUES", most)
            blocks, runs = list(accessor.columns_of_runs(one, names)), one.vibroimpact.runs
            for each in names:
                expected = runs[each].values
                np.testing.assert_array_equal(np.concatenate([block[each] for block in blocks]), expected)


@pytest.mark.parametrize("left", [0, 7, 40])
def test_a_half_written_shard_is_one_error(made: Path, left: int) -> None:
    path = first_object(made, "final_velocity")
    path.write_bytes(path.read_bytes()[:left])
    with open_dataset(made) as opened, pytest.raises(DatasetError, match=r"a\.zarr: expected a Zarr store"):
        opened["final_velocity"].load()


def test_runs_with_a_variable_that_the_store_lacks_are_refused(made: Path) -> None:
    writer, runs = StoreWriter(made), read_flat(made.parent / "a.nc")
    block = next(iter(writer.grid.blocks()))
    with pytest.raises(DatasetError, match="expected at most 4 runs in the shard, each with a cell, got 15"):
        writer.write_shard(block, runs)
    runs["loop_residual"] = runs["final_phase"]
    with pytest.raises(DatasetError, match=r"variables of the store, got loop_residual too"):
        writer.write_shard(block, runs)


def test_the_runs_of_a_store_are_those_of_its_file(made: Path) -> None:
    assert_same_runs(read_runs(made), read_flat(made.parent / "a.nc"))


def test_the_package_that_is_missing_is_named_with_its_extra(
    made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    zarr_package.cache_clear()
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(UsageError, match=r"expected the package zarr .* pip install 'vibroimpact\[store\]'"):
        open_dataset(made)


# ---- places ----


def test_a_folder_stands_for_the_dataset_in_it(tmp_path: Path, small_shards: None) -> None:
    folder = tmp_path / "campaign"
    folder.mkdir()
    write_dataset(up_down(), folder / "dataset.nc")
    convert(folder, tmp_path / "a.zarr").close()
    (folder / "dataset.nc").unlink()
    assert dataset_place(folder) == folder / "dataset.nc"
    (tmp_path / "a.zarr").rename(folder / "dataset.zarr")
    assert dataset_place(folder) == folder / "dataset.zarr"
    with vi.open_dataset(folder) as opened:
        assert opened.sizes["angular_frequency"] == 3


def test_an_address_in_memory_holds_a_store(tmp_path: Path) -> None:
    write_dataset(grid_of_runs(), tmp_path / "a.nc")
    assert_there_and_back(tmp_path / "a.nc", "memory://kept.zarr", tmp_path / "b.nc")
    assert dataset_place(Path("memory://kept.zarr")) == "memory://kept.zarr"
    system, _ = system_of("memory://kept.zarr")
    system.rm("/kept.zarr", recursive=True)
    with pytest.raises(DatasetError, match=r"memory://kept\.zarr: expected a Zarr store, got none there"):
        open_dataset("memory://kept.zarr")
    with pytest.raises(DatasetError, match=r"nosuch://a\.zarr: "):
        open_dataset("nosuch://a.zarr")


# ---- the command ----


def test_convert_says_the_sizes_and_replaces_only_what_is_the_same(tmp_path: Path) -> None:
    write_dataset(dataset_of([record(1.0), record(2.0)]), tmp_path / "a.nc")
    write_dataset(dataset_of([record(1.0)], attrs={"title": "other"}), tmp_path / "b.nc")
    for output in (tmp_path / "a.zarr", "memory://a.zarr"):
        for _ in range(2):
            done = in_this_process("convert", tmp_path / "a.nc", output)
            assert done.returncode == 0, done.stderr
        assert re.fullmatch(
            r"2 runs in .* s: .*a\.zarr, .* MB in \d+ files; .*a\.nc has .* MB in 1 file\.\n", done.stdout
        )
        refused = in_this_process("convert", tmp_path / "b.nc", output)
        assert refused.returncode == 2
        assert "a.zarr: expected a new file, or one that holds the same" in refused.stderr
        assert in_this_process("convert", tmp_path / "b.nc", output, "--force").returncode == 0
        with open_dataset(output) as opened:
            assert opened.attrs["title"] == "other"


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("a.nc b.nc", "expected a name ending in .zarr, got '.nc'"),
        ("a.zarr b.zarr", "expected a name ending in .nc, got '.zarr'"),
        ("a.zarr memory://b.zarr", "expected a name ending in .nc, got the address of a store"),
        ("a.nc folder.zarr", "expected a place where a file can be written, got a folder"),
        ("a.nc nowhere/b.zarr", "got no folder of that name"),
        ("none.nc b.zarr", "expected a dataset file, got no such file"),
        ("memory://none.zarr b.nc", "expected a Zarr store, got none there"),
    ],
)
def test_convert_refuses_in_one_line(
    made: Path, monkeypatch: pytest.MonkeyPatch, words: str, reason: str
) -> None:
    monkeypatch.chdir(made.parent)
    Path("folder.zarr").mkdir()
    done = in_this_process("convert", *words.split())
    assert done.returncode == 2
    assert reason in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_conversion_that_fails_leaves_what_was_there(made: Path) -> None:
    file, before = made.parent / "a.nc", sorted(path.name for path in made.parent.iterdir())
    path = first_object(made, "final_velocity")
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(DatasetError, match=r"a\.zarr: expected a Zarr store"):
        convert_dataset(made, file)
    assert open_dataset(file).sizes["mass"] == 3
    kept = made.parent / "kept.nc"
    file.rename(kept)
    content = bytearray(kept.read_bytes())
    content[len(content) // 2] ^= 0xFF
    kept.write_bytes(content)
    with pytest.raises(DatasetError, match=r"kept\.nc"):
        convert_dataset(kept, made)
    kept.rename(file)
    assert sorted(path.name for path in made.parent.iterdir()) == before
    assert open_dataset(made).sizes["mass"] == 3


def test_a_shard_that_is_lost_is_one_error(made: Path) -> None:
    first_object(made, "final_velocity").unlink()
    with open_dataset(made) as opened, pytest.raises(DatasetError, match=r"no object final_velocity/c"):
        opened["final_velocity"].load()


@pytest.mark.parametrize(
    "words",
    [
        "describe",
        "classify",
        "plot -o a.png --run 3",
        pytest.param("plot -o a.png", marks=pytest.mark.long),
        pytest.param("estimate impacts --run 3", marks=pytest.mark.long),
    ],
)
def test_commands_say_of_a_store_what_they_say_of_its_file(
    made: Path, monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    monkeypatch.chdir(made.parent)
    name, *more = words.split()
    command = [name, *([more.pop(0)] if name == "estimate" else [])]
    of_file, of_store = (in_this_process(*command, each, *more) for each in ("a.nc", "a.zarr"))
    assert of_store.returncode == of_file.returncode
    assert of_store.stdout == of_file.stdout.replace("a.nc", "a.zarr")
    assert of_store.stderr == of_file.stderr.replace("a.nc", "a.zarr")
