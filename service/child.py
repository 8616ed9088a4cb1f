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
SHORT = (errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOBUFS)
"""Errors of a process or system without free descriptors or memory; they pass."""


def say(**what: Any) -> None:
    """Tell the service something: one line of JSON on standard output."""
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def begin_as_child() -> None:
    """Keep standard output for what is said, and end with the service.

    What an FMU prints goes to standard error, and so into the log. When standard input ends the service is gone: this
    process is killed then, with what it has started.
    """
    sys.stdout.flush()
    sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
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
