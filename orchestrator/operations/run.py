"""Operation `run`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Door, Force, Operation, Option, operation
from vibroimpact.orchestrator.operations.arguments import Changes, SceneFile, Strict


@operation("orchestrator.commands.run:run_to_dataset", Door("run", also=("progress: bool = True",)))
class Run(Operation):
    """Run a scene in this process, one point after the other, into one dataset.

    Example: vibroimpact run examples/single_run.toml -o run.nc
    """

    scene: SceneFile
    output: Annotated[
        Path, Option("--output", "-o", python="path: PathLike | None = None", help="Dataset to write (.nc).")
    ]
    changes: Changes = None
    force: Force = False
    strict: Strict = False
