"""The columns of a file to import, and their column of instants, by the user's choice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.hardware.formats.labels import seconds_in
from vibroimpact.hardware.formats.table import Column, RawFile, Table
from vibroimpact.hardware.recordings.settings import ImportSettings
from vibroimpact.orchestrator.scene.problems import nearest

NO_COLUMN = "none"


def chosen_tables(raw: RawFile, settings: ImportSettings) -> list[Table]:
    """Return the tables of a file with the selected columns, with instants set apart and in s.

    Numbers of columns count from 1 through all columns of all tables, including instants at their place in the file.
    DatasetError: a named column is missing, or the instants are doubtful.
    """
    tables = list(raw.tables)
    numbered = [column for table in tables for column in _in_file_order(table)]
    if settings.time_column is not None:
        tables = _with_time_column(tables, settings.time_column, numbered)
    if settings.columns:
        tables = _with_columns(tables, settings.columns, numbered)
    return [_in_seconds(_with_clear_dates(table, settings)) for table in tables if table.columns]


def _with_clear_dates(table: Table, settings: ImportSettings) -> Table:
    """Return the table without doubtful instants if a rate replaces them; else raise DatasetError."""
    if table.time is None or not table.time.ambiguity:
        return table
    if settings.rate is not None:
        return replace(table, time=None)
    raise DatasetError(
        message(
            f"column of instants, {table.time.label!r}: expected dates that can be read in one way, got others: "
            f"{table.time.ambiguity}. Give ",
            *(Argument("dates", "day-first"), " or ", Argument("dates", "month-first"), "."),
        )
    )


def _in_file_order(table: Table) -> list[Column]:
    """Return the columns in the order of the file, including the instants."""
    columns = list(table.columns)
    if table.time is not None:
        columns.insert(table.time_place, table.time)
    return columns


def _find(selector: str | int, columns: Sequence[Column], key: str) -> Column:
    """Return the column with a number or heading."""
    labels = [column.label for column in columns]
    if selector in labels:
        return columns[labels.index(str(selector))]
    number = int(selector) if str(selector).isascii() and str(selector).isdecimal() else 0
    if 1 <= number <= len(columns):
        return columns[number - 1]
    hint = nearest(selector, labels)
    raise DatasetError(
        f"{key}: expected a heading or a number from 1 to {len(columns)}, got {str(selector)[:60]!r}. {hint}"
    )


def _with_time_column(
    tables: Sequence[Table], selector: str | int, numbered: Sequence[Column]
) -> list[Table]:
    """Return the tables with another column of instants, or with none."""
    chosen = None if selector == NO_COLUMN else _find(selector, numbered, "time_column")
    found = []
    for table in tables:
        columns = _in_file_order(table)
        if chosen is None:
            found.append(replace(table, columns=columns, time=None))
        elif any(column is chosen for column in columns):
            others = [column for column in columns if column is not chosen]
            found.append(replace(table, columns=others, time=chosen))
        else:
            found.append(table)
    return found


def _with_columns(
    tables: Sequence[Table], selector: Sequence[str | int], numbered: Sequence[Column]
) -> list[Table]:
    chosen = [_find(one, numbered, "columns") for one in selector]
    kept = []
    for table in tables:
        columns = [column for column in chosen if any(column is own for own in table.columns)]
        if table.time is not None and any(column is table.time for column in chosen) and not columns:
            columns, table = [table.time], replace(table, time=None)
        kept.append(replace(table, columns=columns))
    return kept


def _in_seconds(table: Table) -> Table:
    """Return the table with its instants in s."""
    if table.time is None:
        return table
    factor = seconds_in(table.time.unit) or 1.0
    if factor == 1.0:
        return table
    with np.errstate(over="ignore"):
        return replace(table, time=replace(table.time, values=table.time.values * factor, unit="s"))
