"""The only module that reads NetCDF files: each is checked first, and every damage is one DatasetError."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import netCDF4

from vibroimpact.analysis.files.object_paths import local_copy
from vibroimpact.analysis.files.open_files import OpenFile, give_back, netcdf_lock, reading, take
from vibroimpact.analysis.files.probing import UnsoundFileError, check_sound, refuse_changed
from vibroimpact.analysis.files.store_attributes import attributes_read
from vibroimpact.analysis.files.stores import is_store, opened_group
from vibroimpact.fmus.errors import DatasetError

DAMAGE = (
    *(
        OSError,
        RuntimeError,
        ValueError,
        AttributeError,
        LookupError,
        TypeError,
        MemoryError,
        ArithmeticError,
    ),
    UnsoundFileError,
)
"""Exceptions of the libraries on damaged bytes; a text that is not UTF-8 is a ValueError."""


@contextmanager
def one_error(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn every exception from reading damaged contents into one DatasetError that names the file."""
    try:
        yield
    except DAMAGE as problem:
        raise unreadable(path, problem) from problem


@contextmanager
def opened_netcdf(path: str | os.PathLike[str]) -> Iterator[netCDF4.Dataset]:
    """Open a file with the NetCDF library, once it is known to be sound; values keep their stored form.

    Raises
    ------
    DatasetError
        The file is missing or damaged, even if the damage shows only during reading.
    """
    with local_copy(path) as local, one_error(path):
        state = check_sound(local)
        with reading(os.path.abspath(local)) as file:
            refuse_changed(local, state)
            yield file


def taken(path: str) -> OpenFile:
    """Return a file that is known to be sound, open until `open_files.give_back`.

    UnsoundFileError or OSError: the file cannot be used.
    """
    state = check_sound(path)
    with netcdf_lock():
        file = take(os.path.abspath(path))
        try:
            refuse_changed(path, state)
        except BaseException:
            give_back(file)
            raise
        return file


def unreadable(path: str | os.PathLike[str], problem: Exception) -> DatasetError:
    """Return the error for a file that is missing or damaged."""
    if isinstance(problem, FileNotFoundError):
        return DatasetError(f"{os.fspath(path)}: expected a dataset file, got no such file.")
    words = str(problem)
    if not isinstance(problem, OSError | RuntimeError | UnsoundFileError):
        words = f"contents that do not fit together ({type(problem).__name__}: {words[:200]})"
    return DatasetError(
        f"{os.fspath(path)}: expected a readable NetCDF dataset, got {words}. "
        "The file is damaged or of another kind; write it again."
    )


def file_attributes(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the global attributes of a NetCDF file or a store; empty if it cannot be read."""
    try:
        if is_store(path):
            return attributes_read(dict(opened_group(path, "r").attrs))
        with opened_netcdf(path) as file:
            return {name: file.getncattr(name) for name in file.ncattrs()}
    except DatasetError:
        return {}
