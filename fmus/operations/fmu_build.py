"""Operation `fmu build`: compile the components of the package for this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Operation, Option, operation


@operation("fmus.commands.fmu:build_into")
class BuildFmus(Operation):
    """Compile all components for this machine.

    Example: vibroimpact fmu build
    """

    output: Annotated[Path | None, Option(help="Folder to fill; default: the package's.")] = None
