"""The runs of a store one after the other, as a NetCDF file has them: a shard at a time, ordered by `run_index`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.assembling import Described, assembled
from vibroimpact.analysis.dataset.checking import count_problems
from vibroimpact.analysis.dataset.grid import direction_codes
from vibroimpact.analysis.dataset.merging import joined
from vibroimpact.analysis.dataset.places import dataset_place
from vibroimpact.analysis.dataset.reading import read_flat
from vibroimpact.analysis.dataset.schema import RAGGED, UnitSystem, attributes_of
from vibroimpact.analysis.dataset.stores.grid import Block
from vibroimpact.analysis.dataset.stores.reading import StoreContents
from vibroimpact.analysis.dataset.stores.store import LABELS
from vibroimpact.analysis.files.stores import Place, is_store, one_store_error
from vibroimpact.fmus.errors import DatasetError

_DIMS = {label: dim for dim, label in LABELS.items()}


@dataclass(frozen=True, slots=True, eq=False)
class Shard:
    """The runs of one shard of a store; `first` and `last` are the lowest and the highest `run_index`."""

    store: StoreRuns
    number: int
    block: Block
    first: int
    last: int
    count: int

    @property
    def path(self) -> str:
        """Name of the shard in messages."""
        return f"{self.store.place}: shard {self.number}"

    def rows(self) -> xr.Dataset:
        """Return the runs of the shard, in the order of their index."""
        return self.store.runs(self.number, self.block)


@dataclass(slots=True)
class StoreRuns:
    """The runs of a finished store.

    Parameters
    ----------
    place : path or address

    Attributes
    ----------
    shards : list of Shard
        Shards with runs, in the order of their numbers.
    sizes : dict
        Number of runs, and of rows of each ragged dimension.
    """

    place: Place
    shards: list[Shard] = field(init=False)
    sizes: dict[str, int] = field(init=False)
    _contents: StoreContents = field(init=False)
    _opened: xr.Dataset = field(init=False)

    def __post_init__(self) -> None:
        self._contents = StoreContents(self.place)
        self._opened = self._contents.stored()
        self.shards = list(self._found_shards())
        rows = {dim: int(count.sum()) for dim, count in self._contents.rows.items()}
        self.sizes = {"run": sum(shard.count for shard in self.shards), **rows}

    def _found_shards(self) -> Iterator[Shard]:
        for number, block in enumerate(self._contents.grid.blocks()):
            index = self._values("run_index", block)
            there = index[index >= 0]
            if there.size:
                yield Shard(self, number, block, int(there.min()), int(there.max()), there.size)

    def _values(self, name: str, block: Block) -> NDArray[Any]:
        """Return the values of the cells of a block, one after the other."""
        variable = self._opened.variables[name]
        grid = self._contents.grid
        part = variable.isel(
            {dim: cells for dim, cells in zip(grid.dims, block, strict=True) if dim in variable.dims}
        )
        whole = {dim: cells.stop - cells.start for dim, cells in zip(grid.dims, block, strict=True)}
        further = [dim for dim in part.dims if dim not in whole]
        spread = part.set_dims({**whole, **{dim: part.sizes[dim] for dim in further}})
        values: NDArray[Any] = spread.transpose(*grid.dims, *further).values
        return values.reshape(-1, *(part.sizes[dim] for dim in further))

    def form(self) -> xr.Dataset:
        """Return the dataset without runs: names, types, attributes, and the values that all runs share."""
        none = tuple(slice(0, 0) for _ in self._contents.grid.dims)
        rows = {dim: slice(0, 0) for dim in self._contents.rows}
        found = self._assembled(none, np.empty(0, dtype=np.int64), rows)
        return found.drop_vars([f"{dim}_run" for dim in rows])

    def runs(self, number: int, block: Block) -> xr.Dataset:
        """Return the runs of a block, in the order of their index.

        Raises
        ------
        DatasetError
            A chunk is damaged, or the counts of rows do not fit.
        """
        with one_store_error(self.place):
            ids, index = self._values("run_id", block), self._values("run_index", block)
            places = np.flatnonzero(index >= 0)
            places = places[np.argsort(index[places])]
            rows = {}
            for dim, count in self._contents.rows.items():
                first = self._contents.rows_before(dim, number)
                rows[dim] = slice(first, first + int(count[number]))
            found = self._assembled(block, places, rows)
            problems = count_problems(found)
            if problems:
                raise DatasetError(f"{self.place}: {problems[0]} The store is damaged; write it again.")
            return self._in_order(found, ids[places])

    def _in_order(self, runs: xr.Dataset, ids: NDArray[np.int32]) -> xr.Dataset:
        """Return runs whose rows, stored in the order of writing, follow one another in the order of the runs."""
        moved, by_id = {}, np.argsort(ids)
        for dim in self._contents.rows:
            owners = runs.variables[f"{dim}_run"].values
            at = np.minimum(np.searchsorted(ids, owners, sorter=by_id), ids.size - 1)
            runs_of_rows = by_id[at]
            if (np.diff(runs_of_rows) < 0).any():
                moved[dim] = np.argsort(runs_of_rows, kind="stable")
                owners = owners[moved[dim]]
            if not np.array_equal(owners, np.repeat(ids, runs.variables[RAGGED[dim]].values)):
                raise DatasetError(
                    f"{self.place}: {dim}_run: expected the runs that {RAGGED[dim]} counts, got others. "
                    "The store is damaged; write it again."
                )
        found = runs.drop_vars([f"{dim}_run" for dim in self._contents.rows])
        return found.isel(moved) if moved else found

    def _assembled(self, block: Block, places: NDArray[Any], rows: dict[str, slice]) -> xr.Dataset:
        contents, opened = self._contents, self._opened
        constant = {name for name in opened.coords if not opened.variables[name].dims}
        constant -= {"direction", "run_index"}
        data: dict[str, Described | xr.Variable] = {}
        for name in [*contents.names, "direction"]:
            if name in ("run_id", "displacement_range") or name in contents.places:
                continue
            variable = opened.variables[name]
            attrs = {key: value for key, value in variable.attrs.items() if key != "_FillValue"}
            if name in constant:
                data[name] = ((), variable.values, attrs)
            elif name in LABELS.values():
                data[name] = ((_DIMS[name],), variable.values.astype(object), attrs)
            elif variable.dims and variable.dims[0] in RAGGED:
                dim = str(variable.dims[0])
                data[name] = (variable.dims, variable[rows[dim]].values, attrs)
            else:
                data[name] = self._of_runs(name, block, places, attrs)
        coords = {name: data.pop(name) for name in contents.linked if name in data}
        return assembled(data, coords, contents.attrs)

    def _of_runs(self, name: str, block: Block, places: NDArray[Any], attrs: dict[str, Any]) -> Described:
        variable, values = self._opened.variables[name], self._values(name, block)[places]
        if name == "direction":
            units: UnitSystem = self._contents.attrs["units_system"]
            return ("run",), direction_codes(values), attributes_of(name, units)
        further = [d for d in variable.dims if d not in self._contents.grid.dims]
        return ("run", *(_DIMS.get(str(d), d) for d in further)), values, attrs


def read_runs(given: Place) -> xr.Dataset:
    """Return all runs of a dataset in memory, one-dimensional as a file has them.

    The dataset is a file, a store, its address, or in the folder of a campaign.

    Raises
    ------
    DatasetError
        The dataset is missing, unfinished, damaged or foreign.
    """
    place = dataset_place(given)
    if not is_store(place):
        return read_flat(place)
    store = StoreRuns(place)
    pieces = [store.form(), *(shard.rows() for shard in store.shards)]
    names = [os.fspath(place), *(shard.path for shard in store.shards)]
    return joined(pieces, names)
