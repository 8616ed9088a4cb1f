"""Write a dataset of runs as a Zarr store: its arrays are made before the runs, and shards are written in any order.

The store has the variables, dimensions, coordinates and attributes that `open_dataset` gives for the NetCDF file.
Impacts, sticks, samples and events are the exception, since their number is not known before. Their arrays have two
dimensions, such as `impact_shard` and `impact_row`: the rows of the runs of one shard, those of the first run first.
`impact_rows` has the number of rows of each shard, and `shard_order` the shards in the order of their runs.

Runs that have no grid beforehand lie along the dimension `run`, with their coordinates. Reading lays them on their
grid.

`create_store` makes the arrays. A `StoreWriter` in any process writes the runs of one shard at a time: a shard of a
variable is one object, with one writer. `finish` writes the numbers of rows and, last, the consolidated
metadata: a store without them is unfinished, and is not opened.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import Any
from uuid import uuid4

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.assembling import Named, new_variable
from vibroimpact.analysis.dataset.derived import RANGE, RANGE_ENDS, range_over_periods
from vibroimpact.analysis.dataset.grid import direction_codes, direction_words, range_attributes
from vibroimpact.analysis.dataset.schema import RAGGED, RULES, constant_names, swept_names
from vibroimpact.analysis.dataset.stores.grid import Block, StoreGrid
from vibroimpact.analysis.dataset.stores.new_arrays import (
    NewArray,
    cells_array,
    rows_array,
    shards_array,
    whole_array,
)
from vibroimpact.analysis.dataset.stores.overview import CLASSES, OVERVIEW, BlockGrid, names_of, quantities_of
from vibroimpact.analysis.files.at_once import done_at_once
from vibroimpact.analysis.files.store_attributes import COORDINATES, STORE_ID, attributes_stored
from vibroimpact.analysis.files.stores import (
    Place,
    announce,
    arrays_of,
    consolidate,
    dims_of,
    is_written,
    kind_of,
    new_array,
    one_store_error,
    opened_group,
)
from vibroimpact.fmus.errors import DatasetError

SHARD_ORDER = "shard_order"
OF_SHARDS = ("shard", *(f"{dim}_shard" for dim in RAGGED))
"""Dimensions with an element for each shard."""
LABELS = {"interface": "connection", "comparison": "compared"}
"""Dimensions of a file that are named by a variable in an opened dataset."""
_LAST = np.iinfo(np.int32).max
RUN_ID = {"long_name": "position of the run in the file", "units": "1"}


@dataclass(frozen=True, slots=True)
class _Piece:
    """The values of one shard in one array."""

    array: Any
    block: Block
    values: NDArray[Any]


def create_store(
    place: Place,
    like: xr.Dataset,
    grid: StoreGrid,
    axes: Mapping[str, xr.Variable],
    *,
    sizes: Mapping[str, int] | None = None,
) -> None:
    """Make the store of a dataset whose sizes are known, with its coordinates and without runs.

    Cells that are never written are NaN, -1 in integers, and empty texts.

    Parameters
    ----------
    place : path or address
        Where nothing is yet.
    like : xarray.Dataset
        Runs of the dataset, one-dimensional as `build_dataset` gives them; any number of runs. It has the variables,
        their types and attributes, the numbers that are the same for all runs, and the global attributes.
    grid : StoreGrid
        Dimensions of the runs, and their shards.
    axes : mapping of str to xarray.Variable
        All coordinates along these dimensions, and the scalar `direction` of independent runs. Coordinates along `run`
        are written with the shards.
    sizes : mapping of str to int, optional
        Sizes of further dimensions (`period`, `state`) where they are not those of `like`.

    Raises
    ------
    UsageError
        The package zarr is missing.
    DatasetError
        The store cannot be made.
    OSError
        The disk is full, or the folder cannot be written.
    """
    group = opened_group(place, "w-")
    with one_store_error(place, writes=True):
        group.update_attributes({**attributes_stored(like.attrs), STORE_ID: uuid4().hex})
        fixed = {**axes, **_fixed(like)}
        linked = _linked(like, grid, fixed)
        for name, one in _arrays(like, grid, sizes or {}).items():
            _made(group, name, one, linked)
        _make_overview(group, like, grid)
        for name, variable in fixed.items():
            made = _made(group, name, whole_array(variable), "")
            values = variable.values
            made[...] = values.astype(object) if values.dtype.kind in "UO" else values


class StoreWriter:
    """Writes the runs of one shard at a time into a store that `create_store` made; any number of processes may.

    Parameters
    ----------
    place : path or address

    Attributes
    ----------
    grid : StoreGrid
    """

    def __init__(self, place: Place) -> None:
        self._place = place
        self._group = opened_group(place, "r+")
        with one_store_error(place, writes=is_written(place, "r+")):
            self._arrays = arrays_of(self._group)
            self._overview = arrays_of(self._group[OVERVIEW]) if OVERVIEW in self._group else {}
            self.grid = grid_of(self._arrays["run_id"])
            linked = str(self._arrays["outcome"].attrs.get(COORDINATES, "")).split()
            kept = {SHARD_ORDER, *(name for name in linked if name != "run_index")}
            self._of_cells = {
                name: array
                for name, array in self._arrays.items()
                if (self.grid.is_line or name not in kept)
                and not _is_of_rows(dims_of(array))
                and dims_of(array)[: len(self.grid.dims)] == self.grid.dims
            }

    def write_shard(
        self,
        block: Block,
        runs: Named,
        cells: NDArray[np.int64] | None = None,
        run_ids: NDArray[np.int32] | None = None,
    ) -> dict[str, str]:
        """Write the runs of one shard, and replace what was there.

        Parameters
        ----------
        block : tuple of slice
            Cells of the shard, as `grid.blocks` yields them.
        runs : xarray.Dataset
            The runs of these cells, one-dimensional as `build_dataset` gives them.
        cells : ndarray of int, shape (run,), optional
            Place of each run among the cells of the block, the last dimension fastest; by default their order.
        run_ids : ndarray of int, shape (run,), optional
            Position of each run in the dataset; by default its `run_index`.

        Returns
        -------
        dict
            SHA-256 of each object of the shard, by its key.

        Raises
        ------
        DatasetError
            The runs are not those of the store: a variable that it lacks, or another number of cells.
        OSError
            The disk is full, or the store is out of reach.
        """
        columns = runs.variables
        self._refuse_others(runs)
        count = len(columns["run_index"])
        shape = tuple(cells_along.stop - cells_along.start for cells_along in block)
        places = np.arange(count) if cells is None else cells
        ids = np.asarray(columns["run_index"].values if run_ids is None else run_ids, dtype=np.int32)
        if len(places) != count or len(ids) != count or count > math.prod(shape):
            raise DatasetError(
                f"{self._place}: expected at most {math.prod(shape)} runs in the shard, each with a cell, got {count}."
            )
        in_order = count == math.prod(shape) and bool((places == np.arange(count)).all())
        pieces = chain(
            self._cells(block, columns, ids, None if in_order else places, shape),
            self._blocks_of_overview(block, columns, places, shape),
            self._rows(self.grid.number(block), columns, ids),
        )
        with one_store_error(self._place, writes=True):
            written = done_at_once(self._replace, pieces, self._place, lambda piece: piece.values.nbytes)
        return {key: digest for each in written for key, digest in sorted(each.items())}

    def _cells(
        self,
        block: Block,
        columns: Mapping[Any, xr.Variable],
        ids: NDArray[np.int32],
        places: NDArray[Any] | None,
        shape: tuple[int, ...],
    ) -> Iterator[_Piece]:
        """Yield the values of the runs of a shard on its cells."""
        for name, array in self._of_cells.items():
            values = ids if name == "run_id" else _column(columns, name)
            yield _Piece(array, block, _on_cells(array, values, places, shape))

    def read_shard(
        self, block: Block, names: Collection[str], cells: NDArray[np.int64]
    ) -> dict[str, NDArray[Any]]:
        """Return the values of the runs of a shard, as `write_shard` took them.

        Parameters
        ----------
        block, cells
            As given to `write_shard`; each cell has a run.
        names : collection of str
            Variables of runs and rows; others than those of the store are left out.

        Raises
        ------
        DatasetError
            An object of the store is damaged.
        """
        found: dict[str, NDArray[Any]] = {}
        number = self.grid.number(block)
        with one_store_error(self._place):
            for name in self._of_cells.keys() & set(names):
                array = self._of_cells[name]
                values = np.asarray(array[block], dtype=kind_of(array))
                found[name] = values.reshape(-1, *values.shape[len(block) :])[cells]
            if "direction" in found:
                found["direction"] = direction_codes(found["direction"])
            for dim in self._ragged:
                count = int(self._arrays[RAGGED[dim]][block].sum())
                for name, array in self._arrays.items():
                    if name in names and _is_along(array, dim):
                        found[name] = np.asarray(array[number, :count], dtype=kind_of(array))
        return found

    def _blocks_of_overview(
        self, block: Block, columns: Mapping[Any, xr.Variable], places: NDArray[Any], shape: tuple[int, ...]
    ) -> Iterator[_Piece]:
        """Yield the blocks of a shard in the overview of a large map."""
        blocks = BlockGrid.of(self.grid)
        if blocks is None:
            return
        parts: dict[str, NDArray[Any]] = {}
        for name, values in quantities_of(columns).items():
            on_cells = np.full(math.prod(shape), np.nan)
            on_cells[places] = values
            reduced = blocks.reduced(on_cells.reshape(shape))
            parts |= {f"{name}_{part}": found for part, found in reduced.items()}
        if all(name in columns for name in CLASSES):
            kinds = []
            for name in CLASSES:
                codes = np.full(math.prod(shape), -1, dtype=np.int64)
                codes[places] = columns[name].values
                kinds.append(codes.reshape(shape))
            parts |= dict(zip(CLASSES, blocks.rarest(kinds), strict=True))
        for name, values in parts.items():
            yield _Piece(self._overview[name], blocks.place(block), values)

    @property
    def _ragged(self) -> list[str]:
        return [dim for dim in RAGGED if f"{dim}_rows" in self._arrays]

    def _rows(self, number: int, columns: Mapping[Any, xr.Variable], ids: Any) -> Iterator[_Piece]:
        """Yield the rows of the runs of a shard."""
        for dim in self._ragged:
            owners = np.repeat(ids, columns[RAGGED[dim]].values)
            for name, array in self._arrays.items():
                if not _is_along(array, dim):
                    continue
                values = owners if name == f"{dim}_run" else None
                if values is None and name in columns:
                    values = columns[name].values
                if values is not None and len(values):
                    yield _Piece(array, (slice(number, number + 1), slice(0, len(values))), values[None])

    def _replace(self, piece: _Piece) -> dict[str, str]:
        """Write whole shards of an array, and return the SHA-256 of each object; older ones may be damaged."""
        array, further = piece.array, piece.array.shape[len(piece.block) :]
        block = (*piece.block, *(slice(0, size) for size in further))
        with self._group.store.replaced(_keys(array, block)) as found:
            array[block] = piece.values
        return dict(found)

    def _refuse_others(self, runs: Named) -> None:
        known = {*self._arrays, "direction", *swept_names(runs)}
        others = sorted(str(name) for name in runs.variables if name not in known)
        if others:
            raise DatasetError(
                f"{self._place}: expected runs with the variables of the store, got {', '.join(others)} too."
            )

    def finish(
        self,
        attrs: Mapping[str, Any] | None = None,
        *,
        sizes: Mapping[str, int] | None = None,
        absent: Collection[str] = (),
    ) -> None:
        """Write the number of rows of each shard, and the consolidated metadata, which make the store a dataset.

        The counts of rows are read from the store, a shard at a time.

        Parameters
        ----------
        attrs : mapping, optional
            Further global attributes.
        sizes : mapping of str to int, optional
            Smaller sizes of dimensions than those announced.
        absent : collection of str
            Variables that no run has, which are removed.
        """
        with one_store_error(self._place, writes=True):
            self._group.update_attributes(attributes_stored(attrs or {}))
            for name in absent:
                if self._arrays.pop(name, None) is not None:
                    self._of_cells.pop(name, None)
                    del self._group[name]
            shape = zip(self.grid.dims, self.grid.shape, strict=True)
            grid = replace(self.grid, shape=tuple((sizes or {}).get(dim, size) for dim, size in shape))
            final = {**(sizes or {}), **{dim: grid.shards for dim in OF_SHARDS}}
            shapes = {array.path: _cut(array, final) for array in self._arrays.values()}
            for dim in self._ragged:
                rows = self._of_shards(grid, RAGGED[dim], lambda counts: int(np.maximum(counts, 0).sum()))
                self._arrays[f"{dim}_rows"][: grid.shards] = np.array(rows, dtype=np.int64)
                most = max([1, *rows])
                for array in self._arrays.values():
                    if _is_along(array, dim):
                        shapes[array.path] = (grid.shards, most, *array.shape[2:])
            if self._ragged:
                first = self._of_shards(
                    grid, "run_index", lambda index: int(index[index >= 0].min(initial=_LAST))
                )
                self._arrays[SHARD_ORDER][: grid.shards] = np.argsort(first, kind="stable")
            changed = [array for array in self._arrays.values() if shapes[array.path] != array.shape]
            done_at_once(
                lambda array: announce(self._place, array.path, shapes[array.path]), changed, self._place
            )
        consolidate(self._place)

    def _of_shards(self, grid: StoreGrid, name: str, found: Callable[[NDArray[Any]], int]) -> list[int]:
        """Return a number of each shard, found from its values of a variable."""
        array = self._arrays[name]
        return done_at_once(lambda block: found(array[block]), grid.blocks(), self._place)


def _arrays(like: xr.Dataset, grid: StoreGrid, sizes: Mapping[str, int]) -> dict[str, NewArray]:
    """Return the arrays of runs and rows, by name."""
    kept = {*_fixed(like)}
    kept |= set() if grid.is_line else {"direction", *swept_names(like)}
    found: dict[str, NewArray] = {}
    for name, variable in like.variables.items():
        if name in kept:
            continue
        if variable.dims[0] in RAGGED:
            elements = {str(each): variable.sizes[each] for each in variable.dims[1:]}
            found[str(name)] = rows_array(
                str(variable.dims[0]), grid, variable.dtype, variable.attrs, elements
            )
        else:
            further = {LABELS.get(str(d), str(d)): sizes.get(str(d), n) for d, n in variable.sizes.items()}
            further.pop("run")
            found[str(name)] = cells_array(grid, further, variable.dtype, variable.attrs)
    if grid.is_line:
        found["direction"] = cells_array(grid, {}, object, {"long_name": RULES["direction"].long_name})
    found["run_id"] = cells_array(grid, {}, np.int32, RUN_ID)
    if all(name in found for name in RANGE_ENDS):
        attributes = range_attributes(like.variables[RANGE_ENDS[0]])
        found[RANGE] = cells_array(grid, {}, np.float64, attributes)
    for dim, count in RAGGED.items():
        if count in found:
            owner = {"long_name": f"run_id of the run of each {dim}", "units": "1"}
            found[f"{dim}_run"] = rows_array(dim, grid, np.int32, owner)
            number = {"long_name": f"number of rows of {dim} in each shard", "units": "1"}
            found[f"{dim}_rows"] = shards_array(f"{dim}_shard", grid, number)
            order = {"long_name": "numbers of the shards in the order of their runs", "units": "1"}
            found[SHARD_ORDER] = shards_array("shard", grid, order)
    return found


def _make_overview(group: Any, like: xr.Dataset, grid: StoreGrid) -> None:
    """Make the arrays of the overview of a large map."""
    blocks = BlockGrid.of(grid)
    if blocks is None:
        return
    overview = group.create_group(OVERVIEW)
    for name in names_of(like.variables):
        dtype = RULES[name].dtype if name in CLASSES else np.float64
        one = NewArray(grid.dims, blocks.shape, blocks.in_shard, blocks.in_shard, dtype, {})
        _made(overview, name, one, "")


def _fixed(like: xr.Dataset) -> dict[str, xr.Variable]:
    """Return the variables that are the same for all runs: numbers of the scene, and labels."""
    found = {name: like.variables[name] for name in constant_names(like)}
    for dim, name in LABELS.items():
        if name in like.variables:
            label = like.variables[name]
            found[name] = new_variable((LABELS[dim],), label.values, label.attrs)
    return found


def _linked(like: xr.Dataset, grid: StoreGrid, fixed: Mapping[str, xr.Variable]) -> str:
    """Return the names of the coordinates of runs, in the order of the scene, for the attribute of each variable."""
    names = ["run_index", "direction", *swept_names(like), *fixed]
    linked = [name for name in names if grid.is_line or name in fixed or name == "run_index"]
    return " ".join(dict.fromkeys(linked))


def _made(group: Any, name: str, one: NewArray, linked: str) -> Any:
    """Make one array of a store."""
    attributes = attributes_stored(one.attrs)
    if linked and name not in linked.split():
        attributes[COORDINATES] = linked
    return new_array(group, name, one.dims, one.shape, one.chunk, one.shard, one.dtype, attributes)


def _cut(array: Any, sizes: Mapping[str, int]) -> tuple[int, ...]:
    """Return the shape of an array with some of its dimensions cut."""
    return tuple(sizes.get(dim, size) for dim, size in zip(dims_of(array), array.shape, strict=True))


def _keys(array: Any, block: Block) -> list[str]:
    """Return the keys of the objects of an array with these cells along all of its dimensions."""
    shard = array.shards or array.chunks
    spans = [range(s.start // n, -(-s.stop // n)) for s, n in zip(block, shard, strict=True)]
    return [f"{array.path}/{array.metadata.encode_chunk_key(place)}" for place in product(*spans)]


def grid_of(run_id: Any) -> StoreGrid:
    """Return the cells of a store, from the array that has a number for each."""
    return StoreGrid(dims_of(run_id), run_id.shape, run_id.chunks, run_id.shards or run_id.chunks)


def _is_along(array: Any, dim: str) -> bool:
    """Return whether an array has the rows of a ragged dimension."""
    return dims_of(array)[:2] == (f"{dim}_shard", f"{dim}_row")


def _is_of_rows(dims: tuple[str, ...]) -> bool:
    return dims[:1] in {(f"{dim}_shard",) for dim in RAGGED}


def _column(columns: Mapping[Any, xr.Variable], name: str) -> NDArray[Any] | None:
    """Return the values of runs, those of derived variables too; None for a variable that the runs lack."""
    if name == RANGE:
        return range_over_periods(*(columns[end].values for end in RANGE_ENDS))
    if name == "direction":
        return direction_words(columns[name].values).astype(object)
    return None if name not in columns else np.asarray(columns[name].values)


def _on_cells(
    array: Any, values: NDArray[Any] | None, places: NDArray[Any] | None, shape: tuple[int, ...]
) -> Any:
    """Return values of runs on the cells of a block, in the form of an array; without places, in their order."""
    further = array.shape[len(shape) :]
    if values is not None and places is None and values.shape[1:] == further:
        return np.asarray(values, dtype=kind_of(array)).reshape((*shape, *further))
    found: Any = np.full((math.prod(shape), *further), array.fill_value, dtype=kind_of(array))
    if values is not None:
        places = np.arange(len(values)) if places is None else places
        found[(places, *(slice(0, size) for size in values.shape[1:]))] = values
    return found.reshape((*shape, *further))
