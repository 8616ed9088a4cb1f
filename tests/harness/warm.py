"""Python programs started by tests: copies of a warm process if there is one, which saves the imports.

A test of imports, of memory, of variables that are read at import, or of the start itself starts cold.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, Any, TypeAlias

PROGRAM = "from harness.warm_server import main; main()"
TESTS = Path(__file__).resolve().parents[1]

DEVNULL = subprocess.DEVNULL
ENDED = "the warm process for commands has ended"
WITHOUT_THREADS = {"OPENBLAS_NUM_THREADS": "1", "JE_ARROW_MALLOC_CONF": "background_thread:false"}
"""Variables that keep numpy and pyarrow from starting threads at import; a fork would lose the threads."""

_server: tuple[subprocess.Popen[str], tempfile.TemporaryDirectory[str]] | None = None
_ready = False
_seconds = 0.0
_lock = threading.Lock()


def refuse_threads() -> None:
    """Raise AssertionError if this process has a second thread, of Python or of a library."""
    threads = [Path(f"/proc/self/task/{number}/comm").read_text() for number in os.listdir("/proc/self/task")]
    assert len(threads) == 1, f"expected one thread before a fork, got {threads}"


def start_server() -> None:
    """Start the warm process, which imports while the caller continues; copies of the caller use it too."""
    global _server
    # a socket's path has to be short
    folder = tempfile.TemporaryDirectory(prefix="warm-", dir="/tmp")
    path = os.pathsep.join([str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])])
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM, str(Path(folder.name, "socket"))],
        env=os.environ | WITHOUT_THREADS | {"PYTHONPATH": path},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    _server = process, folder
    atexit.register(end_server)


def wait_for_server() -> None:
    """Wait until the warm process has imported all, if there is one."""
    global _ready
    if _server is not None and not _ready:
        assert _server[0].stdout is not None
        assert _server[0].stdout.readline() == "ready\n", "the warm process for commands did not start"
        _ready = True


def end_server() -> None:
    """End the warm process, if there is one."""
    global _server, _ready
    if _server is not None:
        process, folder = _server
        _server, _ready = None, False
        process.communicate()
        folder.cleanup()


def seconds_used() -> float:
    """Return the processor time of all ended copies that this process has started, s."""
    return _seconds


def start(
    program: str,
    *arguments: str | Path,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
    stdin: int | None = subprocess.DEVNULL,
    stdout: int | IO[Any] | None = subprocess.PIPE,
    stderr: int | IO[Any] | None = subprocess.PIPE,
    start_new_session: bool = False,
    cold: bool = False,
) -> Program:
    """Start `python -u -c PROGRAM ARGUMENTS...`; return an object like `subprocess.Popen` in text mode.

    Parameters
    ----------
    program : str
        Python, run as `__main__`.
    arguments : str or Path
    cwd : Path, optional
    env : mapping, optional
        The whole environment; by default that of this process.
    stdin, stdout, stderr : int or file
        As for `subprocess.Popen`.
    start_new_session : bool
        False: the program has only a process group of its own.
    cold : bool
        Start a new Python.
    """
    words = [*map(str, arguments)]
    if _server is not None and not cold:
        return Copy(program, words, cwd, env, (stdin, stdout, stderr), start_new_session)
    return subprocess.Popen(
        [sys.executable, "-u", "-c", program, *words],
        cwd=cwd,
        env=None if env is None else dict(env),
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        text=True,
        start_new_session=start_new_session,
        process_group=None if start_new_session or os.name != "posix" else 0,
    )


def run(
    program: str, *arguments: str | Path, timeout: float = 120.0, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end; return its exit code and its output."""
    with start(program, *arguments, **options) as process:
        try:
            out, err = process.communicate(timeout=timeout)
        except BaseException:
            process.kill()
            raise
        code = process.wait()
    return subprocess.CompletedProcess([*map(str, arguments)], code, out, err)


class Copy:
    """A copy of the warm process that runs a program, with the part of `subprocess.Popen` that tests use.

    Attributes
    ----------
    pid : int
    returncode : int or None
    stdin, stdout, stderr : file or None
        Own end of a pipe.
    """

    def __init__(
        self,
        program: str,
        arguments: list[str],
        cwd: Path | None,
        env: Mapping[str, str] | None,
        streams: tuple[int | IO[Any] | None, ...],
        start_new_session: bool,
    ) -> None:
        assert _server is not None
        self.returncode: int | None = None
        self._waiting = threading.Lock()
        self.args = arguments
        request = {
            "program": program,
            "arguments": arguments,
            "folder": os.fspath(cwd or Path.cwd()),
            "environment": dict(os.environ if env is None else env),
            "session": start_new_session,
        }
        with contextlib.ExitStack() as stack:
            ends = [_ends(number, stream, stack) for number, stream in enumerate(streams)]
            (self.stdin, given), (self.stdout, out), (self.stderr, err) = ends
            self._connection = socket.socket(socket.AF_UNIX)
            self._connection.connect(str(Path(_server[1].name, "socket")))
            data = json.dumps(request).encode() + b"\n"
            sent = socket.send_fds(self._connection, [data], [given, out, err])
            # a copy may have ended by now: sending nothing to it is an error
            if sent < len(data):
                self._connection.sendall(data[sent:])
            self.pid = int(self._line())

    def _line(self) -> bytes:
        """Return the next line of the warm process, without reading beyond it: `wait` checks for more."""
        line = b""
        while not line.endswith(b"\n"):
            byte = self._connection.recv(1)
            assert byte, ENDED
            line += byte
        return line

    def poll(self) -> int | None:
        """Return the exit code; None while the program runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end; return the exit code, or the negative number of the signal."""
        global _seconds
        with self._waiting:
            if self.returncode is None:
                self._connection.settimeout(timeout or None if timeout != 0.0 else 0.0)
                try:
                    ready = self._connection.recv(1, socket.MSG_PEEK)
                except (TimeoutError, BlockingIOError):
                    raise subprocess.TimeoutExpired(self.args, timeout or 0.0) from None
                assert ready, ENDED
                self._connection.settimeout(None)
                answer = json.loads(self._line())
                self._connection.close()
                self.returncode = int(answer["code"])
                with _lock:
                    _seconds += answer["seconds"]
        return self.returncode

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Return the whole output and error output, after the end."""
        deadline = None if timeout is None else time.monotonic() + timeout
        streams = [stream for stream in (self.stdout, self.stderr) if stream and not stream.closed]
        outputs: dict[IO[str] | None, str] = {None: "", **dict.fromkeys(streams, "")}

        def read(stream: IO[str]) -> None:
            outputs[stream] = stream.read()

        readers = [threading.Thread(target=read, args=[stream], daemon=True) for stream in streams]
        for reader in readers:
            reader.start()
        for reader in readers:
            reader.join(None if deadline is None else max(0.0, deadline - time.monotonic()))
            if reader.is_alive():
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        self.wait(None if deadline is None else max(0.001, deadline - time.monotonic()))
        for stream in streams:
            stream.close()
        return outputs.get(self.stdout, ""), outputs.get(self.stderr, "")

    def send_signal(self, number: int) -> None:
        """Send a signal, unless the program has ended, even if its end was not noticed before."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill the program."""
        self.send_signal(signal.SIGKILL)

    def terminate(self) -> None:
        """Send SIGTERM to the program."""
        self.send_signal(signal.SIGTERM)

    def __enter__(self) -> Copy:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for stream in (self.stdout, self.stderr, self.stdin):
            if stream is not None:
                stream.close()
        self.wait()


def _ends(
    number: int, stream: int | IO[Any] | None, stack: contextlib.ExitStack
) -> tuple[IO[str] | None, int]:
    """Return the own end of a standard stream, if it is a pipe, and the file descriptor of the other end."""
    mode = "r" if number else "w"
    if stream == subprocess.PIPE:
        pipe = os.pipe()
        mine, theirs = pipe if number else reversed(pipe)
        stack.callback(os.close, theirs)
        return open(mine, mode), theirs
    if stream == subprocess.DEVNULL:
        return None, stack.enter_context(open(os.devnull, "r+")).fileno()
    if stream is None:
        return None, number
    return None, stream if isinstance(stream, int) else stream.fileno()


Program: TypeAlias = subprocess.Popen[str] | Copy
"""A running program, whatever its start."""
