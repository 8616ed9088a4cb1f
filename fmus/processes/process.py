"""A Python process in a session of its own: it streams its answers, and may outlive the process that has started it."""

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
    """A process that runs Python, with a pipe of orders to it and one of answers from it.

    Ctrl-C and the end of a terminal reach all processes of a session: this one does not hear them, and is ended by the
    process that has started it. Whether it ends with that process is its own matter (`child.end_when_closed`).

    Parameters
    ----------
    *arguments : str
        Of Python: `-m` and a module, or a file, then what these are given.
    errors : str
        What becomes of its standard error: `dropped`, `kept` to be read here, or `shared` with this process.
    passed : sequence of int
        Descriptors that it has too.
    environment : mapping, optional
        Its own in place of that of this process.
    folder : Path, optional
        Its current folder in place of that of this process.

    Raises
    ------
    OSError
        It cannot be started.
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
        self._heard = b""
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
        """Write bytes; a process that is gone shows in its answers."""
        with suppress(BrokenPipeError):
            self.stdin.writelines(rows)
            self.stdin.flush()

    def line(self, seconds: float) -> str:
        """Return the next line that it says; empty: none came in time, or none comes any more."""
        end = time.monotonic() + seconds
        while b"\n" not in self._heard:
            if not select.select([self.stdout], [], [], max(end - time.monotonic(), 0.0))[0]:
                return ""
            part = os.read(self.stdout.fileno(), 4096)
            if not part:
                return ""
            self._heard += part
        line, _, self._heard = self._heard.partition(b"\n")
        return line.decode(errors="replace").strip()

    def lines(self) -> Iterator[str]:
        """Yield the lines that it says, until its answers end."""
        return _lines(self.stdout)

    def lines_of_errors(self) -> Iterator[str]:
        """Yield the lines of its standard error, which is kept, until that ends."""
        assert self.stderr is not None
        return _lines(self.stderr)

    def end(self, seconds: float) -> int:
        """Close the pipe of orders; kill its session where it has not ended after a time, s; return its exit code."""
        with suppress(BrokenPipeError):  # what was still to be said has no reader any more
            self.stdin.close()
        return self._killed_after(seconds)

    def interrupt(self, seconds: float) -> int:
        """End it as Ctrl-C does; kill its session where it has not ended after a time, s; return its exit code."""
        self.send_signal(signal.SIGINT)
        return self._killed_after(seconds)

    def _killed_after(self, seconds: float) -> int:
        try:
            return self.wait(seconds)
        except subprocess.TimeoutExpired:
            self.kill_session()
            return self.wait()

    def kill_session(self) -> None:
        """Kill it with all that it has started in its session, also what is left there after its end."""
        if sys.platform == "win32":
            self.kill()
            return
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)


def _lines(pipe: IO[bytes]) -> Iterator[str]:
    with io.TextIOWrapper(pipe, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            yield line.removesuffix("\n")
