"""Operation `rig recover`: the journal of an aborted measurement into a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Door, Force, Operation, Option, Positional, operation


@operation("hardware.programs.recover:recover_into", Door("recover"))
class Recover(Operation):
    """Make the recording of an aborted measurement, from its journal.

    Example: vibroimpact rig recover tip.journal -o tip.nc
    """

    journal: Annotated[
        Path,
        Positional(
            help="Journal of an aborted measurement.",
            metavar="REC.journal",
            python="journal: str | os.PathLike[str]",
        ),
    ]
    output: Annotated[
        Path | None,
        Option("--output", "-o", help="Recording to write; by default REC.nc beside the journal.", python=""),
    ] = None
    force: Force = False
