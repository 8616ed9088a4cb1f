"""No compiled library is let at a file before its content is known to be sound.

The library that reads NetCDF files crashes on some damaged ones and never returns from others, where no signal of
Python is heard. What matches the SHA-256 that it ends with (`fingerprints`) is opened directly. Anything else, a file
of version 0.1 or of another program, is read once by a process of its own (`fmus.reader_process`, which runs
`netcdf_values`); the SHA-256 of what was sound is kept in the user's cache, so that the same content is not read twice.

A file that changes between the look and the opening is refused. One that is changed in place while it is open is not
protected; this package replaces files, and never changes one.
"""

from __future__ import annotations

import hashlib
import os
import stat
from contextlib import suppress
from pathlib import Path

from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.analysis.files.fingerprints import matches_recorded_hash
from vibroimpact.fmus.file_names import refuse_no_text
from vibroimpact.fmus.file_state import FileState, file_state, is_settled
from vibroimpact.fmus.private_folder import UnsafeFolderError, private_folder
from vibroimpact.fmus.reader_process import Order, read_apart

#: Limit of the processor time to read a file: a constant, s, and its size over a rate, bytes/s.
PROBE_SECONDS = 10.0
PROBE_RATE = 20e6
#: Address space of the process that reads, bytes: what a file of some bytes promises may be any number.
MEMORY = 4 << 30
LONGEST_REASON = 300
#: A file may promise values of so many times its size, which is more than deflate can pack; or of so many bytes
#: whatever its size, since what a program never wrote takes no space.
MOST_EXPANSION = 1100
SPARSE_BYTES = 400_000_000
#: Version of the check; contents that an older one found sound are checked again.
LOOK = 2
#: Contents that are remembered as sound, at most.
MOST_REMEMBERED = 4096
READER = "vibroimpact.analysis.files.netcdf_values:read"


class UnsoundFileError(Exception):
    """A file does not read; `str` says what it is, to follow `got`.

    Attributes
    ----------
    raised : str
        Name of the exception that the library raised; empty where it crashed or did not end.
    """

    def __init__(self, why: str, raised: str = "") -> None:
        super().__init__(why)
        self.raised = raised


#: What this process found out: of files that have not changed since, and of contents.
_of_files: dict[FileState, UnsoundFileError | None] = {}
_of_contents: dict[str, UnsoundFileError | None] = {}


def check_sound(path: str | os.PathLike[str]) -> FileState:
    """Refuse a NetCDF file that does not read.

    Parameters
    ----------
    path : path

    Returns
    -------
    tuple of int
        State of the file that was looked at; `refuse_changed` compares.

    Raises
    ------
    UnsoundFileError
        It is damaged, of another kind, no regular file, or changed meanwhile.
    DatasetError
        Its content is not the one whose hash it ends with.
    UsageError
        Its name is no text.
    OSError
        It is missing or cannot be read.
    """
    path = os.path.abspath(path)
    refuse_no_text(path)
    status = os.stat(path)
    if not stat.S_ISREG(status.st_mode):
        raise UnsoundFileError("no regular file")
    state = file_state(status)
    if state in _of_files:
        verdict = _of_files[state]
    else:
        verdict = _verdict(path, status.st_size)
        refuse_changed(path, state)
        if is_settled(state):
            _of_files[state] = verdict
    if verdict is not None:
        raise UnsoundFileError(str(verdict), verdict.raised)
    return state


def refuse_changed(path: str | os.PathLike[str], state: FileState) -> None:
    """Raise UnsoundFileError where a file is no longer the one that was looked at."""
    if file_state(os.stat(path)) != state:
        raise UnsoundFileError("one that changed while it was being opened")


def _verdict(path: str, size: int) -> UnsoundFileError | None:
    if matches_recorded_hash(path):
        return None
    with open(path, "rb") as file:
        content = f"NetCDF-{LOOK} {hashlib.file_digest(file, 'sha256').hexdigest()}"
    if content not in _of_contents:
        _of_contents[content] = None if content in _remembered() else _probed(path, size)
        if _of_contents[content] is None:
            _remember(content)
    return _of_contents[content]


def _probed(path: str, size: int) -> UnsoundFileError | None:
    """Let a process of its own read a file."""
    seconds = PROBE_SECONDS + size / PROBE_RATE
    options = {"most_bytes": max(SPARSE_BYTES, MOST_EXPANSION * size)}
    answer = read_apart(Order(READER, path, options, seconds, MEMORY, libraries=("netCDF4",)))
    if answer.verdict == "read":
        return None
    return UnsoundFileError(answer.why(seconds)[:LONGEST_REASON], answer.error * (answer.verdict == "raised"))


def _memory() -> Path:
    return private_folder("sound-files") / "sha256.txt"


def _remembered() -> set[str]:
    """Return the contents that were sound; none where the cache is not the user's alone, or not there."""
    with suppress(OSError, UnsafeFolderError):
        return set(_memory().read_text(encoding="ascii", errors="replace").splitlines())
    return set()


def _remember(content: str) -> None:
    """Remember a content as sound; one forgotten is only read again, so that losing one does no harm."""
    with suppress(OSError, UnsafeFolderError):
        memory = _memory()
        if content in _remembered():
            return
        # One short line at the end of a file is written whole, whoever else writes.
        with memory.open("a", encoding="ascii") as file:
            file.write(content + "\n")
        lines = memory.read_text(encoding="ascii", errors="replace").splitlines()
        if len(lines) > MOST_REMEMBERED:
            write_atomically(memory, "".join(f"{line}\n" for line in lines[-MOST_REMEMBERED // 2 :]).encode())
