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
        help="Address of the service; default $VIBROIMPACT_SERVICE, then the one in --data, then 127.0.0.1:8737.",
    ),
]
Folder = Annotated[
    Path | None,
    Option("--data", help="Folder of the service, with its token and URL; default $VIBROIMPACT_TOKEN."),
]
Name = Annotated[str, Positional(help="The id that `submit` printed.", metavar="ID")]
