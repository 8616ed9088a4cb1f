"""Tables that are parts of one: a file that was appended to, or whose clock restarts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from vibroimpact.hardware.formats.table import Column, Floats, Table

_MOST_RESTARTS = 100
_FEWEST_ROWS = 3
_LATE = 1.5
"""Distance of two parts, in intervals, above which the later one does not follow at once."""
_BACK_BY = 3.0
"""Step back of a clock, in intervals, above which it restarts; a smaller step is disorder."""


def joined(tables: Sequence[Table]) -> tuple[list[Table], list[str]]:
    """Return tables joined if they continue each other in time, and remarks; the time axis handles gaps."""
    result: list[Table] = []
    remarks: list[str] = []
    for table in tables:
        together = _continued(result[-1], table) if result else None
        if together is None:
            result.append(table)
            continue
        remarks.append(_joint_remark(result[-1], together, table.title or "a later part"))
        result[-1] = together
    return result, remarks


def _joint_remark(before: Table, together: Table, title: str) -> str:
    """Return the remark on the joint of two parts."""
    assert together.time is not None
    rows = len(before.columns[0].values)
    ends, begins = together.time.values[rows - 1 : rows + 1]
    usual = float(np.median(np.diff(together.time.values)))
    if begins - ends > _LATE * usual:
        return f"{title} begins {begins - ends:.6g} s after the last sample of the one before: they share one time axis"
    return f"{title} continues the one before: they are joined"


def _continued(before: Table, after: Table) -> Table | None:
    """Return both tables as one if the second continues the first later with the same columns, else None."""
    if [column.label for column in before.columns] != [column.label for column in after.columns]:
        return None
    if (
        before.vectors
        or len({len(column.values) for table in (before, after) for column in table.columns[1:]}) > 2
    ):
        return None
    first, second = _instants(before), _instants(after)
    if first is None or second is None or len(first) != len(before.columns[0].values):
        return None
    interval = before.columns[0].interval
    if interval != after.columns[0].interval or not second[0] > first[-1]:
        return None
    columns = [_appended(one, other) for one, other in zip(before.columns, after.columns, strict=True)]
    return replace(before, columns=columns, time=Column("instants", np.append(first, second), "s"))


def _instants(table: Table) -> Floats | None:
    """Return the instants of a table's rows, by its column or its header; None if its columns differ."""
    column = table.columns[0]
    if any(len(other.values) != len(column.values) or other.group != column.group for other in table.columns):
        return None
    if table.time is not None:
        return table.time.values
    if column.interval is not None:
        return np.asarray(column.start + column.interval * np.arange(len(column.values)), dtype=np.float64)
    return None


def _appended(one: Column, other: Column) -> Column:
    overrange = None
    if one.overrange is not None or other.overrange is not None:
        parts = [
            np.zeros(len(column.values), dtype=bool) if column.overrange is None else column.overrange
            for column in (one, other)
        ]
        overrange = np.concatenate(parts)
    return replace(one, values=np.append(one.values, other.values), overrange=overrange)


def split_at_restarts(table: Table) -> tuple[list[Table], list[str]]:
    """Return the parts of a table between restarts of its clock: several records in one file."""
    if table.time is None or len(table.time.values) < 2 * _FEWEST_ROWS or table.vectors:
        return [table], []
    time = table.time.values
    steps = np.diff(time)
    forward = steps[steps > 0.0]
    usual = float(np.median(forward)) if len(forward) else 0.0
    starts = np.flatnonzero(steps < -_BACK_BY * usual) + 1
    edges = [0, *starts.tolist(), len(time)]
    pieces = list(pairwise(edges))
    if (
        not len(starts)
        or len(starts) > _MOST_RESTARTS
        or min(end - begin for begin, end in pieces) < _FEWEST_ROWS
    ):
        return [table], []
    # a restarted clock begins at its first value; a misplaced row does not
    length = float(np.nanmax(time) - np.nanmin(time))
    if not np.all(np.abs(time[starts] - time[0]) <= 0.01 * length + 2.0 * usual):
        return [table], []
    remark = (
        f"the instants begin again {len(starts)} times: {len(pieces)} records, each on a time axis of its own"
    )
    return [_piece(table, begin, end, number) for number, (begin, end) in enumerate(pieces, 1)], [remark]


def _piece(table: Table, begin: int, end: int, number: int) -> Table:
    def cut(column: Column) -> Column:
        overrange = None if column.overrange is None else column.overrange[begin:end]
        return replace(column, values=column.values[begin:end], overrange=overrange)

    assert table.time is not None
    title = table.title if number == 1 else f"{table.title} record {number}".strip()
    columns = [cut(column) for column in table.columns]
    return replace(
        table, columns=[column for column in columns if len(column.values)], time=cut(table.time), title=title
    )
