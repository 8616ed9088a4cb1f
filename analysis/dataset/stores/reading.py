"""Open the Zarr store of a dataset of runs: the same dataset as from its NetCDF file, in chunks of Dask where large."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import BackendArray
from xarray.core import indexing

from vibroimpact.analysis.dataset.assembling import new_axis, new_variable
from vibroimpact.analysis.dataset.checking import refuse_foreign, structure_problems
from vibroimpact.analysis.dataset.grid import are_grid, direction_codes, on_grid
from vibroimpact.analysis.dataset.schema import RAGGED, RULES, SWEPT_ALONG
from vibroimpact.analysis.dataset.stores.overview import OVERVIEW, BlockGrid
from vibroimpact.analysis.dataset.stores.store import LABELS, SHARD_ORDER, grid_of
from vibroimpact.analysis.dataset.stores.storing import Read
from vibroimpact.analysis.files.at_once import done_at_once
from vibroimpact.analysis.files.probing import MOST_EXPANSION, SPARSE_BYTES
from vibroimpact.analysis.files.store_attributes import COORDINATES, STORE_ID, attributes_read
from vibroimpact.analysis.files.stores import (
    Place,
    arrays_of,
    kind_of,
    one_store_error,
    opened_group,
    size_up_to,
)
from vibroimpact.fmus.errors import DatasetError

_DERIVED = ("run_id", *(f"{dim}_run" for dim in RAGGED), "displacement_range")


class _StoreArray(BackendArray):
    """An array of a store; every fault while it is read is one error that names store and array."""

    def __init__(self, place: Place, array: Any) -> None:
        self._place, self._array = place, array
        self.shape = array.shape
        self.dtype = kind_of(array)

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.BASIC, self._values
        )

    def _values(self, key: tuple[Any, ...]) -> NDArray[Any]:
        forward, turned = _forward(key, self.shape)
        with one_store_error(self._place):
            values: NDArray[Any] = np.asarray(self._read(forward), dtype=self.dtype)[turned]
        return values

    def _read(self, key: tuple[Any, ...]) -> Any:
        return self._array[key]


class _RowsArray(_StoreArray):
    """The rows of all shards, one shard after the other: a dimension of impacts, sticks, samples or events."""

    def __init__(self, place: Place, array: Any, rows: NDArray[np.int64], order: NDArray[np.int64]) -> None:
        super().__init__(place, array)
        self._order = order
        self._ends = np.concatenate([[0], np.cumsum(rows[order])])
        self.shape = (int(self._ends[-1]), *array.shape[2:])

    def _read(self, key: tuple[Any, ...]) -> Any:
        one, elements = key[0], key[1:]
        if not isinstance(one, slice):
            return self._read((slice(one, one + 1), *elements))[0]
        first, stop, step = one.indices(self.shape[0])
        pieces = [self._array[shard, part] for shard, part in self._parts(first, max(first, stop))]
        rows = np.concatenate([np.empty((0, *self.shape[1:]), self.dtype), *pieces])[::step]
        return rows[(slice(None), *elements)]

    def _parts(self, first: int, stop: int) -> Iterator[tuple[int, slice]]:
        """Yield the shards with rows from `first` to `stop - 1`, each with its part of them."""
        for shard, begin, end in zip(self._order, self._ends[:-1], self._ends[1:], strict=True):
            low, high = max(first, begin), min(stop, end)
            if low < high:
                yield int(shard), slice(int(low - begin), int(high - begin))


def _forward(key: tuple[Any, ...], shape: tuple[int, ...]) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Return a key without steps backwards, and the key that turns its values round: zarr only goes forwards."""
    forward: list[Any] = []
    turned: list[Any] = []
    for one, size in zip(key, shape, strict=True):
        if not isinstance(one, slice):
            forward.append(int(one) % size)
            continue
        places = range(size)[one]
        backward = places.step < 0
        places = places[::-1] if backward else places
        forward.append(slice(places.start, places.stop, places.step) if len(places) else slice(0, 0))
        turned.append(slice(None, None, -1) if backward else slice(None))
    return tuple(forward), tuple(turned)


@dataclass(frozen=True, slots=True)
class _Flat:
    """Names, dimensions, types and attributes of a store as its NetCDF file has them, for the checks of files."""

    variables: Mapping[str, Any]
    dims: frozenset[str]
    attrs: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class _Described:
    dims: tuple[str, ...]
    dtype: np.dtype[Any]
    attrs: Mapping[str, Any]


class StoreContents:
    """The contents of a finished store, whose metadata have passed the checks of files.

    Parameters
    ----------
    place : path or address

    Attributes
    ----------
    grid : StoreGrid
    attrs : dict
        Global attributes.
    names : list of str
        Names of the variables in the order of the schema; derived variables come last.
    linked : list of str
        Names of the coordinates, in the order of the scene.
    token : str
        Number of the store, by which its chunks of Dask are named.
    rows : dict
        Number of rows of each shard, by the name of their ragged dimension.
    order : ndarray of int
        Numbers of the shards in the order of their runs, which is the order of the rows.

    Raises
    ------
    DatasetError
        The store is missing, unfinished, damaged or foreign, or announces more values than it can hold.
    """

    def __init__(self, place: Place) -> None:
        group = opened_group(place, "r")
        with one_store_error(place):
            self._place, self.attrs = place, attributes_read(dict(group.attrs))
            self.token = str(group.attrs.get(STORE_ID, ""))[:64] or uuid4().hex
            self._overview = arrays_of(group[OVERVIEW]) if OVERVIEW in group else {}
            arrays = self._arrays = arrays_of(group)
            refuse_foreign(place, self.attrs, arrays)
            self._take_form()
            problems = structure_problems(self._flat())  # type: ignore[arg-type]  # has what the check uses
            if problems:
                raise DatasetError(f"{os.fspath(place)}: {problems[0]} The store is damaged; write it again.")
            self._refuse_large()

    def _take_form(self) -> None:
        arrays = self._arrays
        self.grid = grid_of(arrays["run_id"])
        self._dims = {name: tuple(array.metadata.dimension_names or ()) for name, array in arrays.items()}
        self._attrs = {name: dict(array.attrs) for name, array in arrays.items()}
        self._points = self._dims["run_id"]
        self.linked = str(self._attrs["outcome"].get(COORDINATES, "")).split()
        self._refuse_sizes()
        self.rows = {dim: self._rows_of(dim) for dim in RAGGED if f"{dim}_rows" in arrays}
        self.order = self._order_of_shards() if self.rows else np.arange(self.grid.shards)
        self.names = self._names()

    def _rows_of(self, dim: str) -> NDArray[np.int64]:
        """Return the number of rows of each shard."""
        array = self._arrays[f"{dim}_rows"]
        if math.prod(array.shape) > SPARSE_BYTES:
            raise ValueError(f"{dim}_rows: the shape {array.shape}")
        rows = np.asarray(array[...], dtype=np.int64).reshape(-1)
        if (rows < 0).any():
            raise ValueError(f"{dim}_rows: a number below 0")
        for name, dims in self._dims.items():
            if dims[:2] == _row_dims(dim):
                shards, most = self._arrays[name].shape[:2]
                if shards != rows.size or rows.max(initial=0) > most:
                    raise ValueError(f"{name}: fewer rows than {dim}_rows says")
        return rows

    def _order_of_shards(self) -> NDArray[np.int64]:
        """Return the numbers of the shards in the order of their runs."""
        array = self._arrays[SHARD_ORDER]
        if array.shape != (self.grid.shards,):
            raise ValueError(f"{SHARD_ORDER}: the shape {array.shape}")
        order = np.asarray(array[...], dtype=np.int64)
        if not np.array_equal(np.sort(order), np.arange(order.size)):
            raise ValueError(f"{SHARD_ORDER}: other numbers than those of the shards")
        return order

    def rows_before(self, dim: str, number: int) -> int:
        """Return the number of rows before those of a shard."""
        place = int(np.flatnonzero(self.order == number)[0])
        return int(self.rows[dim][self.order[:place]].sum())

    def _refuse_sizes(self) -> None:
        """Raise ValueError unless each dimension has one size."""
        sizes: dict[str, int] = {}
        for name, dims in self._dims.items():
            for dim, size in zip(dims, self._arrays[name].shape, strict=True):
                if sizes.setdefault(dim, size) != size:
                    raise ValueError(f"{name}: {dim} of the size {size}, elsewhere {sizes[dim]}")

    def _names(self) -> list[str]:
        """Return the names of the variables in the order of the schema; derived variables come last."""
        hidden = {SHARD_ORDER, *(f"{dim}_rows" for dim in self.rows)}
        first = [name for name in RULES if name in self._arrays]
        others = sorted(self._arrays.keys() - {*first, *hidden, *_DERIVED})
        return [*first, *others, *(name for name in _DERIVED if name in self._arrays)]

    def _is_of_cells(self, name: str) -> bool:
        return self._dims[name][: len(self._points)] == self._points and not self._is_fixed(name)

    def _is_fixed(self, name: str) -> bool:
        return name in self.linked and name != "run_index"

    def _ragged(self, name: str) -> str | None:
        return next((dim for dim in self.rows if self._dims[name][:2] == _row_dims(dim)), None)

    def _flat(self) -> _Flat:
        """Return the variables as a file has them, along runs and rows."""
        found = {name: self._described(name) for name in self.names if name not in _DERIVED}
        for name in self.places:
            found.pop(name, None)
        rule = RULES["direction"]
        attributes = {"long_name": rule.long_name, "units": rule.unit}
        found["direction"] = _Described(("run",), np.dtype(rule.dtype), attributes)
        return _Flat(found, frozenset(d for one in found.values() for d in one.dims), self.attrs)

    @property
    def places(self) -> set[str]:
        """Coordinates that are in no file: numbers or copies along a dimension that swept parameters share."""
        shared = {attrs.get(SWEPT_ALONG) for attrs in self._attrs.values()}
        return {name for name in self._points if name in shared and SWEPT_ALONG not in self._attrs[name]}

    def _described(self, name: str) -> _Described:
        array, dims, ragged = self._arrays[name], self._dims[name], self._ragged(name)
        if ragged is not None:
            dims = (ragged, *dims[2:])
        elif self._is_of_cells(name):
            files = {label: dim for dim, label in LABELS.items()}
            dims = ("run", *(files.get(dim, dim) for dim in dims[len(self._points) :]))
        elif name in LABELS.values():
            dims = tuple(dim for dim, label in LABELS.items() if label == name)
        elif dims:
            dims = ("run",)
        return _Described(dims, kind_of(array), attributes_read(self._attrs[name]))

    def _refuse_large(self) -> None:
        """Raise ValueError if the store announces more than its objects can hold."""
        promised = 0
        for name in self.names:
            ragged = self._ragged(name)
            shape = self._arrays[name].shape
            size = math.prod(shape if ragged is None else (int(self.rows[ragged].sum()), *shape[2:]))
            promised += size * kind_of(self._arrays[name]).itemsize
        if promised > SPARSE_BYTES:
            # the folders of a large store would be listed for a second
            size = size_up_to(self._place, -(-promised // MOST_EXPANSION))
            most = max(SPARSE_BYTES, MOST_EXPANSION * size)
            if promised > most:
                raise ValueError(f"values of {promised} bytes, at most {most} fit into its objects")

    def dataset(self) -> xr.Dataset:
        """Return the dataset on the dimensions of its sweep; values are read when used, those of coordinates now.

        Runs one after the other are laid on their grid as those of a file are.
        """
        stored = self.stored()
        if not self.grid.is_line:
            return stored
        flat = self._as_file(stored)
        if not are_grid(flat):
            return stored
        opened = on_grid(flat, lazily=True)
        opened.encoding["source"] = os.fspath(self._place)
        return opened

    def _as_file(self, stored: xr.Dataset) -> Read:
        """Return runs one after the other as a file has them: directions are codes."""
        variables = {
            str(name): variable.copy(deep=False)
            for name, variable in stored.variables.items()
            if name not in _DERIVED
        }
        codes = direction_codes(variables["direction"].values)
        variables["direction"] = new_variable("run", codes, variables["direction"].attrs)
        variables["outcome"].encoding["coordinates"] = " ".join(self.linked)
        return Read(variables, tuple(map(str, stored.coords)), self.attrs)

    def stored(self) -> xr.Dataset:
        """Return the dataset on the dimensions of the arrays of the store."""
        read = done_at_once(self._variable, self.names, self._place)
        variables = dict(zip(self.names, read, strict=True))
        linked = sorted((name for name in self.linked if name in variables), key=self._rank)
        coords = {name: variables.pop(name) for name in linked}
        with one_store_error(self._place):
            opened = xr.Dataset(variables, coords=coords, attrs=self.attrs)
        opened.encoding["source"] = os.fspath(self._place)
        return opened

    def _rank(self, name: str) -> int:
        """Return the place of the kind of a coordinate among all, as files are opened with them."""
        if name == "direction" or self._dims[name]:
            kinds = (name == "run_index", name in LABELS.values(), False, bool(self._dims[name]), True)
        else:
            kinds = (name == "run_index", False, True, True, True)
        return kinds.index(True)

    def overview(self, name: str) -> NDArray[Any] | None:
        """Return an array of the overview of a large map, without the blocks beyond its last cells; None without it."""
        blocks = BlockGrid.of(self.grid)
        if blocks is None or name not in self._overview:
            return None
        array = self._overview[name]
        with one_store_error(self._place):
            if tuple(array.shape) != blocks.shape:
                raise ValueError(f"{OVERVIEW}/{name}: the shape {array.shape}, expected {blocks.shape}")
            ends = (slice(0, len(blocks.starts(axis))) for axis in range(len(blocks.shape)))
            return np.asarray(array[tuple(ends)])

    def _variable(self, name: str) -> xr.Variable:
        array, attrs = self._arrays[name], attributes_read(self._attrs[name])
        if self._is_fixed(name):
            return _fixed(name, self._dims[name], _StoreArray(self._place, array), attrs)
        dims, ragged = self._dims[name], self._ragged(name)
        if ragged is None:
            return self._lazy(
                name, dims, _StoreArray(self._place, array), attrs, array.shards or array.chunks
            )
        if kind_of(array).kind == "f":
            attrs["_FillValue"] = np.float64(np.nan)
        rows = self.rows[ragged]
        chunks = (tuple(rows[self.order][rows[self.order] > 0].tolist()) or (0,), *array.shape[2:])
        read = _RowsArray(self._place, array, rows, self.order)
        return self._lazy(name, (ragged, *dims[2:]), read, attrs, chunks)

    def _lazy(
        self, name: str, dims: tuple[str, ...], array: _StoreArray, attrs: Any, chunks: Any
    ) -> xr.Variable:
        """Return a variable that is read when it is used: in chunks of Dask where it has several."""
        lazily = indexing.LazilyIndexedArray(array)
        if all(size <= _first(part) for size, part in zip(array.shape, chunks, strict=True)):
            cached: Any = indexing.MemoryCachedArray(indexing.CopyOnWriteArray(lazily))  # type: ignore[arg-type]  # as xarray does
            return xr.Variable(dims, cached, attrs)
        variable = xr.Variable(dims, lazily, attrs)
        return variable.chunk(dict(zip(dims, chunks, strict=True)), name=f"{name}-{self.token}")


def _first(part: Any) -> int:
    return int(part[0] if isinstance(part, tuple) else part)


def _row_dims(dim: str) -> tuple[str, str]:
    return f"{dim}_shard", f"{dim}_row"


def _fixed(name: str, dims: tuple[str, ...], array: _StoreArray, attrs: Mapping[str, Any]) -> xr.Variable:
    """Return a coordinate in memory."""
    values = np.asarray(array[indexing.BasicIndexer((slice(None),) * len(dims))])
    if values.dtype.kind == "O":  # labels get texts of one length, as an index has
        values = values.astype(np.str_)
    return new_axis(name, values, attrs) if dims == (name,) else new_variable(dims, values, attrs)
