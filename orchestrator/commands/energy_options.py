"""Commands of what the modes of impacting bodies exchange and where they resonate, and their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroimpact.analysis.commands.shared_options import DatasetFile, FigureFile, Force
from vibroimpact.orchestrator.commands.scene_options import Changes

SceneOrDataset = Annotated[
    Path,
    typer.Argument(help="Scene file (TOML); or the dataset of its runs (.nc), the folder of a campaign."),
]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command()(energies)
    app.command()(resonances)
    app.command()(lyapunov)


def energies(
    file: SceneOrDataset,
    output: DatasetFile = None,
    figure: FigureFile = None,
    run: Annotated[
        int | None, typer.Option(help="run_index of one run, of which each impact is told.", min=0)
    ] = None,
    changes: Changes = None,
    force: Force = False,
) -> None:
    """Say how energy goes between the modes of an impacting body: what force, damping and impacts give and take.

    Of an oscillator, a chain or a beam on restitution stops, over the periodic orbit of each run, by exact integrals. A
    scene is run first. A run without a periodic orbit (chaos, sticking, no impacts) is told with its reason.

    Example: vibroimpact energies examples/thesis/figure_6_15.toml --figure energies.png
    """
    from vibroimpact.orchestrator.commands.energies import show_energies

    show_energies(file, output, figure, run, changes or (), force)


def resonances(
    file: SceneOrDataset,
    output: DatasetFile = None,
    figure: FigureFile = None,
    changes: Changes = None,
    force: Force = False,
) -> None:
    """Find the peaks of a sweep of the forcing frequency, of the whole body and of each mode, beside what shifts them.

    A stop shifts natural frequencies: by pi / arccos(-a / x), a its position, x the deepest excursion on the other
    side. That is right for one elastic, undamped, unforced mode, and else a guess. A scene is run first.

    Example: vibroimpact resonances examples/thesis/figure_6_4.toml --figure resonances.png
    """
    from vibroimpact.orchestrator.commands.resonances import show_resonances

    show_resonances(file, output, figure, changes or (), force)


def lyapunov(
    file: SceneOrDataset,
    output: DatasetFile = None,
    figure: FigureFile = None,
    changes: Changes = None,
    force: Force = False,
) -> None:
    """Find the Lyapunov exponents of runs with impacts, from the saltation of their impacts; their sum is checked.

    Of an oscillator, a chain or a beam on restitution stops; 200 impacts and more count. A scene is run first. A run
    without exponents (no impacts, sticking) is told with its reason.

    Example: vibroimpact lyapunov examples/thesis/figure_2_11.toml --set record.recorded_periods=2000
    """
    from vibroimpact.orchestrator.commands.lyapunov import show_exponents

    show_exponents(file, output, figure, changes or (), force)
