"""File names that are text: scenes, manifests and datasets store names, and the NetCDF library opens no other names."""

from __future__ import annotations

import os
import sys

from vibroimpact.fmus.errors import UsageError


def is_text(value: object) -> bool:
    """Return whether a value is text that a file can hold; an unpaired surrogate is not.

    >>> is_text("café"), is_text(os.fsdecode(b"caf" + bytes([0xE9])))
    (True, False)
    """
    return isinstance(value, str) and not any("\ud800" <= letter <= "\udfff" for letter in value)


_DEVICES = frozenset(
    ("con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(10)))
)


def is_device(name: str) -> bool:
    """Return whether Windows takes a file name for one of its devices, whatever its extension.

    >>> is_device("con.nc"), is_device("LPT1.tar.gz"), is_device("console.nc")
    (True, True, False)
    """
    return name.partition(".")[0].rstrip(" ").lower() in _DEVICES


def refuse_no_text(path: str | os.PathLike[str]) -> None:
    """Raise UsageError if the name of a file or folder is not text, as a name from a system with another encoding.

    Raises
    ------
    UsageError
        The name is not text; the message shows it.
    """
    if not is_text(os.fspath(path)):
        encoding = sys.getfilesystemencoding()
        raise UsageError(
            f"{os.fspath(path)}: expected a name in {encoding}, the encoding of this system, got other bytes. "
            "Rename it."
        )
