"""Operation `rig sine`: a sine on an output of a rig."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import Door, Operation, Option, operation
from vibroimpact.hardware.operations.arguments import RigChoice


@operation("hardware.programs.sine:drive_output", Door("drive_sine", also=("progress: bool = True",)))
class DriveSine(Operation):
    """Drive an output with a sine until Ctrl-C or for a time; a guardian brings it to rest if this program cannot.

    Example: vibroimpact rig sine --rig grpc://127.0.0.1:31763 --output Dev1/ao0 --frequency 5.3 --amplitude 1
    """

    output: Annotated[str, Option(help="Driving output.", metavar="TERMINAL", python="terminal: str")]
    frequency: Annotated[float, Option(help="Frequency, Hz.")]
    amplitude: Annotated[float, Option(help="Amplitude, V.")]
    ramp: Annotated[
        float, Option(help="Duration of the rise at the start and of the fall at the end, s.")
    ] = 0.5
    duration: Annotated[
        float | None, Option(help="Duration, ramps included, s; by default until Ctrl-C.")
    ] = None
    rate: Annotated[float, Option(help="Samples per second.")] = 10_000.0
    most_amplitude: Annotated[float, Option(help="Limit of the output voltage, V.")] = 5.0
    most_slew: Annotated[float, Option(help="Limit of the output slew rate, V/s.")] = 2000.0
    rig: RigChoice = None
