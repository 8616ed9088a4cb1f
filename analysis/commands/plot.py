"""The command `vibroimpact plot`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroimpact.analysis.dataset import open_dataset, open_measured
from vibroimpact.analysis.dataset.outputs import refuse_outputs, writing
from vibroimpact.analysis.dataset.results import file_attributes
from vibroimpact.analysis.files.fingerprints import matches_recorded_hash
from vibroimpact.analysis.files.opening import DAMAGE, unreadable
from vibroimpact.analysis.recording import open_recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.terminal import say

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.analysis.figures import Figure
    from vibroimpact.analysis.recording import Recording

_KINDS_HELP = (
    "auto; of a sweep bifurcation, map, impacts-per-period, strobe, shapes, scores; of a run run, portrait, strobe, "
    "impact-map, return-map, spectrum, energies; of a recording or replay spectrum too; of a benchmark convergence, "
    "work-precision."
)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("plot")(plot)


def plot(
    file: Annotated[
        Path, typer.Argument(help="Dataset, recording or results (.nc), or the folder of a campaign.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Figure to write: .png, .pdf or .svg.")],
    kind: Annotated[str, typer.Option(help=_KINDS_HELP)] = "auto",
    run: Annotated[
        int | None, typer.Option(help="run_index of the run to draw; alone it implies --kind run.", min=0)
    ] = None,
    recording: Annotated[
        str | None,
        typer.Option(help="Recording of a replay, fitted or not: a1.nc, or the name of a comparison."),
    ] = None,
    start: Annotated[float | None, typer.Option("--from", help="Start of the window, s.")] = None,
    stop: Annotated[float | None, typer.Option("--to", help="End of the window, s.")] = None,
    periods: Annotated[
        float | None,
        typer.Option(help="Length of the window in forcing periods, after --from or before --to."),
    ] = None,
    title: Annotated[str | None, typer.Option(help='Title above the figure; "" for none.')] = None,
    width: Annotated[float | None, typer.Option(help="Width of the figure, mm; else one column, 85.")] = None,
    height: Annotated[float | None, typer.Option(help="Height of the figure, mm.")] = None,
) -> None:
    """Draw a dataset: a bifurcation diagram, maps over two parameters, one run, a recording, a replay, estimates.

    Example: vibroimpact plot campaign/dataset.nc -o bifurcation.png
    """
    # matplotlib takes half a second to import; other commands do not pay for it.
    from vibroimpact.analysis import figures

    # as `open_dataset` takes the folder of a campaign
    file = file / "dataset.nc" if file.is_dir() else file
    refuse_outputs([file], None, output)
    options: dict[str, Any] = {"recording": recording, "start": start, "stop": stop, "periods": periods}
    options |= {"title": title, "width": width, "height": height}
    try:
        with _opened(file) as data:
            figure = _drawn(file, data, lambda: figures.draw(data, kind, run, **options))
    except DAMAGE as problem:
        # Values are read when first used, so that damage may show only here. What bears the hash of its writer holds
        # what was written: there the fault is not the file's.
        if isinstance(problem, OSError | RuntimeError) or not matches_recorded_hash(file):
            raise unreadable(file, problem) from problem
        raise
    with writing(output):
        figures.save(figure, output)
    say(f"Figure written to {output}.")


def _opened(file: Path) -> AbstractContextManager[xr.Dataset | Recording]:
    """Open a recording, a dataset of runs, or what an analysis found or a benchmark measured."""
    attributes = file_attributes(file)
    if "recording_schema" in attributes:
        return nullcontext(open_recording(file))
    if "results_kind" in attributes:
        results = open_measured(file)
        if attributes["results_kind"] == "spikes" and "interval" not in results:
            results.close()
            raise UsageError(
                f"{file}: expected at least three spikes, whose intervals can be drawn, got fewer. "
                "`vibroimpact spikes --figure` draws them beside the signal."
            )
        return results
    if "dataset_schema" not in attributes:
        measured = open_measured(file)
        if "error" in measured:
            return measured
        measured.close()
    return open_dataset(file)


def _drawn(file: Path, data: xr.Dataset | Recording, draw: Callable[[], Figure]) -> Figure:
    """Return the figure of a file; results may lack what their figure shows, or be another's."""
    kind = data.attrs.get("results_kind")
    if kind is None:
        return draw()
    try:
        return draw()
    except (LookupError, ValueError, TypeError, AttributeError) as problem:
        raise DatasetError(
            f"{file}: expected what `vibroimpact {kind}` writes, got other contents: {str(problem)[:200]}"
        ) from problem
