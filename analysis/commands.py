"""The command `vibroimpact plot`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from vibroimpact.analysis.dataset import open_dataset, open_measured, unreadable
from vibroimpact.fmus.errors import UsageError

_KINDS = ("auto", "bifurcation", "run", "convergence", "portrait", "impact-map", "energies", "shapes")


def register(app: typer.Typer) -> None:
    """Add the commands of this package to the command line."""
    app.command("plot")(plot)


def plot(
    file: Annotated[Path, typer.Argument(help="Dataset file, or the folder of a campaign.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Figure to write: .png, .pdf or .svg.")],
    kind: Annotated[
        str,
        typer.Option(
            help="auto, bifurcation, run, portrait, impact-map, energies and shapes (of modes), "
            "or convergence (of a benchmark)."
        ),
    ] = "auto",
    run: Annotated[
        int | None, typer.Option(help="run_index of the run to draw; implies --kind run.", min=0)
    ] = None,
) -> None:
    """Draw a dataset: a bifurcation diagram, maps over two parameters, one run, or a ladder of macro steps.

    Example: vibroimpact plot campaign/dataset.nc -o bifurcation.png
    """
    # matplotlib takes half a second to import; other commands do not pay for it.
    from vibroimpact.analysis import figures

    if kind not in _KINDS:
        raise UsageError(f"--kind: expected one of {', '.join(_KINDS)}, got {kind!r}.")
    with open_measured(file) if kind == "convergence" else open_dataset(file) as dataset:
        try:
            figure = figures.draw(dataset, cast(Any, kind), run)
        except (OSError, RuntimeError) as problem:
            # Values are read when first used, so a damaged file may show only here.
            raise unreadable(file, problem) from problem
    try:
        figures.save(figure, output)
    except OSError as problem:
        raise UsageError(f"{output}: could not be written: {problem.strerror or problem}.") from problem
    typer.echo(f"Figure written to {output}.")
