"""Columns of numbers from cells of text: decimal commas, empty cells, markers of overrange and of missing samples."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.instants import is_clock, is_date, is_day, read_instants
from vibroimpact.hardware.formats.table import MOST_COLUMNS, MOST_SAMPLES, Column, Floats

# instruments write these for an input beyond its range, or open
OVERRANGE_WORDS = frozenset(
    {"ovrng", "ovrrng", "ovr", "ovrn", "over", "overrange", "over-range", "overload", "ovl"}
    | {"ovld", "ol", "o.l.", "+ol", "-ol", "+over", "-over", "over+", "over-", "open", "opn"}
    | {"inf", "+inf", "-inf", "infinity", "-infinity", "+infinity", "1.#inf", "-1.#inf", "1.#infoo"}
    | {"#overflow", "overflow", "sat", "saturated", "\u221e", "+\u221e", "-\u221e"}
)
# instruments write these for a missing sample
MISSING_WORDS = frozenset(
    {"nan", "-nan", "+nan", "na", "n/a", "#n/a", "#na", "-", "--", "---", "?", "*", "null"}
    | {"none", "nil", "nodata", "no-data", "missing", "invalid", "bad", "error", "1.#qnan", "-1.#qnan"}
    | {"1.#ind", "-1.#ind"}
)
OVERRANGE_FROM = 9.8e37
"""Absolute value above which a number means overrange: SCPI instruments write 9.9e37, LabVIEW 1e308."""
NOT_A_NUMBER = 9.91e37
"""SCPI's number for a missing sample."""

# possessive quantifiers, for cells of a million digits and a letter
_NUMBER = re.compile(r"[-+]?(?:\d++\.?\d*+|\.\d++)(?:[eEdD][-+]?\d{1,4})?", re.ASCII)
# 29.990,96 and 29,990.96: both signs in one number
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(?:(?:\.\d{3})++,\d++|(?:,\d{3})++\.\d++)", re.ASCII)
# the same; with a decimal comma also 101.325; 1,234 with a decimal point may be two cells
_POINTS = re.compile(r"[-+]?[1-9]\d{0,2}(?:\.\d{3})++(?:,\d++)?", re.ASCII)
_COMMAS = re.compile(r"[-+]?[1-9]\d{0,2}(?:(?:,\d{3})++\.\d++|(?:,\d{3}){2,9})", re.ASCII)
_LONGEST_QUOTE = 40
_NONE: Floats = np.empty(0)


def is_number(text: str, decimal: str = ".") -> bool:
    """Whether a cell is a plain number.

    >>> is_number("-1.5e3"), is_number("1,5", ","), is_number("1_000"), is_number("abc")
    (True, True, False, False)
    >>> is_number("101.325", ","), is_number("0.325", ","), is_number("1,234.5"), is_number("1,234")
    (True, False, True, False)
    """
    return _NUMBER.fullmatch(_with_point(text.strip(), decimal)) is not None


def has_thousands(text: str) -> bool:
    """Whether a cell is a number with separators of thousands.

    >>> has_thousands("29.990,96"), has_thousands("1,234,567.5"), has_thousands("29.990"), has_thousands("0.100,5")
    (True, True, False, False)
    """
    return _THOUSANDS.fullmatch(text.strip()) is not None


def is_marker(text: str) -> bool:
    """Whether a cell is empty or marks a missing sample.

    >>> is_marker("OVRNG"), is_marker(""), is_marker("NaN"), is_marker("velocity")
    (True, True, True, False)
    """
    word = text.strip().lower()
    return not word or word in OVERRANGE_WORDS or word in MISSING_WORDS


def split_line(line: str, delimiter: str | None) -> list[str]:
    """Return the cells of a line; a delimiter of None splits at blanks."""
    if delimiter is None:
        return line.split()
    if line.count('"') > 1:
        # a delimiter in quotes is part of its cell
        with suppress(csv.Error):
            return [
                cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
            ]
    return [cell.strip().strip('"') for cell in line.split(delimiter)]


def read_cells(lines: Sequence[str], delimiter: str | None, decimal: str, dates: str = "") -> list[Column]:
    """Return the columns of rows of cells, without labels, each up to its last cell that is not empty.

    Cells are separated by the delimiter, by blanks where it is None. `dates` is the order of day and month; empty: it
    is found. A column of days beside one of times of day gives them their dates, and is empty. More columns or cells
    than one import takes raise DatasetError.
    """
    quick = _read_regular(lines, delimiter, decimal)
    if quick is not None:
        _refuse_wide(len(quick), 1)
        return [column_of("", values) for values in quick]
    rows = [split_line(line, delimiter) for line in lines]
    widths = set(map(len, rows))
    _refuse_wide(max(widths, default=0), len(rows))
    written = [_Cells(cells) for cells in zip(*rows, strict=True)] if len(widths) < 2 else _ragged(rows)
    columns = [_read_column(cells, decimal, dates) for cells in written]
    for place, (days, clock) in enumerate(pairwise(written)):
        if _are_days(days.texts) and is_clock(_first(clock.texts)):
            together = _with_days(days.of_rows(len(rows)), clock.of_rows(len(rows)), dates)
            if together is not None:
                columns[place], columns[place + 1] = (
                    replace(columns[place], values=_NONE, strange=()),
                    together,
                )
    return columns


@dataclass(frozen=True, slots=True)
class _Cells:
    """Cells of a column, and their rows; None: they stand in all rows from the first one on."""

    texts: Sequence[str]
    rows: Sequence[int] | None = None

    def of_rows(self, count: int) -> Sequence[str]:
        """Return a cell for each row; empty for rows without the column."""
        if self.rows is None:
            return self.texts
        cells = [""] * count
        for row, text in zip(self.rows, self.texts, strict=True):
            cells[row] = text
        return cells


def _ragged(rows: Sequence[Sequence[str]]) -> list[_Cells]:
    """Return the cells with content from rows of different widths: a wide row costs only its own cells."""
    texts: list[list[str]] = [[] for _ in range(max(map(len, rows)))]
    places: list[list[int]] = [[] for _ in texts]
    for row, cells in enumerate(rows):
        for column, cell in enumerate(cells):
            if cell.strip():
                texts[column].append(cell)
                places[column].append(row)
    return [_Cells(*one) for one in zip(texts, places, strict=True)]


def _refuse_wide(columns: int, rows: int) -> None:
    """Raise DatasetError for too many columns, or for short rows next to wide ones that would fill the memory."""
    if columns > MOST_COLUMNS:
        raise DatasetError(f"expected at most {MOST_COLUMNS} columns, got {columns}. Is it turned over?")
    if rows * (columns - 1) > MOST_SAMPLES:
        raise DatasetError(
            f"expected at most {MOST_SAMPLES} cells beside the instants, got {rows} rows of up to {columns} cells. "
            "Cut it into pieces."
        )


def _first(cells: Sequence[str]) -> str:
    """Return the first cell with content."""
    return next((cell for cell in cells if cell.strip()), "")


def _are_days(cells: Sequence[str]) -> bool:
    """Whether a column has a day in every cell with content."""
    return is_day(_first(cells)) and all(is_day(cell) for cell in cells if cell.strip())


def _with_days(days: Sequence[str], clock: Sequence[str], dates: str) -> Column | None:
    """Return the instants of days and times of day; None if the times of day alone are clearer."""
    cells = [f"{day.strip()} {time.strip()}".strip() for day, time in zip(days, clock, strict=True)]
    column = read_instants(cells, is_marker, dates)
    known = column.values[np.isfinite(column.values)]
    is_clear = not column.strange and not column.ambiguity and len(known) > 1
    return column if is_clear and bool(np.all(np.diff(known) >= 0.0)) else None


def _with_point(text: str, decimal: str) -> str:
    if decimal == ",":
        if "." in text:  # a point is then no decimal sign
            text = text.replace(".", "" if _POINTS.fullmatch(text) else "x")
        return text.replace(",", ".")
    return text.replace(",", "") if "," in text and _COMMAS.fullmatch(text) else text


def _read_regular(lines: Sequence[str], delimiter: str | None, decimal: str) -> Floats | None:
    """Return all columns of a full table of plain numbers, shape (column, row); None for other tables."""
    if decimal != "." or not lines:
        return None
    try:
        table = np.loadtxt(lines, delimiter=delimiter, comments=None, ndmin=2)
    except (ValueError, OverflowError):
        return None
    return np.ascontiguousarray(table.T) if len(table) == len(lines) else None


def column_of(label: str, values: Floats, unit: str = "", **facts: Any) -> Column:
    """Return a column of numbers, with NaN for overrange and for missing samples.

    `facts` are further attributes of the column, by name.

    >>> column = column_of("base", np.array([1.0, 9.9e37, 9.91e37, -np.inf]))
    >>> column.values, column.overrange
    (array([ 1., nan, nan, nan]), array([False,  True, False,  True]))
    """
    if np.any(missing := np.isnan(values)):
        values = np.where(missing, np.nan, values)  # one kind of NaN: a signalling one warns in every sum
    low, high = np.fmin.reduce(values, initial=0.0), np.fmax.reduce(values, initial=0.0)
    if low >= -OVERRANGE_FROM and high <= OVERRANGE_FROM:
        return Column(label, values, unit, None, **facts)
    missing = np.isclose(values, NOT_A_NUMBER, rtol=1e-4, atol=0.0)
    overrange = (np.isinf(values) | (np.abs(values) > OVERRANGE_FROM)) & ~missing
    if np.any(overrange | missing):
        values = np.where(overrange | missing, np.nan, values)
    return Column(label, values, unit, overrange if np.any(overrange) else None, **facts)


def _read_column(written: _Cells, decimal: str, dates: str) -> Column:
    """Return one column up to its last cell with content."""
    cells = written.texts
    length = next((row for row in range(len(cells), 0, -1) if cells[row - 1].strip()), 0)
    column = _read_texts(cells[:length], decimal, dates)
    rows = written.rows
    if rows is None or not length:
        return column
    values = np.full(rows[-1] + 1, np.nan)
    values[rows] = column.values
    overrange = None
    if column.overrange is not None:
        overrange = np.zeros(len(values), dtype=bool)
        overrange[rows] = column.overrange
    strange = [(rows[place], text) for place, text in column.strange]
    return replace(column, values=values, overrange=overrange, strange=strange)


def _read_texts(cells: Sequence[str], decimal: str, dates: str) -> Column:
    """Return cells as instants if the first is one, else as numbers."""
    if is_date(_first(cells)):
        return read_instants(cells, is_marker, dates)
    strange: list[tuple[int, str]] = []
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        text = _with_point(cell.strip(), decimal)
        if _NUMBER.fullmatch(text):
            values[row] = float(text.replace("d", "e").replace("D", "e"))
        elif text.lower() in OVERRANGE_WORDS:
            values[row] = np.inf
        elif not is_marker(cell):
            strange.append((row, cell.strip()[:_LONGEST_QUOTE]))
    return column_of("", values, strange=strange)
