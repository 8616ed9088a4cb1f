"""Stores that a stranger made, or whose objects are too large, are refused in one line before they are expanded."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.dataset_examples import grid_of_runs

from vibroimpact.analysis.dataset import open_dataset, write_dataset
from vibroimpact.analysis.dataset.stores.converting import convert_dataset
from vibroimpact.analysis.files import stores
from vibroimpact.analysis.files.stores import zarr_package
from vibroimpact.fmus.errors import DatasetError


def first_object(made: Path, name: str) -> Path:
    return sorted(path for path in (made / name / "c").rglob("*") if path.is_file())[0]


def edited(made: Path, change: object) -> Path:
    """Change the metadata of a store as someone else might."""
    head = json.loads((made / "zarr.json").read_text())
    change(head, head["consolidated_metadata"]["metadata"])  # type: ignore[operator]
    (made / "zarr.json").write_text(json.dumps(head))
    return made


def _codec(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    nodes["mass"]["codecs"].append({"name": "numcodecs.pickle"})


def _name(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    nodes["../../mass"] = nodes["mass"]


def _kind(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    nodes["mass"]["data_type"] = "complex128"


def _shape(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    nodes["mass"]["shape"] = [2**41]


def _sizes(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    nodes["final_phase"]["shape"] = [3, 6]


def _huge(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    for node in nodes.values():
        for axis, dim in enumerate(node.get("dimension_names") or []):
            if dim == "restitution":
                node["shape"][axis] = 2**33


def _chunk(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    nodes["mass"]["chunk_grid"]["configuration"]["chunk_shape"] = [2**30]


def _rows(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    nodes["impact_time"]["shape"] = [1, 1]


def _format(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    head["zarr_format"] = 2


def _table(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    head["consolidated_metadata"]["metadata"] = [1, 2]


def _types(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    nodes["outcome"]["attributes"]["attribute_types"]["flag_values"] = "O"


def _missing(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    del nodes["displacement_min"]


def _unit(head: dict, nodes: dict) -> None:  # type: ignore[type-arg]
    del nodes["final_phase"]["attributes"]["units"]


CHANGES = [
    _codec,
    _name,
    _kind,
    _shape,
    _sizes,
    _huge,
    _chunk,
    _rows,
    _format,
    _table,
    _types,
    _missing,
    _unit,
]


@pytest.mark.parametrize("change", CHANGES)
def test_a_store_that_a_stranger_made_is_refused_in_one_line(made: Path, change: object) -> None:
    with pytest.raises(DatasetError, match=r"a\.zarr: ") as problem:
        open_dataset(edited(made, change))
    assert "\n" not in str(problem.value)
    assert len(str(problem.value)) < 700


def test_a_chunk_that_holds_more_than_it_should_is_refused_before_it_is_expanded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_dataset(grid_of_runs(), tmp_path / "a.nc")
    convert_dataset(tmp_path / "a.nc", tmp_path / "a.zarr")
    for name, fill in (("final_velocity", 0.0), ("message", "x" * 100)):
        zarr = zarr_package()
        array = zarr.open_group(tmp_path / "a.zarr", mode="r")[name]
        large = zarr.create_array(
            tmp_path / f"{name}.zarr",
            shape=(10**6,),
            chunks=(10**6,),
            dtype=array.dtype,
            compressors=array.compressors,
            fill_value=array.fill_value,
        )
        large[...] = np.full(10**6, fill, dtype=object if name == "message" else float)
        first_object(tmp_path / "a.zarr", name).write_bytes((tmp_path / f"{name}.zarr/c/0").read_bytes())
        with open_dataset(tmp_path / "a.zarr") as opened, pytest.raises(DatasetError, match="does not hold"):
            opened[name].load()


def test_an_object_above_its_bound_is_refused(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from vibroimpact.analysis.files import bounded_stores

    monkeypatch.setattr(bounded_stores, "MOST_OBJECT_BYTES", 10)
    with open_dataset(made.parent / "a.nc"), pytest.raises(DatasetError, match="above 10 bytes"):
        open_dataset(made).load()
    monkeypatch.setattr(stores, "MOST_METADATA_BYTES", 10)
    with pytest.raises(DatasetError, match="metadata above 10 bytes"):
        open_dataset(made)


def test_a_store_of_another_program_is_refused(tmp_path: Path) -> None:
    xr.Dataset({"x": ("y", [1.0])}).to_zarr(tmp_path / "a.zarr", zarr_format=3, consolidated=False)
    with pytest.raises(DatasetError, match="expected a finished store"):
        open_dataset(tmp_path / "a.zarr")
    stores.consolidate(tmp_path / "a.zarr")
    with pytest.raises(DatasetError, match="expected a dataset written by vibroimpact, got other contents"):
        open_dataset(tmp_path / "a.zarr")
    (tmp_path / "a.zarr" / "zarr.json").write_text("no JSON")
    with pytest.raises(DatasetError, match=r"a\.zarr: expected a Zarr store"):
        open_dataset(tmp_path / "a.zarr")
