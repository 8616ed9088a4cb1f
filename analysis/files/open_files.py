"""The open NetCDF files: each is open once, and used by one thread at a time.

The NetCDF library is not safe with threads. If a file is open twice, HDF5 confuses its texts when one of the two is
closed. So each file is opened once for all its users. All work with the library is done under one lock: the lock
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
    """Return the lock that every use of the NetCDF library holds."""
    # xarray loads slowly, and much of the package works without it
    from xarray.backends.netCDF4_ import NETCDF4_PYTHON_LOCK

    return NETCDF4_PYTHON_LOCK


@dataclass(slots=True)
class OpenFile:
    """An open file, and the number of its users."""

    root: netCDF4.Dataset
    key: tuple[str, FileState]
    users: int = 1


_open: dict[tuple[str, FileState], OpenFile] = {}
_dropped: list[OpenFile] = []
"""Files that one of their users has dropped while the lock was taken; they are released at the next opening."""


def take(path: str) -> OpenFile:
    """Open a file, or share it if it is open; the caller holds the lock, and releases the file once."""
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
    """Release a file, and close it if it has no users left; the caller holds the lock."""
    file.users -= 1
    if not file.users:
        del _open[file.key]
        file.root.close()


def drop(file: OpenFile) -> None:
    """Release a file as soon as the lock is free: the thread that collects garbage may hold it."""
    if netcdf_lock().locked():
        _dropped.append(file)
        return
    with netcdf_lock():
        give_back(file)


@contextmanager
def reading(path: str) -> Iterator[netCDF4.Dataset]:
    """Open a file under the lock; values keep their stored form."""
    with netcdf_lock():
        file = take(path)
        try:
            file.root.set_auto_maskandscale(False)
            yield file.root
        finally:
            give_back(file)
