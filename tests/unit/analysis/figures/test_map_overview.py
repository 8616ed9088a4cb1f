"""Large maps drawn from their overview: what is rare stays, and a selection is drawn from its points."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from support.dataset_examples import dataset_of, record

import vibroimpact as vi
from vibroimpact.analysis.dataset import write_dataset
from vibroimpact.analysis.dataset.schema import CLASS_COLUMNS, OrbitClass
from vibroimpact.analysis.dataset.stores import grid as store_grid
from vibroimpact.analysis.dataset.stores import overview
from vibroimpact.analysis.dataset.stores.grid import StoreGrid
from vibroimpact.analysis.dataset.stores.overview import BlockGrid
from vibroimpact.analysis.figures.sweep.map_overview import block_classes, block_values

SIDE, LENGTH = 40, 4
"""Points of a map along each dimension, and of a block."""
Opener = Callable[[str], xr.Dataset]


def smooth() -> NDArray[np.float64]:
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    return np.asarray(1.0 + 0.5 * x + 0.3 * y * y)


def with_extremes() -> NDArray[np.float64]:
    ranges = smooth()
    ranges[7, 11], ranges[21, 30], ranges[33, 2] = 9.0, 0.1, np.nan
    return ranges


MAPS = {
    "smooth": smooth(),
    "extremes": with_extremes(),
    "noise": np.random.default_rng(0).uniform(1.0, 2.0, (SIDE, SIDE)),
}


def map_of(ranges: NDArray[np.float64]) -> xr.Dataset:
    y, x = np.divmod(np.arange(SIDE**2), SIDE)
    dataset = (
        dataset_of(
            [record(0.0, impacts=1) for _ in range(SIDE**2)],
            coordinates={"mass": y.astype(float), "restitution": x.astype(float)},
            measured={
                "class_kind": np.full(SIDE**2, OrbitClass.periodic),
                "class_impacts": np.ones(SIDE**2, dtype=np.int32),
                "class_periods": np.where(ranges.ravel() > 5.0, 3, 1),
                CLASS_COLUMNS[-1]: np.full(SIDE**2, "", dtype=object),
            },
        )
        .drop_dims("sample")
        .drop_vars("sample_count")
    )
    dataset["displacement_max"][:] = ranges.reshape(-1, 1)
    dataset["displacement_min"][:] = np.where(np.isnan(ranges), np.nan, 0.0).reshape(-1, 1)
    return dataset


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the stores, each of which is made once."""
    return tmp_path_factory.mktemp("maps")


@pytest.fixture
def opened(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Opener:
    """Open a map of ranges by its name, as the store of a large map."""
    monkeypatch.setattr(store_grid, "CHUNK_POINTS", 2 * SIDE)
    monkeypatch.setattr(store_grid, "SHARD_POINTS", 13 * SIDE)
    monkeypatch.setattr(overview, "SHARD_POINTS", 13 * SIDE)
    monkeypatch.setattr(overview, "MOST_BLOCKS", SIDE // LENGTH)

    def make(name: str) -> xr.Dataset:
        if not (folder / f"{name}.zarr").exists():
            write_dataset(map_of(MAPS[name]), folder / f"{name}.nc")
            vi.convert(folder / f"{name}.nc", folder / f"{name}.zarr").close()
        return vi.open_dataset(folder / f"{name}.zarr")

    return make


def test_isolated_extremes_and_gaps_stay_in_the_overview(opened: Opener) -> None:
    ranges = MAPS["extremes"]
    with opened("extremes") as dataset:
        found = block_values(dataset, "displacement_range")
        assert found is not None
        assert found.values.shape == (len(found.starts["mass"]), len(found.starts["restitution"]))
        at = {
            (y, x): found.values.values[
                np.searchsorted(found.starts["mass"], y, "right") - 1,
                np.searchsorted(found.starts["restitution"], x, "right") - 1,
            ]
            for y, x in ((7, 11), (21, 30), (33, 2))
        }
        assert at[7, 11] == 9.0
        assert at[21, 30] == 0.1
        assert np.isnan(at[33, 2])
        others = found.values.values[np.isfinite(found.values.values)]
        assert np.isin(others, ranges).all()
        assert np.nanmax(found.spread) == 9.0
        assert np.nanmin(found.spread) == 0.1


def test_a_smooth_map_has_the_values_of_its_points(opened: Opener) -> None:
    with opened("smooth") as dataset:
        found = block_values(dataset, "displacement_range")
        assert found is not None
        inside = {dim: np.minimum(first + LENGTH // 2, SIDE - 1) for dim, first in found.starts.items()}
        points = dataset["displacement_range"].isel(inside).values
        assert np.abs(found.values.values - points).max() <= np.ptp(smooth()) / (SIDE / LENGTH)
        assert np.isclose(found.values.values, points).mean() > 0.6  # the last block of a shard is cut
        for kind in ("map", "impacts-per-period", "classes"):
            assert vi.draw(dataset, kind) is not None


@pytest.mark.long
def test_noise_is_drawn_by_points_and_not_by_extremes(opened: Opener) -> None:
    with opened("noise") as dataset:
        found = block_values(dataset, "displacement_range")
        assert found is not None
        assert abs(found.values.values.mean() - 1.5) < 0.1


def test_the_rarest_class_of_a_block_stays(opened: Opener) -> None:
    with opened("extremes") as dataset:
        found = block_classes(dataset)
        assert found is not None
        classes, _ = found
        assert (classes["class_periods"].values == 3).sum() == 1
        assert set(np.unique(classes["class_periods"])) == {1, 3}


def test_a_selection_or_changed_values_have_no_overview(opened: Opener) -> None:
    with opened("smooth") as dataset:
        assert block_values(dataset.isel(mass=slice(0, 30)), "displacement_range") is None
        assert block_values(dataset.isel(mass=slice(0, 30)), "largest_impact_velocity") is None
        assert (
            block_values(
                dataset.assign(displacement_range=dataset["displacement_range"] * 2.0), "displacement_range"
            )
            is None
        )
        assert block_values(dataset.load(), "displacement_range") is None


def test_blocks_begin_anew_in_each_shard_and_cover_each_point() -> None:
    grid = StoreGrid(("a", "b"), (3000, 2999), (21, 2999), (336, 2999))
    blocks = BlockGrid.of(grid)
    assert blocks is not None
    for axis, size in enumerate(grid.shape):
        starts = blocks.starts(axis)
        assert starts[0] == 0
        assert np.diff(np.append(starts, size)).max() == blocks.length[axis]
        assert np.diff(np.append(starts, size)).min() >= 1
    assert BlockGrid.of(StoreGrid.cut(("a", "b"), (900, 900))) is None
    assert BlockGrid.of(StoreGrid.cut(("a",), (10**7,))) is None
