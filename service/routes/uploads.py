"""The body of a request as a file: streamed to the disk, whole or not at all."""

from __future__ import annotations

import asyncio
import hashlib
import shutil
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path

from fastapi import Request
from starlette.requests import ClientDisconnect

from vibroimpact.fmus.confinement import machine_memory
from vibroimpact.service.memory import imports_at_once
from vibroimpact.service.problems import ProblemError

MOST_RECEIVED = 16
"""Number of uploads whose bodies are received at the same time; further uploads wait before their bodies are read."""
STALLED_SECONDS = 30.0
"""Silence after which an upload is aborted, s."""
_PREFIX = ".upload-"


@dataclass(frozen=True, slots=True)
class Upload:
    """An uploaded file, in a folder of its own, which is removed with the request."""

    file: Path
    sha256: str


class Uploads:
    """Receives uploads, some at a time, into a folder of this service alone; leftovers of a killed one are removed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        for left in folder.glob(f"{_PREFIX}*"):
            shutil.rmtree(left)
        self._receptions = asyncio.Semaphore(MOST_RECEIVED)
        self.turn = asyncio.Semaphore(imports_at_once(machine_memory()))
        """Turns for importing uploads, as many as the memory allows; a body that arrives slowly holds none."""

    @asynccontextmanager
    async def received(self, request: Request, name: str) -> AsyncIterator[Upload]:
        """Receive the body of a request under a name; raise ProblemError if it stalled or was cut off."""
        async with self._receptions:
            with tempfile.TemporaryDirectory(prefix=_PREFIX, dir=self._folder) as folder:
                file = Path(folder, name)
                yield Upload(file, await _written(request, file))


async def _written(request: Request, file: Path) -> str:
    """Write the body of a request to a file; return its SHA-256."""
    digest = hashlib.sha256()
    blocks = aiter(request.stream())
    try:
        with file.open("wb") as target:
            while (block := await asyncio.wait_for(anext(blocks, None), STALLED_SECONDS)) is not None:
                digest.update(block)
                target.write(block)
    except TimeoutError:
        raise ProblemError(
            HTTPStatus.REQUEST_TIMEOUT,
            f"expected the rest of {file.name}, got nothing for {STALLED_SECONDS:.0f} s.",
        ) from None
    except ClientDisconnect:
        raise ProblemError(HTTPStatus.BAD_REQUEST, f"{file.name}: the connection was cut off.") from None
    return digest.hexdigest()
