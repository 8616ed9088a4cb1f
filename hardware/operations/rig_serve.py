"""Operation `rig serve`: a virtual rig on a port of this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Operation, Option, Positional, operation


@operation("hardware.commands.rigs:serve_rig")
class ServeRig(Operation):
    """Serve a virtual rig on this machine, as NI's gRPC device server serves a board, until Ctrl-C.

    Example: vibroimpact rig serve examples/rig/oscillator.toml
    """

    file: Annotated[Path, Positional(help="File of a virtual rig (TOML).", metavar="RIG.toml")]
    port: Annotated[int, Option(min=0, max=65535, help="Port; 0: any free port.")] = 31763
    speed: Annotated[
        float | None, Option(help="Seconds of the rig in a second of real time; by default as the file says.")
    ] = None
    lockstep: Annotated[
        bool, Option("--lockstep", help="Time advances only while a program waits for it.")
    ] = False
