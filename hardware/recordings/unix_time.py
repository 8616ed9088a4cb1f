"""Instants that count from 1970, or days of a spreadsheet, as seconds from the start of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.hardware.formats.table import Column, Table
from vibroimpact.hardware.recordings.printed_grid import decimal_step

#: Seconds since 1970 from the year 2000 to 2100; no laboratory's clock runs for 30 years.
_EARLIEST, _LATEST = 946_684_800.0, 4_102_444_800.0
#: Days of a spreadsheet from 1982 to 2064; its day 0 is 1899-12-30.
_FIRST_DAY, _LAST_DAY = 30_000.0, 60_000.0
_DAY_ZERO, _DAY = np.datetime64("1899-12-30", "us"), 86_400.0
#: Steps below which numbers are no seconds (50 kHz), and above which they are (10 Hz; 2.4 hours if they were days).
_FASTEST, _SLOWEST = 2e-5, 0.1
#: Distance of an interval from a round one, and weight of digits that a person prints, both relative to the interval.
_ROUND, _PRINTED = 1e-5, 1e-3
_PARTS = {1.0: "seconds", 1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}


def counted_from_start(
    tables: Sequence[Table], rate: float | None = None
) -> tuple[list[Table], list[str], dict[str, str]]:
    """Return tables whose instants count from the first instead of 1970, with remarks and `source_date`.

    Instants with a unit are in s; without one, their size gives the unit.
    With the user's `rate`, instants are never days.
    """
    tables, days = _in_seconds_of_days(tables) if rate is None else (tables, "")
    if days:
        return (
            list(tables),
            [
                message(
                    f"the instants are days of a spreadsheet: they are counted from {days} (",
                    *(Argument("rate"), " if not)"),
                )
            ],
            {"source_date": days},
        )
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


def _in_seconds_of_days(tables: Sequence[Table]) -> tuple[Sequence[Table], str]:
    """Return tables with the days of a spreadsheet as s, and the first date; it is empty where no table has days.

    DatasetError: instants may be days or seconds.
    """
    found = [table.time for table in tables if table.time is not None and _are_days(table.time)]
    if not found:
        return tables, ""
    times = [time.values[np.isfinite(time.values)] for time in found]
    origin = min(float(values[0]) for values in times)
    date = str(_DAY_ZERO + np.timedelta64(round(origin * _DAY * 1e6), "us"))
    left = float(np.spacing(max(float(values[-1]) for values in times))) * _DAY

    def counted(time: Column) -> Column:
        digits = 10.0 ** np.ceil(np.log10(left))
        return replace(time, values=np.rint((time.values - origin) * _DAY / digits) * digits, unit="s")

    return [
        replace(table, time=counted(table.time))
        if table.time is not None and _are_days(table.time)
        else table
        for table in tables
    ], date


def _are_days(time: Column) -> bool:
    """Whether instants without a unit are days of a spreadsheet: odd as seconds, but round as days.

    DatasetError: they may be either.
    """
    known = time.values[np.isfinite(time.values)]
    if time.unit or time.dated or len(known) < 3 or known[0] < _FIRST_DAY or known[-1] > _LAST_DAY:
        return False
    step = float(np.median(np.diff(known)))
    # seconds are printed with few digits, days with all digits
    if not 0.0 < step < _SLOWEST or decimal_step(known) >= _PRINTED * step:
        return False
    rounding = 2.0 * float(np.spacing(known[-1])) / step
    if not _is_round(step * _DAY, rounding):
        return False
    if step > _FASTEST and _is_round(step, rounding):
        raise DatasetError(
            message(
                f"column of instants: expected seconds, got {known[0]:.6g} and on in steps of {step:.3g}: seconds, "
                "or days of a spreadsheet. Give ",
                *(Argument("rate"), " (samples per second)."),
            )
        )
    return True


def _is_round(interval: float, rounding: float) -> bool:
    """Whether an interval, or its rate, is a whole number, within the relative error `rounding` of binary."""
    larger = max(interval, 1.0 / interval)
    return abs(larger - round(larger)) < (_ROUND + rounding) * larger


def _parts_of(time: Column) -> float | None:
    """Return the number of its units in a second, if instants count from 1970, else None."""
    known = time.values[np.isfinite(time.values)]
    if not len(known):
        return None
    for part in _PARTS if not time.unit else (1.0,):
        if _EARLIEST * part <= known.min() and known.max() <= _LATEST * part:
            return part
    return None


def _since(table: Table, origin: float) -> Table:
    """Return a table whose instants count from an origin (s since 1970), if they counted from 1970.

    Binary rounding of their last digits is repaired or dropped.
    """
    part = None if table.time is None else _parts_of(table.time)
    if table.time is None or part is None:
        return table
    values = table.time.values
    left = float(np.spacing(np.abs(values[np.isfinite(values)]).max())) / part
    step = decimal_step(values) / part or 10.0 ** np.ceil(np.log10(left))
    since = np.rint((values - origin * part) / part / step) * step
    return replace(table, time=replace(table.time, values=since, unit="s"))
