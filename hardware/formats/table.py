"""What a file holds before anything is decided: columns of numbers as they stand in it.

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
"""Bytes; a longer recording is better cut where it was made than guessed at here."""
MOST_SAMPLES = 50_000_000
"""Samples of all channels together that one import may hold in memory."""
MOST_COLUMNS = 1024
"""Columns of one file; more are most likely rows."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column of numbers.

    Attributes
    ----------
    label : str
        What the file calls it; empty where it does not.
    values : ndarray of float, shape (row,)
        NaN where the file has no number.
    unit : str
        Unit label of the file; empty where it has none.
    overrange : ndarray of bool, shape (row,), or None
        Where the file says that the input was beyond its range or open.
    interval : float or None
        Sampling interval that the header declares for this column, s.
    start : float
        Instant of the first row by the header, s.
    group : str
        What began this column, where a table holds columns of several starts.
    rails : tuple of float or None
        Smallest and largest value that the converter can give, in the unit of `values`.
    attrs : dict
        What else the file says.
    dated : bool
        The cells are dates or times of day, and so instants; the values are s after the first one.
    strange : sequence of (row, text)
        Cells of text that are neither a number nor a known marker; their values are NaN.
    doubt : str
        What else the instants may be, in words; a column with a doubt is asked about where it is used.
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
    doubt: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Columns that were written row by row together; they may end at different rows.

    Attributes
    ----------
    columns : sequence of Column
    time : Column or None
        Instants of the rows, where the format says which column has them, s.
    title : str
        Group or segment of the file; empty where it has one only.
    vectors : bool
        The columns are arrays of their own, not rows of one table: lengths and meanings need not agree.
    time_place : int
        How many columns stand before that of the instants in the file.
    rate : float or None
        Samples per second, where the file says so for all columns.
    """

    columns: Sequence[Column]
    time: Column | None = None
    title: str = ""
    vectors: bool = False
    time_place: int = 0
    rate: float | None = None

    def clock_of(self, column: Column) -> Floats | None:
        """Return the instants that hold for the rows of a column, s; None where no column has them.

        Shape (row,); they may end before the column does, in a table of rows.
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
    """All that an importer found in a file.

    Attributes
    ----------
    source_format : str
        In words: "LabVIEW measurement file, version 2".
    tables : sequence of Table
    remarks : sequence of str
        What was noticed on the way, one sentence each.
    attrs : dict
        Provenance that the file itself gives: `source_date`, `operator`, ...
    damage : str
        What is wrong with the file as a whole; a remark, and part of a refusal for another reason.
    """

    source_format: str
    tables: Sequence[Table]
    remarks: Sequence[str] = ()
    attrs: dict[str, Any] = field(default_factory=dict)
    damage: str = ""
