"""One campaign at a time in a folder: a lock that the system releases when its holder dies."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.file_names import refuse_no_text
from vibroimpact.fmus.messages import WITH_OUTPUT, message

if sys.platform == "win32":
    import msvcrt

    def try_lock(handle: int) -> None:
        """Lock an open file for this process; raises OSError where another process holds it."""
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def try_lock(handle: int) -> None:
        """Lock an open file for this process; raises OSError where another process holds it."""
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def locked_folder(folder: Path, holder: str = "campaign") -> Iterator[None]:
    """Hold a folder for this process.

    Parameters
    ----------
    folder : Path
    holder : str
        The kind of program that holds the folder, in words.

    Raises
    ------
    UsageError
        When another process holds it, or the folder cannot be written.
    """
    try:
        handle = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise not_writable(folder, error) from error
    try:
        try:
            try_lock(handle)
        except OSError as error:
            raise UsageError(
                f"{folder}: expected a folder of its own, got one in which another {holder} is running. "
                "Wait for it, or choose another folder."
            ) from error
        yield
    finally:
        os.close(handle)


def make_folder(folder: Path) -> None:
    """Make a folder and make sure that files can be written in it.

    Raises
    ------
    UsageError
        When that cannot be done.
    """
    refuse_no_text(folder.absolute())
    try:
        folder.mkdir(parents=True, exist_ok=True)
        trial = folder / f".writable-{os.getpid()}"
        trial.touch()
        trial.unlink()
    except OSError as error:
        raise not_writable(folder, error) from error


def not_writable(folder: Path, error: OSError) -> UsageError:
    """Return the error for a folder that cannot be written."""
    return UsageError(
        message(
            f"{folder}: expected a folder that can be written, got {error.strerror}. Choose another",
            WITH_OUTPUT,
            ".",
        )
    )
