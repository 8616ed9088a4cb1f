"""Operation `rig spikes`: pulses of a load cell into a recording."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import Door, Force, Operation, Option, operation
from vibroimpact.hardware.operations.arguments import (
    Calibrations,
    Channels,
    Duration,
    MeasuringRig,
    Rate,
    Recorded,
)


@operation(
    "hardware.programs.spikes:record_pulses",
    Door("record_spikes", also=("journal: str | os.PathLike[str] | None = None",)),
)
class RecordSpikes(Operation):
    """Record the pulses of a load cell with the samples around them; `vibroimpact spikes` measures them.

    Example: vibroimpact rig spikes --rig local --channel cell=Dev1/ai1,5 --rate 50000 --threshold 0.1 -o hits.nc
    """

    output: Recorded
    channel: Channels
    rate: Rate
    threshold: Annotated[
        float, Option(help="Threshold of a pulse, unit of the channel; a negative one is passed downwards.")
    ]
    duration: Duration = None
    pulses: Annotated[int | None, Option(help="Number of pulses after which the measurement ends.")] = None
    on: Annotated[str, Option(help="Channel with the pulses; by default the first.")] = ""
    presamples: Annotated[int, Option(help="Number of samples kept before a pulse.")] = 64
    postsamples: Annotated[int, Option(help="Number of samples kept after a pulse.")] = 64
    dead_time: Annotated[
        float,
        Option(help="Dead time from the start of a pulse, s; later crossings within it belong to the pulse."),
    ] = 0.0
    hysteresis: Annotated[float, Option(help="Part of the threshold below which a pulse ends.")] = 0.5
    calibration: Calibrations = None
    rig: MeasuringRig = None
    force: Force = False
