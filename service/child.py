"""What the processes of the service share: they tell it things in lines of JSON, and end when it does, or when told."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import signal
import subprocess
import sys
import threading
from typing import Any

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of a disk, a quota or a limit of files that is full; they pass."""


def say(**what: Any) -> None:
    """Tell the service something: one line of JSON on standard output."""
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def end_with_service() -> None:
    """End this process and what it has started as soon as standard input does: then the service is gone."""
    threading.Thread(target=_wait_for_end, daemon=True).start()


def _wait_for_end() -> None:
    os.read(0, 1)
    os.killpg(os.getpid(), signal.SIGKILL)


def kill_session(process: subprocess.Popen[Any]) -> None:
    """Kill a process with all that it has started in its session."""
    if sys.platform == "win32":
        process.kill()
        return
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
