"""The process that reads untrusted files: damaged bytes can do harm to the libraries only here.

Each file is read in a separate process, a `fork` of one with the libraries already imported, and limited by
`confinement`. Run as a file, this module is a server that forks. Each line of standard input is an order, a JSON
object. The answer is a line of JSON: {"verdict": "read" | "raised" | "late" | "died", ...}. For "read" it has the
sizes of the buffers whose bytes follow. Nothing is pickled.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import select
import signal
import sys
from collections.abc import Mapping
from typing import Any

from vibroimpact.fmus.confinement import confine, end_with_parent
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.fmus.processes.child import write_whole
from vibroimpact.fmus.processes.fork import forked

#: Time without a file to read after which the server ends, s.
IDLE = 30.0
LONGEST_TEXT = 20_000
_LATE = frozenset(
    getattr(signal, name) for name in ("SIGALRM", "SIGPROF", "SIGXCPU") if hasattr(signal, name)
)


def import_libraries(order: Mapping[str, Any]) -> None:
    """Import the libraries for the file of an order, once for all files."""
    for name in (*order["libraries"], order["reader"].partition(":")[0]):
        with contextlib.suppress(ImportError):  # the reader reports missing libraries
            importlib.import_module(name)


def read_in_limits(order: Mapping[str, Any], parent: int, answers: int, begins: int | None = None) -> None:
    """Read a file, by an `Order` as a mapping, within limits, and answer; this process is a fork for this file alone.

    The process ends with its parent. The descriptors are for the answer, and for a byte that announces its beginning.
    """
    end_with_parent(parent)
    confine(order["seconds"], order["memory"])
    message = read_here(order)
    for timer in (signal.ITIMER_PROF, signal.ITIMER_REAL):  # the receiver of the answer may be slow
        signal.setitimer(timer, 0.0)
    if begins is not None:
        os.write(begins, b"1")
    write_whole(answers, message)


def read_here(order: Mapping[str, Any]) -> list[Any]:
    """Read the file of an order in this process; return the line of the answer and its buffers."""
    try:
        module, _, function = order["reader"].partition(":")
        facts, buffers = getattr(importlib.import_module(module), function)(order["path"], order["options"])
        views = [memoryview(buffer).cast("B") for buffer in buffers]
        found = {"verdict": "read", "facts": facts, "sizes": [view.nbytes for view in views]}
        return [_line(found), *views]
    # any exception is an effect of the file on its reader
    except BaseException as error:
        return [_line(_raised(error))]


def _raised(error: BaseException) -> dict[str, Any]:
    found: dict[str, Any] = {
        "verdict": "raised",
        "error": type(error).__name__,
        "text": str(error)[:LONGEST_TEXT],
    }
    if isinstance(error, VibroimpactError):
        found["typed"] = error.typed[:LONGEST_TEXT]
    if isinstance(error, OSError):
        found |= {"system": True, "errno": error.errno, "reason": error.strerror or str(error)[:LONGEST_TEXT]}
    return found


def how_it_ended(status: int) -> dict[str, str]:
    """Return the answer for a process that ended without one, from the status of its end."""
    ended_by = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    return {"verdict": "late" if ended_by in _LATE else "died", "error": str(ended_by or "")}


def _line(found: dict[str, Any]) -> bytes:
    return json.dumps(found).encode() + b"\n"


def _read_in_fork(order: dict[str, Any], answers: int) -> None:
    """Let a separate process read the file of an order, and answer; report its end if it does not answer."""
    has_begun, begins = os.pipe()
    server = os.getpid()
    process = forked(lambda: read_in_limits(order, server, answers, begins))
    os.close(begins)
    with os.fdopen(has_begun, "rb") as pipe:
        # standard input has data only when nobody waits for this answer any more
        if select.select([0, pipe.fileno()], [], [])[0] == [0]:
            os.kill(process, signal.SIGKILL)
        answered = pipe.read()
    _, status = os.waitpid(process, 0)
    if status and answered:
        os._exit(1)  # in the middle of its answer, which nobody can continue to read
    if not answered:
        write_whole(answers, [_line(how_it_ended(status))])


def main() -> None:
    """Answer orders until standard input ends, or no order comes for `IDLE` s."""
    answers = os.dup(1)
    os.dup2(2, 1)  # text printed by a library must not mix with the answers
    forks = hasattr(os, "fork")
    while not forks or select.select([0], [], [], IDLE)[0]:
        line = sys.stdin.buffer.readline()
        if not line:
            return
        order = json.loads(line)
        import_libraries(order)
        if forks:
            _read_in_fork(order, answers)
        else:
            write_whole(answers, read_here(order))


if __name__ == "__main__":
    main()
