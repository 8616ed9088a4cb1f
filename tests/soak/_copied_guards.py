"""Guards as copies of a warm process: nearly all processor time of a cold start is spent on imports."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from typing import IO

from harness import warm

from vibroimpact.orchestrator.guard import point_process

COLD = 4
"""Number of cases of a process that start their guards cold: a small sample does not pay for a warm process."""
PROGRAM = """
import os, sys
for number in map(int, sys.argv[4:]):
    opened = os.open(f"/proc/{sys.argv[1]}/fd/{number}", os.O_RDWR if number == int(sys.argv[3]) else os.O_WRONLY)
    if opened != number:
        os.dup2(opened, number)
        os.close(opened)
os.write(1, b" ")
sys.argv = ["-m", sys.argv[2]]
from vibroimpact.orchestrator.guard.supervisor import main
main()
"""
_cases = 0


@contextlib.contextmanager
def copied_guards() -> Iterator[None]:
    """Start guards as copies of a warm process inside this context, except for the first cases of this process."""
    global _cases
    _cases += 1
    if sys.platform != "linux" or _cases <= COLD:
        yield
        return
    if _cases == COLD + 1:
        with contextlib.chdir("/"):  # a case's processes are known by their folder
            warm.start_server()
        warm.wait_for_server()
    point_process.Process, before = _Process, point_process.Process  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        point_process.Process = before  # type: ignore[misc]


class _Process:
    """A copy with the part of `Process` that a guard uses."""

    stdin: IO[bytes]
    stdout: IO[bytes]

    def __init__(self, _option: str, _module: str, bell: str, *, passed: Sequence[int]) -> None:
        memory = next((number for number in passed if number != int(bell)), -1)
        words = map(str, (os.getpid(), bell, memory, *passed))
        self._copy = warm.start(
            PROGRAM, *words, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
        )
        self.stdin, self.stdout = self._copy.stdin.detach(), self._copy.stdout.detach()
        os.read(self.stdout.fileno(), 1)  # it has its descriptors: the guard may close its own

    def terminate(self) -> None:
        """Send SIGTERM to the supervisor."""
        self._copy.terminate()

    def end(self, seconds: float) -> int:
        """Close the pipe of orders; kill the session if the end takes longer than `seconds`; return the exit code."""
        with contextlib.suppress(BrokenPipeError):
            self.stdin.close()
        try:
            return self._copy.wait(seconds)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._copy.pid, signal.SIGKILL)
            return self._copy.wait()
