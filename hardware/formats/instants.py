"""Instants from cells of text: dates with times of day, clocks of 12 and 24 hours, minutes and seconds."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.hardware.formats.table import Column, Floats

DAY_FIRST, MONTH_FIRST = "day-first", "month-first"
"""Orders of day and month in a date such as 02/03/2019."""

_CLOCK = (
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2})"
    r"(?::(?P<second>\d{2})(?:[.,](?P<fraction>\d{1,18})|:(?P<thousandths>\d{3}))?)?"
    r"(?:[ \u202f\u00a0]?(?P<half>[AaPp])\.?[Mm]\.?)?"
)
_DATE = (
    r"(?:(?P<year>\d{4})[-/.](?P<month>\d{1,2})[-/.](?P<day>\d{1,2})"
    r"|(?P<one>\d{1,2})(?P<mark>[-/.])(?P<other>\d{1,2})(?P=mark)(?P<late>\d{4}|\d{2})"
    r"|(?P<named_day>\d{1,2})[- ](?P<name>[A-Za-z]{3})[- ](?P<named_year>\d{4}))"
)
_STAMP = re.compile(rf"{_DATE}(?:T|,? {{1,4}}){_CLOCK}(?P<zone>Z| ?[-+]\d{{2}}:?\d{{2}})?", re.ASCII)
_TIME_OF_DAY = re.compile(rf"{_CLOCK}", re.ASCII)
_MINUTES = re.compile(r"(?P<minute>\d{1,4}):(?P<second>[0-5]\d)[.,](?P<fraction>\d{1,9})", re.ASCII)
_DAY = re.compile(r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}", re.ASCII)
_MONTHS = {
    name: number
    for number, name in enumerate(
        ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"), 1
    )
}
_CENTURY = 2000
"""Century of years with two digits: files of instruments are younger."""
_LONGEST_QUOTE = 40
_DAY_SECONDS, _HOUR_SECONDS = 86_400.0, 3_600.0
_NEXT_DAY = np.datetime64("1970-01-02", "ns")
"""Day of times without a date: they count as 1970-01-01."""
_EVEN_STEPS = 1.5
"""Largest step, in usual steps, of a clock that runs over midnight without a pause."""

_Stamps = NDArray[np.datetime64]


@dataclass(frozen=True, slots=True)
class _Read:
    """Instants of a column: dates, text that is no instant, and whether day and month are interchangeable."""

    stamps: _Stamps
    strange: list[tuple[int, str]]
    is_swappable: bool


def is_date(text: str) -> bool:
    """Whether a cell is a time of day, with or without its date, or minutes and seconds.

    >>> is_date("2026-07-30 12:00:01.5"), is_date("12:00:01"), is_date("2026"), is_date("2026-07-30")
    (True, True, False, False)
    >>> is_date("02/03/2019 11:59:00 PM"), is_date("2019-10-27T00:30:00+02:00"), is_date("00:05.8")
    (True, True, True)
    """
    cell = text.strip()
    return _STAMP.fullmatch(cell) is not None or is_clock(cell) or _MINUTES.fullmatch(cell) is not None


def is_clock(text: str) -> bool:
    """Whether a cell is a time of day without a date; minutes and hours alone may mean something else.

    >>> is_clock("9:15:00"), is_clock("09:15 AM"), is_clock("09:15")
    (True, True, False)
    """
    match = _TIME_OF_DAY.fullmatch(text.strip())
    return match is not None and (match["second"] is not None or match["half"] is not None)


def is_day(text: str) -> bool:
    """Whether a cell is a date alone, without the time of a sample.

    >>> is_day("2026-07-30"), is_day("30.07.2026"), is_day("2026.5")
    (True, True, False)
    """
    return _DAY.fullmatch(text.strip()) is not None


def date_of(text: str, order: str = DAY_FIRST) -> np.datetime64 | None:
    """Return the instant of a time of day with or without its date (UTC if it has an offset); None for no instant.

    >>> str(date_of("2026/07/30 20:07:43.5")), date_of("2026/13/30 20:07"), date_of("today")
    ('2026-07-30T20:07:43.500000000', None, None)
    >>> str(date_of("3/12/2019 12:30:00 AM", "month-first")), str(date_of("2019-10-27T00:30:00+02:00"))
    ('2019-03-12T00:30:00.000000000', '2019-10-26T22:30:00.000000000')
    """
    cell = text.strip()
    minutes = _MINUTES.fullmatch(cell)
    if minutes is not None:
        return _at("1970-01-01", 0, int(minutes["minute"]), int(minutes["second"]), minutes["fraction"])
    match = _STAMP.fullmatch(cell) or (_TIME_OF_DAY.fullmatch(cell) if is_clock(cell) else None)
    if match is None:
        return None
    hour = _hour(match)
    day = _day(match, order) if match.re is _STAMP else "1970-01-01"
    minute, second = int(match["minute"]), int(match["second"] or 0)
    if hour is None or day is None or minute > 59 or second > 59:
        return None
    stamp = _at(day, hour, minute, second, match["fraction"] or match["thousandths"] or "")
    return stamp if stamp is None else stamp - _offset(match)


def _hour(match: re.Match[str]) -> int | None:
    """Return the hour of a clock; None for an invalid hour."""
    hour, half = int(match["hour"]), match["half"]
    if half is None:
        return hour if hour <= 23 else None
    if not 1 <= hour <= 12:
        return None
    return hour % 12 + (12 if half in "Pp" else 0)


def _day(match: re.Match[str], order: str) -> str | None:
    """Return the date of a stamp in ISO form; None for an invalid month."""
    if match["year"] is not None:
        year, month, day = int(match["year"]), int(match["month"]), int(match["day"])
    elif match["name"] is not None:
        year, day = int(match["named_year"]), int(match["named_day"])
        month = _MONTHS.get(match["name"].lower(), 0)
    else:
        one, other, year = int(match["one"]), int(match["other"]), int(match["late"])
        year += _CENTURY if len(match["late"]) == 2 else 0
        # dates with points always have the day first
        day, month = (one, other) if match["mark"] == "." or order != MONTH_FIRST else (other, one)
    return f"{year:04d}-{month:02d}-{day:02d}" if 1 <= month <= 12 else None


def _at(day: str, hour: int, minute: int, second: int, fraction: str) -> np.datetime64 | None:
    """Return an instant of a day, to the nanosecond; None for an invalid day."""
    nanoseconds = (hour * 3600 + minute * 60 + second) * 10**9 + int(f"{fraction:0<9.9}")
    try:
        return np.datetime64(day, "ns") + np.timedelta64(nanoseconds, "ns")
    except (ValueError, OverflowError):
        return None


def _offset(match: re.Match[str]) -> np.timedelta64:
    """Return the offset of a stamp's clock ahead of UTC."""
    zone = match["zone"] if match.re is _STAMP else None
    if zone is None or zone == "Z":
        return np.timedelta64(0, "ns")
    digits = zone.strip()[1:].replace(":", "")
    minutes = int(digits[:2]) * 60 + int(digits[2:])
    return np.timedelta64((-minutes if "-" in zone else minutes) * 60 * 10**9, "ns")


def read_instants(cells: Sequence[str], is_marker: Callable[[str], bool], order: str = "") -> Column:
    """Return cells of dates and times of day as seconds after the first one.

    Dates such as 02/03/2019 may be valid with the day first and with the month first. If the two orders give different
    instants, `ambiguity` of the column reports it. `is_marker` recognises cells of missing samples. `order` is
    `day-first` or `month-first`; empty: found from the dates.
    """
    read = _read(cells, is_marker, order or DAY_FIRST)
    known = _seconds(read.stamps, cells)
    if order or not read.is_swappable:
        return _column(known, read)
    other = _read(cells, is_marker, MONTH_FIRST)
    seconds = _seconds(other.stamps, cells)
    if len(other.strange) != len(read.strange):
        return _column(*((known, read) if len(read.strange) < len(other.strange) else (seconds, other)))
    if np.array_equal(known, seconds, equal_nan=True):
        return _column(known, read)
    fitting = [(one, found) for one, found in ((known, read), (seconds, other)) if _goes_on(one)]
    if len(fitting) == 1:
        return _column(*fitting[0])
    first = next(cell.strip() for cell in cells if is_date(cell))
    ambiguity = f"the dates, such as {first[:_LONGEST_QUOTE]!r}, may have the day or the month first"
    return _column(known, read, ambiguity)


def _column(seconds: Floats, read: _Read, ambiguity: str = "") -> Column:
    dated = not bool(np.all(np.isnan(seconds)))
    return Column("", seconds, dated=dated, strange=read.strange, ambiguity=ambiguity)


def _read(cells: Sequence[str], is_marker: Callable[[str], bool], order: str) -> _Read:
    """Return the instants of cells with day and month in one order."""
    strange: list[tuple[int, str]] = []
    stamps = np.full(len(cells), np.datetime64("NaT", "ns"))
    for row, cell in enumerate(cells):
        stamp = date_of(cell, order)
        if stamp is not None:
            stamps[row] = stamp
        elif not is_marker(cell):
            strange.append((row, cell.strip()[:_LONGEST_QUOTE]))
    first = next((match for cell in cells if (match := _STAMP.fullmatch(cell.strip()))), None)
    return _Read(stamps, strange, first is not None and first["mark"] in ("/", "-"))


def _seconds(stamps: _Stamps, cells: Sequence[str]) -> Floats:
    """Return instants as seconds after the first one; a clock without a date runs on over midnight."""
    known = stamps[~np.isnat(stamps)]
    if not len(known):
        return np.full(len(stamps), np.nan)
    seconds = np.asarray((stamps - known[0]) / np.timedelta64(1, "ns") * 1e-9, dtype=np.float64)
    if all(stamp < _NEXT_DAY for stamp in known):
        of_minutes = all(_MINUTES.fullmatch(cell.strip()) for cell in cells if cell.strip())
        period = _HOUR_SECONDS if of_minutes else _DAY_SECONDS
        seconds += period * _wraps(seconds, period)
    return seconds


def _wraps(seconds: Floats, period: float) -> Floats:
    """Return the restarts of a clock up to each row: steps back by half its period; smaller ones are disorder."""
    there = np.flatnonzero(np.isfinite(seconds))
    passed = np.zeros(len(seconds))
    passed[there[1:]] = np.diff(seconds[there]) < -0.5 * period
    counted: Floats = np.cumsum(passed)
    return counted


def _goes_on(seconds: Floats) -> bool:
    """Whether instants ascend in steps of less than a day without a pause."""
    steps = np.diff(seconds[np.isfinite(seconds)])
    if not len(steps) or steps.min() <= 0.0:
        return False
    return bool(steps.max() <= _EVEN_STEPS * np.median(steps) and steps.max() < 0.5 * _DAY_SECONDS)
