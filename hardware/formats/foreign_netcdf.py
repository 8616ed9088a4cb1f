"""NetCDF files of other programs: variables on one dimension, with their coordinate of time if there is one.

scipy reads files of the classic format, in Python alone, since the C library can crash on damaged ones. For the same
reason, a process of its own has read files of version 4 (HDF5) whole before.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.cells import column_of
from vibroimpact.hardware.formats.labels import is_time_name, seconds_in
from vibroimpact.hardware.formats.probe import one_refusal
from vibroimpact.hardware.formats.table import MOST_COLUMNS, MOST_SAMPLES, Column, Floats, RawFile, Table

_SINCE = re.compile(r"(?P<unit>\w+)\s+since\s+(?P<date>.+)")


def read_foreign_netcdf(path: os.PathLike[str] | str) -> RawFile:
    """Return the numeric variables of one dimension, in a table for each dimension.

    DatasetError: the file is damaged, or has no such variables.
    """
    with one_refusal("a whole NetCDF file"):
        with open(path, "rb") as file:
            classic = file.read(3) == b"CDF"
        variables = list(_classic(path) if classic else _hdf5(path))
    return _sorted_out(variables)


#: Name and dimension of a variable, its column if it is numeric and of one dimension, and the remark on it.
_Variable = tuple[str, str, Column | None, str]


def _classic(path: os.PathLike[str] | str) -> Iterator[_Variable]:
    from scipy.io import netcdf_file

    with open(path, "rb") as stream:
        file = netcdf_file(stream, "r", mmap=False, maskandscale=True)
        _check_sizes([int(np.prod(variable.shape)) for variable in file.variables.values()])
        for name, variable in file.variables.items():
            numeric = variable.data.dtype.kind in "fiu" and len(variable.dimensions) == 1
            values = np.ma.filled(np.ma.asarray(variable[:], dtype=np.float64), np.nan) if numeric else None
            yield _variable(name, variable, values)


def _hdf5(path: os.PathLike[str] | str) -> Iterator[_Variable]:
    import netCDF4

    with netCDF4.Dataset(os.fspath(path), "r") as file:
        _check_sizes([int(variable.size) for variable in file.variables.values()])
        for name in file.groups:
            yield name, "", None, "a group is left out; variables outside groups are read"
        for name, variable in file.variables.items():
            numeric = getattr(variable.dtype, "kind", "O") in "fiu" and len(variable.dimensions) == 1
            # the library warns of a meaningless scale or fill value, and continues without it
            with warnings.catch_warnings(record=True) as warned:
                warnings.simplefilter("always")
                values = np.ma.asarray(variable[...], dtype=np.float64).filled(np.nan) if numeric else None
            yield _variable(name, variable, values, "; ".join({str(warning.message) for warning in warned}))


def _check_sizes(sizes: list[int]) -> None:
    if sum(sizes) > MOST_SAMPLES or len(sizes) > MOST_COLUMNS:
        raise DatasetError(f"expected at most {MOST_SAMPLES} numbers in {MOST_COLUMNS} variables, got more.")


def _variable(name: str, variable: Any, values: Floats | None, remark: str = "") -> _Variable:
    if values is None:
        return name, "", None, remark or "is left out; numeric variables of one dimension are read"
    label = _text(variable, "long_name") or name
    attrs = {} if label == name else {"source_label": label}
    column = column_of(name, values, _text(variable, "units"), attrs=attrs)
    return name, variable.dimensions[0], column, remark


def _text(variable: Any, key: str) -> str:
    found = getattr(variable, key, "")
    return found.decode("utf-8", "replace") if isinstance(found, bytes) else str(found)


def _sorted_out(variables: Iterable[_Variable]) -> RawFile:
    """Return the variables of each dimension in one table, with its coordinate of time."""
    remarks: list[str] = []
    by_dimension: dict[str, list[Column]] = {}
    for name, dimension, column, remark in variables:
        if remark:
            remarks.append(f"{name}: {remark[:200]}")
        if column is not None and len(column.values):
            by_dimension.setdefault(dimension, []).append(column)
    tables: list[Table] = []
    attrs: dict[str, Any] = {}
    for dimension, found in by_dimension.items():
        time = next((column for column in found if _is_time(column, dimension)), None)
        columns = [column for column in found if column is not time]
        clock = None if time is None else _counted(time, attrs)
        if columns:
            tables.append(Table(columns, clock, dimension if len(by_dimension) > 1 else ""))
        elif clock is not None:
            tables.append(Table([clock]))
    return RawFile("NetCDF", tables, remarks, attrs)


def _is_time(column: Column, dimension: str) -> bool:
    in_time = seconds_in(column.unit) is not None or _SINCE.fullmatch(column.unit) is not None
    named = is_time_name(column.label)
    return (column.label == dimension and (in_time or named)) or (named and in_time)


def _counted(time: Column, attrs: dict[str, Any]) -> Column:
    """Return instants that count from a date as counted from the first of them; note the date."""
    since = _SINCE.fullmatch(time.unit)
    if since is None:
        return time
    attrs["source_date"] = since["date"]
    # seconds since 1970 would leave too few digits for the interval
    return Column(time.label, time.values - time.values[0], since["unit"])
