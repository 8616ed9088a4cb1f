"""Figures of any file of the service."""

from __future__ import annotations

import io
from http import HTTPStatus
from pathlib import Path
from typing import Any

from vibroimpact.analysis import figures
from vibroimpact.analysis.commands.opened_file import opened_file
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.service.landed import READING
from vibroimpact.service.problems import ProblemError

MEDIA = {"png": "image/png", "svg": "image/svg+xml"}
"""Media types by format."""
DRAWN: dict[str, Any] = {"content": {media: {} for media in MEDIA.values()}}
"""OpenAPI description of the answers of a route that draws."""


def drawn(path: Path, file_format: str, kind: str = "auto", run: int | None = None) -> bytes:
    """Return the figure of a dataset, a recording or an estimate; answer 422 if the file does not hold the request."""
    try:
        buffer = io.BytesIO()
        with READING, opened_file(path) as found:
            figures.draw(found, kind, run).savefig(buffer, format=file_format)
    except VibroimpactError as error:
        raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, error.typed) from None
    return buffer.getvalue()
