"""Operation `import-ssp`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Door, Force, Operation, Option, Positional, operation
from vibroimpact.orchestrator.operations.arguments import Changes


@operation("orchestrator.commands.ssp:import_to_scene", Door("import_ssp"))
class ImportSsp(Operation):
    """Write a system as a scene file, with its FMUs in a folder beside it. `vibroimpact run` takes the system as it is.

    Example: vibroimpact ssp import two.ssp -o two.toml

    A sweep: vibroimpact ssp import two.ssp --parameters soft.ssv --parameters hard.ssv -o sweep.toml
    """

    archive: Annotated[Path, Positional(python="path: PathLike", help="System (.ssp, version 1.0 or 2.0).")]
    output: Annotated[
        Path | None,
        Option(
            "--output",
            "-o",
            python="output: PathLike | None = None",
            help="Scene file to write (.toml); FMUs go beside it.",
        ),
    ] = None
    changes: Changes = None
    parameters: Annotated[
        list[Path] | None,
        Option(
            python="parameters: PathLike | Sequence[PathLike] = ()",
            help="Parameter set (.ssv), a file or one in the archive; several make a sweep.",
        ),
    ] = None
    force: Force = False
