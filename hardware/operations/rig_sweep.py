"""Operation `rig sweep`: a measured frequency sweep into a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Door, Operation, Option, Positional, operation
from vibroimpact.hardware.operations.arguments import RigChoice


@operation(
    "hardware.programs.sweep.command:sweep_rig", Door("measure_sweep", also=("progress: bool = True",))
)
class MeasureSweep(Operation):
    """Measure a frequency sweep, up and down, as a dataset like a campaign's; the same command continues it.

    Ctrl-C brings the output to rest; finished steps are kept.

    Example: vibroimpact rig sweep examples/rig/sweep.toml -o sweep
    """

    file: Annotated[
        Path,
        Positional(
            help="File of a sweep (TOML).", metavar="SWEEP.toml", python="file: str | os.PathLike[str]"
        ),
    ]
    output: Annotated[
        Path,
        Option(
            "--output",
            "-o",
            help="Folder of the dataset.",
            metavar="FOLDER",
            python="folder: str | os.PathLike[str]",
        ),
    ]
    rig: RigChoice = None
    dry_run: Annotated[
        bool,
        Option(
            "--dry-run", help="Draw the planned output and print its duration without driving it.", python=""
        ),
    ] = False
