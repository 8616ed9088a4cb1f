"""The column of instants in a table: known by its heading, its unit, or its ascent."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vibroimpact.hardware.formats.labels import is_time_name, seconds_in, unit_in_time_name
from vibroimpact.hardware.formats.table import Column, Table

FIRST_WITHOUT_HEADING = "column_1"
"""Label of a first column without heading."""
_COUNTS = frozenset(
    {"index", "no", "no.", "nr", "nr.", "#", "sample", "samples", "row", "point", "scan", "record"}
)
"""Headings of a column that counts the rows."""


def without_count(table: Table) -> Table:
    """Return the table without a first column that counts its rows, if another column has the instants."""
    first = table.columns[0] if table.columns and table.time is not None and table.time_place > 0 else None
    if first is None or first.label.strip().lower() not in _COUNTS or len(table.columns) < 2:
        return table
    steps = np.diff(first.values)
    if not len(steps) or not np.all(steps == 1.0):
        return table
    return replace(table, columns=table.columns[1:], time_place=table.time_place - 1)


def with_time(table: Table) -> Table:
    """Return the table with the column of its instants set apart, if one is clear.

    A column is clear if its heading means time. So is a first column without heading that ascends from row to row and
    is followed by others.
    """
    for place, column in enumerate(table.columns):
        if column.dated or is_time_name(column.label) or _is_time_by_unit(column, place):
            return _apart(table, place)
    for place, column in enumerate(table.columns):
        if unit_in_time_name(column.label) and _ascends(column):
            return _apart(table, place)
    if (
        len(table.columns) > 1
        and table.columns[0].label == FIRST_WITHOUT_HEADING
        and _ascends(table.columns[0])
    ):
        return _apart(table, 0)
    return table


def in_pairs(columns: Sequence[Column]) -> list[Table]:
    """Return a table for each of several columns of instants, with its following columns: `t1 a1 t2 a2`."""
    clocks = [place for place, column in enumerate(columns) if _is_clock(column)]
    ends = [*clocks[1:], len(columns)]
    if (
        len(clocks) < 2
        or clocks[0] != 0
        or any(end - begin < 2 for begin, end in zip(clocks, ends, strict=True))
    ):
        return []
    same = [np.array_equal(columns[0].values, columns[place].values, equal_nan=True) for place in clocks]
    if all(same):
        return []
    return [Table(columns[begin + 1 : end], columns[begin]) for begin, end in zip(clocks, ends, strict=True)]


def _is_clock(column: Column) -> bool:
    """Whether a column has the instants of others: it ascends, and its heading or its unit means time."""
    name = re.sub(r"[\s_-]*\d{1,3}$", "", column.label)
    return (column.dated or is_time_name(name) or seconds_in(column.unit) is not None) and _ascends(column)


def _apart(table: Table, place: int) -> Table:
    others = [column for at, column in enumerate(table.columns) if at != place]
    if not others:
        return table
    time = table.columns[place]
    time = replace(time, unit=time.unit or unit_in_time_name(time.label))
    return replace(table, columns=others, time=time, time_place=place)


def _is_time_by_unit(column: Column, place: int) -> bool:
    return place == 0 and seconds_in(column.unit) is not None and _ascends(column)


def _ascends(column: Column) -> bool:
    values = column.values[np.isfinite(column.values)]
    return len(values) > 1 and float(np.mean(np.diff(values) >= 0.0)) > 0.99 and bool(values[-1] > values[0])
