"""The NetCDF files that are open: each once, and touched by one thread at a time.

The NetCDF library is not made for threads, and HDF5 confuses the texts of a file that is open twice when one of the two
is closed. So a file is opened once, however many ask for it, and all work with the library is done under one lock, that
under which xarray reads values.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import netCDF4

from vibroimpact.fmus.file_state import FileState, file_state


@cache
def netcdf_lock() -> Any:
    """Return the lock that is held while the NetCDF library works."""
    # xarray takes a while to load, and much of the package does without
    from xarray.backends.netCDF4_ import NETCDF4_PYTHON_LOCK

    return NETCDF4_PYTHON_LOCK


@dataclass(slots=True)
class OpenFile:
    """An open file, and how many use it."""

    root: netCDF4.Dataset
    key: tuple[str, FileState]
    users: int = 1


_open: dict[tuple[str, FileState], OpenFile] = {}
_dropped: list[OpenFile] = []
"""Files that somebody uses no more, and that could not be given back at once."""


def take(path: str) -> OpenFile:
    """Open a file, or share it where it is open; the caller holds the lock, and gives it back once."""
    while _dropped:
        give_back(_dropped.pop())
    key = (path, file_state(os.stat(path)))
    found = _open.get(key)
    if found is not None:
        found.users += 1
        return found
    opened = _open[key] = OpenFile(netCDF4.Dataset(path, "r"), key)
    return opened


def give_back(file: OpenFile) -> None:
    """Close a file where nobody uses it any more; the caller holds the lock."""
    file.users -= 1
    if not file.users:
        del _open[file.key]
        file.root.close()


def drop(file: OpenFile) -> None:
    """Give a file back as soon as the lock is free: the thread that collects garbage may hold it."""
    if netcdf_lock().locked():
        _dropped.append(file)
        return
    with netcdf_lock():
        give_back(file)


@contextmanager
def reading(path: str) -> Iterator[netCDF4.Dataset]:
    """Open a file under the lock; values come as they are stored."""
    with netcdf_lock():
        file = take(path)
        try:
            file.root.set_auto_maskandscale(False)
            yield file.root
        finally:
            give_back(file)
