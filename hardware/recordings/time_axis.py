"""Decides the instants of a column's samples from all information in a file, and gives the reason.

Sources, in order: the rate that the user gives; the column of instants; the interval of the header. If instants and
header agree, and the instants only lack digits, the header's exact interval is used. If they contradict each other,
the instants are used, and the spread is the uncertainty of the interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import TimeAxis
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.hardware.formats.table import MOST_SAMPLES, Column, Flags, Floats, Table
from vibroimpact.hardware.recordings.gaps import AGREEMENT, EVEN, Gaps, are_whole, gaps_in, pace_of
from vibroimpact.hardware.recordings.printed_grid import digits_of

_ROUNDED = 0.7
"""Largest residual, in units of the last digit, of a line through instants that are only rounded."""
_FEW_HOLES = 0.1
"""Largest share of missing samples for which whole multiples of an interval are a grid with holes."""
_MOST_DOUBTFUL = 0.1
"""Share of rows out of order or repeated, above which the instants are refused."""
_MOST_FILLED = 10
"""Ratio of samples to rows, above which gaps are not filled: this is another kind of record."""


@dataclass(frozen=True, slots=True)
class Placement:
    """The place of a column's rows in time."""

    axis: TimeAxis
    row: NDArray[np.intp]
    """Row of the file for each sample, shape (sample,); -1 for a missing sample."""
    suspect: Flags
    """Samples with a doubtful instant, shape (sample,)."""
    remarks: tuple[str, ...] = ()

    @property
    def missing(self) -> int:
        """Number of samples that the file skips."""
        return int(np.sum(self.row < 0))


def place(
    table: Table, column: Column, rate: float | None = None, start: float | None = None, trigger: str = ""
) -> Placement:
    """Return the place of one column of a table in time; a column of instants, if there is one, is in s.

    `rate` (samples per second) and `start` (instant of the first sample, s) are the user's, and override the file.
    `trigger` is the start event of the axis. DatasetError: nothing gives the instants of the samples, or the instants
    are in disorder.
    """
    placement = _placed(table, column, rate)
    time = placement.axis.time
    if start is not None:
        time = time - time[0] + start
    return replace(placement, axis=replace(placement.axis, time=time, trigger=trigger))


def _placed(table: Table, column: Column, rate: float | None) -> Placement:
    length = len(column.values)
    instants = table.clock_of(column)
    if column.interval is None and table.rate is not None:
        column = replace(column, interval=1.0 / table.rate)
    if rate is not None:
        return _by_rate(rate, column, instants)
    if instants is not None and length > 1:
        heading = "" if table.time is None else table.time.label
        return _by_instants(instants, column, _comparable(table, column), length, heading)
    if column.interval is not None and np.isfinite(column.interval):
        source = "the sampling interval of the header"
        late = f"{column.label}: by the header it begins at {column.start:.6g} s ({length} samples)"
        return _even(column.start, column.interval, length, source, [late] if column.group else [])
    raise DatasetError(
        message(
            f"{column.label}: expected a column of instants or a sampling interval, got neither. Give ",
            *(Argument("rate"), " (samples per second), or ", Argument("time_column"), ". "),
            _columns_tried(table),
        )
    )


def _columns_tried(table: Table) -> str:
    """Return the column that was tried as instants, and the option that selects it, in words."""
    for number, column in enumerate(table.columns, 1):
        values = column.values[np.isfinite(column.values)]
        if len(values) > 1 and bool(np.all(np.diff(values) > 0.0)):
            return message(
                f"Tried: column {number}, {column.label[:40]!r}, ascends from {values[0]:.6g} to {values[-1]:.6g}, but "
                "its heading names no time; ",
                *(Argument("time_column", str(number)), " takes it as s."),
            )
    names = ", ".join(repr(column.label[:40]) for column in table.columns[:5])
    return f"Tried: {names}: no heading names a time, and no column ascends."


def _even(
    start: float, interval: float, length: int, source: str, remarks: Sequence[str], uncertainty: float = 0.0
) -> Placement:
    time = np.asarray(start + interval * np.arange(length), dtype=np.float64)
    if not np.all(np.isfinite(time)) or (length > 1 and not np.all(np.diff(time) > 0.0)):
        raise DatasetError(
            f"interval: expected one of which {length} samples can be counted, got {interval:g} s."
        )
    axis = TimeAxis(time, interval, uncertainty, source)
    return Placement(axis, np.arange(length), np.zeros(length, dtype=bool), tuple(remarks))


def _by_rate(rate: float, column: Column, instants: Floats | None) -> Placement:
    """Return the time axis with the rate of the user; gaps in the file's own instants remain gaps."""
    interval, length = 1.0 / rate, len(column.values)
    begin, remarks = column.start, []
    gaps, count = None, np.arange(length)
    if instants is not None and np.any(np.isfinite(instants)):
        known = np.flatnonzero(np.isfinite(instants))
        begin = float(instants[known[0]]) - interval * int(known[0])
        remarks += _pace_remarks(known, instants[known], interval)
        gaps = gaps_in(known, instants[known], interval)
    if column.interval is not None and abs(column.interval - interval) > AGREEMENT * interval:
        remarks.append(f"the header says {column.interval:.6g} s an interval; the rate given is used instead")
    if gaps is not None and gaps.on_grid and _is_bearable(length + gaps.missing, length):
        count = count + gaps.before(count)
        remarks.append(gaps.remark())
    elif gaps is not None:
        remarks.append(
            f"the rate given counts the rows one after the other, and closes {gaps.text()} in the instants of the file"
        )
    return _on_grid(begin, interval, count, "the rate given by the user", remarks)


def _pace_remarks(row: NDArray[np.intp], instants: Floats, interval: float) -> list[str]:
    """Return a remark if the instants of rows contradict an interval by more than their digits."""
    steps, rows = np.diff(instants), np.diff(row)
    usual = float(np.median(steps)) if len(steps) else 0.0
    inner = steps <= 1.5 * usual if usual > 0.0 else np.ones(len(steps), dtype=bool)
    if not np.any(inner):
        return []
    pace = pace_of(steps[inner], rows[inner], digits_of(instants), interval)
    if pace == interval:
        return []
    return [f"the instants of the file are {pace:.6g} s apart; the rate given is used instead"]


def _is_bearable(samples: int, rows: int) -> bool:
    """Whether rows may be filled up to this number of samples."""
    return samples <= min(MOST_SAMPLES, _MOST_FILLED * rows + 1000)


def _on_grid(
    start: float, interval: float, count: NDArray[np.intp], source: str, remarks: Sequence[str]
) -> Placement:
    """Place rows on an even grid, each at its count; samples without a row are missing."""
    placed = _even(start, interval, int(count[-1]) + 1 if len(count) else 0, source, remarks)
    row = np.full(len(placed.axis.time), -1, dtype=np.intp)
    row[count] = np.arange(len(count))
    return replace(placed, row=row)


def _comparable(table: Table, column: Column) -> list[float]:
    """Return the intervals in the header for this column, and for those recorded with it."""
    length = len(column.values)
    beside = [
        other.interval
        for other in table.columns
        if other.interval is not None and other.group == column.group and 2 * len(other.values) > length
    ]
    if table.rate is not None:
        beside.append(1.0 / table.rate)
    return [interval for interval in beside if np.isfinite(interval)]


def _by_instants(
    instants: Floats, column: Column, declared: Sequence[float], length: int, heading: str = ""
) -> Placement:
    """Place the rows by a column of instants, which may end before the column does."""
    known = np.isfinite(instants)
    line = _straight(np.flatnonzero(known), instants[known])
    if line is not None and not (line.is_rounded and _has_few_holes(instants[known])):
        return _by_line(line, instants, column, declared, length)
    if length > len(instants):
        raise DatasetError(
            f"{column.label}: expected an instant for each of {length} rows, got {len(instants)}, unevenly spaced."
        )
    return _uneven(instants, heading)


def _has_few_holes(instants: Floats) -> bool:
    """Whether instants lie exactly on a grid with few holes: 0, 1, 3, 4 is not a rounded 0, 1.3, 2.6, 3.9."""
    steps = np.diff(instants)
    usual = float(np.median(steps))
    if usual <= 0.0:
        return False
    jumps = steps / usual
    return are_whole(jumps) and 0.0 < float(np.sum(np.rint(jumps) - 1.0)) <= _FEW_HOLES * len(instants)


@dataclass(frozen=True, slots=True)
class _Line:
    """Instants on a straight line over their count: start and interval, s, and the step of their digits, s."""

    start: float
    interval: float
    digits: float
    is_rounded: bool = False


def _straight(count: NDArray[np.intp], instants: Floats) -> _Line | None:
    """Return the line through instants that are even up to their digits; None for uneven ones."""
    if len(instants) < 2 or instants[-1] <= instants[0]:
        return None
    span = int(count[-1] - count[0])
    interval = float(instants[-1] - instants[0]) / span
    centred = count - count.mean()
    beyond = instants - instants[0]  # seconds since 1970 would leave a sum few digits
    slope = float(np.sum(centred * beyond) / np.sum(centred * centred))
    residual = beyond - beyond.mean() - slope * centred
    digits = digits_of(instants)
    allowed = max(EVEN * interval, _ROUNDED * digits)
    worst = float(np.abs(residual).max())
    # two samples prove no line, nor do rounded instants coarser than their whole span
    is_exact = len(instants) > 2 and worst <= 1e-6 * interval
    if slope <= 0.0 or worst > allowed or (digits * 4.0 > span * interval and not is_exact):
        return None
    start = float(instants[0] + beyond.mean() - slope * count.mean())
    if worst <= 1e-6 * interval:
        return _Line(float(instants[0] - count[0] * interval), interval, digits)
    return _Line(start, slope, digits, digits > EVEN * interval)


def _by_line(
    line: _Line, instants: Floats, column: Column, declared: Sequence[float], length: int
) -> Placement:
    remarks = _line_remarks(line, instants, length)
    # possible rotation of the line by the printed digits
    turn = line.digits / (line.interval * max(len(instants) - 1, 1))
    agreeing = [
        interval
        for interval in declared
        if abs(interval - line.interval) <= (AGREEMENT + turn) * line.interval
    ]
    if len(agreeing) < len(declared):
        spread = [line.interval, *declared]
        uncertainty = (max(spread) - min(spread)) / line.interval
        intervals = ", ".join(f"{interval:.6g}" for interval in sorted(set(declared)))
        remarks.append(
            f"the time axes conflict: {intervals} s an interval in the header, {line.interval:.6g} s in the column of "
            f"instants, which is used since it was written with the rows; all frequencies are uncertain by "
            f"{uncertainty:.1%}"
        )
        source = f"the column of instants ({line.interval:.6g} s); the header says {intervals} s"
        return _even(line.start, line.interval, length, source, remarks, uncertainty)
    if declared and line.is_rounded:
        own = column.interval if column.interval is not None else agreeing[0]
        begin = float(instants[0]) if np.isfinite(instants[0]) else line.start
        source = "the first instant, and the sampling interval of the header"
        return _even(begin, own, length, source, remarks)
    placed = _even(line.start, line.interval, length, "the column of instants", remarks)
    placed.suspect[: len(instants)] = ~np.isfinite(instants)
    return placed


def _line_remarks(line: _Line, instants: Floats, length: int) -> list[str]:
    remarks = []
    if line.is_rounded:
        remarks.append(
            f"the instants are rounded to {line.digits:.0e} s and {line.interval:.6g} s apart: they are taken as even"
        )
    missing = int(np.sum(~np.isfinite(instants)))
    if missing:
        remarks.append(f"{missing} rows have no instant; they are counted on")
    if length > len(instants):
        remarks.append(f"{length - len(instants)} rows after the last instant are counted on from it")
    return remarks


def _uneven(instants: Floats, heading: str) -> Placement:
    """Place rows by uneven instants: gaps, jitter, repetitions, disorder."""
    row, suspect, remarks = _in_order(
        instants, f"column of instants{f', {heading[:40]!r}' if heading else ''}"
    )
    time = instants[row]
    if len(time) < 2:
        return Placement(TimeAxis(time, None, source="the column of instants"), row, suspect, tuple(remarks))
    filled = _with_gaps(time)
    if filled is None:
        steps = np.diff(time)
        remarks.append(
            f"the samples are not evenly spaced ({steps.min():.6g} to {steps.max():.6g} s apart): "
            "their instants are kept"
        )
        axis = TimeAxis(time, None, source="the column of instants, uneven")
        return Placement(axis, row, suspect, tuple(remarks))
    gaps, line = filled
    count = np.arange(len(row)) + gaps.before(np.arange(len(row)))
    source = "the column of instants, its gaps filled"
    placed = _on_grid(line.start, line.interval, count, source, [*remarks, gaps.remark()])
    placed.suspect[count] = suspect
    return replace(placed, row=np.where(placed.row < 0, -1, row[placed.row]))


def _in_order(instants: Floats, title: str) -> tuple[NDArray[np.intp], Flags, list[str]]:
    """Return rows in the order of their instants, each instant once; too much disorder is refused."""
    known = np.flatnonzero(np.isfinite(instants))
    remarks = []
    if len(known) < len(instants):
        remarks.append(f"{len(instants) - len(known)} rows without an instant are left out")
    if not len(known):
        raise DatasetError(
            message(
                f"{title}: expected numbers, got none. Give ",
                *(Argument("rate"), ", or another ", Argument("time_column"), "."),
            )
        )
    order = known[np.argsort(instants[known], kind="stable")]
    back = int(np.sum(np.diff(instants[known]) < 0.0))
    moved = order != known
    again = np.append(False, np.diff(instants[order]) == 0.0)
    if back + int(again.sum()) > _MOST_DOUBTFUL * len(known):
        raise DatasetError(
            message(
                f"{title}: expected them to ascend, got {back} steps back and {int(again.sum())} repeated "
                f"in {len(known)} rows. Give ",
                *(Argument("rate"), ", or name another ", Argument("time_column"), "."),
            )
        )
    if back:
        remarks.append(
            f"instants go back {back} times: the {int(moved.sum())} rows are put in order and marked suspect"
        )
    if again.any():
        remarks.append(
            f"{int(again.sum())} rows repeat an instant: the first of each is kept and marked suspect"
        )
    repeated = np.append(again[1:], False)
    return order[~again], (moved | repeated)[~again], remarks


def _with_gaps(time: Floats) -> tuple[Gaps, _Line] | None:
    """Return the gaps in instants on an otherwise even grid, and that grid; None without one."""
    count = np.arange(len(time))
    gaps = gaps_in(count, time)
    if gaps is None or not gaps.on_grid or not _is_bearable(len(time) + gaps.missing, len(time)):
        return None
    line = _straight(count + gaps.before(count), time)
    return None if line is None else (gaps, line)
