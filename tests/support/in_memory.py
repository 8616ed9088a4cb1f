"""Whether a run in memory equals the file of the same run, in types, order and bits."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset, write_dataset
from vibroimpact.analysis.dataset.reading import opened_in_memory
from vibroimpact.orchestrator.running.kept import opened_scene
from vibroimpact.orchestrator.running.whole import run_whole
from vibroimpact.orchestrator.scene import Scene


def assert_memory_is_file(scene: Scene) -> xr.Dataset:
    """Run a scene; compare the dataset in memory with the dataset of its file; return the former."""
    with opened_scene(scene) as opened:
        flat = run_whole(opened)
    found = opened_in_memory(flat)
    with TemporaryDirectory() as folder:
        write_dataset(flat, Path(folder, "run.nc"))
        with open_dataset(Path(folder, "run.nc")) as opened_file:
            expected = opened_file.load()
    xr.testing.assert_identical(found, expected)
    assert list(found.variables) == list(expected.variables)
    assert list(found.dims) == list(expected.dims)
    assert types(found.attrs) == types(expected.attrs)
    for name, variable in expected.variables.items():
        own = found.variables[name]
        assert (own.dtype, type(own)) == (variable.dtype, type(variable)), name
        assert types(own.attrs) == types(variable.attrs), name
        if variable.dtype.kind != "O":
            assert own.values.tobytes() == variable.values.tobytes(), name
    return found


def types(attributes: dict[str, object]) -> dict[str, type]:
    """Return the type of each attribute."""
    return {name: type(value) for name, value in attributes.items()}
