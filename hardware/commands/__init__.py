"""The commands of this package: `options` and `rig_options` declare them, `import_files` and `rigs` do them."""

from __future__ import annotations

import typer

from vibroimpact.hardware.commands import options, rig_options

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    options.register(app)
    rig_options.register(app)
