"""The check of a file's content before any compiled library opens it.

The library that reads NetCDF files crashes on some damaged files. On others it never returns, and does not react to
Python's signals. A file that matches its SHA-256 (`fingerprints`) is opened directly. Any other file, of version
0.1 or of another program, is first read once by a separate process (`fmus.reader_process`, which runs
`netcdf_values`). The SHA-256 of sound content is kept in the user's cache, so the same content is not read twice.

A file that changes between check and opening is refused. There is no protection against a change in place while the
file is open; this package replaces files, and never changes one.
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

#: Limit of the processor time to read a file: a constant, s, plus its size over a rate, bytes/s.
PROBE_SECONDS = 10.0
PROBE_RATE = 20e6
#: Address space of the reading process, bytes: a small file may announce values of any size.
MEMORY = 4 << 30
LONGEST_REASON = 300
#: Largest size of a file's values: its own size times this factor, which is more than deflate can pack. Values that
#: were never written take no space: this many bytes are allowed for any file.
MOST_EXPANSION = 1100
SPARSE_BYTES = 400_000_000
#: Version of the check; contents found sound by an older version are checked again.
CHECK_VERSION = 2
#: Largest number of contents remembered as sound.
MOST_REMEMBERED = 4096
READER = "vibroimpact.analysis.files.netcdf_values:read"


class UnsoundFileError(Exception):
    """A file does not read; `str` names its fault, to follow `got`.

    Attributes
    ----------
    raised : str
        Name of the library's exception; empty where the library crashed or did not end.
    """

    def __init__(self, why: str, raised: str = "") -> None:
        super().__init__(why)
        self.raised = raised


#: Verdicts of this process: by state of unchanged files, and by hash of contents.
_of_files: dict[FileState, UnsoundFileError | None] = {}
_of_contents: dict[str, UnsoundFileError | None] = {}


def check_sound(path: str | os.PathLike[str]) -> FileState:
    """Raise UnsoundFileError if a NetCDF file does not read.

    Parameters
    ----------
    path : path

    Returns
    -------
    tuple of int
        State of the checked file, for `refuse_changed`.

    Raises
    ------
    UnsoundFileError
        It is damaged, of another kind, no regular file, or changed meanwhile.
    DatasetError
        Its content does not match the hash at its end.
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
    """Raise UnsoundFileError if a file has changed since it was checked."""
    if file_state(os.stat(path)) != state:
        raise UnsoundFileError("one that changed while it was being opened")


def _verdict(path: str, size: int) -> UnsoundFileError | None:
    if matches_recorded_hash(path):
        return None
    with open(path, "rb") as file:
        content = f"NetCDF-{CHECK_VERSION} {hashlib.file_digest(file, 'sha256').hexdigest()}"
    if content not in _of_contents:
        _of_contents[content] = None if content in _remembered() else _probed(path, size)
        if _of_contents[content] is None:
            _remember(content)
    return _of_contents[content]


def _probed(path: str, size: int) -> UnsoundFileError | None:
    """Let a separate process read a file; return the fault, if any."""
    seconds = PROBE_SECONDS + size / PROBE_RATE
    options = {"most_bytes": max(SPARSE_BYTES, MOST_EXPANSION * size)}
    answer = read_apart(Order(READER, path, options, seconds, MEMORY, libraries=("netCDF4",)))
    if answer.verdict == "read":
        return None
    return UnsoundFileError(answer.why(seconds)[:LONGEST_REASON], answer.error * (answer.verdict == "raised"))


def _memory() -> Path:
    return private_folder("sound-files") / "sha256.txt"


def _remembered() -> set[str]:
    """Return the contents known to be sound; empty if the cache is missing or not the user's alone."""
    with suppress(OSError, UnsafeFolderError):
        return set(_memory().read_text(encoding="ascii", errors="replace").splitlines())
    return set()


def _remember(content: str) -> None:
    """Remember a content as sound; a lost entry is harmless, since the content is only read again."""
    with suppress(OSError, UnsafeFolderError):
        memory = _memory()
        if content in _remembered():
            return
        # One short line appended to a file is written whole, even if other processes write, too.
        with memory.open("a", encoding="ascii") as file:
            file.write(content + "\n")
        lines = memory.read_text(encoding="ascii", errors="replace").splitlines()
        if len(lines) > MOST_REMEMBERED:
            write_atomically(memory, "".join(f"{line}\n" for line in lines[-MOST_REMEMBERED // 2 :]).encode())
