"""Operation `fmu replay`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Operation, Option, Positional, operation


@operation("analysis.commands.replay_fmu:build_player")
class ExportReplay(Operation):
    """Make an FMU that plays recorded channels in this or another tool: value, slope, validity. Needs no compiler.

    Example: vibroimpact fmu replay a0.nc --channel base --si -o a0.fmu

    For a tool of FMI 2.0 on Windows: vibroimpact fmu replay a0.nc --fmi 2.0 --platform x86_64-windows -o a0.fmu
    """

    recording: Annotated[Path, Positional(help="Recording (.nc), or a dataset with time series.")]
    output: Annotated[Path, Option("--output", "-o", help="FMU to write.")]
    channel: Annotated[list[str] | None, Option(help="Channel to play; again for more; default: all.")] = None
    si: Annotated[bool, Option("--si", help="Play values in SI units: g becomes m/s2, mV becomes V.")] = False
    run: Annotated[int | None, Option(help="run_index, of a dataset of several runs.", min=0)] = None
    fmi: Annotated[str, Option(help="FMI version, 3.0 or 2.0.")] = "3.0"
    platform: Annotated[
        str | None, Option(help="Machines it is for: all, or names, as for `fmu export`.")
    ] = None
