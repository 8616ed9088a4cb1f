"""Open dataset files: one-dimensional as they are stored, or on the real dimensions of the sweep."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import StoreBackendEntrypoint

from vibroimpact.analysis.dataset.assembling import assembled
from vibroimpact.analysis.dataset.checking import count_problems, refuse_foreign, structure_problems
from vibroimpact.analysis.dataset.grid import on_grid, shared_axes
from vibroimpact.analysis.dataset.places import dataset_place
from vibroimpact.analysis.dataset.registering import accessor  # noqa: F401  # for `ds.vibroimpact`
from vibroimpact.analysis.dataset.schema import (
    RAGGED,
    SCHEMA_VERSION,
    swept_names,
)
from vibroimpact.analysis.dataset.stores.storing import as_read
from vibroimpact.analysis.files.lazy_store import LazyStore
from vibroimpact.analysis.files.open_files import OpenFile, give_back, netcdf_lock
from vibroimpact.analysis.files.opening import one_error, opened_netcdf, taken
from vibroimpact.analysis.files.probing import check_sound, refuse_changed
from vibroimpact.analysis.files.stores import Place, is_store
from vibroimpact.fmus.errors import DatasetError

SILENT = "without_messages"
"""Attribute of a part in which no run has a message: its texts, which cost more than all numbers, are not read."""


@dataclass(frozen=True, slots=True)
class Part:
    """Facts about a written part that resuming a campaign needs.

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
    """Open a file that vibroimpact wrote; any fault of the file becomes one DatasetError."""
    with opened_netcdf(path) as file:
        refuse_foreign(path, file.ncattrs(), file.variables)
        yield file


def read_part(path: str | os.PathLike[str]) -> Part:
    """Read the facts that resuming needs: the runs of a part, and its attributes.

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
        return _flat(path, file)


def _flat(path: str | os.PathLike[str], file: netCDF4.Dataset) -> xr.Dataset:
    data = {
        name: (variable.dimensions, _values(file, name), _attributes(variable))
        for name, variable in file.variables.items()
    }
    return fitting(path, _as_flat(file, data))


@dataclass(frozen=True, slots=True)
class Head:
    """The form of a file, and the numbers of its runs.

    Attributes
    ----------
    form : xarray.Dataset
        The file without its runs: the names, the types and the attributes, and the values that all runs share.
    sizes : dict of str to int
        Size of the dimension `run`, and of each ragged dimension.
    first, last : int
        Lowest and highest run index; -1 in a file without runs.
    ascends : bool
        Whether the runs are in the order of their index.
    """

    form: xr.Dataset
    sizes: dict[str, int]
    first: int
    last: int
    ascends: bool


class FileOfRuns:
    """A file of runs that is checked and opened once, and read twice: first its form, then its runs.

    DatasetError: see `read_flat`.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        self._file: OpenFile | None = None
        with one_error(path):
            self._file = taken(path)
        try:
            with self._used() as file:
                refuse_foreign(path, file.ncattrs(), file.variables)
        except DatasetError:
            self.close()
            raise

    @contextmanager
    def _used(self) -> Iterator[netCDF4.Dataset]:
        assert self._file is not None
        with one_error(self.path), netcdf_lock():
            self._file.root.set_auto_maskandscale(False)
            yield self._file.root

    def close(self) -> None:
        """Close the file; nothing happens if it is closed."""
        file, self._file = self._file, None
        if file is not None:
            with netcdf_lock():
                give_back(file)

    def rows(self) -> xr.Dataset:
        """Return all runs in memory, and close the file."""
        with self._used() as file:
            rows = _flat(self.path, file)
        self.close()
        return rows

    def head(self, like: xr.Dataset | None = None) -> Head:
        """Return the form of the file; `like` is a form that it may have."""
        with self._used() as file:
            index = file.variables["run_index"][:]
            return Head(
                like if like is not None and _has_form(file, like) else _form(file),
                {name: file.dimensions[name].size for name in _ALONG if name in file.dimensions},
                int(index.min(initial=index[0])) if index.size else -1,
                int(index.max(initial=-1)),
                not (np.diff(index) <= 0).any(),
            )


_ALONG = ("run", *RAGGED)


def _form(file: netCDF4.Dataset) -> xr.Dataset:
    """Return a file without its runs and rows."""
    data: dict[str, Any] = {}
    for name, variable in file.variables.items():
        kind = object if variable.dtype is str else variable.dtype
        is_shared = variable.dimensions[:1] not in {(dimension,) for dimension in _ALONG}
        values = variable[...] if is_shared else np.empty((0, *variable.shape[1:]), dtype=kind)
        data[name] = (variable.dimensions, values, _attributes(variable))
    return _as_flat(file, data)


def _has_form(file: netCDF4.Dataset, form: xr.Dataset) -> bool:
    """Return whether a file has the variables of a form, with equal dimensions besides runs and rows."""
    own = {name: (one.dimensions, one.shape[1:]) for name, one in file.variables.items()}
    return own == {name: (one.dims, one.shape[1:]) for name, one in form.variables.items()}


def _as_flat(file: netCDF4.Dataset, data: dict[str, Any]) -> xr.Dataset:
    """Return the variables of a file as a dataset, with the attributes of the file."""
    # the library lists variables by the alphabet; this attribute keeps the order of the scene
    links = " ".join(getattr(variable, "coordinates", "") for variable in file.variables.values())
    coords = {name: data.pop(name) for name in dict.fromkeys(links.split())}
    return assembled(data, coords, {name: file.getncattr(name) for name in file.ncattrs() if name != SILENT})


def _values(file: netCDF4.Dataset, name: str) -> NDArray[Any]:
    """Return the values of a stored variable."""
    if name == "message" and SILENT in file.ncattrs():
        return np.full(file.dimensions["run"].size, "", dtype=object)
    values: NDArray[Any] = file.variables[name][...]
    return values


def _attributes(variable: netCDF4.Variable[Any]) -> dict[str, Any]:
    """Return the attributes of a stored variable, without attributes that only the file needs."""
    return {
        name: variable.getncattr(name)
        for name in variable.ncattrs()
        if name not in ("_FillValue", "coordinates")
    }


def open_dataset(path: Place) -> xr.Dataset:
    """Open a dataset on the real dimensions of its sweep.

    Per-run variables get the dimensions `direction` (where the sweep has directions) and one for each swept parameter.
    Parameters that move together share one dimension. Its coordinate has the values of the first of them whose values
    all differ, else numbers from 0. Points that no run covers are NaN, or -1 in integers. With independent runs
    only, `direction` is a scalar coordinate; one run without swept parameters has scalars only. Runs that are no grid
    (scattered or repeated points) keep the dimension `run`.

    Impacts, sticks, samples and events stay on their own dimension; `impact_run` and so on give the `run_id` of each
    row, under any selection. `energy_residual` is along `connection`, the names of the connections; scores of replays
    are along `compared`. `displacement_range` is the largest displacement minus the smallest over the recorded
    periods (m). A variable is read from the file when it is first used. `to_netcdf` may save such a dataset or a
    selection of it; the saved file opens as it was saved.

    Parameters
    ----------
    path : path or address
        A dataset file or store, the folder of a campaign (then the dataset in it), or the address of either for
        fsspec, such as `s3://bucket/map.zarr`. Large variables of a store are in chunks of Dask.

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
    file = dataset_place(path)
    if is_store(file):
        # imported only for a store
        from vibroimpact.analysis.dataset.stores.reading import StoreContents

        return _checked_schema(file, StoreContents(file).dataset())
    flat = open_flat(file)
    try:
        with one_error(file):
            opened = (
                _saved_again(flat)
                if "run_id" in flat.variables
                else on_grid(fitting(file, flat), lazily=True)
            )
    except DatasetError:
        flat.close()
        raise
    if opened is not flat:
        opened.set_close(flat.close)
    opened.encoding["source"] = str(file)
    return opened


def open_measured(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open results of an analysis or a benchmark: any NetCDF file, as it is.

    Estimates of version 0.1 have the dimension `method`, a keyword of `sel`; it is renamed to `estimator`.

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


def open_flat(file: Place) -> xr.Dataset:
    """Open a file lazily in its one-dimensional form."""
    with one_error(file):
        flat = _open_checked(file)
    try:
        refuse_foreign(file, flat.attrs, flat.variables)
        return _checked_schema(file, flat)
    except DatasetError:
        flat.close()
        raise


def _checked_schema(place: Place, dataset: xr.Dataset) -> xr.Dataset:
    schema = str(dataset.attrs["dataset_schema"])[:60]
    if schema != SCHEMA_VERSION:
        raise DatasetError(
            f"{os.fspath(place)}: expected dataset schema {SCHEMA_VERSION}, got {schema}. "
            "Open it with the version of vibroimpact that wrote it."
        )
    return dataset


def _open_checked(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a sound file lazily: seconds stay numbers instead of dates, and numbers stay as they are stored."""
    state = check_sound(path)
    store = LazyStore(os.path.abspath(path))
    try:
        refuse_changed(path, state)
        stored, _ = store.load()
        # xarray would read all texts at once: texts that are no labels can wait.
        texts = {name: stored[name] for name in _texts(stored)}
        # Flags are not floats, and missing values are NaN already.
        # Without an engine xarray loads all installed engines, and asks each of them.
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
    """Return the names of text variables that are no labels."""
    linked = {name for v in stored.values() for name in str(v.attrs.get("coordinates", "")).split()}
    return [
        name
        for name, variable in stored.items()
        if variable.dtype.kind == "O" and name not in linked and name not in variable.dims
    ]


def _saved_again(opened: xr.Dataset) -> xr.Dataset:
    """Return an opened dataset as it was before `to_netcdf` marked missing values."""
    for variable in opened.variables.values():
        variable.attrs.pop("_FillValue", None)
    # version 0.2 saved no coordinate along a shared dimension
    axes = shared_axes({name: opened.variables[name] for name in swept_names(opened)})
    return opened.assign_coords({name: axis for name, axis in axes.items() if name not in opened.variables})


def opened_in_memory(flat: xr.Dataset) -> xr.Dataset:
    """Return a dataset as `open_dataset` would open its file; no file is written.

    Parameters
    ----------
    flat : xarray.Dataset
        One-dimensional and checked: `checking.marked`.
    """
    return on_grid(as_read(flat), lazily=False)


def fitting(file: str | os.PathLike[str], flat: xr.Dataset) -> xr.Dataset:
    """Return a one-dimensional dataset whose types, dimensions and counts fit the schema; else raise DatasetError."""
    problems = structure_problems(flat) or count_problems(flat)
    if problems:
        more = f" And {len(problems) - 1} more problems." if len(problems) > 1 else ""
        raise DatasetError(f"{os.fspath(file)}: {problems[0]}{more} The file is damaged; write it again.")
    return flat
