"""Operation `fmu list`: the components of the package and their FMUs."""

from __future__ import annotations

from vibroimpact.fmus.operations import Operation, operation


@operation("fmus.commands.fmu:print_components")
class ListFmus(Operation):
    """Show every component, its FMUs and their platforms.

    Example: vibroimpact fmu list
    """
