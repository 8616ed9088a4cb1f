"""Reading of an untrusted file in a fork of this process, which needs no imports.

A fork has the memory of this process and none of its descriptors: it can neither write nor send anything. It lacks the
other threads. A fork that waits for one of their locks is abandoned; this says nothing about the file.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from dataclasses import asdict
from pathlib import Path

from vibroimpact.fmus.confinement import PATIENCE
from vibroimpact.fmus.processes.fork import forked
from vibroimpact.fmus.reader_child import how_it_ended, import_libraries, read_in_limits
from vibroimpact.fmus.reader_orders import Answer, Order, received

#: Wall time beyond the limits after which a fork is killed, s; normally the fork ends itself before.
GRACE = 10.0
#: Wall time after which a sleeping fork without progress is abandoned, s; a fork that waits for a disk is not.
PATIENCE_WITH_SLEEP = 3.0
_WATCH_INTERVAL = 0.2
"""Interval between two checks of a fork, s."""
_ANSWER = 3


class _Watch:
    """Watch that kills a fork if it takes too long, or waits in vain."""

    def __init__(self, process: int, seconds: float) -> None:
        self._process, self._deadline = process, time.monotonic() + seconds
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self.is_stuck = False
        self._thread.start()

    def _look(self) -> None:
        before, since = "", time.monotonic()
        while not self._over.wait(_WATCH_INTERVAL):
            now = time.monotonic()
            seen = _asleep_at(self._process)
            if not seen or seen != before:
                before, since = seen, now
            self.is_stuck = now - since > PATIENCE_WITH_SLEEP
            if self.is_stuck or now > self._deadline:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(self._process, signal.SIGKILL)
                return

    def end(self) -> None:
        self._over.set()
        self._thread.join()


def _asleep_at(process: int) -> str:
    """Return the processor time of a sleeping process, as the system writes it; empty if the process is not asleep."""
    try:
        known = Path(f"/proc/{process}/stat").read_text(encoding="latin-1").rpartition(")")[2].split()
    except OSError:
        return ""
    return " ".join(known[11:13]) if known[0] == "S" else ""


def read_in_fork(order: Order) -> Answer | None:
    """Let a fork of this process read a file; return None if the outcome says nothing about the file.

    The fork may wait for a lock that a lost thread held, or the system may have no room for a fork.
    """
    given = asdict(order)
    import_libraries(given)
    parent = os.getpid()
    answers, answer = os.pipe()

    def read() -> None:
        _leave_all_files(answer)
        read_in_limits(given, parent, _ANSWER)

    try:
        process = forked(read)
    except OSError:
        os.close(answers)
        return None
    finally:
        os.close(answer)
    watch = _Watch(process, PATIENCE * order.seconds + GRACE)
    try:
        with open(answers, "rb") as stream:
            found = received(stream, order.most_bytes)
    finally:
        watch.end()
        status = _end(process)
    if found is not None:
        return found
    waited = os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM
    ended = how_it_ended(status)
    return None if waited or watch.is_stuck else Answer(ended["verdict"], error=ended["error"])


def _end(process: int) -> int:
    """Kill a process whose work is over; return its status, 0 if another thread has collected it."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)
    try:
        return os.waitpid(process, 0)[1]
    except ChildProcessError:
        return 0


def _leave_all_files(answer: int) -> None:
    """Close all descriptors that a fork got from its parent, except the descriptor for its answer, as number 3."""
    import fcntl

    answer = fcntl.fcntl(answer, fcntl.F_DUPFD, _ANSWER + 1)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in range(_ANSWER):
        os.dup2(nowhere, number)
    os.dup2(answer, _ANSWER)
    for number in map(int, os.listdir("/proc/self/fd")):
        if number > _ANSWER:
            with contextlib.suppress(OSError):  # the descriptor of the listing itself
                os.close(number)
