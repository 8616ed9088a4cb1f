"""Lets a fork of this process read a file of a stranger: nothing has to be imported again.

A fork has the memory of this process, and none of its descriptors: it can write nothing and tell nobody. It lacks the
other threads; one that waits for a lock of theirs is given up, and says nothing of the file.
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

#: Wall time beyond that of the limits after which a fork is killed, s: the fork itself ends before.
GRACE = 10.0
#: Wall time after which a fork that sleeps and computes nothing is given up, s; one that waits for a disk is not.
PATIENCE_WITH_SLEEP = 3.0
_GLANCE = 0.2
"""Wall time between two looks at a fork, s."""
_ANSWER = 3


class _Watch:
    """Kills a fork that takes too long, or waits for what never comes."""

    def __init__(self, process: int, seconds: float) -> None:
        self._process, self._deadline = process, time.monotonic() + seconds
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self.is_stuck = False
        self._thread.start()

    def _look(self) -> None:
        before, since = "", time.monotonic()
        while not self._over.wait(_GLANCE):
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
    """Return the processor time of a process that sleeps, as the system writes it; empty of one that does not."""
    try:
        known = Path(f"/proc/{process}/stat").read_text(encoding="latin-1").rpartition(")")[2].split()
    except OSError:
        return ""
    return " ".join(known[11:13]) if known[0] == "S" else ""


def read_in_fork(order: Order) -> Answer | None:
    """Let a fork of this process read a file; None where that says nothing of the file.

    A lock that a lost thread held is what a fork may wait for. A system may have no room for a fork.
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
    """End a process that has nothing left to do, whatever it does; return its status, 0 where another took that."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)
    try:
        return os.waitpid(process, 0)[1]
    except ChildProcessError:
        return 0


def _leave_all_files(answer: int) -> None:
    """Let a fork keep no descriptor of the process that it was made from but that of its answer, as number 3."""
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
