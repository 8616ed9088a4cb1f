"""A NetCDF file of runs, read some runs at a time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any, Self

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.assembling import assembled, loaded_variable
from vibroimpact.analysis.dataset.merging import joined, take_runs
from vibroimpact.analysis.dataset.reading import fitting, open_flat, read_flat
from vibroimpact.analysis.dataset.schema import RAGGED
from vibroimpact.analysis.files.opening import one_error
from vibroimpact.analysis.files.stores import Place
from vibroimpact.fmus.errors import DatasetError

LARGE_BYTES = 48 << 20
"""Size of a file, bytes, above which its runs are read in stretches; reading a smaller file at once is faster."""
STRETCH_BYTES = 16 << 20
"""Size of a stretch of runs in its file, bytes; joining takes some four times as much memory."""
_FAR = 1 << 16
"""Distance of runs in a file from which they are read apart."""


class FlatFile:
    """A file of runs, one-dimensional as it is stored, some runs at a time.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    dataset : xarray.Dataset
        All runs, read when they are used.

    Raises
    ------
    DatasetError
        The file is missing, damaged or foreign, or its runs are not in the order of their `run_index`.
    """

    def __init__(self, path: Place) -> None:
        self._path, self._sums = path, dict[str, NDArray[np.int64]]()
        opened = open_flat(path)
        self.close = opened.close
        try:
            with one_error(path):
                self.dataset = _in_order_of_the_scene(fitting(path, opened))
                if not _ascends(self.dataset.variables["run_index"]):
                    raise DatasetError(f"{os.fspath(path)}: expected runs in the order of their run_index.")
        except DatasetError:
            opened.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def stretches(self) -> Iterator[NDArray[np.int64]]:
        """Yield the places of neighbouring runs that take about `STRETCH_BYTES` in the file, from the first run on."""
        runs = self.dataset.sizes["run"]
        most = max(runs * STRETCH_BYTES // max(os.path.getsize(self._path), 1), 1)
        for first in range(0, runs, most):
            yield np.arange(first, min(first + most, runs))

    def runs(self, places: NDArray[np.integer[Any]]) -> xr.Dataset:
        """Return the runs at some places, ascending, with their rows, in memory."""
        pieces = np.split(places, np.flatnonzero(np.diff(places) > _FAR) + 1)
        with one_error(self._path):
            found = [
                take_runs(self._stretch(one[0], one[-1] + 1), one - one[0])
                if one.size
                else self._stretch(0, 0)
                for one in pieces
            ]
        return joined(found, [os.fspath(self._path)] * len(found))

    def _stretch(self, first: int, stop: int) -> xr.Dataset:
        """Return neighbouring runs with their rows."""
        part: dict[str, slice] = {"run": slice(int(first), int(stop))}
        for dim, count in RAGGED.items():
            if count in self.dataset.variables:
                begin = self._rows_before(count, int(first))
                own = self.dataset.variables[count][part["run"]].values.sum(dtype=np.int64)
                part[dim] = slice(begin, begin + int(own))
        some = self.dataset.isel(part)
        data = {str(name): loaded_variable(one) for name, one in some.variables.items()}
        for variable in data.values():
            variable.attrs.pop("_FillValue", None)  # an attribute of the file, not of its runs
        return assembled(data, {str(name): data.pop(str(name)) for name in some.coords}, some.attrs)

    def _rows_before(self, count: str, run: int) -> int:
        """Return the number of rows of all runs before a run; sums at every `_FAR` runs are kept."""
        if count not in self._sums:
            counts = self.dataset.variables[count]
            parts = (counts[first : first + _FAR].values for first in range(0, counts.size, _FAR))
            sums = [part.sum(dtype=np.int64) for part in parts]
            self._sums[count] = np.cumsum([0, *sums])
        block = run // _FAR
        rest = self.dataset.variables[count][block * _FAR : run].values.sum(dtype=np.int64)
        return int(self._sums[count][block] + rest)


def _ascends(index: xr.Variable) -> bool:
    """Return whether numbers ascend; they are read block by block, each with the last number before it."""
    parts = (index[max(first - 1, 0) : first + _FAR].values for first in range(0, index.size, _FAR))
    return all((np.diff(part) > 0).all() for part in parts)


def is_large(path: str | os.PathLike[str]) -> bool:
    """Return whether the runs of a file are read in stretches, if they are in the order of their index."""
    return os.path.getsize(path) > LARGE_BYTES


def blocks_of(path: str | os.PathLike[str]) -> Iterator[xr.Dataset]:
    """Yield the runs of a file in memory, in stretches if the file is large.

    The runs of a large file are in the order of their index. DatasetError: see `FlatFile`.
    """
    if not is_large(path):
        yield read_flat(path)
        return
    with FlatFile(path) as file:
        for places in file.stretches():
            yield file.runs(places)


def _in_order_of_the_scene(flat: xr.Dataset) -> xr.Dataset:
    """Return a dataset whose coordinates have the order of the scene: a file lists variables by the alphabet."""
    linked = str(flat.variables["outcome"].encoding.get("coordinates", "")).split()
    data = {str(name): one for name, one in flat.variables.items()}
    names = dict.fromkeys([*(name for name in linked if name in data), *map(str, flat.coords)])
    return assembled(data, {name: data.pop(name) for name in names}, flat.attrs)
