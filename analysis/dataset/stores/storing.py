"""The stored form of a variable beyond its values, and the form in which reading returns it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.assembling import new_variable
from vibroimpact.analysis.dataset.schema import constant_names, swept_names


@dataclass(frozen=True, slots=True)
class Stored:
    """One variable in a file."""

    name: str
    variable: xr.Variable
    linked: str
    """Names of its coordinates: an attribute of the file; empty where it has none."""
    may_miss: bool
    """Whether NaN marks values that are missing."""


def stored_variables(dataset: xr.Dataset) -> Iterator[Stored]:
    """Yield the variables of a one-dimensional dataset as a file has them."""
    linked = " ".join(("run_index", "direction", *swept_names(dataset), *constant_names(dataset)))
    for name, variable in dataset.variables.items():
        own = ""
        if variable.dims[:1] == ("run",) and name not in dataset.coords:
            own = linked
            own += " connection" if "interface" in variable.dims else ""
            own += " compared" if "comparison" in variable.dims else ""
        # CF forbids missing values in coordinates, so these have no fill value.
        may_miss = variable.dtype.kind == "f" and (bool(own) or variable.dims[:1] not in ((), ("run",)))
        yield Stored(str(name), variable, own, may_miss)


@dataclass(frozen=True, slots=True)
class Read:
    """Contents of a file before they become a dataset of xarray: making that costs more than all other work."""

    variables: dict[str, xr.Variable]
    """In the alphabetical order of the file."""
    coords: tuple[str, ...]
    """Names of the variables that are coordinates."""
    attrs: dict[Any, Any]

    @property
    def sizes(self) -> dict[Any, int]:
        """Size of each dimension."""
        return {dim: size for one in self.variables.values() for dim, size in one.sizes.items()}


def as_read(dataset: xr.Dataset) -> Read:
    """Return a one-dimensional dataset as reading its file gives it back."""
    variables: dict[str, xr.Variable] = {}
    links: set[str] = set()
    # the library lists variables by the alphabet
    for one in sorted(stored_variables(dataset), key=lambda one: one.name):
        attributes = _attributes_read(one.variable.attrs)
        if one.may_miss:
            attributes["_FillValue"] = np.float64(np.nan)
        variables[one.name] = new_variable(one.variable.dims, one.variable.values, attributes)
        if one.linked:
            variables[one.name].encoding["coordinates"] = one.linked
            links.update(one.linked.split())
    for name in links:
        if variables[name].dtype.kind == "O":  # labels get texts of one length, as an index has
            variables[name] = variables[name].astype(np.str_)
    return Read(variables, tuple(sorted(links)), _attributes_read(dataset.attrs))


def _attributes_read(attributes: Mapping[Any, Any]) -> dict[Any, Any]:
    """Return attributes in the types that a file returns: an array of one element is a number."""
    return {name: _read(value) for name, value in attributes.items()}


def _read(value: Any) -> Any:
    if isinstance(value, str):
        return value
    array = np.asarray(value)
    return array.reshape(())[()] if array.size == 1 else array
