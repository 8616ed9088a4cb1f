"""Programs on a rig in processes of their own: started, interrupted, killed, recovered."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from harness import warm

from support.command_line import ENTRY

PATIENCE = 60.0
"""Time, s, after which a program counts as hanging."""


@contextmanager
def program(*words: str | Path, cwd: Path) -> Iterator[warm.Program]:
    """Run a command of `vibroimpact` in a session of its own; kill it if it outlives the block."""
    environment = os.environ | {"COLUMNS": "200"}
    process = warm.start(ENTRY, *words, cwd=cwd, env=environment, start_new_session=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def wait_for_bytes(path: Path, count: int, process: warm.Program) -> None:
    """Wait until a file has a number of bytes."""
    end = time.monotonic() + PATIENCE
    while not (path.exists() and path.stat().st_size >= count):
        if process.poll() is not None or time.monotonic() > end:
            _, said = process.communicate()
            raise AssertionError(f"{path}: expected {count} bytes, the program said: {said}")
        time.sleep(0.01)
