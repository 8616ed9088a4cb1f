"""Convert a dataset of runs between a NetCDF file and a Zarr store, a shard at a time."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.flat_file import FlatFile
from vibroimpact.analysis.dataset.grid import cells_of
from vibroimpact.analysis.dataset.joining import appended_file, blocks_in_order
from vibroimpact.analysis.dataset.outputs import DATASET_ENDING, refuse_outputs, writing
from vibroimpact.analysis.dataset.places import dataset_place, given_place
from vibroimpact.analysis.dataset.reading import open_dataset
from vibroimpact.analysis.dataset.stores.grid import StoreGrid
from vibroimpact.analysis.dataset.stores.runs import StoreRuns
from vibroimpact.analysis.dataset.stores.store import StoreWriter, create_store
from vibroimpact.analysis.files.atomic import sync_folder, whole_or_absent
from vibroimpact.analysis.files.fingerprints import seal
from vibroimpact.analysis.files.stores import (
    STORE_ENDING,
    Place,
    is_address,
    is_store,
    one_store_error,
    system_of,
)
from vibroimpact.fmus.errors import UsageError

Shown = Callable[[int, int], None]
"""Called with the number of converted runs and of all runs."""


def _silent(done: int, runs: int) -> None:
    """Show nothing."""


def convert(file: Place, output: Place) -> xr.Dataset:
    """Convert a dataset of runs from NetCDF to Zarr, or back; return the dataset as `open_dataset` opens it.

    Parameters
    ----------
    file : path or address
        A NetCDF file, a Zarr store, its address for fsspec, or the folder of a campaign.
    output : path or address
        A name that ends in `.nc`, or the place of a store: a name that ends in `.zarr`, or an address. An older
        dataset is replaced only when the new one is complete.

    Raises
    ------
    DatasetError
        The dataset is missing, damaged or foreign, or out of reach.
    UsageError
        The package zarr is missing, or the output cannot be written.

    Examples
    --------
    >>> vi.convert("campaign", "s3://bucket/campaign.zarr")  # doctest: +SKIP
    """
    place, target = dataset_place(file), given_place(output)
    refuse_conversion(place, target)
    with writing(target):
        convert_dataset(place, target)
    return open_dataset(target)


def refuse_conversion(place: Place, output: Place) -> None:
    """Raise UsageError unless a dataset can be written at a place in its other form."""
    if isinstance(output, str):
        if is_store(place):
            raise UsageError(
                f"{output}: expected a name ending in {DATASET_ENDING}, got the address of a store."
            )
        return
    refuse_outputs([place], Path(output), ending=DATASET_ENDING if is_store(place) else STORE_ENDING)


def convert_dataset(place: Place, output: Place, shown: Shown = _silent) -> int:
    """Write a dataset of runs in the other form; return the number of runs.

    Values and attributes are equal. The memory does not grow with the number of runs. Shards whose runs lie between one
    another are in memory together. The result is whole or absent.

    Parameters
    ----------
    place : path or address
        A file, or a store.
    output : path or address
        Replaced only when the new one is complete. An address gets a store, whose last object makes it whole.
    shown : callable
        Gets the progress.

    Raises
    ------
    DatasetError
        The dataset is missing, damaged or foreign.
    OSError
        The result cannot be written.
    """
    if is_store(place):
        return _to_file(StoreRuns(place), Path(output), shown)
    with FlatFile(place) as flat:
        return _to_store(flat, output, shown)


def _to_file(store: StoreRuns, output: Path, shown: Shown) -> int:
    """Write a store as a file; the runs are in the order of their index."""
    form, done = store.form(), 0
    with whole_or_absent(output) as temporary:
        with appended_file(temporary, form, store.sizes) as file:
            shards = sorted(store.shards, key=lambda shard: shard.first)
            for block in blocks_in_order(shards, form, str(store.place)):
                file.append(block)
                done += block.sizes["run"]
                shown(done, store.sizes["run"])
        seal(temporary)
    return done


def _to_store(flat: FlatFile, output: Place, shown: Shown) -> int:
    """Write a file as a store."""
    dims, axes, ids = cells_of(flat.dataset)
    grid, done = StoreGrid.cut(dims, ids.shape), 0
    with whole_store(output) as place:
        create_store(place, flat.dataset, grid, axes)
        writer = StoreWriter(place)
        for block in grid.blocks():
            here = ids[block].reshape(-1)
            cells = np.flatnonzero(here >= 0)
            cells = cells[np.argsort(here[cells])]
            writer.write_shard(block, flat.runs(here[cells]), cells, here[cells])
            done += cells.size
            shown(done, flat.dataset.sizes["run"])
        writer.finish()
    return done


@contextmanager
def whole_store(output: Place) -> Iterator[Place]:
    """Yield the place of a new store, which replaces an older one at `output` once it is finished and on the disk.

    On any failure of the block nothing is left. At an address there is no rename: the older store is removed first.

    Raises
    ------
    OSError
        The place is a file, or a folder that is no store; or it cannot be written.
    """
    if is_address(output):
        _remove_at(output)
        try:
            yield output
        except BaseException:
            with suppress(Exception):
                _remove_at(output)
            raise
        return
    target = Path(output)
    if target.exists() and not is_store(target):
        raise FileExistsError(errno.EEXIST, "a file, or a folder that is no store", os.fspath(target))
    mark = f"{os.getpid()}.{secrets.token_hex(4)}.tmp"
    temporary, older = (target.with_name(f".{target.name}.{word}{mark}") for word in ("", "older."))
    try:
        yield temporary
        _flush(temporary)
        if target.exists():
            os.replace(target, older)
        os.replace(temporary, target)
    finally:
        for leftover in (temporary, older):
            shutil.rmtree(leftover, ignore_errors=True)
    sync_folder(target.parent)


def _remove_at(address: Place) -> None:
    """Remove the store at an address, its metadata first: what is left of it is no store."""
    with one_store_error(address, writes=True):
        system, root = system_of(address)
        if system.exists(f"{root}/zarr.json"):
            system.rm_file(f"{root}/zarr.json")
        if system.exists(root):
            system.rm(root, recursive=True)


def _flush(folder: Path) -> None:
    """Flush the objects of a store to the disk."""
    for path, _, names in os.walk(folder):
        for name in names:
            with open(os.path.join(path, name), "r+b") as file:
                os.fsync(file.fileno())
        sync_folder(Path(path))
