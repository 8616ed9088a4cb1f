"""Commands of what the modes of impacting bodies exchange, and their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroimpact.analysis.commands.shared_options import DatasetFile, FigureFile, Force


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command()(energies)


def energies(
    file: Annotated[
        Path,
        typer.Argument(help="Scene file (TOML); or the dataset of its runs (.nc), the folder of a campaign."),
    ],
    output: DatasetFile = None,
    figure: FigureFile = None,
    run: Annotated[
        int | None, typer.Option(help="run_index of one run, of which each impact is told.", min=0)
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change a key of the scene; may be repeated."),
    ] = None,
    force: Force = False,
) -> None:
    """Say how energy goes between the modes of an impacting body: what the force gives, what damping and impacts take.

    Of an oscillator, a chain or a beam on restitution stops, over the periodic orbit of each run, by exact integrals. A
    scene is run first. A run without a periodic orbit (chaos, sticking, no impacts) is told with its reason.

    Example: vibroimpact energies examples/thesis/figure_6_15.toml --figure energies.png
    """
    from vibroimpact.orchestrator.commands.energies import show_energies

    show_energies(file, output, figure, run, changes or (), force)
