"""Operation `demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Operation, Option, operation


@operation("orchestrator.commands.demo:run_demo")
class Demo(Operation):
    """Run the bifurcation of the impact oscillator: campaign, dataset, figure, and readings with their exact values.

    Example: vibroimpact demo -o demo
    """

    output: Annotated[Path, Option("--output", "-o", help="Folder for the results.")] = Path("demo")
