"""Operation `rig record`: inputs of a rig into a recording."""

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
    "hardware.programs.record:record_channels",
    Door("record", also=("journal: str | os.PathLike[str] | None = None",)),
)
class Record(Operation):
    """Record inputs of a rig; the recording says which rig made it.

    A journal beside it has all samples: after any death of the program, `rig recover` makes the recording.

    Example: vibroimpact rig record --rig virtual:RIG.toml --channel tip=Dev1/ai0,5 --rate 5000 --duration 2 -o tip.nc
    """

    output: Recorded
    channel: Channels
    rate: Rate
    duration: Duration = None
    loopback: Annotated[
        list[str] | None,
        Option(
            help="Input to which an output is wired, and its range in V.",
            metavar="NAME=TERMINAL[,RANGE]",
            python="loopback: Sequence[str] = ()",
        ),
    ] = None
    calibration: Calibrations = None
    rig: MeasuringRig = None
    force: Force = False
