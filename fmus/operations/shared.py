"""Arguments that operations of several packages share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations.declaring import Option

#: Help text of the option of all commands that read FMUs of other tools.
STRICT = "Refuse FMUs that may run wrong, instead of warning."
Force = Annotated[
    bool,
    Option(
        "--force",
        help="Overwrite a file with other contents; repeating the same command needs no --force.",
        python="",
    ),
]
FigureFile = Annotated[
    Path | None, Option("--figure", help="Figure to write: .png, .pdf or .svg.", python="")
]
DatasetFile = Annotated[
    Path | None,
    Option("--output", "-o", help="Dataset to write (.nc).", python="path: PathLike | None = None"),
]
