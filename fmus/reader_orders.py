"""What the process that reads a file is asked, and what it answers: JSON and raw bytes, never a pickle.

The bytes of a file may have taken that process over, so that all it answers is bounded here.
"""

from __future__ import annotations

import io
import json
import signal
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vibroimpact.fmus.messages import Message

#: Bytes of the line that answers, at most: names and remarks.
LONGEST_LINE = 1 << 26


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
        Memory beyond what the process has when it begins, bytes.
    most_bytes : int
        Bytes that all buffers of the answer may have.
    libraries : tuple of str
        Modules that are imported before a process is made for a file, where they are installed.
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
        Name and text of the exception; for `late` and `died` the number of the signal.
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


def received(stream: io.BufferedReader, most_bytes: int) -> Answer | None:
    """Return the answer that comes on a pipe; None where it ends too early, or is none."""
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
        text = Message(text, str(found.get("typed", text)))
        system = OSError(found["errno"], found["reason"]) if "system" in found else None
        return Answer(str(found["verdict"]), found.get("facts"), buffers, error, text, system)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError, MemoryError):
        return None


def _signal_name(number: str) -> str:
    try:
        return signal.Signals(int(number)).name
    except ValueError:
        return "it ended without an answer"
