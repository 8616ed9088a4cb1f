"""Reads a file of a structure in a process of its own, so that its bytes can harm no other process.

The process has limits of time and memory, writes nothing and has no network (`fmus.confinement`).
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.file_names import refuse_no_text
from vibroimpact.fmus.reader_process import Answer, Order, read_apart
from vibroimpact.orchestrator.structures.readers.refusal import LONGEST_REFUSAL, one_line

SECONDS, RATE = 10.0, 1e6
"""Limit of the processor time: a constant, s, plus the size of the file over a rate, bytes/s.

The slowest files, texts of one line and models of nodes alone, are read at some 4e6 bytes/s.
"""
MEMORY, PER_BYTE = 2 << 30, 64
"""Limit of the memory, bytes: a constant for the expansion of small files, plus this many per byte of the file."""
MOST_BYTES = 4 << 30
"""Largest size of a file, also when unpacked, and of the answer, bytes."""
Taken = TypeVar("Taken")


def read_file_apart(
    path: Path,
    reader: str,
    options: Mapping[str, Any],
    taken: Callable[[Any, Sequence[bytearray]], Taken],
    libraries: Sequence[str] = (),
) -> Taken:
    """Return the content of a file, from a reader that runs in a process of its own.

    Parameters
    ----------
    path : Path
    reader : str
        Module and function, `package.module:function`; it takes path and options, and returns JSON values and buffers.
    options : mapping
        Options of the reader, as JSON values.
    taken : callable
        Returns the content for the reader's JSON values and buffers; it checks them.
    libraries : sequence of str
        Modules that the reader imports.

    Raises
    ------
    UsageError
        The file is missing, too large, refused by its reader, crashes its library, or is not read within the limits.
        The text begins with its path.
    """
    size = _size_of(path)
    seconds = SECONDS + size / RATE
    memory = MEMORY + PER_BYTE * size
    order = Order(reader, os.path.abspath(path), options, seconds, memory, MOST_BYTES, tuple(libraries))
    answer = read_apart(order)
    if answer.verdict == "read":
        try:
            return taken(answer.facts, answer.buffers)
        except (ValueError, TypeError, KeyError, IndexError, AttributeError, StopIteration) as problem:
            raise UsageError(
                f"{path}: expected a whole file, got one that its library misreads."
            ) from problem
    raise UsageError(f"{path}: {_reason(answer, seconds)}")


def content_hash(path: Path) -> str:
    """Return the SHA-256 of a regular file, as hexadecimal text; errors are as in `read_file_apart`."""
    _size_of(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _size_of(path: Path) -> int:
    """Return the size of a regular file, bytes; errors are as in `read_file_apart`."""
    refuse_no_text(path)
    try:
        status = path.stat()
    except ValueError as problem:
        raise UsageError(f"{path}: expected the path of a file, got one with a null character.") from problem
    except OSError as problem:
        raise UsageError(
            f"{path}: expected a file that can be read, got an error: {problem.strerror}."
        ) from problem
    if not stat.S_ISREG(status.st_mode):
        raise UsageError(f"{path}: expected a regular file, got another kind.")
    if not 0 < status.st_size <= MOST_BYTES:
        raise UsageError(f"{path}: expected a file of 1 to {MOST_BYTES} bytes, got {status.st_size}.")
    return status.st_size


def _reason(answer: Answer, seconds: float) -> str:
    """Return the text of the reader's refusal, or of its end."""
    if answer.error == UsageError.__name__:
        return one_line(str(answer.text), LONGEST_REFUSAL)
    if answer.error == "MemoryError":
        return "expected a file that fits into the memory, got a larger one."
    return f"expected a whole file, got {one_line(answer.why(seconds))}."
