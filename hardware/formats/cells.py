"""From cells of text to columns of numbers: decimal commas, empty cells, markers of overrange and of nothing."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import zip_longest
from typing import Any

import numpy as np

from vibroimpact.hardware.formats.table import Column, Floats

# Instruments write these for an input that is beyond its range, or open.
OVERRANGE_WORDS = frozenset(
    {"ovrng", "ovrrng", "ovr", "ovrn", "over", "overrange", "over-range", "overload", "ovl"}
    | {"ovld", "ol", "o.l.", "+ol", "-ol", "+over", "-over", "over+", "over-", "open", "opn"}
    | {"inf", "+inf", "-inf", "infinity", "-infinity", "+infinity", "1.#inf", "-1.#inf", "1.#infoo"}
    | {"#overflow", "overflow", "sat", "saturated", "\u221e", "+\u221e", "-\u221e"}
)
# And these for a sample that they do not have.
MISSING_WORDS = frozenset(
    {"nan", "-nan", "+nan", "na", "n/a", "#n/a", "#na", "-", "--", "---", "?", "*", "null"}
    | {"none", "nil", "nodata", "no-data", "missing", "invalid", "bad", "error", "1.#qnan", "-1.#qnan"}
    | {"1.#ind", "-1.#ind"}
)
OVERRANGE_FROM = 9.8e37
"""SCPI instruments give 9.9e37 beyond their range, LabVIEW 1e308; no measured signal is that large."""
NOT_A_NUMBER = 9.91e37
"""SCPI's number for a sample that is none."""

# Possessive, for cells of a million digits and a letter.
_NUMBER = re.compile(r"[-+]?(?:\d++\.?\d*+|\.\d++)(?:[eEdD][-+]?\d{1,4})?", re.ASCII)
_DATE = re.compile(r"\d{4}[-/]\d{2}[-/]\d{2}[T ]\d{2}:\d{2}(?::\d{2}(?:\.\d{1,18})?)?Z?", re.ASCII)
_TIME_OF_DAY = re.compile(r"\d{1,2}:\d{2}:\d{2}(?:[.,]\d{1,18})?", re.ASCII)
_DAY = re.compile(r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}", re.ASCII)
# 29.990,96 and 29,990.96: both signs in one number.
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(?:(?:\.\d{3})++,\d++|(?:,\d{3})++\.\d++)", re.ASCII)
_LONGEST_QUOTE = 40
_DAY_SECONDS = 86_400.0
_HALF_A_DAY = 0.5 * _DAY_SECONDS
"""Step back of a clock of the day that is a midnight, s; a smaller one is disorder."""
_NEXT_DAY = np.datetime64("1970-01-02", "ns")
"""Times of day without a date are those of 1970-01-01."""


def is_number(text: str, decimal: str = ".") -> bool:
    """Whether a cell is a plain number.

    >>> is_number("-1.5e3"), is_number("1,5", ","), is_number("1_000"), is_number("abc")
    (True, True, False, False)
    """
    return _NUMBER.fullmatch(_with_point(text.strip(), decimal)) is not None


def has_thousands(text: str) -> bool:
    """Whether a cell is a number with separators of thousands.

    >>> has_thousands("29.990,96"), has_thousands("1,234,567.5"), has_thousands("29.990"), has_thousands("0.100,5")
    (True, True, False, False)
    """
    return _THOUSANDS.fullmatch(text.strip()) is not None


def is_marker(text: str) -> bool:
    """Whether a cell is empty or stands for a sample that is not there.

    >>> is_marker("OVRNG"), is_marker(""), is_marker("NaN"), is_marker("velocity")
    (True, True, True, False)
    """
    word = text.strip().lower()
    return not word or word in OVERRANGE_WORDS or word in MISSING_WORDS


def is_date(text: str) -> bool:
    """Whether a cell is a time of day, with or without its date.

    >>> is_date("2026-07-30 12:00:01.5"), is_date("12:00:01"), is_date("2026"), is_date("2026-07-30")
    (True, True, False, False)
    """
    cell = text.strip()
    return _DATE.fullmatch(cell) is not None or _TIME_OF_DAY.fullmatch(cell) is not None


def is_day(text: str) -> bool:
    """Whether a cell is a date alone, which says nothing of when a row was sampled.

    >>> is_day("2026-07-30"), is_day("30.07.2026"), is_day("2026.5")
    (True, True, False)
    """
    return _DAY.fullmatch(text.strip()) is not None


def date_of(text: str) -> np.datetime64 | None:
    """Return the instant of a time of day with or without its date; None where it is none.

    >>> str(date_of("2026/07/30 20:07:43.5")), date_of("2026/13/30 20:07"), date_of("today")
    ('2026-07-30T20:07:43.500000000', None, None)
    """
    cell = text.strip()
    if not is_date(cell):
        return None
    if _TIME_OF_DAY.fullmatch(cell):
        cell = f"1970-01-01T{cell.replace(',', '.').zfill(len(cell) + (cell[1] == ':'))}"
    try:
        return np.datetime64(cell.rstrip("Z").replace("/", "-").replace(" ", "T"), "ns")
    except ValueError:
        return None


def split_line(line: str, delimiter: str | None) -> list[str]:
    """Return the cells of a line; None splits at blanks."""
    if delimiter is None:
        return line.split()
    if line.count('"') > 1:
        # a delimiter between quotes is part of its cell
        with suppress(csv.Error):
            return [
                cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
            ]
    return [cell.strip().strip('"') for cell in line.split(delimiter)]


def read_cells(lines: Sequence[str], delimiter: str | None, decimal: str) -> list[Column]:
    """Return the columns of rows of cells, without labels, each up to its last cell that is not empty.

    Cells are separated by the delimiter, by blanks where it is None.
    """
    quick = _read_regular(lines, delimiter, decimal)
    if quick is not None:
        return [column_of("", values) for values in quick]
    rows = [split_line(line, delimiter) for line in lines]
    return [_read_column(cells, decimal) for cells in zip_longest(*rows, fillvalue="")]


def _with_point(text: str, decimal: str) -> str:
    if decimal == ",":
        return text.replace(".", "x").replace(",", ".")  # a point is no decimal sign there
    return text


def _read_regular(lines: Sequence[str], delimiter: str | None, decimal: str) -> Floats | None:
    """Return all columns of a full table of plain numbers, shape (column, row); None where it is not one."""
    if decimal != "." or not lines:
        return None
    try:
        table = np.loadtxt(lines, delimiter=delimiter, comments=None, ndmin=2)
    except (ValueError, OverflowError):
        return None
    return np.ascontiguousarray(table.T) if len(table) == len(lines) else None


def column_of(label: str, values: Floats, unit: str = "", **facts: Any) -> Column:
    """Return a column of numbers in which those that stand for overrange, or for no sample, are NaN.

    `facts` is what else is known of the column, by the names of its attributes.

    Examples
    --------
    >>> column = column_of("base", np.array([1.0, 9.9e37, 9.91e37, -np.inf]))
    >>> column.values, column.overrange
    (array([ 1., nan, nan, nan]), array([False,  True, False,  True]))
    """
    missing = np.isclose(values, NOT_A_NUMBER, rtol=1e-4, atol=0.0)
    overrange = (np.isinf(values) | (np.abs(values) > OVERRANGE_FROM)) & ~missing
    if np.any(overrange | missing):
        values = np.where(overrange | missing, np.nan, values)
    return Column(label, values, unit, overrange if np.any(overrange) else None, **facts)


def _read_column(cells: Sequence[str], decimal: str) -> Column:
    """Read one column up to its last cell that is not empty."""
    length = next((row for row in range(len(cells), 0, -1) if cells[row - 1].strip()), 0)
    cells = cells[:length]
    first = next((cell for cell in cells if cell.strip()), "")
    if is_date(first):
        return _read_dates(cells)
    strange: list[tuple[int, str]] = []
    values = np.full(length, np.nan)
    for row, cell in enumerate(cells):
        text = _with_point(cell.strip(), decimal)
        if _NUMBER.fullmatch(text):
            values[row] = float(text.replace("d", "e").replace("D", "e"))
        elif text.lower() in OVERRANGE_WORDS:
            values[row] = np.inf
        elif not is_marker(cell):
            strange.append((row, cell.strip()[:_LONGEST_QUOTE]))
    return column_of("", values, strange=strange)


def _midnights(seconds: Floats) -> Floats:
    """Return the midnights that a clock of the day has passed up to each row."""
    there = np.flatnonzero(np.isfinite(seconds))
    passed = np.zeros(len(seconds))
    passed[there[1:]] = np.diff(seconds[there]) < -_HALF_A_DAY
    counted: Floats = np.cumsum(passed)
    return counted


def _read_dates(cells: Sequence[str]) -> Column:
    """Read dates with times of day as seconds after the first one."""
    strange: list[tuple[int, str]] = []
    stamps = np.full(len(cells), np.datetime64("NaT", "ns"))
    for row, cell in enumerate(cells):
        stamp = date_of(cell)
        if stamp is not None:
            stamps[row] = stamp
        elif not is_marker(cell):
            strange.append((row, cell.strip()[:_LONGEST_QUOTE]))
    known = stamps[~np.isnat(stamps)]
    if not len(known):
        return Column("", np.full(len(cells), np.nan), strange=strange)
    seconds = (stamps - known[0]) / np.timedelta64(1, "ns") * 1e-9
    if all(stamp < _NEXT_DAY for stamp in known):
        seconds += _DAY_SECONDS * _midnights(seconds)
    return Column("", np.asarray(seconds, dtype=np.float64), dated=True, strange=strange)
