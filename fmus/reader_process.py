"""Lets a process of its own read a file of a stranger; its answer is JSON and raw bytes, never a pickle.

A library may crash on damaged bytes, never end, or take all memory: `reader_child` is where it does so. The process
starts with the first file, serves all that follow, and ends by itself when none comes. What it answers is bounded here
too, since the bytes of a file may have taken it over.
"""

from __future__ import annotations

import atexit
import io
import json
import os
import signal
import subprocess
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from vibroimpact.fmus.confinement import PATIENCE
from vibroimpact.fmus.python_child import python_command

#: Starting Python and importing the libraries, on a loaded machine, s.
START_SECONDS = 60.0
#: What the process may take to end by itself, s.
STOP_SECONDS = 3.0
#: Bytes of the line that answers, at most: names and remarks.
LONGEST_LINE = 1 << 26
_CHILD = Path(__file__).with_name("reader_child.py")


@dataclass(frozen=True, slots=True)
class Order:
    """A file to read.

    Attributes
    ----------
    reader : str
        Module and function, `package.module:function`: from path and options to what JSON can say and buffers.
    path : str
        Absolute.
    options : mapping
        Of what JSON can say.
    seconds : float
        Processor time, s.
    memory : int
        Address space of the process that reads, bytes.
    most_bytes : int
        Bytes that all buffers of the answer may have.
    libraries : tuple of str
        Modules that are imported once for all files, where they are installed.
    """

    reader: str
    path: str
    options: Mapping[str, Any]
    seconds: float
    memory: int
    most_bytes: int = 0
    libraries: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Answer:
    """How reading a file ended.

    Attributes
    ----------
    verdict : str
        `read`, `raised`, `late` or `died`.
    facts : object
        What the reader returned, from JSON.
    buffers : list of bytearray
    error, text : str
        Name and text of the exception; for `died` the number of the signal.
    raised : OSError or None
        The error of the system, where it was one.
    """

    verdict: str
    facts: Any = None
    buffers: list[bytearray] = field(default_factory=list)
    error: str = ""
    text: str = ""
    raised: OSError | None = None

    def why(self, seconds: float) -> str:
        """Return what a file is that was not read, to follow `got`."""
        if self.verdict == "raised":
            return f"{self.error}: {self.text}".rstrip(": ")
        if self.verdict == "late":
            return f"one that the library had not read after {seconds:.0f} s"
        return f"one that crashes the library which reads it ({_signal_name(self.error)})"


def read_apart(order: Order) -> Answer:
    """Let the process of its own read a file.

    Any number of threads may ask; their files are read one after the other.
    """
    return _server.ask(order)


def start() -> None:
    """Start the process now, so that it is ready when the file is known; nothing where it runs already."""
    _server.start_once()


def _signal_name(number: str) -> str:
    try:
        return signal.Signals(int(number)).name
    except ValueError:
        return "it ended without an answer"


class ReaderServer:
    """The process that reads files, and the pipe to it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, order: Order) -> Answer:
        """Return what reading the file of an order came to."""
        line = json.dumps(asdict(order)).encode() + b"\n"
        with self._lock:
            # One that ended for want of work answers nothing, and one that the system ended says nothing of the file.
            answer = self._answer(line, order)
            if answer is None:
                self._start()
                answer = self._answer(line, order)
        return answer or Answer("died")

    def start_once(self) -> None:
        """Start the process where it does not run."""
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                self._start()

    def _start(self) -> None:
        self.close()
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            python_command(str(_CHILD)),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
        )

    def _answer(self, line: bytes, order: Order) -> Answer | None:
        """Return the answer; None where the process is gone, which it is some time after the order's."""
        process = self._process
        if process is None:
            return None
        assert process.stdin is not None
        late = threading.Timer(PATIENCE * order.seconds + START_SECONDS, process.kill)
        late.daemon = True
        late.start()
        try:
            process.stdin.write(line)
            process.stdin.flush()
            return _received(process, order.most_bytes)
        except BrokenPipeError:
            return None
        except BaseException:
            self.close()  # whoever asks next would get this answer
            raise
        finally:
            late.cancel()

    def close(self) -> None:
        """End the process, which ends the one that reads."""
        process, self._process = self._process, None
        if process is None:
            return
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(BrokenPipeError):
            process.stdin.close()
        try:
            process.wait(STOP_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stdout.close()

    def forget(self) -> None:
        """Let a process made by `fork` not read the answers of the one that it was made from."""
        self._lock, self._process = threading.Lock(), None


def _received(process: subprocess.Popen[bytes], most_bytes: int) -> Answer | None:
    """Return the answer that comes; None where it ends too early, or is none of ours: the process is ended then."""
    stream = process.stdout
    assert isinstance(stream, io.BufferedReader)
    line = stream.readline(LONGEST_LINE)
    try:
        found = json.loads(line)
        sizes = [int(size) for size in found.get("sizes", ())]
        if min(sizes, default=0) < 0 or sum(sizes) > most_bytes:
            raise ValueError("more bytes than were asked for")
        buffers = [bytearray(size) for size in sizes]
        if any(stream.readinto(buffer) != len(buffer) for buffer in buffers):
            raise ValueError("less bytes than were said")
        text, error = str(found.get("text", "")), str(found.get("error", ""))
        system = OSError(found["errno"], found["reason"]) if "system" in found else None
        return Answer(str(found["verdict"]), found.get("facts"), buffers, error, text, system)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        process.kill()
        process.wait()
        return None


_server = ReaderServer()
atexit.register(_server.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_server.forget)
