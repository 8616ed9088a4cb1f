"""Operation `replay`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Door, FigureFile, Force, Operation, Option, Positional, operation


@operation(
    "orchestrator.commands.replay:replay_recordings",
    Door("replay", without=("save_scene", "workers", "scheduler")),
)
class Replay(Operation):
    """Drive a scene by recorded channels and compare its motion with measured channels.

    One recording, or several with --fit and --score, make a dataset. A folder as output makes a campaign over all
    recordings and the scene's sweep, on many workers; the same command resumes it.

    Example: vibroimpact replay examples/recordings/board.toml a0.nc -o fit.nc --fit body.damping_ratio --score a1.nc
    """

    scene: Annotated[
        Path, Positional(python="scene: SceneLike", help=r"Scene file (TOML) with a \[replay] table.")
    ]
    recordings: Annotated[
        list[Path] | None,
        Positional(
            python="recordings: PathLike | Sequence[PathLike] = ()",
            help="Recordings to replay and to fit to; by default those that the scene names.",
        ),
    ] = None
    output: Annotated[
        Path | None,
        Option(
            "--output",
            "-o",
            python="path: PathLike | None = None",
            help="Dataset to write (.nc), or the folder of a campaign.",
        ),
    ] = None
    fit: Annotated[
        str | None,
        Option(
            python="fit: str | Sequence[str] = ()",
            help="Numbers of the scene to fit: body.damping_ratio,sensor.gain",
        ),
    ] = None
    score: Annotated[
        list[Path] | None,
        Option(
            python="score: PathLike | Sequence[PathLike] = ()",
            help="Recording that is compared but not used in the fit; may be repeated.",
        ),
    ] = None
    save_scene: Annotated[
        Path | None,
        Option(help="Scene to write with the fitted numbers (.toml); an existing one only with --force."),
    ] = None
    figure: FigureFile = None
    execution: Annotated[
        str | None,
        Option(help="auto, fused, or coupled (driven by a Replay FMU); by default as the scene says."),
    ] = None
    workers: Annotated[int | None, Option(help="Worker processes of a campaign.", min=1)] = None
    scheduler: Annotated[str | None, Option(help="Dask scheduler of a campaign.")] = None
    force: Force = False
