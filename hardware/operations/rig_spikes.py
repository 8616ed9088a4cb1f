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
    threshold: Annotated[float, Option(help="Beyond it is a pulse, unit of the channel; negative: below it.")]
    duration: Duration = None
    pulses: Annotated[int | None, Option(help="Pulses after which it ends.")] = None
    on: Annotated[str, Option(help="Channel that has the pulses; else the first.")] = ""
    presamples: Annotated[int, Option(help="Samples that are kept of before a pulse.")] = 64
    postsamples: Annotated[int, Option(help="Samples that are kept of after a pulse.")] = 64
    dead_time: Annotated[
        float,
        Option(
            help="Time from the start of a pulse, s, within which what passes the threshold belongs to it."
        ),
    ] = 0.0
    hysteresis: Annotated[float, Option(help="Part of the threshold below which a pulse is over.")] = 0.5
    calibration: Calibrations = None
    rig: MeasuringRig = None
    force: Force = False
