"""The child process of a guard, as the guard sees it: orders, answers, and its end."""

from __future__ import annotations

import contextlib
import os
import queue
import select
import sys
import threading
from dataclasses import replace
from functools import partial
from typing import IO, Any

from vibroimpact.fmus.processes.process import Process
from vibroimpact.orchestrator.guard.pipe import BELL, Order, receive, send

#: Whether the system can wait for a bell, so that points run in batches; elsewhere a thread reads single answers.
HAS_BELL = os.name == "posix"
#: Size of the pipe of answers, bytes: the most that Linux allows to every user.
PIPE_SIZE = 1 << 20
#: Longest time for a child to end, s: longer than its supervisor takes to kill all processes of an FMU.
END_TIME = 10.0


def _enlarge(pipe: IO[bytes]) -> None:
    """Let a pipe hold many answers, if the system allows it: a full pipe blocks its writer."""
    if sys.platform == "linux":
        import fcntl  # POSIX only

        with contextlib.suppress(OSError):
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_SIZE)


class PointProcess:
    """A running child process; at most the answers of one batch are under way."""

    def __init__(self, order: Order) -> None:
        self._bell, bell = os.pipe() if HAS_BELL else (-1, -1)
        self._memory = os.memfd_create("records") if sys.platform == "linux" else None
        passed = [each for each in (bell, self._memory) if each is not None] if HAS_BELL else []
        self._process = Process("-m", "vibroimpact.orchestrator.guard.supervisor", str(bell), passed=passed)
        _enlarge(self._process.stdout)
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._reader: threading.Thread | None = None
        if HAS_BELL:
            os.close(bell)
            self._poll = select.poll()
            self._poll.register(self._bell, select.POLLIN)
        else:
            self._reader = threading.Thread(target=self._read, daemon=True)
            self._reader.start()
        self.say(replace(order, memory=self._memory))

    def _read(self) -> None:
        while (answer := receive(self._process.stdout)) is not None:
            self._answers.put(answer)
        self._answers.put(None)

    def say(self, message: Any) -> None:
        """Send a message; a dead child shows in its answer."""
        with contextlib.suppress(BrokenPipeError):
            send(self._process.stdin, message)

    def answers(self, seconds: float) -> tuple[list[Any], bool]:
        """Wait for answers; return them, and whether they are the last of the batch.

        The last answer of a dead child is None. TimeoutError: the child has not rung its bell; `end` returns its
        answers so far.
        """
        if self._reader is not None:
            try:
                return [self._answers.get(timeout=seconds)], True
            except queue.Empty:
                raise TimeoutError from None
        if not self._poll.poll(1e3 * seconds):
            raise TimeoutError
        rung = os.read(self._bell, BELL.size)
        if len(rung) < BELL.size:
            return [None], True
        count, last = BELL.unpack(rung)
        answers = [receive(self._process.stdout, self._memory) for _ in range(count)]
        return answers, last or answers[-1] is None

    def end(self, *, at_once: bool = False) -> tuple[int, list[Any]]:
        """End the child, by force if needed; return its exit code (negative: the signal) and unread answers."""
        if at_once:
            self._process.terminate()
        code = self._process.end(END_TIME)
        answers = self._unread()
        self._process.stdout.close()
        if self._memory is not None:
            os.close(self._memory)
        return code, answers

    def _unread(self) -> list[Any]:
        if self._reader is not None:
            self._reader.join()
            return []
        os.close(self._bell)
        pipe = self._process.stdout
        # a process that an FMU has started may hold the pipe open
        os.set_blocking(pipe.fileno(), False)
        return list(iter(partial(receive, pipe, self._memory), None))
