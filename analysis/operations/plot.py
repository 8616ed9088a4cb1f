"""Operation `plot`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.analysis.operations.arguments import AnyFile, WindowEnd, WindowStart
from vibroimpact.fmus.operations import Operation, Option, operation

_KINDS_HELP = (
    "auto; of a sweep bifurcation, branches, classes, map, impacts-per-period, impact-frequency, strobe, shapes, "
    "scores; of a run run, portrait, strobe, impact-map, return-map, spectrum, density, energies; of a recording or "
    "replay spectrum and density too; of a benchmark convergence, work-precision."
)


@operation("analysis.commands.plot:draw_file")
class Plot(Operation):
    """Draw a dataset: a bifurcation diagram, maps over two parameters, one run, a recording, a replay, estimates.

    Example: vibroimpact plot campaign/dataset.nc -o bifurcation.png

    A measured sweep over the simulated one: vibroimpact plot sweep --over campaign -o both.png
    """

    file: AnyFile
    output: Annotated[Path, Option("--output", "-o", help="Figure to write: .png, .pdf or .svg.")]
    kind: Annotated[str, Option(help=_KINDS_HELP)] = "auto"
    run: Annotated[
        int | None, Option(help="run_index of the run to draw; alone it implies --kind run.", min=0)
    ] = None
    recording: Annotated[
        str | None,
        Option(help="Recording of a replay, fitted or not: a1.nc, or the name of a comparison."),
    ] = None
    start: WindowStart = None
    stop: WindowEnd = None
    periods: Annotated[
        float | None,
        Option(help="Length of the window in forcing periods, after --from or before --to."),
    ] = None
    over: Annotated[
        Path | None,
        Option(help="Another sweep, drawn below: the simulated one of a measured one.", metavar="FILE"),
    ] = None
    segment: Annotated[
        int | None, Option(help="Of a density: samples of a segment, a power of two; else 1024.")
    ] = None
    variable: Annotated[
        str | None,
        Option(
            help="Of a bifurcation diagram or branches: what is drawn, such as displacement_max, strobe_displacement, "
            "impact_phase.",
            metavar="NAME",
        ),
    ] = None
    title: Annotated[str | None, Option(help='Title above the figure; "" for none.')] = None
    width: Annotated[float | None, Option(help="Width of the figure, mm; else one column, 85.")] = None
    height: Annotated[float | None, Option(help="Height of the figure, mm.")] = None
