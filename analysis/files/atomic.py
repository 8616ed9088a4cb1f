"""Write a file so that it is whole or absent, whatever happens in between."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from vibroimpact.analysis.files.object_paths import ObjectPath


def refuse_special(path: str | os.PathLike[str]) -> None:
    """Raise OSError if a path leads to something other than a file, which renaming a file there would replace.

    A privileged user could otherwise replace `/dev/null` for the whole machine.

    Raises
    ------
    OSError
        It is a folder, a device, a pipe or a socket.
    """
    target = Path(path)
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), os.fspath(target))
    if target.exists() and not target.is_file():
        raise OSError(errno.EINVAL, "a device, a pipe or a socket", os.fspath(target))


def write_atomically(path: str | os.PathLike[str], *content: bytes | memoryview) -> None:
    """Write the whole content of a file or an object, or leave the older one in place.

    The content goes to a temporary name in the same folder (hidden, ending in `.tmp`), is flushed to the disk, and is
    renamed. The folder is flushed to the disk afterwards. On any failure the temporary file is removed.

    Parameters
    ----------
    path : path
    *content : bytes-like
        Written one after the other.

    Raises
    ------
    OSError
        If the file cannot be written (no space, no permission, no folder, no place for a file), with the system's
        reason.
    """
    if isinstance(path, ObjectPath):
        path.write_bytes(b"".join(content))
        return
    with whole_or_absent(path) as temporary, open(temporary, "xb") as file:
        for piece in content:
            file.write(piece)


@contextmanager
def whole_or_absent(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path; the file that the block writes there replaces `path` once it is on the disk.

    On any failure of the block the temporary file is removed, and its space is free even if a library keeps it open.

    Raises
    ------
    OSError
        See `write_atomically`.
    """
    target = Path(path)
    refuse_special(target)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")
    try:
        yield temporary
        with open(temporary, "r+b") as file:
            os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException as problem:
        with suppress(OSError):
            os.truncate(temporary, 0)
            temporary.unlink()
        if isinstance(problem, OSError):
            # The error of a write has no file name, and a person knows the target, not the temporary name.
            problem.filename, problem.filename2 = os.fspath(target), None
        raise
    sync_folder(target.parent)


def sync_folder(folder: Path) -> None:
    """Flush the new name of a file to the disk; a system that cannot open folders does so itself."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
