"""A dataset of several: each part keeps its variables, with the name of the part in front of names and dimensions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from vibroimpact.analysis.dataset.assembling import assembled
from vibroimpact.analysis.dataset.grid import on_grid
from vibroimpact.analysis.dataset.schema import NOT_SWEPT, SWEPT_ALONG, constant_names, names_list
from vibroimpact.analysis.dataset.stores.storing import as_read
from vibroimpact.fmus.errors import DatasetError

PARTS = "parts"
"""Attribute of a composed dataset: the names of its parts, separated by blanks."""
_NAMES_A_DIMENSION = ("sample_dimension", SWEPT_ALONG)
"""Attributes of variables whose value is a dimension."""
_OF_THE_FILE = ("_FillValue", "coordinates")
"""Attributes of variables that only a file needs."""


def composed(kind: str, parts: Mapping[str, xr.Dataset], attrs: Mapping[str, Any]) -> xr.Dataset:
    """Return one dataset of several.

    Parameters
    ----------
    kind : str
        Its attribute `results_kind`.
    parts : mapping of str to xarray.Dataset
        Results of analyses, and runs in their one-dimensional form, by their names.
    attrs : mapping
        Attributes of the whole. Those of a part have its name in front.
    """
    variables: dict[str, xr.Variable] = {}
    coords: dict[str, xr.Variable] = {}
    attributes = dict(attrs) | {"results_kind": kind, PARTS: " ".join(parts)}
    for part, dataset in parts.items():
        # numbers that all runs of one part share would become coordinates of the other parts, too
        found = _renamed(dataset.reset_coords(constant_names(dataset)), "", f"{part}_")
        for name, variable in found.variables.items():
            (coords if name in found.coords else variables)[str(name)] = variable
        attributes |= {f"{part}_{name}": value for name, value in dataset.attrs.items()}
    return assembled(variables, coords, attributes)


def part_of(dataset: xr.Dataset, part: str) -> xr.Dataset:
    """Return a part of a composed dataset, as it is without the others; runs are opened on their sweep.

    Raises
    ------
    DatasetError
        The dataset has no such part.
    """
    names = str(dataset.attrs.get(PARTS, "")).split()
    if part not in names:
        raise DatasetError(f"part: expected one of those there are ({names_list(names)}), got {part!r}.")
    prefix = f"{part}_"
    found = _renamed(
        dataset[[name for name in dataset.variables if str(name).startswith(prefix)]], prefix, ""
    )
    constants = [
        name
        for name, each in found.variables.items()
        if not each.dims and each.attrs.items() >= NOT_SWEPT.items()
    ]
    attributes = {
        str(name).removeprefix(prefix): value
        for name, value in dataset.attrs.items()
        if str(name).startswith(prefix)
    }
    found = found.set_coords(constants).assign_attrs(attributes)
    return on_grid(as_read(found), lazily=False) if "dataset_schema" in attributes else found


def _renamed(dataset: xr.Dataset, prefix: str, new: str) -> xr.Dataset:
    """Return a dataset with another prefix of its variables and dimensions, and without attributes of its own."""
    found = dataset.rename(
        {name: new + str(name).removeprefix(prefix) for name in {*dataset.variables, *dataset.dims}}
    )
    found.attrs = {}
    for variable in found.variables.values():
        own = {
            name: new + str(value).removeprefix(prefix)
            for name, value in variable.attrs.items()
            if name in _NAMES_A_DIMENSION
        }
        kept = {name: value for name, value in variable.attrs.items() if name not in _OF_THE_FILE}
        variable.attrs = {**kept, **own}
    return found
