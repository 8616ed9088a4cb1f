"""NetCDF files of other programs: variables on one dimension, with their coordinate of time where there is one.

Files of the classic format are read with scipy, in Python alone, since the C library can crash on damaged ones; files
of version 4 (HDF5) are read by another process first, for the same reason.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibroimpact.analysis.files.probing import NETCDF
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.cells import sorted_out
from vibroimpact.hardware.formats.labels import is_time_name, seconds_in
from vibroimpact.hardware.formats.probe import check_reads
from vibroimpact.hardware.formats.table import (
    MOST_COLUMNS,
    MOST_SAMPLES,
    Column,
    Floats,
    RawFile,
    Table,
)

_SINCE = re.compile(r"(?P<unit>\w+)\s+since\s+(?P<date>.+)")


@dataclass(frozen=True, slots=True)
class _Variable:
    """A variable of either format; no values where it is not numeric or not of one dimension."""

    name: str
    dimension: str
    values: Floats | None
    unit: str
    label: str
    remark: str


def check_netcdf4(path: os.PathLike[str] | str) -> None:
    """Refuse a file of version 4 on which the NetCDF library crashes, or never ends.

    Raises
    ------
    DatasetError
        It does, or says that the file is damaged.
    """
    check_reads(path, NETCDF)


def read_foreign_netcdf(path: os.PathLike[str] | str) -> RawFile:
    """Read the numeric variables of one dimension; a table for each dimension.

    Raises
    ------
    DatasetError
        The file is damaged, or has no such variables.
    """
    try:
        with open(path, "rb") as file:
            classic = file.read(3) == b"CDF"
        variables = list(_classic(path) if classic else _hdf5(path))
    except DatasetError:
        raise
    # the libraries report damage as errors of every kind, MemoryError too
    except Exception as problem:
        raise DatasetError(
            f"expected a whole NetCDF file, got one that cannot be read ({type(problem).__name__}: {problem})."
        ) from problem
    return _sorted_out(variables)


def _classic(path: os.PathLike[str] | str) -> Iterable[_Variable]:
    from scipy.io import netcdf_file

    with open(path, "rb") as stream:
        file = netcdf_file(stream, "r", mmap=False, maskandscale=True)
        _check_sizes([int(np.prod(variable.shape)) for variable in file.variables.values()])
        for name, variable in file.variables.items():
            numeric = variable.data.dtype.kind in "fiu" and len(variable.dimensions) == 1
            values = np.ma.filled(np.ma.asarray(variable[:], dtype=np.float64), np.nan) if numeric else None
            yield _variable(name, variable, values)


def _hdf5(path: os.PathLike[str] | str) -> Iterable[_Variable]:
    import netCDF4

    with netCDF4.Dataset(os.fspath(path), "r") as file:
        _check_sizes([int(variable.size) for variable in file.variables.values()])
        for name in file.groups:
            yield _Variable(name, "", None, "", "", "a group is left out; variables outside groups are read")
        for name, variable in file.variables.items():
            numeric = getattr(variable.dtype, "kind", "O") in "fiu" and len(variable.dimensions) == 1
            # the library warns of a scale or a fill value that means nothing, and goes on without it
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                values = np.ma.asarray(variable[...], dtype=np.float64).filled(np.nan) if numeric else None
            yield _variable(name, variable, values, "; ".join({str(warning.message) for warning in said}))


def _check_sizes(sizes: list[int]) -> None:
    if sum(sizes) > MOST_SAMPLES or len(sizes) > MOST_COLUMNS:
        raise DatasetError(f"expected at most {MOST_SAMPLES} numbers in {MOST_COLUMNS} variables, got more.")


def _variable(name: str, variable: Any, values: Floats | None, remark: str = "") -> _Variable:
    dimension = variable.dimensions[0] if len(variable.dimensions) == 1 else ""
    label = _text(variable, "long_name") or name
    return _Variable(name, dimension, values, _text(variable, "units"), label, remark)


def _text(variable: Any, key: str) -> str:
    found = getattr(variable, key, "")
    return found.decode("utf-8", "replace") if isinstance(found, bytes) else str(found)


def _sorted_out(variables: list[_Variable]) -> RawFile:
    """Put the variables of each dimension into one table, with its coordinate of time."""
    remarks: list[str] = []
    by_dimension: dict[str, list[_Variable]] = {}
    for variable in variables:
        if variable.remark:
            remarks.append(f"{variable.name}: {variable.remark[:200]}")
        if variable.values is None and not variable.remark:
            remarks.append(f"{variable.name}: is left out; numeric variables of one dimension are read")
        elif variable.values is not None and len(variable.values):
            by_dimension.setdefault(variable.dimension, []).append(variable)
    tables: list[Table] = []
    attrs: dict[str, Any] = {}
    for dimension, found in by_dimension.items():
        time = next((variable for variable in found if _is_time(variable)), None)
        columns = [_column(variable) for variable in found if variable is not time]
        if columns:
            title = dimension if len(by_dimension) > 1 else ""
            tables.append(Table(columns, None if time is None else _time(time, attrs), title))
        elif time is not None:
            tables.append(Table([_time(time, attrs)]))
    return RawFile("NetCDF", tables, remarks, attrs)


def _is_time(variable: _Variable) -> bool:
    in_time = seconds_in(variable.unit) is not None or _SINCE.fullmatch(variable.unit) is not None
    named = is_time_name(variable.name)
    return (variable.name == variable.dimension and (in_time or named)) or (named and in_time)


def _time(variable: _Variable, attrs: dict[str, Any]) -> Column:
    column = _column(variable)
    since = _SINCE.fullmatch(variable.unit)
    if since is None:
        return column
    attrs["source_date"] = since["date"]
    # a clock's seconds since 1970 would leave too few digits for the interval
    return Column(column.label, column.values - column.values[0], since["unit"])


def _column(variable: _Variable) -> Column:
    assert variable.values is not None
    numbers = sorted_out(variable.values)
    return Column(
        variable.name,
        numbers.values,
        variable.unit,
        numbers.overrange,
        attrs={} if variable.label == variable.name else {"source_label": variable.label},
    )
