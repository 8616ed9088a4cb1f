"""Tables of vectors from named arrays, which MATLAB and HDF5 files hold in structures and groups."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.cells import column_of
from vibroimpact.hardware.formats.labels import is_time_name, seconds_in
from vibroimpact.hardware.formats.table import MOST_COLUMNS, MOST_SAMPLES, Column, Table

RATES = frozenset(
    {"fs", "samplerate", "sample_rate", "sampling_rate", "samplingrate", "samplingfrequency"}
    | {"sampling_frequency"}
)
INTERVALS = frozenset({"dt", "ts", "deltat", "delta_t", "sampling_interval", "samplinginterval"})


@dataclass(slots=True)
class Scope:
    """A structure or group: its numeric arrays by name, and their clock."""

    path: str = ""
    """Names of the enclosing structures, joined by dots; empty for the file itself."""
    arrays: dict[str, Any] = field(default_factory=dict)
    """Numeric arrays by their own names."""
    units: dict[str, str] = field(default_factory=dict)
    """Unit labels of arrays that have one, by name."""
    rate: float | None = None
    """Samples per second of all its arrays."""
    around: Scope | None = None
    """The enclosing structure; its clock is used if this one has none."""
    numbers: int = 0
    """Numbers read into the outermost structure and all within it; kept if reading stops at a limit."""

    def within(self, name: str) -> Scope:
        """Return a structure of this name inside this one."""
        return Scope(self.dotted(name), around=self)

    def dotted(self, name: str) -> str:
        """Return the full name of an array."""
        return f"{self.path}.{name}" if self.path else name

    def outward(self) -> Iterator[Scope]:
        """Yield this structure and the enclosing ones, the nearest first."""
        yield self
        if self.around is not None:
            yield from self.around.outward()


def tables_of(scopes: Sequence[Scope]) -> tuple[list[Table], list[str]]:
    """Return a table of the arrays of each structure, the outer ones first, and remarks.

    A vector named `t` or `time` has the instants, a number named `fs` or `dt` the rate. Both also hold in inner
    structures that have none. DatasetError: more columns or samples than one import takes.
    """
    remarks: list[str] = []
    if sum(array.size for scope in scopes for array in scope.arrays.values()) > MOST_SAMPLES:
        raise DatasetError(f"expected at most {MOST_SAMPLES} numbers, got more. Save fewer variables.")
    tables: list[Table] = []
    clocks: dict[str, Column] = {}
    for scope in scopes:
        columns, time = _columns_of(scope, remarks)
        if time is not None and not columns and not scope.path:
            columns, time = [time], None
        elif time is not None:
            clocks[scope.path] = time
        if columns:
            clock = next((clocks[one.path] for one in scope.outward() if one.path in clocks), None)
            rate = next((one.rate for one in scope.outward() if one.rate is not None), None)
            tables.append(Table(columns, clock, vectors=True, rate=rate))
    if sum(len(table.columns) for table in tables) > MOST_COLUMNS:
        raise DatasetError(f"expected at most {MOST_COLUMNS} columns, got more. Save fewer variables.")
    return tables, remarks


def _columns_of(scope: Scope, remarks: list[str]) -> tuple[list[Column], Column | None]:
    """Return the columns of a structure, and its instants; set its rate from its numbers."""
    columns: list[Column] = []
    time: Column | None = None
    for name, values in scope.arrays.items():
        label, unit = scope.dotted(name), scope.units.get(name, "")
        if not values.size:
            remarks.append(f"{label}: holds no numbers and is left out")
        elif values.size == 1 and name.lower() in RATES | INTERVALS:
            number = float(values.ravel()[0])
            rate = number if name.lower() in RATES else (1.0 / number if number else 0.0)
            if 0.0 < rate < np.inf:
                scope.rate = rate
            else:
                remarks.append(f"{label}: the sampling rate of the file, {rate}, is left out")
        elif is_time_name(name) and values.size == max(values.shape) and values.size > 1:
            time = _numbers(label, values.ravel(), unit if seconds_in(unit) is not None else "s")
        else:
            columns += _columns(label, values, unit, remarks)
    return columns, time


def _columns(label: str, values: Any, unit: str, remarks: list[str]) -> list[Column]:
    """Return the columns of an array; a row vector is one column."""
    if values.ndim > 2:
        remarks.append(f"{label}: an array of {values.ndim} dimensions is left out; vectors are read")
        return []
    if values.ndim < 2 or min(values.shape) == 1:
        return [_numbers(label, values.ravel(), unit)]
    if values.shape[0] < values.shape[1]:
        remarks.append(f"{label}: {values.shape[0]} rows of {values.shape[1]} are taken as the channels")
        values = values.T
    return [_numbers(f"{label}_{place + 1}", values[:, place], unit) for place in range(values.shape[1])]


def _numbers(label: str, values: Any, unit: str) -> Column:
    return column_of(label, np.array(values, dtype=np.float64), unit)
