"""Open dataset files: one-dimensional as they are stored, or on the real dimensions of the sweep."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import BackendArray, StoreBackendEntrypoint
from xarray.core import indexing

from vibroimpact.analysis.dataset.accessor import VibroimpactAccessor  # noqa: F401  # for `ds.vibroimpact`
from vibroimpact.analysis.dataset.assembling import assembled, new_axis, new_variable
from vibroimpact.analysis.dataset.checking import count_problems, structure_problems
from vibroimpact.analysis.dataset.schema import (
    RAGGED,
    RULES,
    SCHEMA_VERSION,
    SWEPT_ALONG,
    Direction,
    constant_names,
    standing_for,
    swept_names,
)
from vibroimpact.analysis.files.lazy_store import LazyStore
from vibroimpact.analysis.files.opening import one_error, opened_netcdf
from vibroimpact.analysis.files.probing import check_sound, refuse_changed
from vibroimpact.fmus.errors import DatasetError

# A sweep that is no grid (scattered points) would waste memory on a grid; then `run` stays the dimension.
_LARGEST_GRID_PER_RUN = 10


@dataclass(frozen=True, slots=True)
class Part:
    """What resuming a campaign needs of a written part.

    Attributes
    ----------
    run_index : ndarray of int, shape (run,)
    attrs : dict
        Global attributes.
    """

    run_index: NDArray[np.int32]
    attrs: dict[str, Any]


@contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[netCDF4.Dataset]:
    """Open a file that vibroimpact wrote; whatever is wrong with it is one DatasetError."""
    with opened_netcdf(path) as file:
        _refuse_foreign(path, file.ncattrs(), file.variables)
        yield file


def _refuse_foreign(
    path: str | os.PathLike[str], attributes: Collection[object], variables: Collection[object]
) -> None:
    if "dataset_schema" not in attributes or not all(name in variables for name in ("run_index", "outcome")):
        raise DatasetError(
            f"{os.fspath(path)}: expected a dataset written by vibroimpact, got other NetCDF contents. "
            "Use the dataset.nc of a campaign or the file of a run."
        )


def read_part(path: str | os.PathLike[str]) -> Part:
    """Read what resuming needs of a part: which runs it holds, and its attributes.

    Raises
    ------
    DatasetError
        If the file is missing, damaged, foreign or holds no run.
    """
    with _opened(path) as file:
        if file.dimensions["run"].size == 0:
            raise DatasetError(
                f"{os.fspath(path)}: expected a part with at least one run, got none. Delete the file."
            )
        return Part(
            run_index=file.variables["run_index"][:],
            attrs={name: file.getncattr(name) for name in file.ncattrs()},
        )


def read_flat(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a whole file into memory, one-dimensional as it is stored.

    Raises
    ------
    DatasetError
        If the file is missing, damaged or foreign.
    """
    with _opened(path) as file:
        data = {
            name: (variable.dimensions, variable[...], _attributes(variable))
            for name, variable in file.variables.items()
        }
        # the library lists variables by the alphabet, this attribute as the scene does
        links = " ".join(getattr(variable, "coordinates", "") for variable in file.variables.values())
        linked = dict.fromkeys(links.split())
        attrs = {name: file.getncattr(name) for name in file.ncattrs()}
        coords = {name: data.pop(name) for name in linked}
        return _fitting(path, assembled(data, coords, attrs))


def _attributes(variable: netCDF4.Variable[Any]) -> dict[str, Any]:
    """Return the attributes of a stored variable without those that only the file needs."""
    return {
        name: variable.getncattr(name)
        for name in variable.ncattrs()
        if name not in ("_FillValue", "coordinates")
    }


def dataset_file(path: str | os.PathLike[str]) -> Path:
    """Return the file that a name stands for: of the folder of a campaign its dataset."""
    # os.path: False for names that no file can have, where Path.is_dir raises
    return Path(path) / "dataset.nc" if os.path.isdir(path) else Path(path)


def open_dataset(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a dataset on the real dimensions of its sweep.

    Per-run variables get the dimensions `direction` (where the sweep has directions) and one for each swept
    parameter. Parameters that move together share one; its coordinate has the values of the first of them whose
    values all differ, else numbers from 0. Points that no run covers are NaN, or -1 in integers. With independent runs
    only, `direction` is a scalar coordinate; one run without swept parameters has scalars only. Runs that are no grid
    (scattered or repeated points) keep the dimension `run`. Impacts, sticks, samples and events stay on their
    own dimension; `impact_run` and so on give the `run_id` each row belongs to, under any selection.
    `energy_residual` is along `connection`, the names of the connections; scores of replays are along `compared`.
    `displacement_range` is the largest displacement minus the smallest over the recorded periods (m).
    A variable is read from the file when it is first used. What `to_netcdf` has saved of such a dataset, all of it or a
    selection, opens as it was saved.

    Parameters
    ----------
    path : path
        A dataset file, or a campaign's folder (then its `dataset.nc`).

    Raises
    ------
    DatasetError
        If the file is missing, damaged or foreign.

    Examples
    --------
    >>> ds = open_dataset("campaign")  # doctest: +SKIP
    >>> up = ds.displacement_range.sel(direction="up")  # doctest: +SKIP
    >>> up.sel(angular_frequency=0.9, method="nearest")  # doctest: +SKIP
    >>> ds.vibroimpact.impacts(direction="up", angular_frequency=0.9)  # doctest: +SKIP
    """
    file = dataset_file(path)
    flat = _open_flat(file)
    try:
        with one_error(file):
            opened = _saved_again(flat) if "run_id" in flat.variables else _on_grid(_fitting(file, flat))
    except DatasetError:
        flat.close()
        raise
    if opened is not flat:
        opened.set_close(flat.close)
    opened.encoding["source"] = str(file)
    return opened


def open_measured(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open what an analysis found or a benchmark measured: any NetCDF file, as it is.

    Estimates of version 0.1 come with their dimension `method`, which `sel` has a keyword of, as `estimator`.

    Raises
    ------
    DatasetError
        If the file is missing or damaged.
    """
    with one_error(path):
        opened = _open_checked(path)
    if not {"method", "quantity"} <= set(opened.dims):
        return opened
    renamed = opened.rename(method="estimator")
    renamed.set_close(opened.close)
    return renamed


def _open_flat(file: Path) -> xr.Dataset:
    """Open a file lazily in its one-dimensional form."""
    with one_error(file):
        flat = _open_checked(file)
    try:
        _refuse_foreign(file, flat.attrs, flat.variables)
        schema = str(flat.attrs["dataset_schema"])[:60]
        if schema != SCHEMA_VERSION:
            raise DatasetError(
                f"{file}: expected dataset schema {SCHEMA_VERSION}, got {schema}. "
                "Open it with the version of vibroimpact that wrote it."
            )
    except DatasetError:
        flat.close()
        raise
    return flat


def _open_checked(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a file lazily, once it is known to be sound: seconds are not dates, and numbers are as they are stored."""
    state = check_sound(path)
    store = LazyStore(os.path.abspath(path))
    try:
        refuse_changed(path, state)
        stored, _ = store.load()
        # xarray would read all texts at once: those that are no labels can wait.
        texts = {name: stored[name] for name in _texts(stored)}
        # Flags are not floats, and what is missing is NaN already.
        # Without an engine xarray loads all that are installed, and asks each of them.
        dataset = xr.open_dataset(
            store,
            engine=StoreBackendEntrypoint,
            decode_times=False,
            mask_and_scale=False,
            drop_variables=texts,
        )
    except BaseException:
        store.close()
        raise
    opened = dataset.assign(texts)
    opened.set_close(store.close)
    return opened


def _texts(stored: Mapping[str, xr.Variable]) -> list[str]:
    """Return the variables of texts that are no labels."""
    linked = {name for v in stored.values() for name in str(v.attrs.get("coordinates", "")).split()}
    return [
        name
        for name, variable in stored.items()
        if variable.dtype.kind == "O" and name not in linked and name not in variable.dims
    ]


def _saved_again(opened: xr.Dataset) -> xr.Dataset:
    """Return an opened dataset as it was before `to_netcdf` marked what is missing."""
    for variable in opened.variables.values():
        variable.attrs.pop("_FillValue", None)
    # version 0.2 saved no coordinate along a shared dimension
    axes = _shared_axes({name: opened.variables[name] for name in swept_names(opened)})
    return opened.assign_coords({name: axis for name, axis in axes.items() if name not in opened.variables})


def _fitting(file: str | os.PathLike[str], flat: xr.Dataset) -> xr.Dataset:
    """Return a dataset whose types, dimensions and counts are those of the schema; all else relies on them."""
    problems = structure_problems(flat) or count_problems(flat)
    if problems:
        more = f" And {len(problems) - 1} more problems." if len(problems) > 1 else ""
        raise DatasetError(f"{os.fspath(file)}: {problems[0]}{more} The file is damaged; write it again.")
    return flat


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

    @cached_property
    def _values(self) -> NDArray[Any]:
        # one run alone is a bare value: text would stay so
        values = np.array(self._read()[self._run_id], dtype=self.dtype)
        missing = self._run_id < 0
        if missing.any():
            values[missing] = {"f": np.nan, "i": -1}.get(values.dtype.kind, "")
        return values


def _on_grid(flat: xr.Dataset) -> xr.Dataset:
    """Return the dataset on the dimensions of its sweep, with the ragged arrays beside it."""
    if "connection" in flat.variables:
        # In memory names may be a dimension, and then they select.
        flat = flat.swap_dims(interface="connection")
    if "compared" in flat.variables:
        flat = flat.swap_dims(comparison="compared")
    dims, axes, scalars, run_id = _grid(flat)
    swept, constants = swept_names(flat), constant_names(flat)
    variables: dict[str, xr.Variable] = {}
    # The order of the schema reads better than the alphabet; sampled variables come last.
    order = [name for name in RULES if name in flat.variables]
    for name in [*order, *(name for name in flat.variables if name not in RULES)]:
        variable = flat.variables[name]
        if name in (*swept, *constants, "direction"):
            continue
        variables[str(name)] = _placed(variable, dims, run_id) if variable.dims[:1] == ("run",) else variable
    variables["run_id"] = new_variable(
        dims, run_id, {"long_name": "position of the run in the file", "units": "1"}
    )
    variables |= _row_owners(flat)
    if "displacement_max" in flat.variables:
        variables["displacement_range"] = _displacement_range(flat, dims, run_id)
    coordinates = {"run_index": variables.pop("run_index")}
    coordinates |= {name: variables.pop(name) for name in ("connection", "compared") if name in variables}
    coordinates |= {name: flat.variables[name] for name in constants}
    if dims == ("run",):
        coordinates |= {name: flat.variables[name] for name in swept}
        coordinates["direction"] = new_variable(
            "run", _direction_names(flat), _plain(flat.variables["direction"])
        )
        axes = {}
    return xr.Dataset(variables, coords=coordinates | axes | scalars, attrs=flat.attrs)


def _placed(variable: xr.Variable, dims: tuple[str, ...], run_id: NDArray[np.int32]) -> xr.Variable:
    """Return a per-run variable on the grid; it is read when it is first used."""
    attributes = {
        key: value for key, value in variable.attrs.items() if key not in ("_FillValue", "coordinates")
    }
    array = _RunArray(lambda: np.asarray(variable.values), run_id, variable)
    return xr.Variable((*dims, *variable.dims[1:]), indexing.LazilyIndexedArray(array), attributes)


def _displacement_range(flat: xr.Dataset, dims: tuple[str, ...], run_id: NDArray[np.int32]) -> xr.Variable:
    """Return the largest minus the smallest displacement over the recorded periods, NaN periods aside."""

    def read() -> NDArray[np.float64]:
        largest = np.fmax.reduce(flat.variables["displacement_max"].values, axis=1, initial=-np.inf)
        smallest = np.fmin.reduce(flat.variables["displacement_min"].values, axis=1, initial=np.inf)
        return np.where(largest >= smallest, largest - smallest, np.nan)

    attributes = {
        "long_name": "displacement range over the recorded periods",
        "units": flat.variables["displacement_max"].attrs["units"],
    }
    array = _RunArray(read, run_id, flat.variables["final_displacement"])
    return xr.Variable(dims, indexing.LazilyIndexedArray(array), attributes)


def _row_owners(flat: xr.Dataset) -> dict[str, xr.Variable]:
    """Return, for each row of each ragged array, the run_id of the run it belongs to."""
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


def _grid(
    flat: xr.Dataset,
) -> tuple[tuple[str, ...], dict[str, xr.Variable], dict[str, xr.Variable], NDArray[np.int32]]:
    """Return the dimensions of the sweep, coordinates along them, scalar ones, and the run at each point (-1: none)."""
    axes: dict[str, xr.Variable] = {}
    sizes: dict[str, int] = {}
    scalars: dict[str, xr.Variable] = {}
    places: list[NDArray[np.intp]] = []
    directions = flat.variables["direction"].values
    names = _direction_names(flat)
    if directions.size and (directions != Direction.independent).any():
        present, place = _distinct(directions)
        labels = np.array([Direction(int(value)).name for value in present])
        axes["direction"] = new_axis("direction", labels, _plain(flat.variables["direction"]))
        sizes["direction"] = labels.size
        places.append(place)
    elif directions.size:
        scalars["direction"] = new_variable((), np.asarray(names[0]), _plain(flat.variables["direction"]))
    for dimension, names_along in _swept_along(flat).items():
        values, place = _distinct_points([flat.variables[name] for name in names_along])
        for name, column in zip(names_along, values.T, strict=True):
            new = new_axis if name == dimension else new_variable
            axes[name] = new(dimension, column, flat.variables[name].attrs)
        sizes[dimension] = len(values)
        places.append(place)
    axes |= _shared_axes(axes)
    run_id = _runs_on(tuple(sizes.values()), places, flat.sizes["run"])
    if run_id is None:
        return ("run",), {}, {}, np.arange(flat.sizes["run"], dtype=np.int32)
    return tuple(sizes), axes, scalars, run_id


def _shared_axes(columns: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """Return the coordinate of each dimension that parameters share: values of one of them, or numbers from 0."""
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


def _swept_along(flat: xr.Dataset) -> dict[str, list[str]]:
    """Return the swept parameters along each dimension: those that move together share one."""
    found: dict[str, list[str]] = {}
    for name in _in_order_of_the_scene(flat):
        found.setdefault(flat.variables[name].attrs.get(SWEPT_ALONG, name), []).append(name)
    return found


def _distinct_points(columns: list[xr.Variable]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the points that runs have along a dimension, shape (point, parameter), and at which each run is.

    One parameter ascends; several that move together are in the order of the runs.
    """
    if len(columns) == 1 and SWEPT_ALONG not in columns[0].attrs:
        values, place = _distinct(columns[0].values)
        return values[:, None], place
    rows = np.stack([column.values for column in columns], axis=1)
    values, first, place = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    return values[order], rank[place.reshape(-1)]


def _distinct(values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.intp]]:
    """Return the values that occur, ascending, and the place of each element among them.

    By a table of hashes: sorting 10^6 values, as `np.unique` does, takes ten times as long.
    """
    place, present = pd.factorize(values, sort=True, use_na_sentinel=False)
    return np.asarray(present), place


def _in_order_of_the_scene(flat: xr.Dataset) -> list[str]:
    """Return the swept parameters as the scene lists them: variables of a file come by the alphabet."""
    linked = str(flat["outcome"].encoding.get("coordinates", "")).split()
    return sorted(swept_names(flat), key=lambda name: linked.index(name) if name in linked else len(linked))


def _runs_on(shape: tuple[int, ...], places: list[NDArray[np.intp]], runs: int) -> NDArray[np.int32] | None:
    """Return the run at each grid point, or None when the runs are no grid."""
    size = int(np.prod(shape, dtype=np.int64))
    if runs == 0 or size > _LARGEST_GRID_PER_RUN * runs:
        return None
    where = np.ravel_multi_index(tuple(places), shape) if shape else np.zeros(runs, dtype=np.intp)
    if np.bincount(where, minlength=1).max() > 1:
        return None
    run_id = np.full(size, -1, dtype=np.int32)
    run_id[where] = np.arange(runs, dtype=np.int32)
    return run_id.reshape(shape)


def _direction_names(flat: xr.Dataset) -> NDArray[np.str_]:
    """Return the direction of each run as a word."""
    names = np.array([member.name for member in Direction])
    words: NDArray[np.str_] = names[flat.variables["direction"].values]
    return words


def _plain(variable: xr.Variable) -> dict[str, Any]:
    """Return the attributes of a flag variable that is opened as words."""
    return {"long_name": variable.attrs.get("long_name", RULES["direction"].long_name)}
