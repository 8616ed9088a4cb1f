"""Arguments shared by operations on rigs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Option

_RIG_HELP = "virtual:RIG.toml, grpc://host:port or local."
RigChoice = Annotated[str | None, Option("--rig", help=_RIG_HELP, metavar="RIG")]
MeasuringRig = Annotated[
    str | None,
    Option("--rig", help=_RIG_HELP, metavar="RIG", python="rig: str | Rig | None"),
]
Recorded = Annotated[Path, Option("--output", "-o", help="Recording to write (.nc).", python="")]
Channels = Annotated[
    list[str],
    Option(
        help="NAME=TERMINAL[,RANGE]: an input and its range in V; repeatable, 8 at most.",
        metavar="NAME=TERMINAL[,RANGE]",
        python="channels: Sequence[str]",
    ),
]
Rate = Annotated[float, Option(help="Samples per second and channel.")]
Duration = Annotated[float | None, Option(help="Duration, s; by default until Ctrl-C.")]
Calibrations = Annotated[
    list[Path] | None,
    Option(
        help="File of calibrations (TOML), for values in m or N instead of V.",
        metavar="FILE.toml",
        python="calibration: Sequence[str | os.PathLike[str]] = ()",
    ),
]
