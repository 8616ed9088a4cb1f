"""Operation `export-ssp`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Door, Operation, Option, Positional, operation
from vibroimpact.orchestrator.operations.arguments import Changes


@operation("orchestrator.commands.ssp:export_to_archive", Door("export_ssp"))
class ExportSsp(Operation):
    """Write a scene of components as a system for other tools: FMUs, start values, connections.

    Parts without a form in SSP (events, record, sweep, execution) go into an annotation, which an import reads back.

    Example: vibroimpact ssp export examples/two_oscillators.toml -o two.ssp
    """

    scene: Annotated[Path, Positional(python="scene: SceneLike", help="Scene file (TOML) of components.")]
    output: Annotated[
        Path | None, Option("--output", "-o", python="path: PathLike", help="Archive to write (.ssp).")
    ] = None
    changes: Changes = None
    ssp: Annotated[str, Option(help="SSP version, 1.0 or 2.0.")] = "1.0"
    fmi: Annotated[
        str | None,
        Option(
            help="FMI version of this package's components in the archive, 2.0 or 3.0; by default 2.0, with "
            "SSP 2.0 as the scene says."
        ),
    ] = None
    gains: Annotated[
        str,
        Option(
            help="A gain is a component with its own units, or a transformation of its connection: without delay "
            "where values are exchanged once a step, but OMSimulator leaves it out."
        ),
    ] = "component"
    platform: Annotated[str | None, Option(help="Target machines, as in `vibroimpact fmu export`.")] = None
