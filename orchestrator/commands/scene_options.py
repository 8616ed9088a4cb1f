"""Options that commands of scenes have, worded once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroimpact.fmus.commands.options import STRICT

SceneFile = Annotated[Path, typer.Argument(help="Scene file (TOML), or a system (SSP).")]
Strict = Annotated[bool, typer.Option("--strict", help=STRICT)]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key of the scene before it is checked, the key as messages write it; may be repeated.",
    ),
]
