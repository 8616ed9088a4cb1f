"""The raw content of a file, before any decision: its columns of numbers.

Every format's module returns a `RawFile`; the modules that make a recording of it know no format.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

LARGEST_FILE = 2**29
"""Largest file, bytes; a longer recording is better cut by its own program."""
MOST_SAMPLES = 50_000_000
"""Most samples of all channels together in one import."""
MOST_COLUMNS = 1024
"""Most columns of one file; more are most likely rows."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column of numbers.

    Attributes
    ----------
    label : str
        Its name in the file, or empty.
    values : ndarray of float, shape (row,)
        NaN for a missing number.
    unit : str
        Unit label of the file, or empty.
    overrange : ndarray of bool, shape (row,), or None
        Samples that the file marks as beyond the range, or as an open input.
    interval : float or None
        Declared sampling interval of this column, s.
    start : float
        Instant of the first row by the header, s.
    group : str
        The start event of this column, if a table has columns of several starts.
    rails : tuple of float or None
        Smallest and largest value that the converter can give, in the unit of `values`.
    attrs : dict
        Further facts in the file.
    dated : bool
        The cells are dates or times of day, and so instants; the values are s after the first one.
    strange : sequence of (row, text)
        Cells of text that are neither a number nor a known marker; their values are NaN.
    ambiguity : str
        Another possible reading of the instants, in words; using such a column needs a decision of the user.
    """

    label: str
    values: Floats
    unit: str = ""
    overrange: Flags | None = None
    interval: float | None = None
    start: float = 0.0
    group: str = ""
    rails: tuple[float, float] | None = None
    attrs: dict[str, Any] = field(default_factory=dict)
    dated: bool = False
    strange: Sequence[tuple[int, str]] = ()
    ambiguity: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Columns written together, row by row; they may end at different rows.

    Attributes
    ----------
    columns : sequence of Column
    time : Column or None
        Instants of the rows, s, if the format names their column.
    title : str
        Group or segment of the file; empty if it has only one.
    vectors : bool
        The columns are separate arrays, not rows of one table: lengths and meanings may differ.
    time_place : int
        Number of columns before the instants in the file.
    rate : float or None
        Samples per second, if the file gives one rate for all columns.
    """

    columns: Sequence[Column]
    time: Column | None = None
    title: str = ""
    vectors: bool = False
    time_place: int = 0
    rate: float | None = None

    def clock_of(self, column: Column) -> Floats | None:
        """Return the instants of a column's rows, s; None if no column has them.

        Shape (row,); in a table of rows they may end before the column does.
        """
        if self.time is None or column.group:
            return None
        instants = self.time.values
        if self.vectors and len(instants) != len(column.values):
            return None
        if len(instants) < min(2, len(column.values)):
            return None
        return instants[: len(column.values)]


@dataclass(frozen=True, slots=True)
class RawFile:
    """The content of a file, as an importer found it.

    Attributes
    ----------
    source_format : str
        In words: "LabVIEW measurement file, version 2".
    tables : sequence of Table
    remarks : sequence of str
        Observations, one sentence each.
    attrs : dict
        Provenance in the file itself: `source_date`, `operator`, ...
    damage : str
        Damage of the file as a whole; it is a remark, and part of other refusals.
    """

    source_format: str
    tables: Sequence[Table]
    remarks: Sequence[str] = ()
    attrs: dict[str, Any] = field(default_factory=dict)
    damage: str = ""
