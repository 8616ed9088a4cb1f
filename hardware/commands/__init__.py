"""The commands of this package; each module registers its own."""

from __future__ import annotations

import typer

from vibroimpact.hardware.commands import import_recording

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands of this package to the command line."""
    import_recording.register(app)
