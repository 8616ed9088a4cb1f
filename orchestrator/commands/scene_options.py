"""Options that commands of scenes have, worded once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SceneFile = Annotated[Path, typer.Argument(help="Scene file (TOML), or a system (SSP).")]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key of the scene before it is checked, the key as messages write it; may be repeated.",
    ),
]
