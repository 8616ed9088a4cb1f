"""The runs of a dataset on the real dimensions of their sweep, and the ragged arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import BackendArray
from xarray.core import indexing

from vibroimpact.analysis.dataset.assembling import Named, new_axis, new_variable
from vibroimpact.analysis.dataset.derived import RANGE, RANGE_ENDS, range_over_periods
from vibroimpact.analysis.dataset.schema import (
    RAGGED,
    RULES,
    SWEPT_ALONG,
    Direction,
    constant_names,
    standing_for,
    swept_names,
)

BLOCK_RUNS = 1 << 20
"""Number of runs whose values are in memory together while their grid is found."""
_Placed = Callable[[slice], NDArray[np.intp]]
"""Function that returns the places of runs along a dimension."""
# Grid points per run above which a sweep (scattered points) would waste memory on a grid; `run` stays its dimension.
_LARGEST_GRID_PER_RUN = 10


class _RunArray(BackendArray):
    """A per-run variable laid out on the grid, read as a whole when first used."""

    def __init__(
        self, read: Callable[[], NDArray[Any]], run_id: NDArray[np.int32], like: xr.Variable
    ) -> None:
        self._read = read
        self._run_id = run_id
        self.shape = (*run_id.shape, *like.shape[1:])
        self.dtype = like.dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.BASIC, lambda basic: self._values[basic]
        )

    def now(self) -> NDArray[Any]:
        """Return the values as a reader of all values gets them; a single text keeps its length."""
        return np.asarray(self._values[()])

    @cached_property
    def _values(self) -> NDArray[Any]:
        # a single run gives a scalar, which text would stay without the array
        values = np.array(self._read()[self._run_id], dtype=self.dtype)
        missing = self._run_id < 0
        if missing.any():
            values[missing] = {"f": np.nan, "i": -1}.get(values.dtype.kind, "")
        return values


class Flat(Named, Protocol):
    """Runs one after the other, as a file has them: a dataset of xarray, or variables read from a file."""

    @property
    def sizes(self) -> Mapping[Any, int]:
        """Size of each dimension."""

    @property
    def attrs(self) -> Mapping[Any, Any]:
        """Attributes of the file."""


def on_grid(flat: Flat, *, lazily: bool) -> xr.Dataset:
    """Return runs on the dimensions of their sweep, with the ragged arrays; lazily: read when first used."""
    labelled = _with_labels(flat)
    dims, axes, scalars, run_id = _grid(labelled)
    swept, constants = swept_names(labelled), constant_names(labelled)
    place = _Placing(dims, run_id, lazily)
    variables: dict[str, xr.Variable] = {}
    # The order of the schema reads better than the alphabet; sampled variables come last.
    order = [name for name in RULES if name in labelled.variables]
    for name in [*order, *(name for name in labelled.variables if name not in RULES)]:
        variable = labelled.variables[name]
        if name in (*swept, *constants, "direction"):
            continue
        variables[str(name)] = place.per_run(variable) if variable.dims[:1] == ("run",) else variable
    variables["run_id"] = new_variable(
        dims, run_id, {"long_name": "position of the run in the file", "units": "1"}
    )
    variables |= _row_owners(labelled)
    if RANGE_ENDS[0] in labelled.variables:
        variables[RANGE] = _displacement_range(labelled, place)
    coordinates = {"run_index": variables.pop("run_index")}
    coordinates |= {name: variables.pop(name) for name in ("connection", "compared") if name in variables}
    coordinates |= {name: labelled.variables[name] for name in constants}
    if dims == ("run",):
        coordinates |= {name: labelled.variables[name] for name in swept}
        words = direction_words(labelled.variables["direction"].values)
        coordinates["direction"] = new_variable("run", words, _plain(labelled.variables["direction"]))
        axes = {}
    return xr.Dataset(variables, coords=coordinates | axes | scalars, attrs=labelled.attrs)


def _with_labels(flat: Flat) -> Flat:
    """Return runs with names as dimensions, where there are some: a dataset in memory selects by them."""
    renamed = {"connection": "interface", "compared": "comparison"}
    if not set(renamed.values()) & set(flat.sizes):
        return flat
    if isinstance(flat, xr.Dataset):
        dataset = flat
    else:
        data = dict(flat.variables)
        coords = {name: data.pop(name) for name in flat.coords}
        dataset = xr.Dataset(data, coords=coords, attrs=flat.attrs)
    return dataset.swap_dims({stored: name for name, stored in renamed.items() if name in flat.variables})


@dataclass(frozen=True, slots=True)
class _Placing:
    """Layout of per-run variables: the dimensions, the run at each point, and whether values are read lazily."""

    dims: tuple[str, ...]
    run_id: NDArray[np.int32]
    lazily: bool

    def per_run(self, variable: xr.Variable) -> xr.Variable:
        """Return a per-run variable on the grid."""
        attributes = {
            key: value for key, value in variable.attrs.items() if key not in ("_FillValue", "coordinates")
        }
        array = _RunArray(lambda: np.asarray(variable.values), self.run_id, variable)
        return self.laid_out((*self.dims, *variable.dims[1:]), array, attributes)

    def laid_out(self, dims: tuple[Any, ...], array: _RunArray, attributes: Mapping[Any, Any]) -> xr.Variable:
        """Return the variable of an array, read now or when it is first used."""
        if not self.lazily:
            return new_variable(dims, array.now(), attributes)
        return xr.Variable(dims, indexing.LazilyIndexedArray(array), attributes)


def _displacement_range(flat: Flat, place: _Placing) -> xr.Variable:
    """Return the largest minus the smallest displacement over the recorded periods, without NaN periods."""

    def read() -> NDArray[np.float64]:
        return range_over_periods(*(flat.variables[name].values for name in RANGE_ENDS))

    attributes = range_attributes(flat.variables[RANGE_ENDS[0]])
    array = _RunArray(read, place.run_id, flat.variables["final_displacement"])
    return place.laid_out(place.dims, array, attributes)


def range_attributes(largest: xr.Variable) -> dict[str, str]:
    """Return the attributes of the range, whose unit is that of the extremes."""
    return {
        "long_name": "displacement range over the recorded periods",
        "units": str(largest.attrs["units"]),
    }


def _row_owners(flat: Flat) -> dict[str, xr.Variable]:
    """Return the run_id of the owner of each row, for each ragged array."""
    runs = np.arange(flat.sizes["run"], dtype=np.int32)
    return {
        f"{dimension}_run": new_variable(
            dimension,
            np.repeat(runs, flat.variables[count].values),
            {"long_name": f"run_id of the run of each {dimension}", "units": "1"},
        )
        for dimension, count in RAGGED.items()
        if count in flat.variables
    }


def cells_of(
    flat: Flat,
) -> tuple[tuple[str, ...], dict[str, xr.Variable], NDArray[np.int32]]:
    """Return the dimensions of a sweep, its coordinates with the scalar `direction`, and the run at each point.

    The values of runs are read block by block. Runs without a grid are in a row, without coordinates.
    """
    dims, axes, scalars, run_id = _grid(flat)
    return dims, axes | scalars, run_id


def _grid(
    flat: Flat,
) -> tuple[tuple[str, ...], dict[str, xr.Variable], dict[str, xr.Variable], NDArray[np.int32]]:
    """Return the dimensions of the sweep, coordinates along them, scalar ones, and the run at each point (-1: none)."""
    axes: dict[str, xr.Variable] = {}
    sizes: dict[str, int] = {}
    scalars: dict[str, xr.Variable] = {}
    places: list[_Placed] = []
    directions = flat.variables["direction"]
    present, place = _distinct(directions)
    if directions.size and (present != Direction.independent).any():
        labels = [Direction(int(value)).name for value in present]
        axes["direction"] = direction_axis(labels, _plain(directions))
        sizes["direction"] = len(labels)
        places.append(place)
    elif directions.size:
        scalars["direction"] = new_variable((), np.asarray(Direction.independent.name), _plain(directions))
    for dimension, names_along in _swept_along(flat).items():
        own, place = _axis(dimension, {name: flat.variables[name] for name in names_along})
        axes |= own
        sizes[dimension] = next(iter(own.values())).size
        places.append(place)
    axes |= shared_axes(axes)
    run_id = _run_grid(tuple(sizes.values()), places, flat.sizes["run"])
    if run_id is None:
        return ("run",), {}, {}, np.arange(flat.sizes["run"], dtype=np.int32)
    return tuple(sizes), axes, scalars, run_id


def direction_axis(words: Sequence[str], attributes: Mapping[str, Any] | None = None) -> xr.Variable:
    """Return the coordinate along the directions of a sweep."""
    return new_axis("direction", np.array(words), attributes or {"long_name": RULES["direction"].long_name})


def axis_of(
    dimension: str, columns: Mapping[str, xr.Variable]
) -> tuple[dict[str, xr.Variable], NDArray[np.intp]]:
    """Return the coordinates of parameters along their dimension, and the place of each run along it.

    Parameters
    ----------
    dimension : str
    columns : mapping of str to xarray.Variable, shape (run,)
        Values of each parameter that moves along the dimension.
    """
    axes, place = _axis(dimension, columns)
    return axes, place(slice(None))


def _axis(dimension: str, columns: Mapping[str, xr.Variable]) -> tuple[dict[str, xr.Variable], _Placed]:
    """Return the coordinates of parameters along their dimension, and the place of runs along it."""
    values, place = _distinct_points(list(columns.values()))
    axes: dict[str, xr.Variable] = {}
    for (name, variable), column in zip(columns.items(), values.T, strict=True):
        new = new_axis if name == dimension else new_variable
        axes[name] = new(dimension, column, variable.attrs)
    return axes, place


def shared_axes(columns: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """Return the coordinate of each dimension that parameters share: values of one parameter, or numbers from 0."""
    along: dict[str, dict[str, NDArray[np.float64]]] = {}
    for name, column in columns.items():
        if column.attrs.get(SWEPT_ALONG) in column.dims:
            along.setdefault(column.attrs[SWEPT_ALONG], {})[name] = column.values
    axes: dict[str, xr.Variable] = {}
    for dimension, members in along.items():
        chosen = standing_for(dimension, members)
        if chosen is None:
            numbers = np.arange(len(next(iter(members.values()))))
            attributes = {"long_name": f"place along {dimension}", "units": "1"}
            axes[dimension] = new_axis(dimension, numbers, attributes)
        else:
            attributes = {key: value for key, value in columns[chosen].attrs.items() if key != SWEPT_ALONG}
            axes[dimension] = new_axis(dimension, members[chosen], attributes)
    return axes


def _swept_along(flat: Flat) -> dict[str, list[str]]:
    """Return the swept parameters along each dimension; parameters that move together share one."""
    found: dict[str, list[str]] = {}
    for name in _in_order_of_the_scene(flat):
        found.setdefault(flat.variables[name].attrs.get(SWEPT_ALONG, name), []).append(name)
    return found


def _distinct_points(columns: list[xr.Variable]) -> tuple[NDArray[np.float64], _Placed]:
    """Return the distinct points of runs along a dimension, shape (point, parameter), and the points of runs.

    One parameter ascends; several parameters that move together keep the order of the runs.
    """
    if len(columns) == 1 and SWEPT_ALONG not in columns[0].attrs:
        values, placed = _distinct(columns[0])
        return values[:, None], placed
    rows = np.stack([column.values for column in columns], axis=1)
    values, first, place = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    ranks = rank[place.reshape(-1)]
    return values[order], lambda part: ranks[part]


def _distinct(column: xr.Variable) -> tuple[NDArray[Any], _Placed]:
    """Return the values that occur, ascending, and the places of runs among them; values are read block by block.

    It uses tables of hashes: sorting 10^6 values, as `np.unique` does, takes ten times as long.
    """
    present = np.empty(0, dtype=column.dtype)
    for part in _blocks(column.size):
        present = pd.unique(np.concatenate([present, pd.unique(column[part].values)]))
    present = np.sort(present)

    def placed(part: slice) -> NDArray[np.intp]:
        place, own = pd.factorize(column[part].values, use_na_sentinel=False)
        found: NDArray[np.intp] = np.searchsorted(present, own)[place]
        return found

    return present, placed


def _blocks(runs: int) -> Iterator[slice]:
    """Yield neighbouring runs whose values are in memory together."""
    for first in range(0, runs, BLOCK_RUNS):
        yield slice(first, min(first + BLOCK_RUNS, runs))


def _in_order_of_the_scene(flat: Flat) -> list[str]:
    """Return the swept parameters in the order of the scene: a file lists variables by the alphabet."""
    linked = str(flat.variables["outcome"].encoding.get("coordinates", "")).split()
    return sorted(swept_names(flat), key=lambda name: linked.index(name) if name in linked else len(linked))


def _run_grid(shape: tuple[int, ...], places: list[_Placed], runs: int) -> NDArray[np.int32] | None:
    """Return the run at each grid point, or None when the runs form no grid."""
    size = int(np.prod(shape, dtype=np.int64))
    if runs == 0 or size > _LARGEST_GRID_PER_RUN * runs:
        return None
    run_id = np.full(size, -1, dtype=np.int32)
    for part in _blocks(runs):
        own = np.arange(part.start, part.stop, dtype=np.int32)
        along = tuple(place(part) for place in places)
        where = np.ravel_multi_index(along, shape) if shape else np.zeros(own.size, dtype=np.intp)
        is_taken = (run_id[where] >= 0).any()
        run_id[where] = own
        if is_taken or (run_id[where] != own).any():
            return None
    return run_id.reshape(shape)


def direction_words(codes: NDArray[Any]) -> NDArray[np.str_]:
    """Return the direction of each run as a word, from its code."""
    words: NDArray[np.str_] = np.array([member.name for member in Direction])[codes]
    return words


def direction_codes(words: NDArray[Any]) -> NDArray[Any]:
    """Return the direction of each run as a code, from its word; -1 for another word."""
    codes = {member.name: int(member) for member in Direction}
    return np.array([codes.get(word, -1) for word in words.tolist()], dtype=RULES["direction"].dtype)


def are_grid(flat: Flat) -> bool:
    """Return whether runs form a grid, on which `on_grid` lays them."""
    return _grid(_with_labels(flat))[0] != ("run",)


def _plain(variable: xr.Variable) -> dict[str, Any]:
    """Return the attributes of a flag variable that is opened as words."""
    return {"long_name": variable.attrs.get("long_name", RULES["direction"].long_name)}
