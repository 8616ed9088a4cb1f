from __future__ import annotations

import tempfile
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from support.dataset_examples import CONNECTIONS, coupled_dataset, coupled_record, dataset_of, failed, record

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import (
    Direction,
    RunRecord,
    file_names,
    join_files,
    merge_datasets,
    read_flat,
    write_dataset,
)
from vibroimpact.analysis.dataset.schema import SWEPT_ALONG
from vibroimpact.analysis.files.fingerprints import matches_recorded_hash

Lengths = st.lists(st.tuples(*(st.integers(0, 4),) * 3), min_size=1, max_size=8)


def runs_of(lengths: list[tuple[int, int, int]]) -> list[RunRecord]:
    return [record(float(k), *sizes) for k, sizes in enumerate(lengths)]


@settings(max_examples=20)
@given(Lengths, st.randoms(use_true_random=False))
def test_ragged_arrays_come_back_run_by_run_from_a_file(
    lengths: list[tuple[int, int, int]], random: object
) -> None:
    runs = runs_of(lengths)
    places = np.arange(len(runs), dtype=np.float64)
    random.shuffle(places)  # type: ignore[attr-defined]
    dataset = dataset_of(runs, coordinates={"angular_frequency": places})
    with tempfile.TemporaryDirectory() as folder:
        write_dataset(dataset, Path(folder, "runs.nc"))
        with open_dataset(Path(folder, "runs.nc")) as opened:
            for run, place in zip(runs, places, strict=True):
                hits = opened.vibroimpact.impacts(angular_frequency=place + (0.2 if len(runs) > 1 else 0.0))
                stuck = opened.sel(angular_frequency=[place]).vibroimpact.sticks()
                sampled = opened.vibroimpact.samples(angular_frequency=place, exact=True)
                assert run.impacts is not None
                assert run.sticks is not None
                assert run.samples is not None
                np.testing.assert_array_equal(hits.impact_time, run.impacts[:, 0])
                np.testing.assert_array_equal(hits.impact_impulse, run.impacts[:, 3])
                np.testing.assert_array_equal(stuck.stick_end, run.sticks[:, 1])
                np.testing.assert_array_equal(sampled.velocity, run.samples[:, 2])


@settings(max_examples=20)
@given(Lengths, st.data())
def test_parts_in_any_order_merge_into_what_one_build_gives(
    lengths: list[tuple[int, int, int]], data: st.DataObject
) -> None:
    runs = runs_of(lengths)
    if data.draw(st.booleans()):
        runs[0] = failed("broken")
    order = data.draw(st.permutations(range(len(runs))))
    cuts = sorted(data.draw(st.sets(st.integers(1, len(runs)), max_size=3)))
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for first, last in zip([0, *cuts], [*cuts, len(runs)], strict=True):
            chosen = order[first:last]
            if chosen:
                paths.append(Path(folder, f"{first}.nc"))
                write_dataset(part_of(runs, chosen), paths[-1])
        shuffled = data.draw(st.permutations(paths))
        merged = merge_datasets(shuffled)
        whole, joined = Path(folder, "whole.nc"), Path(folder, "joined.nc")
        write_dataset(merged, whole)
        assert join_files(shuffled, joined) == any(run.message for run in runs)
        assert_same_files(joined, whole)
    xr.testing.assert_identical(merged, part_of(runs, list(range(len(runs)))))


def assert_same_files(one: Path, other: Path) -> None:
    assert matches_recorded_hash(one)
    with netCDF4.Dataset(one) as first, netCDF4.Dataset(other) as second:
        assert list(first.variables) == list(second.variables)
        assert first.ncattrs() == second.ncattrs()
        for name, variable in first.variables.items():
            again = second.variables[name]
            assert (variable.dtype, variable.dimensions) == (again.dtype, again.dimensions)
            assert (variable.ncattrs(), variable.chunking()) == (again.ncattrs(), again.chunking())
    xr.testing.assert_identical(read_flat(one), read_flat(other))


def part_of(runs: list[RunRecord], chosen: list[int]) -> xr.Dataset:
    return dataset_of(
        [runs[k] for k in chosen],
        run_index=np.array(chosen),
        coordinates={"angular_frequency": np.array(chosen, dtype=np.float64)},
        direction=[Direction(k % 3) for k in chosen],
    )


Sizes = st.lists(st.tuples(st.integers(0, 5), st.integers(0, 3)), min_size=1, max_size=8)


@settings(max_examples=20)
@given(Sizes, st.data())
def test_events_and_residuals_of_parts_in_any_order_come_back_run_by_run(
    sizes: list[tuple[int, int]], data: st.DataObject
) -> None:
    runs = [coupled_record(float(k), *both) for k, both in enumerate(sizes)]
    order = data.draw(st.permutations(range(len(runs))))
    cut = data.draw(st.integers(0, len(runs)))
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for chosen in filter(None, (order[:cut], order[cut:])):
            places = {"mass": np.array(chosen, dtype=np.float64)}
            part = coupled_dataset([runs[k] for k in chosen], run_index=chosen, coordinates=places)
            paths.append(Path(folder, f"{len(paths)}.nc"))
            write_dataset(part, paths[-1])
        merged = merge_datasets(paths)
        xr.testing.assert_identical(merged, coupled_dataset(runs))
        write_dataset(merged, Path(folder, "merged.nc"))
        join_files(paths, Path(folder, "joined.nc"))
        assert_same_files(Path(folder, "joined.nc"), Path(folder, "merged.nc"))
        with open_dataset(Path(folder, "merged.nc")) as opened:
            shuffled = opened.isel(mass=order)
            for k, run in enumerate(runs):
                assert run.events is not None
                assert run.energy_residual is not None
                found = shuffled.vibroimpact.events(mass=k)
                columns = [found.event_time, found.event_index, found.event_component]
                np.testing.assert_array_equal(np.column_stack(columns), run.events)
                residual = shuffled.energy_residual.sel(mass=k, connection=CONNECTIONS)
                np.testing.assert_array_equal(residual, run.energy_residual)


Together = st.integers(1, 3).flatmap(
    lambda keys: st.lists(
        st.tuples(*(st.sampled_from([-2.0, 0.25, 0.5, 8.0]),) * keys), min_size=1, max_size=6, unique=True
    )
)


@settings(max_examples=20)
@given(Together, st.sampled_from(["size", "draw"]), st.integers(1, 2), st.booleans())
def test_points_of_keys_that_move_together_are_selected_by_their_axis(
    points: list[tuple[float, ...]], dimension: str, frequencies: int, saved: bool
) -> None:
    names = [f"stop_{key}_position" for key in range(1, 1 + len(points[0]))]
    columns = np.repeat(np.array(points).T, frequencies, axis=1)
    coordinates = dict(zip(names, columns, strict=True))
    coordinates["angular_frequency"] = np.tile(np.arange(float(frequencies)), len(points))
    dataset = dataset_of(
        [record(float(k)) for k in range(columns.shape[1])],
        coordinates=coordinates,
        unit_of=dict.fromkeys(names, "m"),
    )
    for name in names:
        dataset[name].attrs[SWEPT_ALONG] = dimension
    with tempfile.TemporaryDirectory() as folder:
        write_dataset(dataset, Path(folder, "runs.nc"))
        with open_dataset(Path(folder, "runs.nc")) as opened:
            # version 0.2 saved opened files without the axis
            opened.drop_vars(dimension).to_netcdf(Path(folder, "again.nc"))
        with open_dataset(Path(folder, "again.nc" if saved else "runs.nc")) as opened:
            values = [name for name in names if len(set(opened[name].values)) == len(points)]
            numbered = not values or (dimension == "draw" and len(names) > 1)
            axis = range(len(points)) if numbered else opened[values[0]].values
            assert opened[dimension].values.tolist() == list(axis)
            for place, value in enumerate(axis):
                chosen = opened.sel({dimension: value})
                assert chosen.displacement_range.equals(opened.displacement_range.isel({dimension: place}))
                point = {dimension: value, "angular_frequency": frequencies - 1.0}
                assert opened.vibroimpact.impacts(**point, exact=True)[names[0]] == points[place][0]
            with pytest.raises(KeyError, match="not all values found"):
                opened.sel({dimension: 0.3})


@given(st.lists(st.text("aA1_[.é", max_size=4), unique=True, max_size=12))
def test_different_quantities_have_different_names_that_cf_allows(quantities: list[str]) -> None:
    names = file_names(quantities)
    assert len({name.lower() for name in names}) == len(quantities)
    assert all(name[0].isalpha() and name.isascii() and name.isidentifier() for name in names)
