"""Operation `estimate response`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.analysis.operations.arguments import ChannelName, Data, RunIndex, WindowEnd, WindowStart
from vibroimpact.fmus.operations import DatasetFile, FigureFile, Force, Operation, Option, Request, operation


@operation("analysis.commands.estimate:response_of")
class EstimateResponse(Operation):
    """Estimate a resonance from a drive and a response, or from a simulated sweep of the frequency.

    Example: vibroimpact estimate response hammer.nc --drive force --channel tip --segment 8192
    """

    data: Data
    channel: ChannelName = None
    start: WindowStart = None
    stop_time: WindowEnd = None
    run: RunIndex = None
    drive: Annotated[
        str | None, Option(request=Request(), help="Channel that drives, for a frequency response.")
    ] = None
    form: Annotated[
        str,
        Option(
            request=Request(choices=("auto", "displacement", "velocity", "acceleration", "transmissibility")),
            help="Motion: auto, displacement, velocity, acceleration or transmissibility.",
        ),
    ] = "auto"
    band: Annotated[
        tuple[float, float] | None,
        Option(request=Request(above=0), help="Band of the resonance, two numbers, Hz."),
    ] = None
    segment: Annotated[
        int | None,
        Option(request=Request(least=16, most=2**26), help="Samples in a segment of the spectra.", min=16),
    ] = None
    window: Annotated[
        str,
        Option(
            request=Request(choices=("bartlett", "hann", "boxcar")),
            help="Window of the spectra: bartlett, hann or boxcar.",
        ),
    ] = "bartlett"
    estimator: Annotated[
        str, Option(request=Request(choices=("h1", "h2")), help="h1 (noisy response) or h2 (noisy drive).")
    ] = "h1"
    output: DatasetFile = None
    figure: FigureFile = None
    force: Force = False
