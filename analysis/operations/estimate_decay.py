"""Operation `estimate decay`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.analysis.operations.arguments import ChannelName, Data, RunIndex, WindowEnd, WindowStart
from vibroimpact.fmus.operations import DatasetFile, FigureFile, Force, Operation, Option, Request, operation


@operation("analysis.commands.estimate:decay_of")
class EstimateDecay(Operation):
    """Estimate frequency, damping and damping law from a free decay.

    Example: vibroimpact estimate decay pendulum.nc --from 40 --to 80 -o estimates.nc --figure estimates.png
    """

    data: Data
    channel: ChannelName = None
    start: WindowStart = None
    stop_time: WindowEnd = None
    run: RunIndex = None
    law: Annotated[
        str,
        Option(request=Request(), help="Damping law to fit: all, none, or a sum such as viscous+coulomb."),
    ] = "all"
    cubic: Annotated[
        bool, Option("--cubic", request=Request(), help="Fit a cubic stiffness with every damping law.")
    ] = False
    periods: Annotated[
        float | None,
        Option(request=Request(least=2, most=1e6), help="Periods in a window of the backbone.", min=2.0),
    ] = None
    output: DatasetFile = None
    figure: FigureFile = None
    force: Force = False
