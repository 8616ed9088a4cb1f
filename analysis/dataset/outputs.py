"""The files that a command writes: checked before the command computes, and named in errors of writing."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from vibroimpact.analysis.files.opening import file_attributes
from vibroimpact.analysis.files.stores import STORE_ENDING, Place, holds_store, is_address, is_store
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.file_names import refuse_no_text
from vibroimpact.fmus.messages import WITH_OUTPUT, message

FIGURE_ENDINGS = (".png", ".pdf", ".svg")
DATASET_ENDING = ".nc"
FILE_ENDINGS = (
    DATASET_ENDING,
    STORE_ENDING,
    *FIGURE_ENDINGS,
    ".csv",
    ".txt",
    ".h5",
    ".hdf5",
    ".mat",
    ".json",
    ".toml",
    ".fmu",
    ".ssp",
)
"""Endings that nobody gives a folder on purpose."""
LONGEST_NAME = 200
"""Bytes: most file systems take 255, and the temporary file has a longer name."""


def refuse_outputs(
    read: Iterable[Place], output: Path | None, figure: Path | None = None, *, ending: str = DATASET_ENDING
) -> None:
    """Refuse outputs that would overwrite a file to be read, lie in no folder, or have the ending of another kind.

    Parameters
    ----------
    read : iterable of Path or str
        Files and stores that the command reads.
    output, figure : Path or None
        Files that the command will write.
    ending : str
        Ending of the output.

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
        _refuse_long_name(target)
        if any(_same(target, file) for file in files):
            raise UsageError(f"{target}: expected a new file, got one that is read. Choose another name.")
        if target.is_dir() and not (ending == STORE_ENDING and is_store(target)):
            raise UsageError(f"{target}: expected a place where a file can be written, got a folder.")
        if not os.access(target.parent, os.W_OK | os.X_OK):
            got = "one that cannot be written to" if target.parent.is_dir() else "no folder of that name"
            raise UsageError(
                f"{target}: expected a place where a file can be written, got {got}: {target.parent}."
            )
        refuse_no_text(target.absolute())
    if output is not None and output.suffix != ending:
        got = output.suffix[:60] or "none"
        raise UsageError(f"{output}: expected a name ending in {ending}, got {got!r}.")
    if figure is not None and figure.suffix.lower() not in FIGURE_ENDINGS:
        endings = ", ".join(FIGURE_ENDINGS)
        got = figure.suffix[:60] or "none"
        raise UsageError(f"{figure}: expected a name ending in {endings}, got {got!r}.")


def _refuse_long_name(target: Path) -> None:
    length = len(os.fsencode(target.name))
    if length > LONGEST_NAME:
        raise UsageError(
            f"{target.name[:60]}...: expected a name of {LONGEST_NAME} bytes at most, got {length}."
        )


def refuse_folder(folder: Path) -> None:
    """Raise UsageError if the name of a new folder is too long, or looks like the name of a file.

    Raises
    ------
    UsageError
    """
    _refuse_long_name(folder)
    if folder.suffix.lower() in FILE_ENDINGS and not folder.is_dir():
        raise UsageError(
            message(
                f"{folder}: expected the name of a folder, got that of a file ({folder.suffix}). Choose another",
                WITH_OUTPUT,
                ".",
            )
        )


def refuse_overwriting(
    output: Place | None, force: bool, is_same: Callable[[Mapping[str, Any]], bool]
) -> None:
    """Refuse to overwrite a dataset with other contents; a command may be repeated, and figures are drawn anew.

    Parameters
    ----------
    output : Path, str or None
        A str is the address of a store.
    force : bool
        Whether the user allows it all the same.
    is_same : callable
        Whether global attributes belong to a dataset that the command would write.

    Raises
    ------
    UsageError
        With the file and what to do.
    """
    if output is None or force:
        return
    is_there = holds_store(output) if is_address(output) else os.path.exists(output)
    if not is_there or is_same(file_attributes(output)):
        return
    raise UsageError(
        f"{output}: expected a new file, or one that holds the same, got one that holds something else. "
        "Choose another name, or overwrite it with --force."
    )


class Places(Protocol):
    """Arguments of operations with results: dataset, figure, and permission to replace other files."""

    @property
    def output(self) -> Path | None:
        """Dataset to write."""

    @property
    def figure(self) -> Path | None:
        """Figure to write."""

    @property
    def force(self) -> bool:
        """Whether a file with other contents may be replaced."""


def refuse_places(options: Places, read: Iterable[Place], **same: object) -> None:
    """Raise UsageError for places that cannot be written, or that hold other contents.

    Parameters
    ----------
    read : iterable of Path
        Files that are read, and must not be overwritten.
    **same : object
        Attributes by which an existing dataset counts as made by the same command before.

    Raises
    ------
    UsageError
    """
    refuse_outputs(list(read), options.output, options.figure)

    def is_the_same(there: Mapping[str, Any]) -> bool:
        return all(there.get(name) == value for name, value in same.items())

    refuse_overwriting(options.output, options.force, is_the_same)


@contextmanager
def writing(path: Place) -> Iterator[None]:
    """Turn an operating system's error of writing, such as a full disk, into an error that names the file.

    Raises
    ------
    UsageError
        On an OSError inside the context.

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


def _same(one: Path, other: Place) -> bool:
    try:
        return one.samefile(other)
    except OSError:
        return False
