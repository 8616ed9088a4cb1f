"""Arguments that operations on datasets and recordings share, worded once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Option, Positional, Request

AnyFile = Annotated[
    Path,
    Positional(
        help="Dataset (.nc, .zarr, address), recording or results (.nc), or the folder of a campaign."
    ),
]
Data = Annotated[Path, Positional(help="Recording (.nc), or dataset of runs (.nc, .zarr, address).")]
ChannelName = Annotated[
    str | None, Option("--channel", request=Request(), help="Channel to use; not needed where there is one.")
]
WindowStart = Annotated[float | None, Option("--from", request=Request(), help="Start of the window, s.")]
WindowEnd = Annotated[float | None, Option("--to", request=Request("stop"), help="End of the window, s.")]
RunIndex = Annotated[
    int | None,
    Option(
        "--run",
        request=Request(least=0, most=2**31),
        help="run_index of the run, where there are several.",
        min=0,
    ),
]
