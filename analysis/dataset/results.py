"""Write what an analysis found: small NetCDF-4 files (CF-1.11), whole or not there at all."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.assembling import new_axis, new_variable
from vibroimpact.analysis.dataset.schema import CONVENTIONS
from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.analysis.files.fingerprints import sealed
from vibroimpact.fmus.errors import DatasetError

RESULTS_SCHEMA = "1"

Row = tuple[str | tuple[str, ...], Any, str, str]
"""A variable: dimensions (none: a number), values, CF unit, name in words."""
Rows = Mapping[str, Row]


def described(rows: Rows) -> dict[str, xr.Variable]:
    """Return variables of xarray, each with its `units` and `long_name`.

    >>> described({"rate": ((), 2.0, "Hz", "events per second")})["rate"].attrs
    {'units': 'Hz', 'long_name': 'events per second'}
    """
    return {name: _variable(name, row) for name, row in rows.items()}


def _variable(name: str, row: Row) -> xr.Variable:
    dims, values, unit, words = row
    attributes = {"units": unit, "long_name": words}
    if dims in (name, (name,)):
        return new_axis(name, np.asarray(values), attributes)
    return new_variable(dims, np.asarray(values), attributes)


def write_results(dataset: xr.Dataset, path: str | os.PathLike[str], *, kind: str) -> None:
    """Write the dataset of an analysis.

    Parameters
    ----------
    dataset : xarray.Dataset
        Every variable with `units` and `long_name`; any dimensions.
    path : path
        An older file of this name is replaced only when the new one is complete.
    kind : str
        What it is (`spikes`, `estimates`, `replay`, ...), by which `vibroimpact plot` knows how to draw it.

    Raises
    ------
    DatasetError
        A variable has no unit or no name in words.
    OSError
        The file cannot be written, with the reason of the operating system.
    """
    problems = [
        f"{kind}: {name}: expected the attribute {key}, got none."
        for name, variable in dataset.variables.items()
        for key in ("units", "long_name")
        if not variable.attrs.get(key)
    ]
    if problems:
        raise DatasetError("\n".join(problems))
    identity = {"Conventions": CONVENTIONS, "results_schema": RESULTS_SCHEMA, "results_kind": kind}
    described = dataset.assign_attrs(dataset.attrs | identity)
    encoding: dict[Any, dict[str, Any]] = {
        name: {"_FillValue": np.nan if name not in dataset.coords else None}
        for name, variable in dataset.variables.items()
        if variable.dtype.kind == "f"
    }
    write_atomically(path, *sealed(bytes(described.to_netcdf(engine="netcdf4", encoding=encoding))))
