"""The commands of this package; each module registers its own."""

from __future__ import annotations

import typer

from vibroimpact.analysis.commands import estimate, plot, replay_fmu, spikes

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands of this package to the command line."""
    for module in (plot, estimate, spikes, replay_fmu):
        module.register(app)
