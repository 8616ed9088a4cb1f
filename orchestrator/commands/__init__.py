"""The command line; `cli` is what starts, each module registers its own commands."""

from __future__ import annotations

import typer

from vibroimpact.orchestrator.commands import campaign, replay

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands of this package to the command line."""
    campaign.register(app)
    replay.register(app)
