"""The command `vibroimpact plot`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from vibroimpact.analysis import estimate_command, replay_fmu_command, spikes_command
from vibroimpact.analysis.dataset import open_dataset, open_measured
from vibroimpact.analysis.fingerprints import matches_recorded_hash
from vibroimpact.analysis.opening import DAMAGE, unreadable
from vibroimpact.analysis.outputs import refuse_outputs, writing
from vibroimpact.analysis.recording_files import is_recording, open_recording
from vibroimpact.analysis.results import results_kind
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.terminal import say

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.analysis.figures import Figure

_KINDS = ("auto", "bifurcation", "run", "convergence", "portrait", "impact-map", "energies", "shapes")


def register(app: typer.Typer) -> None:
    """Add the commands of this package to the command line."""
    app.command("plot")(plot)
    estimate_command.register(app)
    spikes_command.register(app)
    replay_fmu_command.register(app)


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
    """Draw a dataset: a bifurcation diagram, maps over two parameters, one run, a recording, a replay, estimates.

    Example: vibroimpact plot campaign/dataset.nc -o bifurcation.png
    """
    # matplotlib takes half a second to import; other commands do not pay for it.
    from vibroimpact.analysis import figures

    if kind not in _KINDS:
        raise UsageError(f"--kind: expected one of {', '.join(_KINDS)}, got {kind!r}.")
    # as `open_dataset` takes the folder of a campaign
    file = file / "dataset.nc" if file.is_dir() else file
    refuse_outputs([file], None, output)
    found = results_kind(file)
    try:
        if kind == "auto" and run is None and is_recording(file):
            figure = figures.draw_recording(open_recording(file))
        elif kind == "auto" and found is not None:
            with open_measured(file) as results:
                figure = _drawn(results, found, file)
        else:
            with open_measured(file) if kind == "convergence" else open_dataset(file) as dataset:
                figure = figures.draw(dataset, cast(Any, kind), run)
    except DAMAGE as problem:
        # Values are read when first used, so that damage may show only here. What bears the hash of its writer holds
        # what was written: there the fault is not the file's.
        if isinstance(problem, OSError | RuntimeError) or not matches_recorded_hash(file):
            raise unreadable(file, problem) from problem
        raise
    with writing(output):
        figures.save(figure, output)
    say(f"Figure written to {output}.")


def _drawn(results: xr.Dataset, kind: str, file: Path) -> Figure:
    """Return the figure of what an analysis found; results may lack what their figure shows, or be another's."""
    from vibroimpact.analysis import figures

    if kind == "spikes" and "interval" not in results:
        raise UsageError(
            f"{file}: expected at least three spikes, whose intervals can be drawn, got fewer. "
            "`vibroimpact spikes --figure` draws them beside the signal."
        )
    try:
        return figures.draw_results(results, kind)
    except (LookupError, ValueError, TypeError, AttributeError) as problem:
        raise DatasetError(
            f"{file}: expected what `vibroimpact {kind}` writes, got other contents: {str(problem)[:200]}"
        ) from problem
