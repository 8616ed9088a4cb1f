"""Refuse a file on which the compiled library that reads it crashes, or which it never ends to read."""

from __future__ import annotations

import os

from vibroimpact.analysis.files.probing import LibraryRead, UnsoundFileError, check_sound
from vibroimpact.fmus.errors import DatasetError


class UnreadableError(DatasetError):
    """A file does not read; `raised` is the name of the exception of the library, if that is how it ended."""

    def __init__(self, message: str, raised: str) -> None:
        super().__init__(message)
        self.raised = raised


def check_reads(path: os.PathLike[str] | str, reading: LibraryRead) -> None:
    """Refuse a file that does not read; see `analysis.probing`.

    Parameters
    ----------
    path : path
    reading : LibraryRead
        What is about to be done with it.

    Raises
    ------
    UnreadableError
        Without the name of the file, which the importer puts before it.
    """
    try:
        check_sound(path, reading)
    except UnsoundFileError as problem:
        message = f"expected a whole {reading.library} file, got {problem}."
        raise UnreadableError(message, problem.raised) from problem
    except DatasetError as problem:
        raise UnreadableError(str(problem).removeprefix(f"{os.path.abspath(path)}: "), "") from problem
