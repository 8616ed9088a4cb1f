"""Operation `describe`."""

from __future__ import annotations

from vibroimpact.analysis.operations.arguments import AnyFile
from vibroimpact.fmus.operations import Operation, operation


@operation("analysis.commands.describe:describe_file")
class Describe(Operation):
    """List the contents of a file: its origin, its dimensions, each variable with its meaning, unit and values.

    Example: vibroimpact describe run.nc
    """

    file: AnyFile
