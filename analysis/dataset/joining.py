"""Join the files of a campaign to one file, block by block: the memory does not grow with the number of runs.

The form of the joined file follows from the heads of all files. Its space is
reserved before the first run is written: a full disk is an error of the system, which the NetCDF library never sees.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import pairwise
from math import prod
from pathlib import Path
from typing import Any, Protocol

import netCDF4
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.checking import marked
from vibroimpact.analysis.dataset.flat_file import FlatFile, is_large
from vibroimpact.analysis.dataset.merging import joined, refuse_unlike, take_runs
from vibroimpact.analysis.dataset.reading import FileOfRuns, read_flat
from vibroimpact.analysis.dataset.stores.storing import stored_variables
from vibroimpact.analysis.dataset.writing import define_variable, store_texts
from vibroimpact.analysis.files.atomic import whole_or_absent
from vibroimpact.analysis.files.fingerprints import seal
from vibroimpact.analysis.files.open_files import netcdf_lock
from vibroimpact.fmus.errors import DatasetError

_MOST_OPEN = 128
"""Largest number of files that stay open from the look at their form to the reading of their runs."""
_HEAD_BYTES = 1 << 16
"""Space reserved for names and attributes, bytes; more of them grow the file later."""


def join_files(
    paths: Sequence[str | os.PathLike[str]],
    target: str | os.PathLike[str],
    finished: Callable[[xr.Dataset], xr.Dataset] = lambda form: form,
) -> bool:
    """Write the runs of dataset files into one file, ordered by `run_index`; return whether any run has a message.

    Values, attributes and form are those of `merge_datasets` and `write_dataset`. Files whose runs lie between the
    runs of others are in memory together. Other files are in memory one at a time; large ones in stretches.

    Parameters
    ----------
    paths : sequence of path
        One-dimensional files with the same variables, in any order; attributes are those of the first.
    target : path
        An older file of this name is replaced only when the new one is complete.
    finished : callable
        Returns the form of the joined file, without runs, with its own attributes and scalar coordinates.

    Raises
    ------
    DatasetError
        If a file cannot be read, the files differ in their variables, or a run is in two files.
    OSError
        If the file cannot be written, with the reason of the operating system.
    """
    if not paths:
        raise DatasetError("merge: expected at least one file, got none.")
    with ExitStack() as opened, whole_or_absent(target) as temporary:
        form, files, sizes = _survey(paths, opened)
        with appended_file(temporary, marked(finished(form)), sizes) as file:
            for block in blocks_in_order(files, form, os.fspath(paths[0])):
                file.append(marked(block))
        seal(temporary)
    return file.has_messages


# ---- the files ----


@dataclass(frozen=True, slots=True)
class _File:
    """A `Piece` that is a file."""

    path: str
    first: int
    last: int
    opened: FileOfRuns | None
    """The file itself; None where too many others are open."""

    def rows(self) -> xr.Dataset:
        """Return the runs of the file in the order of their index."""
        rows = read_flat(self.path) if self.opened is None else self.opened.rows()
        index = rows.variables["run_index"].values
        return take_runs(rows, np.argsort(index)) if (np.diff(index) < 0).any() else rows


@dataclass(frozen=True, slots=True, eq=False)
class _Stretch:
    """A `Piece` of a large file; `places` are those of its runs in the file."""

    path: str
    first: int
    last: int
    file: FlatFile
    places: NDArray[np.int64]

    def rows(self) -> xr.Dataset:
        """Return the runs."""
        return self.file.runs(self.places)


def _stretches(file: FlatFile, path: str) -> Iterator[_Stretch]:
    """Yield the stretches of a large file."""
    index = file.dataset.variables["run_index"].values
    for places in file.stretches():
        yield _Stretch(path, int(index[places[0]]), int(index[places[-1]]), file, places)


def _survey(
    paths: Sequence[str | os.PathLike[str]], opened: ExitStack
) -> tuple[xr.Dataset, list[Piece], dict[str, int]]:
    """Return the common form of files, their runs, and the sizes of the dimensions of all files together.

    Large files stay open until `opened` ends.
    """
    form: xr.Dataset | None = None
    files, sizes, first_name = list[Piece](), dict[str, int](), os.fspath(paths[0])
    for path in [os.fspath(path) for path in paths]:
        file = FileOfRuns(path)
        opened.callback(file.close)
        head = file.head(form)
        form = head.form if form is None else form
        if head.form is not form and not _are_alike(form, head.form):
            form = joined([form, head.form], [first_name, path])
        sizes = {name: sizes.get(name, 0) + head.sizes.get(name, 0) for name in sizes | head.sizes}
        kept = None
        if head.ascends and is_large(path):
            files += _stretches(opened.enter_context(FlatFile(path)), path)
        elif head.sizes["run"]:
            kept = file if len(files) < _MOST_OPEN else None
            files.append(_File(path, head.first, head.last, kept))
        if kept is None:
            file.close()
    assert form is not None
    return form, sorted(files, key=lambda file: file.first), sizes


class Piece(Protocol):
    """Runs of a dataset, such as one of its files, with the lowest and the highest run index."""

    @property
    def path(self) -> str:
        """Name in messages."""

    @property
    def first(self) -> int:
        """Lowest run index."""

    @property
    def last(self) -> int:
        """Highest run index."""

    def rows(self) -> xr.Dataset:
        """Return the runs in the order of their index."""


def blocks_in_order(files: Sequence[Piece], form: xr.Dataset, form_name: str) -> Iterator[xr.Dataset]:
    """Yield the runs of all files in blocks, ordered by their index; a block ends where a file begins or ends."""
    waiting, rows = list(reversed(files)), dict[Piece, xr.Dataset]()
    ends = sorted({file.first for file in files} | {file.last + 1 for file in files})
    for begin, end in pairwise(ends):
        while waiting and waiting[-1].first == begin:
            rows[waiting[-1]] = waiting[-1].rows()
            waiting.pop()
        pieces = {file.path: _between(part, begin, end) for file, part in rows.items()}
        rows = {file: part for file, part in rows.items() if file.last >= end}
        found = {path: piece for path, piece in pieces.items() if piece.sizes["run"]}
        if len(found) == 1 and _are_alike(form, *found.values()):
            for path, piece in found.items():
                refuse_unlike(path, piece, form_name, form)
                yield piece
        elif found:
            yield joined([form, *found.values()], [form_name, *found])


def _are_alike(one: xr.Dataset, other: xr.Dataset) -> bool:
    """Return whether two datasets have the same variables, with equal dimensions besides their runs and rows."""
    forms = [
        {name: (variable.dims, variable.shape[1:]) for name, variable in rows.variables.items()}
        for rows in (one, other)
    ]
    return forms[0] == forms[1]


def _between(rows: xr.Dataset, begin: int, end: int) -> xr.Dataset:
    """Return the runs with an index from `begin` to `end - 1`."""
    index = rows.variables["run_index"].values
    places = np.searchsorted(index, (begin, end))
    if places[0] == 0 and places[1] == index.size:
        return rows
    return take_runs(rows, np.arange(*places))


# ---- the joined file ----


class _AppendedFile:
    """A NetCDF-4 file of known size, to which runs are appended in their order."""

    def __init__(self, file: netCDF4.Dataset, form: xr.Dataset, sizes: Mapping[str, int]) -> None:
        self._file, self._reached, self.has_messages = file, dict.fromkeys(sizes, 0), False
        # Every value is written once: filling first would write everything twice.
        file.set_fill_off()
        file.setncatts(dict(form.attrs))
        for name, size in form.sizes.items():
            file.createDimension(str(name), sizes.get(str(name), size))
        # by the alphabet, as the library lists the variables of a file made in memory
        for one in sorted(stored_variables(form), key=lambda one: one.name):
            shape = [sizes.get(str(name), size) for name, size in one.variable.sizes.items()]
            placed = define_variable(file, one, prod(shape))
            if one.variable.dims[:1] not in {(name,) for name in sizes}:
                self._store(placed, one.variable, 0)

    def append(self, block: xr.Dataset) -> None:
        """Append runs; they have the variables of the form."""
        with netcdf_lock():
            for name, variable in block.variables.items():
                if variable.dims[:1] and str(variable.dims[0]) in self._reached:
                    first = self._reached[str(variable.dims[0])]
                    self._store(self._file.variables[str(name)], variable, first)
        for name in self._reached:
            self._reached[name] += block.sizes[name]

    def _store(self, placed: netCDF4.Variable[Any], variable: xr.Variable, first: int) -> None:
        values = variable.values
        if values.dtype.kind == "O":
            if any(values.tolist()):
                store_texts(placed, values, first)
                self.has_messages |= placed.name == "message"
        elif not variable.dims:
            placed[...] = values
        elif values.size:
            placed[first : first + len(values)] = values


@contextmanager
def appended_file(path: Path, form: xr.Dataset, sizes: Mapping[str, int]) -> Iterator[_AppendedFile]:
    """Make a file of a known size, to which the block appends runs."""
    size = _HEAD_BYTES + sum(
        prod(sizes.get(str(name), length) for name, length in variable.sizes.items())
        * variable.dtype.itemsize
        for variable in form.variables.values()
        if variable.dtype.kind != "O"
    )
    _reserve(path, size)
    try:
        with netcdf_lock():
            file = netCDF4.Dataset(path, "w", format="NETCDF4")
        try:
            _reserve(path, size)  # the library has emptied the file
            with netcdf_lock():
                target = _AppendedFile(file, form, sizes)
            yield target
        finally:
            with netcdf_lock():
                file.close()
    except RuntimeError as error:
        raise OSError(errno.EIO, f"the NetCDF library says: {error}", os.fspath(path)) from error


def _reserve(path: Path, size: int) -> None:
    """Reserve the space of a file on the disk; OSError, where there is less. Other systems find out while writing."""
    if not hasattr(os, "posix_fallocate"):
        return
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        os.posix_fallocate(handle, 0, size)
    except OSError as error:
        # a file system may not know the call
        if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):
            raise
    finally:
        os.close(handle)
