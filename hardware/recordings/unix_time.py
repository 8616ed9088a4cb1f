"""Instants that count from 1970: a recording counts from its start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vibroimpact.hardware.formats.table import Column, Table
from vibroimpact.hardware.recordings.printed_grid import decimal_step

#: Seconds since 1970 from the year 2000 to 2100; no laboratory's clock runs for 30 years.
_EARLIEST, _LATEST = 946_684_800.0, 4_102_444_800.0
_PARTS = {1.0: "seconds", 1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}


def counted_from_start(tables: Sequence[Table]) -> tuple[list[Table], list[str], dict[str, str]]:
    """Let instants that count from 1970 count from the first of them; return tables, remarks and `source_date`.

    Instants with a unit are in s; those without one are in the unit that their size tells.
    """
    counting = [
        (table.time, part)
        for table in tables
        if table.time is not None and (part := _parts_of(table.time)) is not None
    ]
    if not counting:
        return list(tables), [], {}
    origin = min(float(time.values[np.isfinite(time.values)][0]) / part for time, part in counting)
    date = str(np.datetime64(round(origin * 1e6), "us"))
    what = " and ".join(dict.fromkeys(_PARTS[part] for _, part in counting))
    remark = f"the instants are {what} since 1970: they are counted from {date} (UTC)"
    return [_since(table, origin) for table in tables], [remark], {"source_date": date}


def _parts_of(time: Column) -> float | None:
    """Return how many of its units make a second, where instants count from 1970; None where they do not."""
    known = time.values[np.isfinite(time.values)]
    if not len(known):
        return None
    for part in _PARTS if not time.unit else (1.0,):
        if _EARLIEST * part <= known.min() and known.max() <= _LATEST * part:
            return part
    return None


def _since(table: Table, origin: float) -> Table:
    """Return a table whose instants count from an origin (s since 1970), if they counted from 1970.

    What binary took of their last digits is put back or dropped.
    """
    part = None if table.time is None else _parts_of(table.time)
    if table.time is None or part is None:
        return table
    values = table.time.values
    left = float(np.spacing(np.abs(values[np.isfinite(values)]).max())) / part
    step = decimal_step(values) / part or 10.0 ** np.ceil(np.log10(left))
    since = np.rint((values - origin * part) / part / step) * step
    return replace(table, time=replace(table.time, values=since, unit="s"))
