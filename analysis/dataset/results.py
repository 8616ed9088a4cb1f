"""Results of analyses: a table of variables for each kind, made into datasets and written as NetCDF-4 (CF-1.11)."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.assembling import new_axis, new_variable
from vibroimpact.analysis.dataset.provenance import program_attributes
from vibroimpact.analysis.dataset.schema import CONVENTIONS, UnitSystem, VariableRule
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


TableRow = tuple[str, str, str, str] | tuple[str, str, str, str, str]
"""A row of a `ResultTable`."""
SECONDS = "second"
"""Unit of times measured by the machine's clock: s in every system of units."""
SWEPT = "..."
"""Placeholder among the dimensions of a table for the dimensions of the studied runs."""


class ResultTable:
    """The variables that results of one kind may have.

    Parameters
    ----------
    kind : str
        Kind of the results, by which `vi.draw` chooses their drawing.
    *rows : tuple of str
        Name, dimensions separated by blanks, SI unit, name in words. `text` after these: values are texts. A name that
        ends in `#` stands for several variables, each with its number. `{WORD}` in a unit or in words is filled in
        with the values.

    Examples
    --------
    >>> table = ResultTable("peaks", ("at", "peak", "rad s-1", "frequency of the peak"))
    >>> table.dataset({"at": [1.0, 2.0]})["at"].attrs
    {'units': 'rad s-1', 'long_name': 'frequency of the peak'}
    """

    def __init__(self, kind: str, *rows: TableRow) -> None:
        self.kind = kind
        self.rules = {row[0]: _rule(*row) for row in rows}

    def dataset(
        self,
        values: Mapping[str, Any],
        attrs: Mapping[str, Any] | None = None,
        *,
        over: tuple[str, ...] = (),
        coords: Mapping[str, xr.Variable] | None = None,
        units: UnitSystem = "SI",
        **said: str,
    ) -> xr.Dataset:
        """Return the dataset of some values, with the attribute `results_kind`.

        Parameters
        ----------
        values : mapping of str to array
            By the names of the table; names without values become no variables.
        attrs : mapping, optional
            Attributes of the dataset.
        over : tuple of str
            Dimensions of the runs that were analysed.
        coords : mapping of str to xarray.Variable, optional
            Coordinates of these dimensions.
        units : {"SI", "nondimensional"}
            In the latter no variable has a unit.
        **said
            Texts for the words in braces in units and names.

        Raises
        ------
        DatasetError
            The table has no such variable.
        """
        rules = {name: self.rule_of(name) for name in values}
        rows: dict[str, Row] = {}
        for name, rule in rules.items():
            dims = tuple(dim for each in rule.dims for dim in (over if each == SWEPT else (each,)))
            of_one = isinstance(values[name], str)  # numpy keeps a single text as it is
            array = np.asarray(values[name], dtype=None if of_one else rule.dtype)
            unit = _unit_in(units, rule.unit).format(**said)
            rows[name] = dims, array, unit, rule.long_name.format(**said)
        found = xr.Dataset(described(rows), coords, dict(attrs or {}))
        return found.assign_attrs(results_kind=self.kind)

    def rule_of(self, name: str) -> VariableRule:
        """Return the table's rule of a variable; an unknown variable raises DatasetError."""
        if name in self.rules:
            return self.rules[name]
        family, number = re.sub(r"\d+$", "#", name), name[len(name.rstrip("0123456789")) :]
        if family not in self.rules:
            raise DatasetError(f"{self.kind}: {name}: expected a variable of its table, got another.")
        rule = self.rules[family]
        return replace(rule, name=name, long_name=rule.long_name.replace("#", number))


def _unit_in(units: UnitSystem, unit: str) -> str:
    if unit == SECONDS:
        return "s"
    return "1" if units == "nondimensional" else unit


def _rule(name: str, dims: str, unit: str, words: str, of: str = "") -> VariableRule:
    return VariableRule(name, tuple(dims.split()), unit, words, object if of == "text" else None)


_MOST_PLAIN = 1 << 16
"""Size of a variable of numbers above which it is stored compressed, bytes."""
_DEFLATED = {"zlib": True, "complevel": 1, "shuffle": True}


def write_results(dataset: xr.Dataset, path: str | os.PathLike[str], *, kind: str = "") -> None:
    """Write the dataset of an analysis.

    Parameters
    ----------
    dataset : xarray.Dataset
        Every variable with `units` and `long_name`; any dimensions. Versions and commit of the program are added where
        it has none.
    path : path
        An older file of this name is replaced only when the new one is complete.
    kind : str
        Kind of the results (`spikes`, `estimates`, `replay`, ...), by which `vibroimpact plot` chooses their drawing.
        Default: the attribute `results_kind` of the dataset.

    Raises
    ------
    DatasetError
        It has no kind, or a variable has no unit or no name in words.
    OSError
        The file cannot be written, with the reason of the operating system.
    """
    kind = kind or dataset.attrs.get("results_kind", "")
    if not kind:
        raise DatasetError("results: expected a kind, got none. Name one, or use the dataset of a study.")
    problems = [
        f"{kind}: {name}: expected the attribute {key}, got none."
        for name, variable in dataset.variables.items()
        for key in ("units", "long_name")
        if not variable.attrs.get(key)
    ]
    if problems:
        raise DatasetError("\n".join(problems))
    identity = {"Conventions": CONVENTIONS, "results_schema": RESULTS_SCHEMA, "results_kind": kind}
    described = dataset.assign_attrs(program_attributes() | dataset.attrs | identity)
    encoding: dict[Any, dict[str, Any]] = {
        name: {"_FillValue": np.nan if name not in dataset.coords else None}
        | (_DEFLATED if variable.nbytes > _MOST_PLAIN else {})
        for name, variable in dataset.variables.items()
        if variable.dtype.kind == "f"
    }
    write_atomically(path, *sealed(bytes(described.to_netcdf(engine="netcdf4", encoding=encoding))))
