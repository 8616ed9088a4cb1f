"""Arguments that operations of the service's client share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Option, Positional

Url = Annotated[
    str | None,
    Option(
        "--service",
        metavar="URL",
        help="Of the service; by default $VIBROIMPACT_SERVICE, else that in --data, else 127.0.0.1:8737.",
    ),
]
Folder = Annotated[
    Path | None,
    Option("--data", help="Folder of the service, which has its token and URL; else $VIBROIMPACT_TOKEN."),
]
Name = Annotated[str, Positional(help="The id that `submit` printed.", metavar="ID")]
