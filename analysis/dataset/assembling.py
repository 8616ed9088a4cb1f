"""Datasets of xarray made of arrays, without importing dask.array and pint, a quarter of a second each."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from typing import Any, Protocol, TypeAlias

import numpy as np
import pandas as pd
import xarray as xr
from xarray.core.indexing import PandasIndexingAdapter

Described: TypeAlias = tuple[tuple[Hashable, ...], Any, Mapping[Any, Any]]
"""Dimensions, values and attributes of a variable."""


class Named(Protocol):
    """Variables, some of which are coordinates: a dataset of xarray, or variables that become one."""

    @property
    def variables(self) -> Mapping[Any, xr.Variable]:
        """All variables by name."""

    @property
    def coords(self) -> Iterable[Any]:
        """The names of the coordinates."""


def assembled(
    variables: Mapping[str, Described | xr.Variable],
    coords: Mapping[str, Described | xr.Variable],
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """Return the dataset of some variables; arrays of numpy are taken over as they are, not copied."""
    return xr.Dataset(wrapped(variables), coords=wrapped(coords), attrs=attrs)


def wrapped(variables: Mapping[str, Described | xr.Variable]) -> dict[str, xr.Variable]:
    """Return variables of xarray by their names.

    Without its fast path xarray checks whether each array is one of Dask, and imports Dask for the check.
    """
    return {
        name: parts if isinstance(parts, xr.Variable) else new_variable(*parts)
        for name, parts in variables.items()
    }


def new_variable(dims: str | tuple[Hashable, ...], values: Any, attrs: Mapping[Any, Any]) -> xr.Variable:
    """Return one variable of xarray."""
    return xr.Variable(dims, values, attrs, fastpath=type(values) is np.ndarray)


def loaded_variable(variable: xr.Variable) -> xr.Variable:
    """Return a variable with its values in memory.

    `Variable.compute` would check whether each array is one of Dask, and import Dask for the check.
    """
    if isinstance(variable, xr.IndexVariable):
        return variable
    found = new_variable(variable.dims, variable.values, variable.attrs)
    found.encoding = variable.encoding
    return found


def new_axis(dimension: str, values: np.ndarray[Any, Any], attrs: Mapping[Any, Any]) -> xr.IndexVariable:
    """Return the coordinate along a dimension.

    For an array that is no index yet, xarray checks whether it is one of pint, and imports pint for the check.
    """
    index = PandasIndexingAdapter(pd.Index(values), dtype=values.dtype)
    return xr.IndexVariable(dimension, index, attrs)
