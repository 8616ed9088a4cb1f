"""No compiled library is let at a file before its content is known to be sound.

The libraries that read NetCDF and MATLAB files crash on some damaged ones and never return from others, where no
signal of Python is heard. What matches the SHA-256 that it ends with (`fingerprints`) is opened directly. Anything
else, a file of version 0.1 or of another program, is read once by a process of its own (`probe_child`); the SHA-256
of what was sound is kept in the user's cache, so that the same content is not read twice.

A file that changes between the look and the opening is refused. One that is changed in place while it is open is not
protected; this package replaces files, and never changes one.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import signal
import stat
import subprocess
import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.analysis.files.fingerprints import matches_recorded_hash
from vibroimpact.fmus.file_names import refuse_no_text
from vibroimpact.fmus.file_state import FileState, file_state, is_settled
from vibroimpact.fmus.private_folder import UnsafeFolderError, private_folder
from vibroimpact.fmus.python_child import python_command

#: Limit of the time to read a file: a constant, s, and its size over a rate, bytes/s.
PROBE_SECONDS = 10.0
PROBE_RATE = 20e6
#: Starting Python and importing the libraries, on a loaded machine, s.
START_SECONDS = 60.0
#: What the process may take to end by itself, s.
STOP_SECONDS = 3.0
#: A file may promise values of so many times its size, which is more than deflate can pack; or of so many bytes
#: whatever its size, since what a program never wrote takes no space.
MOST_EXPANSION = 1100
SPARSE_BYTES = 400_000_000
#: Version of the check; contents that an older one found sound are checked again.
LOOK = 2
#: Contents that are remembered as sound, at most.
MOST_REMEMBERED = 4096
_CHILD = Path(__file__).with_name("probe_child.py")


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


@dataclass(frozen=True, slots=True)
class LibraryRead:
    """What a library will do with a file.

    Attributes
    ----------
    library : str
        `NetCDF`, `MATLAB`, `HDF5`, `Parquet` or `Feather`.
    names : tuple of str
        MATLAB classes, or attributes of HDF5 in lower case, that are read.
    """

    library: str = "NetCDF"
    names: tuple[str, ...] = ()


NETCDF = LibraryRead()
#: What this process found out: of files that have not changed since, and of contents.
_of_files: dict[tuple[FileState, LibraryRead], UnsoundFileError | None] = {}
_of_contents: dict[str, UnsoundFileError | None] = {}


def check_sound(path: str | os.PathLike[str], reading: LibraryRead = NETCDF) -> FileState:
    """Refuse a file that does not read.

    Parameters
    ----------
    path : path
    reading : LibraryRead
        What is about to be done with it.

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
    key = (state, reading)
    if key in _of_files:
        verdict = _of_files[key]
    else:
        verdict = _verdict(path, status.st_size, reading)
        refuse_changed(path, state)
        if is_settled(state):
            _of_files[key] = verdict
    if verdict is not None:
        raise UnsoundFileError(str(verdict), verdict.raised)
    return state


def refuse_changed(path: str | os.PathLike[str], state: FileState) -> None:
    """Raise UnsoundFileError where a file is no longer the one that was looked at."""
    if file_state(os.stat(path)) != state:
        raise UnsoundFileError("one that changed while it was being opened")


def _verdict(path: str, size: int, reading: LibraryRead) -> UnsoundFileError | None:
    if matches_recorded_hash(path):
        return None
    with open(path, "rb") as file:
        content = f"{reading.library}-{LOOK} {hashlib.file_digest(file, 'sha256').hexdigest()}"
    if content not in _of_contents:
        _of_contents[content] = None if content in _remembered() else _probed(path, size, reading)
        if _of_contents[content] is None:
            _remember(content)
    return _of_contents[content]


def _probed(path: str, size: int, reading: LibraryRead) -> UnsoundFileError | None:
    """Let a process of its own read a file."""
    seconds = PROBE_SECONDS + size / PROBE_RATE
    options = {"names": reading.names, "most_bytes": max(SPARSE_BYTES, MOST_EXPANSION * size)}
    order = {"kind": reading.library, "path": path, "seconds": seconds, "options": options}
    found = _server.ask(order, seconds + START_SECONDS)
    if found["verdict"] == "sound":
        return None
    if found["verdict"] == "raised":
        return UnsoundFileError(f"{found['error']}: {found['text']}".rstrip(": "), found["error"])
    if found["verdict"] == "late":
        return UnsoundFileError(f"one that the library had not read after {seconds:.0f} s")
    return UnsoundFileError(f"one that crashes the library which reads it ({_signal_name(found['error'])})")


def _signal_name(number: str) -> str:
    try:
        return signal.Signals(int(number)).name
    except ValueError:
        return "it ended without an answer"


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


class _ProbeServer:
    """The process that reads files first; it starts with the first file and ends by itself when none comes."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, order: dict[str, Any], seconds: float) -> dict[str, str]:
        """Return what reading the file of an order came to."""
        line = json.dumps(order).encode() + b"\n"
        with self._lock:
            # One that ended for want of work answers nothing, and one that the system ended says nothing of the file.
            answer = self._answer(line, seconds)
            if not answer:
                self._start()
                answer = self._answer(line, seconds)
        found: dict[str, str] = json.loads(answer) if answer else {"verdict": "died", "error": ""}
        return found

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

    def _answer(self, line: bytes, seconds: float) -> bytes:
        """Return the line that answers; nothing where the process is gone, which it is after `seconds`."""
        process = self._process
        if process is None:
            return b""
        assert process.stdin is not None
        assert process.stdout is not None
        late = threading.Timer(seconds, process.kill)
        late.daemon = True
        late.start()
        try:
            process.stdin.write(line)
            process.stdin.flush()
            return process.stdout.readline()
        except BrokenPipeError:
            return b""
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


_server = _ProbeServer()
atexit.register(_server.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_server.forget)
