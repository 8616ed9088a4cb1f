"""A Python process in a session of its own: it streams its answers, and may outlive its parent process."""

from __future__ import annotations

import io
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Literal

from vibroimpact.fmus.processes.python_child import python_command

_ERRORS = {"dropped": subprocess.DEVNULL, "kept": subprocess.PIPE, "shared": None}


class Process(subprocess.Popen[bytes]):
    """A process that runs Python, with a pipe for orders and a pipe for answers.

    Ctrl-C and the end of a terminal reach all processes of a session, but not this process; its parent ends it. The
    child decides whether it ends with its parent (`child.end_when_closed`).

    Parameters
    ----------
    *arguments : str
        Arguments of Python: `-m` and a module, or a file, followed by the program's own arguments.
    errors : str
        Use of its standard error: `dropped`, `kept` to be read here, or `shared` with this process.
    passed : sequence of int
        Further descriptors that the process inherits.
    environment : mapping, optional
        Environment of the process; the default is the environment of this process.
    folder : Path, optional
        Current folder of the process; the default is the current folder of this process.

    Raises
    ------
    OSError
        The process cannot be started.
    """

    stdin: IO[bytes]
    stdout: IO[bytes]

    def __init__(
        self,
        *arguments: str,
        errors: Literal["dropped", "kept", "shared"] = "dropped",
        passed: Sequence[int] = (),
        environment: Mapping[str, str] | None = None,
        folder: Path | None = None,
    ) -> None:
        self._received = b""
        super().__init__(
            python_command(*arguments),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=_ERRORS[errors],
            pass_fds=passed,
            env=environment,
            cwd=folder,
            start_new_session=True,
        )

    def say(self, rows: Iterable[bytes | memoryview]) -> None:
        """Write bytes to the process; if it is gone, its answers show that."""
        with suppress(BrokenPipeError):
            self.stdin.writelines(rows)
            self.stdin.flush()

    def line(self, seconds: float) -> str:
        """Return the next line of its answers; empty if none came in time, or the answers have ended."""
        end = time.monotonic() + seconds
        while b"\n" not in self._received:
            if not select.select([self.stdout], [], [], max(end - time.monotonic(), 0.0))[0]:
                return ""
            part = os.read(self.stdout.fileno(), 4096)
            if not part:
                return ""
            self._received += part
        line, _, self._received = self._received.partition(b"\n")
        return line.decode(errors="replace").strip()

    def lines(self) -> Iterator[str]:
        """Yield the lines of its answers until they end."""
        return _lines(self.stdout)

    def lines_of_errors(self) -> Iterator[str]:
        """Yield the lines of its standard error, which must be `kept`, until it ends."""
        assert self.stderr is not None
        return _lines(self.stderr)

    def end(self, seconds: float) -> int:
        """Close the pipe of orders; kill the session if the end takes longer than `seconds`; return the exit code."""
        with suppress(BrokenPipeError):  # the unsent rest has no reader any more
            self.stdin.close()
        return self._killed_after(seconds)

    def interrupt(self, seconds: float) -> int:
        """End the process as Ctrl-C does; kill the session after `seconds` without its end; return the exit code."""
        self.send_signal(signal.SIGINT)
        return self._killed_after(seconds)

    def _killed_after(self, seconds: float) -> int:
        try:
            return self.wait(seconds)
        except subprocess.TimeoutExpired:
            self.kill_session()
            return self.wait()

    def kill_session(self) -> None:
        """Kill all processes of its session, also those left after its own end."""
        if sys.platform == "win32":
            self.kill()
            return
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)


def _lines(pipe: IO[bytes]) -> Iterator[str]:
    with io.TextIOWrapper(pipe, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            yield line.removesuffix("\n")
