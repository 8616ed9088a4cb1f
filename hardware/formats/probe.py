"""Refuses a file that a library cannot read: damaged, missing, or never ending."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from vibroimpact.analysis.files.probing import UnsoundFileError, check_sound
from vibroimpact.fmus.errors import DatasetError


class UnreadableError(DatasetError):
    """A file does not read; `raised` is the name of the library's exception, if there was one."""

    def __init__(self, message: str, raised: str) -> None:
        super().__init__(message)
        self.raised = raised


def check_reads(path: os.PathLike[str] | str) -> None:
    """Raise UnreadableError, to which the importer adds the file's name, if the library cannot read a NetCDF file.

    See `analysis.files.probing`.
    """
    try:
        check_sound(path)
    except UnsoundFileError as problem:
        message = f"expected a whole NetCDF file, got {problem}."
        raise UnreadableError(message, problem.raised) from problem
    except DatasetError as problem:
        raise UnreadableError(str(problem).removeprefix(f"{os.path.abspath(path)}: "), "") from problem


@contextmanager
def one_refusal(what: str) -> Iterator[None]:
    """Turn a library's errors on a damaged file, MemoryError too, into one DatasetError.

    >>> with one_refusal("a whole MATLAB file"):
    ...     raise KeyError("t")
    Traceback (most recent call last):
    vibroimpact.fmus.errors.DatasetError: expected a whole MATLAB file, got one that cannot be read (KeyError: 't').
    """
    try:
        yield
    except DatasetError:
        raise
    except Exception as problem:
        raise DatasetError(
            f"expected {what}, got one that cannot be read ({type(problem).__name__}: {problem})."
        ) from problem


def missing_extra(what: str, package: str, extra: str) -> DatasetError:
    """Return the error of a format whose package is not installed.

    >>> str(missing_extra("a universal file (UFF)", "pyuff", "uff")).partition(". ")[0]
    'a universal file (UFF): expected the package pyuff to read it, got none'
    """
    return DatasetError(
        f"{what}: expected the package {package} to read it, got none. Install it: pip install "
        f"'vibroimpact[{extra}]', or in a clone pip install '.[{extra}]'."
    )
