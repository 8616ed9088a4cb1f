"""Orders to the process that reads a file, and its answers: JSON and raw bytes, never a pickle.

The bytes of a file may have taken over the reading process, so its answers are bounded here.
"""

from __future__ import annotations

import io
import json
import signal
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vibroimpact.fmus.messages import Message

#: Longest line of an answer, bytes: it holds names and remarks.
LONGEST_LINE = 1 << 26


@dataclass(frozen=True, slots=True)
class Order:
    """A file to read.

    Attributes
    ----------
    reader : str
        Module and function, `package.module:function`; it takes path and options, and returns JSON values and buffers.
    path : str
        Absolute path.
    options : mapping
        Options that JSON can hold.
    seconds : float
        Limit of the processor time, s.
    memory : int
        Memory beyond that at the start of the process, bytes.
    most_bytes : int
        Largest size of all buffers of the answer together, bytes.
    libraries : tuple of str
        Modules to import before a process is made for a file, if they are installed.
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
    """Outcome of reading a file.

    Attributes
    ----------
    verdict : str
        `read`, `raised`, `late` or `died`.
    facts : object
        Result of the reader, from JSON.
    buffers : list of bytearray
    error, text : str
        Name and text of the exception; for `late` and `died` the number of the signal.
    raised : OSError or None
        The operating system's error, if it was one.
    """

    verdict: str
    facts: Any = None
    buffers: list[bytearray] = field(default_factory=list)
    error: str = ""
    text: str = ""
    raised: OSError | None = None

    def why(self, seconds: float) -> str:
        """Return the reason why a file was not read, to follow `got`."""
        if self.verdict == "raised":
            return f"{self.error}: {self.text}".rstrip(": ")
        if self.verdict == "late":
            return f"one that the library had not read after {seconds:.0f} s"
        return f"one that crashes the library which reads it ({_signal_name(self.error)})"


def received(stream: io.BufferedReader, most_bytes: int) -> Answer | None:
    """Return the answer from a pipe; None if it is incomplete or malformed."""
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
