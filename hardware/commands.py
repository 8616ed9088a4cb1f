"""The commands of this package; each module registers its own."""

from __future__ import annotations

import typer

from vibroimpact.hardware import import_command


def register(app: typer.Typer) -> None:
    """Add the commands of this package to the command line."""
    import_command.register(app)
