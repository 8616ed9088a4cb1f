"""Merge the parts of a campaign into one dataset."""

from __future__ import annotations

import os
from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.assembling import assembled, wrapped
from vibroimpact.analysis.dataset.reading import read_flat
from vibroimpact.analysis.dataset.schema import (
    COUPLED_COLUMNS,
    IMPACT_COLUMNS,
    NEEDED_IMPACT_COLUMNS,
    RAGGED,
    flat_order,
)
from vibroimpact.fmus.errors import DatasetError

# Labels that are not along run, the same in all parts.
_LABELS = frozenset({"connection", "compared"})
_SHARED_SIZES = ("state", "interface", "comparison")
# Variables that parts may lack: a part of failed runs has no loops, a part of an older version no durations.
_MAY_LACK = (*COUPLED_COLUMNS, *(name for name in IMPACT_COLUMNS if name not in NEEDED_IMPACT_COLUMNS))
# Attributes with the meaning of the values: parts that differ in them cannot be joined.
_MEANING = ("units", "component_variable", "flag_meanings")


def merge_datasets(paths: Sequence[str | os.PathLike[str]]) -> xr.Dataset:
    """Merge dataset files of one campaign into one dataset, ordered by `run_index`.

    Parameters
    ----------
    paths : sequence of path
        One-dimensional files with the same variables, in any order.

    Returns
    -------
    xarray.Dataset
        In memory; the global attributes are those of the file with the lowest run index.

    Raises
    ------
    DatasetError
        If a file cannot be read, the files differ in their variables, or a run is in two files.
    """
    if not paths:
        raise DatasetError("merge: expected at least one file, got none.")
    parts = [read_flat(path) for path in paths]
    first_index = [part.run_index.values[0] if part.sizes["run"] else -1 for part in parts]
    order = np.argsort(first_index, kind="stable")
    return joined([parts[k] for k in order], [os.fspath(paths[k]) for k in order])


def joined(parts: list[xr.Dataset], names: Sequence[str]) -> xr.Dataset:
    """Join one-dimensional datasets along run and along every ragged dimension, then put the runs in order.

    The list is emptied. A variable of the parts is let go as soon as it is joined, so that memory holds few of them
    twice.

    Parameters
    ----------
    parts : list of xarray.Dataset
        Attributes are those of the first.
    names : sequence of str
        Names of their files, for messages.

    Raises
    ------
    DatasetError
        If they differ in their variables, or a run is in two of them.
    """
    first, variables = _alike(parts, names)
    parts.clear()
    columns = {
        str(name): _stacked([each.pop(name).values for each in variables], variable.dims)
        for name, variable in first.variables.items()
        if not _is_shared(name, variable)
    }
    index = columns["run_index"]
    if (np.diff(index) <= 0).any():
        order = np.argsort(index)
        if (np.diff(index[order]) == 0).any():
            raise DatasetError(
                f"merge: expected each run in one file, got a run_index twice in {len(names)} files."
            )
        columns = _ordered(columns, first, order)
    return _with_columns(first, columns)


def take_runs(dataset: xr.Dataset, rows: NDArray[np.intp]) -> xr.Dataset:
    """Return some runs of a one-dimensional dataset with their ragged rows, in this order.

    Parameters
    ----------
    dataset : xarray.Dataset
        One-dimensional, as `reading.read_flat` returns it.
    rows : ndarray of int, shape (run,)
        Places of the runs.
    """
    columns = {str(name): v.values for name, v in dataset.variables.items() if not _is_shared(name, v)}
    return _with_columns(dataset, _ordered(columns, dataset, rows))


def _is_shared(name: Hashable, variable: xr.Variable) -> bool:
    """Whether a variable is the same for all runs: a label, or a number of the scene."""
    return name in _LABELS or not variable.dims


def _with_columns(first: xr.Dataset, columns: dict[str, NDArray[Any]]) -> xr.Dataset:
    """Return a dataset like `first`, with other values along run."""
    columns |= {str(name): v.values for name, v in first.variables.items() if _is_shared(name, v)}
    data = {
        str(name): (variable.dims, columns[str(name)], variable.attrs)
        for name, variable in first.variables.items()
    }
    coords = {str(name): data.pop(str(name)) for name in first.coords}
    return assembled(data, coords, first.attrs)


def _alike(
    parts: Sequence[xr.Dataset], names: Sequence[str]
) -> tuple[xr.Dataset, list[dict[Hashable, xr.Variable]]]:
    """Return the first part, completed, and the variables of all; DatasetError if they differ."""
    completed = _completed(parts)
    for name, part in zip(names, completed, strict=True):
        refuse_unlike(name, part, names[0], completed[0])
    return completed[0], [dict(part.variables) for part in completed]


def _completed(parts: Sequence[xr.Dataset]) -> list[xr.Dataset]:
    """Return the parts with NaN for variables that only other parts have, where runs may lack them."""
    known = {name: part.variables[name] for part in parts for name in _MAY_LACK if name in part.variables}
    completed = []
    for part in parts:
        missing = {
            name: (variable.dims, np.full(part.sizes[variable.dims[0]], np.nan), variable.attrs)
            for name, variable in known.items()
            if name not in part.variables and variable.dims[0] in part.sizes
        }
        completed.append(part.assign(wrapped(missing)) if missing else part)
    return completed


def refuse_unlike(name: str, part: xr.Dataset, first_name: str, first: xr.Dataset) -> None:
    """Raise DatasetError unless a part can be joined with the first one.

    Parameters
    ----------
    name, first_name : str
        Names of the files of both, for the message.
    part, first : xarray.Dataset
        One-dimensional.

    Raises
    ------
    DatasetError
        When they differ in their variables, or in the meaning of these.
    """
    different = (set(part.variables) ^ set(first.variables)) - set(_MAY_LACK)
    if different:
        raise DatasetError(
            f"{name}: expected the variables of {first_name}, "
            f"got a difference in {', '.join(sorted(map(str, different)))}."
        )
    for dimension in _SHARED_SIZES:
        expected, got = first.sizes.get(dimension), part.sizes.get(dimension)
        if expected != got:
            raise DatasetError(
                f"{name}: {dimension}: expected the size {expected} of {first_name}, got {got}."
            )
    for variable, one in first.variables.items():
        other = part.variables.get(variable)
        if other is not None and one.dims[:1] == ("sample",) and one.shape[1:] != other.shape[1:]:
            raise DatasetError(
                f"{name}: {variable}: expected samples of the shape {one.shape[1:]} of {first_name}, "
                f"got {other.shape[1:]}."
            )
    _refuse_other_meaning(name, part, first_name, first)


def _refuse_other_meaning(name: str, part: xr.Dataset, first_name: str, first: xr.Dataset) -> None:
    """Raise DatasetError if equal names or numbers mean something else than in the first part."""
    for variable, meaning in first.variables.items():
        for key in _MEANING if variable in part.variables else ():
            expected, got = meaning.attrs.get(key), part.variables[variable].attrs.get(key)
            if expected != got and not (key == "flag_meanings" and _is_longer(expected, got)):
                raise DatasetError(
                    f"{name}: {variable}: expected {key} {expected!r} as in {first_name}, got {got!r}."
                )
    for label in [name for name, variable in first.variables.items() if _is_shared(name, variable)]:
        expected, got = (np.atleast_1d(source.variables[label].values) for source in (first, part))
        if not np.array_equal(expected, got):
            raise DatasetError(
                f"{name}: {label}: expected those of {first_name} ({', '.join(map(str, expected))}), "
                f"got {', '.join(map(str, got))}."
            )


def _is_longer(one: object, other: object) -> bool:
    """Return whether one of two lists of flags has those of the other and more: an older version knew fewer."""
    lists = sorted((str(one).split(), str(other).split()), key=len)
    return lists[1][: len(lists[0])] == lists[0]


def _stacked(arrays: Sequence[NDArray[Any]], dims: tuple[Any, ...]) -> NDArray[Any]:
    """Join the arrays of one variable; runs with fewer periods than the longest end in NaN."""
    periods = max(array.shape[1] for array in arrays) if "period" in dims else 0
    if any(array.shape[1] < periods for array in arrays if periods):
        arrays = [np.pad(a, ((0, 0), (0, periods - a.shape[1])), constant_values=np.nan) for a in arrays]
    return np.concatenate(arrays)


def _ordered(
    columns: dict[str, NDArray[Any]], like: xr.Dataset, order: NDArray[np.intp]
) -> dict[str, NDArray[Any]]:
    """Return all columns with the runs, and the ragged rows of each run, in this order."""
    rows = {"run": order}
    for dimension, count_name in RAGGED.items():
        if count_name in columns:
            count = columns[count_name].astype(np.int64)
            rows[dimension] = flat_order((np.cumsum(count) - count)[order], count[order])
    return {name: values[rows[str(like.variables[name].dims[0])]] for name, values in columns.items()}
