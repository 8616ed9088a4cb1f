"""Operation `basins`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, Option, study
from vibroimpact.orchestrator.operations.arguments import Changes, SceneFile


@study("orchestrator.orbits.basin_shares:BasinShares", Door("basins", without=("output",)))
class Basins(Operation):
    """Find the attractor of each start in a plane of displacements and velocities, and the share of each attractor.

    Long runs find the attractors, and classes of runs name them. A start counts as soon as it is close to an
    attractor: within a distance from which all test starts came back. The slowest decay that was met says how long
    starts are followed. Shares have confidence intervals, and the largest share that may have been missed is printed.
    With --parameter the shares are those over a number of the scene, as stacked fractions.

    Example: vibroimpact basins examples/basins.toml --points 500 -o basins.nc --figure basins.png
    """

    scene: SceneFile
    x: Annotated[
        str | None,
        Option(
            metavar="LOW:HIGH",
            python="x: Span | None = None",
            help="Displacements at the start (m); by default up to twice the size of the scene's motion.",
        ),
    ] = None
    y: Annotated[
        str | None,
        Option(
            metavar="LOW:HIGH",
            python="y: Span | None = None",
            help="Velocities at the start (m/s); by default up to twice the size of the scene's motion.",
        ),
    ] = None
    points: Annotated[
        str,
        Option(
            metavar="N or NxM", python="points: tuple[int, int] = (200, 200)", help="Starts along both axes."
        ),
    ] = "200"
    number: Annotated[
        int | None,
        Option(help="Mass of a chain (first impacting one) or mode of a beam (1) with these starts."),
    ] = None
    periods: Annotated[int, Option(help="Budget: most forcing periods for which one start is followed.")] = (
        100_000
    )
    edges: Annotated[
        bool, Option(help="Follow the edges between basins to the saddles on them, which `follow` takes.")
    ] = False
    parameter: Annotated[
        str | None,
        Option(metavar="KEY", help="Number of the scene over which the shares of the attractors are found."),
    ] = None
    start: Annotated[
        float | None,
        Option(
            "--from",
            python="parameter_range: tuple[float, float] | None = None",
            help="First end of its range.",
        ),
    ] = None
    stop: Annotated[float | None, Option("--to", python="", help="Second end of its range.")] = None
    values: Annotated[int, Option(help="Number of values in that range.")] = 21
    output: DatasetFile = None
    figure: FigureFile = None
    changes: Changes = None
    force: Force = False
