"""Campaigns: sweeps of a scene on many workers, kept in a folder and returned as a dataset."""

from __future__ import annotations

import os
from contextlib import nullcontext
from typing import TYPE_CHECKING, Literal

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.fmus.errors import UsageError
from vibroimpact.given import PathLike, SceneLike, given_path, prepared_scene
from vibroimpact.orchestrator.campaign import run_campaign
from vibroimpact.orchestrator.campaign.workers.processors import refuse_two_kinds_of_workers
from vibroimpact.orchestrator.run.progress import Progress, shown_progress
from vibroimpact.orchestrator.ssp import refuse_system_elsewhere

if TYPE_CHECKING:
    from vibroimpact.orchestrator.campaign.workers.cluster import Client


def campaign(
    scene: SceneLike,
    folder: PathLike,
    *,
    workers: int | None = None,
    scheduler: str | Client | None = None,
    format: Literal["netcdf", "zarr"] | None = None,
    progress: bool = True,
) -> xr.Dataset:
    """Compute all points of a scene's sweep with many workers; the same call resumes an interrupted campaign.

    Parameters
    ----------
    scene : Scene, path or mapping
        A scene with a sweep, the file of a scene or of a system (SSP), or the tables of a scene.
    folder : path
        Folder of this campaign alone; it is made when absent. The dataset is its file `dataset.nc`, or its store
        `dataset.zarr`. The folder may be an address such as `s3://bucket/map`; the dataset is then a store.
    workers : int, optional
        Number of worker processes on this machine. By default the campaign begins in this process. One worker for
        each processor takes over where more than 2 s of work are left.
    scheduler : str or dask.distributed.Client, optional
        Dask scheduler whose workers to use instead: its address, or a client of it.
    format : {"netcdf", "zarr"}, optional
        Format of the dataset: one file, or a Zarr store that grows without being joined. By default a file; a store
        from 10^7 points on, where zarr is installed (`pip install "vibroimpact[store]"`).
    progress : bool
        Whether to show the progress.

    Returns
    -------
    xarray.Dataset
        The dataset as `open_dataset(folder)` returns it.

    Raises
    ------
    SceneError
        The scene is wrong; the message lists all problems, one a line.
    UsageError
        The folder cannot be written or belongs to another scene, or nothing listens at `scheduler`.
    CampaignError
        The campaign could not finish; the same call resumes it.
    CampaignInterrupted
        Ctrl-C was pressed (a KeyboardInterrupt); the same call resumes the campaign.

    Examples
    --------
    >>> found = campaign("examples/bifurcation.toml", "bifurcation", workers=2)        # doctest: +SKIP
    >>> found.displacement_range.sel(direction="up")                                   # doctest: +SKIP
    """
    if workers is not None and (not isinstance(workers, int) or workers < 1):
        raise UsageError(f"workers: expected a whole number of 1 or more, got {workers!r}.")
    refuse_two_kinds_of_workers(workers, scheduler)
    if isinstance(scene, str | os.PathLike):
        refuse_system_elsewhere(scene, scheduler)
    with shown_progress() if progress else nullcontext(Progress()) as shown:
        report = run_campaign(
            prepared_scene(scene),
            given_path(folder),
            workers=workers,
            scheduler=scheduler,
            progress=shown,
            format=format,
        )
    return open_dataset(report.dataset)
