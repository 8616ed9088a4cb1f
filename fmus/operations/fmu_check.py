"""Operation `fmu check`: find the faults of FMUs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import STRICT, Operation, Option, Positional, operation


@operation("fmus.commands.fmu:check_all")
class CheckFmus(Operation):
    """Check FMUs: description, binaries, functions, token. Runs their code.

    Faults that keep an FMU from running are errors. Faults that may spoil a run, and mere oddities, are printed.

    Example: vibroimpact fmu check Oscillator.fmu
    """

    files: Annotated[list[Path] | None, Positional(help="FMU files; default: all of the package.")] = None
    strict: Annotated[bool, Option("--strict", help=STRICT)] = False
