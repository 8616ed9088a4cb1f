"""Reads a NetCDF file whole, only to see whether it can be read; runs in the separate process of `probing`."""

from __future__ import annotations

import math
import os
import zlib
from typing import Any

#: Number of values read at a time.
BLOCK = 1 << 20


def read(path: str, options: dict[str, Any]) -> tuple[None, tuple[()]]:
    """Read every attribute and every value of a NetCDF file; `most_bytes` limits the announced size of its values.

    HDF5 can take values from other files. If no other file can be opened, such values fail to read, or differ.
    """
    values = _netcdf_values(path, options["most_bytes"])
    _limit_open_files()
    if _netcdf_values(path, options["most_bytes"]) != values:
        raise ValueError("it takes values from another file")
    return None, ()


def _netcdf_values(path: str, most: int) -> int:
    """Read a file; return a checksum of its values."""
    import netCDF4

    with netCDF4.Dataset(path, "r") as file:
        file.set_auto_maskandscale(False)
        promised = sum(_size(variable) for variable in file.variables.values())
        if promised > most:
            raise ValueError(f"it promises {promised} bytes of values, at most {most} fit")
        holders: list[Any] = [file, *file.variables.values()]
        for holder in holders:
            for name in holder.ncattrs():
                holder.getncattr(name)
        found = 0
        for variable in file.variables.values():
            found = _read_values(variable, found)
        return found


def _limit_open_files() -> None:
    """Limit this process to one more open file than it has now, where the system supports the limit."""
    if not hasattr(os, "fork"):
        return  # this process continues to read other files
    import resource

    free = os.dup(0)  # the lowest free file number
    os.close(free)
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (free + 1, most))


def _size(variable: Any) -> int:
    return math.prod(int(size) for size in variable.shape) * getattr(variable.dtype, "itemsize", 8)


def _read_values(variable: Any, found: int = 0) -> int:
    """Read all values, block by block; return the checksum `found` with them."""
    if not variable.shape or 0 in variable.shape:
        return _checksum(found, variable[...])
    rows = max(1, BLOCK // math.prod(variable.shape[1:]))
    for first in range(0, variable.shape[0], rows):
        found = _checksum(found, variable[first : first + rows])
    return found


def _checksum(found: int, values: Any) -> int:
    """Return a checksum continued by values; objects (texts) lie in the file itself, and are skipped."""
    block = getattr(values, "data", values)
    kind = getattr(getattr(values, "dtype", None), "kind", "O")
    return found if kind == "O" else zlib.crc32(bytes(block), found)
