"""The files that a command is to write: looked at before it reads and computes, and named where writing fails."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from vibroimpact.fmus.errors import UsageError

FIGURE_ENDINGS = (".png", ".pdf", ".svg")
LONGEST_NAME = 200
"""Bytes: most file systems take 255, and what is half-written has a longer name."""


def refuse_outputs(read: Iterable[Path], output: Path | None, figure: Path | None = None) -> None:
    """Refuse outputs that would overwrite what is read, have no folder, or whose ending is that of no figure.

    Parameters
    ----------
    read : iterable of Path
        Files that the command reads.
    output, figure : Path or None
        What it is to write.

    Raises
    ------
    UsageError
        With the file and what to do.
    """
    files = list(read)
    if output is not None and output == figure:
        raise UsageError(
            f"{output}: expected two files for dataset and figure, got one. Choose another name."
        )
    for target in (output, figure):
        if target is None:
            continue
        if len(os.fsencode(target.name)) > LONGEST_NAME:
            raise UsageError(
                f"{target.name[:60]}...: expected a name of {LONGEST_NAME} bytes at most, "
                f"got {len(os.fsencode(target.name))}."
            )
        if any(_same(target, file) for file in files):
            raise UsageError(f"{target}: expected a new file, got one that is read. Choose another name.")
        if target.is_dir():
            raise UsageError(f"{target}: expected a place where a file can be written, got a folder.")
        if not os.access(target.parent, os.W_OK | os.X_OK):
            got = "one that cannot be written to" if target.parent.is_dir() else "no folder of that name"
            raise UsageError(
                f"{target}: expected a place where a file can be written, got {got}: {target.parent}."
            )
    if figure is not None and figure.suffix.lower() not in FIGURE_ENDINGS:
        endings = ", ".join(FIGURE_ENDINGS)
        raise UsageError(f"--figure: expected a name ending in {endings}, got {figure.name[:60]!r}.")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn what keeps a file from being written, such as a full disk, into an error with its name.

    Raises
    ------
    UsageError
        Of an OSError within.

    Examples
    --------
    >>> with writing(Path("a.nc")):
    ...     raise OSError(28, "No space left on device")
    Traceback (most recent call last):
    vibroimpact.fmus.errors.UsageError: a.nc: could not be written: No space left on device.
    """
    try:
        yield
    except OSError as problem:
        raise UsageError(f"{path}: could not be written: {problem.strerror or problem}.") from problem


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:
        return False
