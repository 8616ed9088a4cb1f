"""Operation `estimate bounces`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.analysis.operations.arguments import ChannelName, Data, RunIndex, WindowEnd, WindowStart
from vibroimpact.fmus.operations import DatasetFile, FigureFile, Force, Operation, Option, operation


@operation("analysis.commands.estimate:bounces_of")
class EstimateBounces(Operation):
    """Estimate the restitution of a body that bounces under its weight, or under another constant force.

    Where the restitution changes with the speed of impact, r(v) is given in its place.

    Example: vibroimpact estimate bounces ball.nc --channel height -o estimates.nc --figure estimates.png
    """

    data: Data
    channel: ChannelName = None
    start: WindowStart = None
    stop_time: WindowEnd = None
    run: RunIndex = None
    side: Annotated[
        str | None, Option(help="Side of the stop, upper or lower; else as the signal shows.")
    ] = None
    output: DatasetFile = None
    figure: FigureFile = None
    force: Force = False
