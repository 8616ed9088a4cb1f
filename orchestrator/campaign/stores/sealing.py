"""The shards of a growing store: written by a worker, from the rows of a chunk or from parts, and sealed.

A shard has one writer. The worker that computes all of its runs as one chunk writes it, or else the process that gets
its complete parts. All objects of a shard are on the disk before its seal is.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import Outcome
from vibroimpact.analysis.dataset.assembling import assembled
from vibroimpact.analysis.dataset.schema import COUPLED_COLUMNS, attributes_of
from vibroimpact.analysis.dataset.stores.store import StoreWriter
from vibroimpact.analysis.files.object_paths import AnyPath, located
from vibroimpact.orchestrator.campaign.stores.seals import SEALS, STORE, Seal, write_seal
from vibroimpact.orchestrator.campaign.stores.shards import Cells, Shard, cells_of
from vibroimpact.orchestrator.run.dataset import coordinate_names, empty_dataset
from vibroimpact.orchestrator.run.points import columns_of_points
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import expand


def optional_columns(scene: Scene) -> tuple[str, ...]:
    """Return the variables of a scene's store that no run may have."""
    return COUPLED_COLUMNS if scene.execution.adapts else ("loop_residual",)


@dataclass(frozen=True, slots=True)
class GrowingStore:
    """The store of a campaign for its workers: the folder or address of the campaign, and the size of a shard."""

    home: str
    shard_points: int

    @property
    def path(self) -> AnyPath:
        """Folder of the store."""
        return located(self.home) / STORE

    @property
    def seals(self) -> AnyPath:
        """Folder of the seals."""
        return located(self.home) / SEALS

    def cells(self, scene: Scene) -> Cells:
        """Return the cells of a scene's runs in shards of this store."""
        return cells_of(scene, self.shard_points)

    def shard_of(self, scene: Scene, first: int, stop: int) -> Shard | None:
        """Return the shard with exactly these runs."""
        return self.cells(scene).shard_with(first, stop)


def write_shard(
    store: GrowingStore, scene: Scene, shard: Shard, rows: xr.Dataset, branch: int, attrs: Mapping[str, Any]
) -> Seal:
    """Write the rows of a shard's runs into a store, then the seal, and return the seal.

    Parameters
    ----------
    rows : xarray.Dataset
        All runs of the shard, one-dimensional, in their order and marked (`checking.marked`).
    branch : int
        Branch of the first run.
    attrs : mapping
        Attributes of the seal, as those of a part.

    Raises
    ------
    DatasetError
        The rows do not fit the store.
    OSError
        The shard cannot be written.
    """
    writer = _writer(str(store.path), str(attrs["scene_hash"]))
    objects = writer.write_shard(shard.block, rows, store.cells(scene).places(shard))
    _flush(store.path, objects)
    values, counts = np.unique(rows.outcome.values, return_counts=True)
    seal = Seal(
        shard=shard.number,
        branch=branch,
        first=shard.first,
        stop=shard.stop,
        attrs={name: np.asarray(value).tolist() for name, value in attrs.items()},
        outcomes={Outcome(value).name: int(count) for value, count in zip(values, counts, strict=True)},
        has_messages=any(rows.variables["message"].values.tolist()),
        periods=rows.sizes.get("period", 0),
        absent=tuple(name for name in COUPLED_COLUMNS if name not in rows.variables),
        objects=objects,
    )
    write_seal(store.seals, seal)
    return seal


def read_shard(store: GrowingStore, scene: Scene, seal: Seal) -> xr.Dataset:
    """Return the rows of a sealed shard, one-dimensional, as a part has them.

    Raises
    ------
    DatasetError
        An object of the shard is damaged.
    """
    cells = store.cells(scene)
    shard, like = cells.sealed_shard(seal.first, seal.stop), empty_dataset(scene)
    assert shard is not None, "a seal is checked before its shard is read"
    values: dict[str, Any] = {"run_index": np.arange(shard.first, shard.stop, dtype=np.int32)}
    if not cells.cells.is_line:
        points = columns_of_points(expand(scene), shard.first, shard.stop)
        values |= {name: points.values[key] for key, name in coordinate_names(scene).items()}
        values |= {"direction": points.direction}
    names = (
        {str(name) for name in (*like.variables, *optional_columns(scene))} - values.keys() - set(seal.absent)
    )
    writer = _writer(str(store.path), str(seal.attrs["scene_hash"]))
    values |= writer.read_shard(shard.block, names, cells.places(shard))
    variables: dict[str, Any] = {
        str(name): variable if str(name) not in values else (variable.dims, values[str(name)], variable.attrs)
        for name, variable in like.variables.items()
    }
    for name in optional_columns(scene):
        if name in values:
            variables[name] = (("run",), values[name], attributes_of(name, scene.units))
    coords = {str(name): variables.pop(str(name)) for name in like.coords}
    return assembled(variables, coords, {**like.attrs, **seal.attrs})


@lru_cache(maxsize=1)
def _writer(path: str, scene_hash: str) -> StoreWriter:
    """Return the writer into a store; the hash tells stores apart that follow one another at one place."""
    return StoreWriter(path)


def _flush(store: AnyPath, keys: Iterable[str]) -> None:
    """Flush objects of a store, and the names of new ones, to the disk; an object store has done so itself."""
    if not isinstance(store, Path):
        return
    folders = {str((store / key).parent) for key in keys}
    for path in (*(str(store / key) for key in keys), *sorted(folders)):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
