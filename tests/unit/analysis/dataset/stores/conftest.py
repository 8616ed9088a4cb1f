"""A finished store of several shards, for the tests of stores."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from support.dataset_examples import grid_of_runs

from vibroimpact.analysis.dataset import write_dataset
from vibroimpact.analysis.dataset.stores import grid as store_grid
from vibroimpact.analysis.dataset.stores.converting import convert_dataset


@pytest.fixture(scope="module")
def cut_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cut")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store_grid, "CHUNK_POINTS", 2)
        patch.setattr(store_grid, "SHARD_POINTS", 4)
        write_dataset(grid_of_runs(), folder / "a.nc")
        convert_dataset(folder / "a.nc", folder / "a.zarr")
    return folder


@pytest.fixture
def made(cut_store: Path, tmp_path: Path) -> Path:
    """A finished store of several shards, and the file that it was made of."""
    for name in ("a.nc", "a.zarr"):
        (shutil.copytree if name == "a.zarr" else shutil.copy)(cut_store / name, tmp_path / name)
    return tmp_path / "a.zarr"
