"""Operation `campaign`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from vibroimpact.fmus.operations import Door, Operation, Option, Positional, operation
from vibroimpact.orchestrator.operations.arguments import Changes, Strict


@operation("orchestrator.commands.campaign:run_to_folder", Door("campaign", also=("progress: bool = True",)))
class Campaign(Operation):
    """Run all points of a scene's sweep with many workers; the same command resumes.

    Example: vibroimpact campaign examples/bifurcation.toml -o bifurcation --workers 2
    """

    scene: Annotated[
        Path,
        Positional(
            python="scene: SceneLike",
            help="Scene file (TOML) or a system (SSP) with a sweep, or the folder of a campaign that goes on.",
        ),
    ]
    output: Annotated[
        Path,
        Option(
            "--output",
            "-o",
            python="folder: PathLike",
            help="Folder of the campaign, or an address such as s3://bucket/map.",
        ),
    ]
    changes: Changes = None
    workers: Annotated[
        int | None,
        Option(
            help="Worker processes; by default one for each processor, if more than 2 s of work remain.",
            min=1,
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        Option(
            python="scheduler: str | Client | None = None",
            help="Use the workers of this Dask scheduler (tcp://host:8786) instead.",
        ),
    ] = None
    format: Annotated[
        Literal["netcdf", "zarr"] | None,
        Option(
            python="format: Literal['netcdf', 'zarr'] | None = None",
            help="Format of the dataset: one NetCDF file, or a Zarr store that grows without being joined. By default "
            "netcdf; zarr from 10^7 points on, where it is installed.",
        ),
    ] = None
    strict: Strict = False
