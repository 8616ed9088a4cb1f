"""Operation `diagram`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, Option, study
from vibroimpact.orchestrator.operations.arguments import (
    Changes,
    Doublings,
    Grazes,
    SceneFile,
    SecondStart,
    SecondStop,
)


@study("orchestrator.orbits.diagram:Diagram", Door("diagram"))
class MakeDiagram(Operation):
    """Sweep a scene both ways, follow its orbits, and find shares of basins and exponents: one figure, one dataset.

    Without --parameter the diagram is over the one or two keys of the scene's own sweep. A part that a scene cannot
    have is named with the reason, and the others are made.

    With --second the diagram is a map of the classes of runs over both numbers, with the loci of bifurcations on it.

    Example: vibroimpact diagram examples/bifurcation.toml -o diagram.nc --figure diagram.png
    """

    scene: SceneFile
    parameter: Annotated[str | None, Option(metavar="KEY", help="Varied number of the scene.")] = None
    start: Annotated[float | None, Option("--from", help="First end of its range.")] = None
    stop: Annotated[float | None, Option("--to", help="Second end of its range.")] = None
    output: DatasetFile = None
    figure: FigureFile = None
    values: Annotated[int | None, Option(help="Number of values in that range (401; 121 with --second).")] = (
        None
    )
    parts: Annotated[
        str | None,
        Option(
            metavar="NAME,...",
            python="parts: Sequence[str] | None = None",
            help="Parts that are made: sweep, branches, shares, exponents; with --second sweep, loci. Default: all.",
        ),
    ] = None
    points: Annotated[int, Option(help="Starts along both axes of the planes in which basins are found.")] = (
        60
    )
    share_values: Annotated[int, Option(help="Number of values at which the shares of basins are found.")] = (
        41
    )
    impacts: Annotated[int | None, Option(help="Impacts of the first orbits that are followed (1).")] = None
    periods: Annotated[int, Option(help="Forcing periods of the first orbits that are followed.")] = 1
    doublings: Doublings = 1
    grazes: Grazes = 1
    second: Annotated[str | None, Option(metavar="KEY", help="Second varied number of the scene.")] = None
    second_start: SecondStart = None
    second_stop: SecondStop = None
    second_values: Annotated[int | None, Option(help="Number of values in its range (81).")] = None
    changes: Changes = None
    force: Force = False
