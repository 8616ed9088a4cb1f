"""Operation `fmu check`: what is wrong with FMUs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import STRICT, Operation, Option, Positional, operation


@operation("fmus.commands.fmu:check_all")
class CheckFmus(Operation):
    """Check FMUs: description, binaries, functions, token. Runs their code.

    What will not run is an error, what may run wrong and what is only odd are said.

    Example: vibroimpact fmu check Oscillator.fmu
    """

    files: Annotated[list[Path] | None, Positional(help="FMU files; all of the package if none.")] = None
    strict: Annotated[bool, Option("--strict", help=STRICT)] = False
