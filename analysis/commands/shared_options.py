"""Options that commands of several packages have, worded once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Force = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Overwrite a file that holds something else; the same command may be repeated without.",
    ),
]
FigureFile = Annotated[Path | None, typer.Option("--figure", help="Figure to write: .png, .pdf or .svg.")]
DatasetFile = Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")]
