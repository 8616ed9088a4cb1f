"""The format of a campaign's dataset: chosen by the first command, kept by all later ones."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Literal, get_args

from vibroimpact.analysis.dataset.stores.grid import SHARD_POINTS
from vibroimpact.analysis.files.object_paths import AnyPath
from vibroimpact.analysis.files.stores import zarr_package
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import WITH_OUTPUT, message
from vibroimpact.orchestrator.campaign.destination import Destination, JoinedFile
from vibroimpact.orchestrator.campaign.manifest import Manifest
from vibroimpact.orchestrator.campaign.parts import Note
from vibroimpact.orchestrator.campaign.stores.seals import SEALS, STORE, finished_store, has_rows
from vibroimpact.orchestrator.campaign.workers.pieces import MOST_BYTES
from vibroimpact.orchestrator.run.parameters import most_elements
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import run_count

DatasetFormat = Literal["netcdf", "zarr"]

FILE_POINTS = 10**7
"""Number of points from which on the default is a store: one process joins a file, .3 us a point."""

SHARD_BYTES = MOST_BYTES
"""Largest size of the results of a shard in memory, bytes: a worker computes the shard as one chunk."""

_RUN_NUMBERS = 6
"""Numbers of a run that every scene records."""
_PERIOD_NUMBERS, _IMPACT_NUMBERS = 5, 8
_IMPACTS_PER_PERIOD = 2
"""Assumed number of impacts in a recorded period; many more need more memory, not another result."""


def default_format(scene: Scene) -> DatasetFormat:
    """Return the format of a new campaign: a store for 10^7 points or more, where zarr is installed."""
    is_large = run_count(scene.sweep) >= FILE_POINTS
    return "zarr" if is_large and importlib.util.find_spec("zarr") is not None else "netcdf"


def has_dataset(home: AnyPath) -> bool:
    """Return whether a folder has a dataset of either format, finished or not."""
    return (home / "dataset.nc").exists() or has_rows(home / STORE)


def chosen_shard_points(
    home: AnyPath, scene: Scene, manifest: Manifest | None, format: DatasetFormat | None
) -> int:
    """Return the number of points of a shard of a campaign's store; 0: its dataset is a file.

    Parameters
    ----------
    home : Path or ObjectPath
        Folder of the campaign, or its address, where the dataset is a store.
    scene : Scene
    manifest : Manifest or None
        Manifest of the campaign that has begun in the folder.
    format : {"netcdf", "zarr"} or None
        Format that the caller chooses.

    Raises
    ------
    UsageError
        The format is unknown, zarr is not installed, or the campaign has begun with the other format.
    """
    if format is not None and format not in get_args(DatasetFormat):
        raise UsageError(f'format: expected "netcdf" or "zarr", got {format!r}.')
    if not isinstance(home, Path):
        if format == "netcdf":
            raise UsageError(
                message(
                    f"{home}: expected the format zarr for a campaign at an address, got netcdf. "
                    "Leave the format out, or choose a folder of this machine",
                    WITH_OUTPUT,
                    ".",
                )
            )
        format = "zarr"
    if manifest is not None:
        began: DatasetFormat = "zarr" if manifest.shard_points else "netcdf"
        if format not in (None, began):
            raise UsageError(
                message(
                    f"{home}: expected the format with which this campaign was started, {began}, got {format}. "
                    "Leave the format out, or choose another folder",
                    WITH_OUTPUT,
                    "; `vibroimpact convert` makes either from the other.",
                )
            )
    chosen = format or ("zarr" if (home / STORE).exists() else default_format(scene))
    is_store = chosen == "zarr" if manifest is None else manifest.shard_points > 0
    if is_store:
        zarr_package()
    if manifest is not None:
        return manifest.shard_points
    return shard_points_of(scene) if is_store else 0


def shard_points_of(scene: Scene) -> int:
    """Return the number of points of a shard: 2^20, or the power of two whose results fit in memory."""
    record = scene.record
    periods = record.recorded_periods if record.each_period else min(record.recorded_periods, 1)
    numbers = _RUN_NUMBERS + 2 * most_elements(scene) + periods * _PERIOD_NUMBERS
    if record.impacts:
        numbers += max(record.recorded_periods, 1) * _IMPACTS_PER_PERIOD * _IMPACT_NUMBERS
    points = SHARD_POINTS
    while points > 1 and points * numbers * 8 > SHARD_BYTES:
        points //= 2
    return points


def destination_of(
    home: AnyPath, scene: Scene, shard_points: int, scene_hash: str, note: Note
) -> Destination:
    """Return the dataset of a campaign; `note` gets a line for each damaged shard."""
    if not shard_points and isinstance(home, Path):
        return JoinedFile(home, scene)
    # imported only for a store
    from vibroimpact.orchestrator.campaign.stores.grown import GrownStore
    from vibroimpact.orchestrator.campaign.stores.sealing import GrowingStore

    return GrownStore(GrowingStore(str(home), shard_points), scene, scene_hash, note)


def earlier_store(
    home: AnyPath, scene: Scene, shard_points: int, scene_hash: str, note: Note
) -> Destination | None:
    """Return the store of the sweep before an extension, ready to be read; None where its dataset is a file."""
    if not shard_points:
        return None
    store = destination_of(home, scene, shard_points, scene_hash, note)
    if finished_store(store.path, home / SEALS) is None:
        store.make()
    return store
