"""Operation `estimate impacts`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.analysis.operations.arguments import ChannelName, Data, RunIndex, WindowEnd, WindowStart
from vibroimpact.fmus.operations import DatasetFile, FigureFile, Force, Operation, Option, Request, operation


@operation("analysis.commands.estimate:impacts_of")
class EstimateImpacts(Operation):
    """Estimate restitution, damping, frequency and forcing from motion against a stop.

    For a simulated run, forcing and stop are taken from its scene.

    Example: vibroimpact estimate impacts run.nc --run 3 -o estimates.nc --figure estimates.png
    """

    data: Data
    channel: ChannelName = None
    start: WindowStart = None
    stop_time: WindowEnd = None
    run: RunIndex = None
    forcing_frequency: Annotated[
        float | None,
        Option(request=Request(least=0), help="Frequency of the force, Hz; 0: no force oscillates."),
    ] = None
    angular_frequency: Annotated[float | None, Option(request=Request(least=0), help="The same, rad/s.")] = (
        None
    )
    amplitude: Annotated[
        float | None,
        Option(
            request=Request(above=0),
            help="Amplitude of the force, N; needs the mass and a natural frequency.",
        ),
    ] = None
    static_deflection: Annotated[
        float | None,
        Option(
            request=Request(above=0), help="Amplitude of the force over the stiffness, unit of the channel."
        ),
    ] = None
    phase: Annotated[float | None, Option(request=Request(), help="Phase of the force at time 0, rad.")] = (
        None
    )
    stop: Annotated[
        float | None,
        Option(request=Request("stop_position"), help="Position of the stop, unit of the channel."),
    ] = None
    natural_frequency: Annotated[
        float | None, Option(request=Request(above=0), help="Undamped natural frequency, Hz.")
    ] = None
    damping_ratio: Annotated[
        float | None, Option(request=Request(), help="Damping ratio, where it is known.")
    ] = None
    mass: Annotated[float | None, Option(request=Request(above=0), help="Mass, kg.")] = None
    offset: Annotated[
        float | None, Option(request=Request(), help="What the channel reads at rest, where it is known.")
    ] = None
    clock_drifts: Annotated[
        bool,
        Option(
            "--clock-drifts",
            request=Request(),
            help="Clocks of force and recording differ: the forcing frequency is fitted, within 0.5 %.",
        ),
    ] = False
    output: DatasetFile = None
    figure: FigureFile = None
    force: Force = False
