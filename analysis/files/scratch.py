"""Folders for temporary files; the next process removes the folders of a process that was killed.

The owner of a folder holds a lock on a file in it; the system releases the lock when the process dies in any way. A
folder whose lock is free has no owner and is removed. A folder without a lock file, or of another user, stays.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from vibroimpact.analysis.files.folder_lock import try_lock

_PREFIX = "vibroimpact-scratch-"
_LOCK = ".owner-of-this-scratch-folder"
_MOST_TRIES = 100


_shown: dict[str, str] = {}
"""Names in messages of paths in scratch folders of this process."""


def show_as(path: str, name: str) -> None:
    """Let messages of this process show a name for a path in a scratch folder."""
    _shown[path] = name


def with_names(text: str) -> str:
    """Return a message with the names of paths in scratch folders.

    >>> show_as("scratch/b.toml", "b.ssp"); with_names("scratch/b.toml: expected a rate")
    'b.ssp: expected a rate'
    """
    for path, name in _shown.items():
        text = text.replace(path, name)
    return text


class ScratchFolder:
    """A folder for temporary files of this process, inside the system's folder for temporary files.

    Parameters
    ----------
    kind : str
        Purpose of the folder; part of its name.

    Attributes
    ----------
    name : str
        Its path.

    Raises
    ------
    OSError
        When it cannot be made.
    """

    def __init__(self, kind: str) -> None:
        sweep()
        self.name, handle = _locked_folder(kind)
        self._remove = weakref.finalize(self, _remove, self.name, handle)

    def cleanup(self) -> None:
        """Remove the folder with its contents, at the end of the process at the latest."""
        self._remove()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.cleanup()


def sweep() -> None:
    """Remove the scratch folders of this user whose processes are dead."""
    for folder in _own_folders():
        with suppress(OSError):
            handle = os.open(folder / _LOCK, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
            try:
                try_lock(handle)
            except OSError:
                os.close(handle)
                continue
            _remove(str(folder), handle)


def _own_folders() -> Iterator[Path]:
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with suppress(OSError):
            status = folder.lstat()
            if stat.S_ISDIR(status.st_mode) and status.st_uid == getattr(os, "getuid", lambda: 0)():
                yield folder


def _locked_folder(kind: str) -> tuple[str, int]:
    """Make a folder and lock it; repeat if a sweep removed it between the two steps."""
    for _ in range(_MOST_TRIES):
        folder = tempfile.mkdtemp(prefix=f"{_PREFIX}{kind}-")
        lock = Path(folder, _LOCK)
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            try_lock(handle)
        except (BlockingIOError, PermissionError):
            os.close(handle)
            continue
        except OSError as error:
            # On a system without file locks no sweep removes the folder either.
            if error.errno not in (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS):
                raise
        if lock.exists():
            return folder, handle
        os.close(handle)
    raise OSError(
        f"{tempfile.gettempdir()}: expected a folder of its own there, got one swept {_MOST_TRIES} times."
    )


def _remove(folder: str, handle: int) -> None:
    if os.name == "nt":
        # Windows does not remove an open file.
        os.close(handle)
        shutil.rmtree(folder, ignore_errors=True)
        return
    shutil.rmtree(folder, ignore_errors=True)
    os.close(handle)
