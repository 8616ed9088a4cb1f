"""LabVIEW measurement files (.lvm): a header for the file, one for each segment, and rows of text.

The source is National Instruments, "Specification for the LabVIEW Measurement File (.lvm)". `X_Columns` gives the
number of columns of instants: none, one, or one per channel. `Multi_Headings` says whether each segment repeats its
header.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import message
from vibroimpact.hardware.formats.cells import is_marker, is_number, read_cells, split_line
from vibroimpact.hardware.formats.clock_columns import with_time
from vibroimpact.hardware.formats.cut_off import without_cut_cells
from vibroimpact.hardware.formats.instants import date_of
from vibroimpact.hardware.formats.labels import is_time_name, seconds_in, split_label
from vibroimpact.hardware.formats.table import Column, RawFile, Table
from vibroimpact.hardware.formats.text import columns_of

SIGNATURE = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";"}
_MOST_SEGMENTS = 1000

Header = Mapping[str, Sequence[str]]


@dataclass(frozen=True, slots=True)
class _Segment:
    """One segment: its header by key (cells after the key), its headings and its rows."""

    header: Header
    headings: Sequence[str]
    rows: Sequence[str]


def read_labview(content: str) -> RawFile:
    """Return the content of a LabVIEW measurement file; DatasetError for a header without end, or without rows."""
    lines, special = _without_special_blocks(content.splitlines())
    separator = _separator(lines)
    header, after = _header(lines, 0, separator)
    decimal = _first(header, "Decimal_Separator", ".")
    decimal = decimal if decimal in (".", ",") and decimal != separator else "."
    remarks = [f"{special} special blocks of the file are left out"] if special else []
    tables: list[Table] = []
    origin: np.datetime64 | None = None
    for number, segment in enumerate(_segments(lines, after, separator, decimal), 1):
        rows, cut = without_cut_cells(segment.rows, content, separator, decimal)
        begins = _earliest(segment.header) or _earliest(header)
        origin = begins if origin is None else origin
        late = _seconds_between(origin, begins)
        title = "" if number == 1 else f"segment {number}"
        # channels with equal starts share one trigger, in any segment
        own = "" if begins is not None and not late else title
        found, more = _tables(replace(segment, rows=rows), header, separator, decimal, late, own)
        tables += found
        remarks += [message(f"{title}: ", line) if title else line for line in (*more, *cut)]
    if not tables:
        raise DatasetError(
            "expected rows of numbers after the header, got none. The measurement holds no data."
        )
    attrs = {} if origin is None else {"source_date": str(np.datetime_as_string(origin, unit="us"))}
    if _first(header, "Operator", ""):
        attrs["source_operator"] = _first(header, "Operator", "")
    version = _first(header, "Writer_Version", "unknown")
    return RawFile(f"LabVIEW measurement file, version {version}", tables, remarks, attrs)


def _without_special_blocks(lines: Sequence[str]) -> tuple[list[str], int]:
    """Return the lines outside blocks of other programs (`***Start_Special***` and on), and the number of blocks."""
    kept, blocks, inside = [], 0, False
    for line in lines:
        if line.startswith("***Start_Special***"):
            inside, blocks = True, blocks + 1
        elif line.startswith("***End_Special***"):
            inside = False
        elif not inside:
            kept.append(line)
    return kept, blocks


def _separator(lines: Sequence[str]) -> str:
    for line in lines[:40]:
        if line.startswith("Separator"):
            rest = line.removeprefix("Separator")
            return _SEPARATORS.get(rest.strip("\t,; ").lower(), rest[:1] or "\t")
    following = lines[0].removeprefix(SIGNATURE)[:1]
    return following if following in ("\t", ",", ";") else "\t"


def _header(lines: Sequence[str], start: int, separator: str) -> tuple[dict[str, list[str]], int]:
    """Return the entries of a header by key, and the number of the line after it."""
    entries: dict[str, list[str]] = {}
    for place in range(start, len(lines)):
        key, *cells = split_line(lines[place], separator)
        if key == _END:
            return entries, place + 1
        if key:
            entries[key] = cells
    raise DatasetError(f"expected the line {_END}, got the end of the file. The file is cut off.")


def _first(header: Header, key: str, default: str) -> str:
    return next((cell for cell in header.get(key, ()) if cell), default)


def _segments(lines: Sequence[str], start: int, separator: str, decimal: str) -> list[_Segment]:
    """Return the segments; a file without segment headers is one segment."""
    found: list[_Segment] = []
    place = start
    while place < len(lines):
        header: dict[str, list[str]] = {}
        if not any(character.strip() for character in lines[place].split(separator)):
            place += 1
            continue
        if _starts_header(lines, place, separator, decimal):
            header, place = _header(lines, place, separator)
        headings: list[str] = []
        first = place
        if place < len(lines) and not _is_row(lines[place], separator, decimal):
            headings, first = split_line(lines[place], separator), place + 1
        end = first
        while end < len(lines) and _is_row(lines[end], separator, decimal):
            end += 1
        if end == place:
            got = repr(lines[place][:40]) if place < len(lines) else "the end of the file"
            raise DatasetError(f"line {place + 1}: expected a row of numbers, got {got}.")
        if end > first:
            found.append(_Segment(header, headings, lines[first:end]))
        if len(found) > _MOST_SEGMENTS:
            raise DatasetError(f"expected at most {_MOST_SEGMENTS} segments, got more.")
        place = end
    return found


def _starts_header(lines: Sequence[str], place: int, separator: str, decimal: str) -> bool:
    """Whether a header begins here: its end comes before any row of numbers."""
    for line in lines[place : place + 60]:
        if line.startswith(_END):
            return True
        if _is_row(line, separator, decimal):
            return False
    return False


def _is_row(line: str, separator: str, decimal: str) -> bool:
    """Whether a line has numbers; its last cell may be a comment, and an entry of a header has a key first."""
    cells = split_line(line, separator)
    if not any(is_number(cell, decimal) for cell in cells):
        return any(cells) and all(is_marker(cell) for cell in cells) and len(cells) > 1
    return is_number(cells[0], decimal) or is_marker(cells[0])


def _earliest(header: Header) -> np.datetime64 | None:
    return min((stamp for stamp in _stamps(header) if stamp is not None), default=None)


def _seconds_between(first: np.datetime64 | None, later: np.datetime64 | None) -> float:
    """Return the time between two instants, s; 0 if one is unknown."""
    if first is None or later is None:
        return 0.0
    return float((later - first) / np.timedelta64(1, "ns")) * 1e-9


def _stamps(header: Header) -> list[np.datetime64 | None]:
    """Return the start of each channel, cell by cell; None if the header has none, or 1904 or earlier."""
    found: list[np.datetime64 | None] = []
    for date, time in zip(header.get("Date", ()), header.get("Time", ()), strict=False):
        # LabVIEW writes more digits of a second than a datetime64 holds
        clock, _, fraction = time.replace(",", ".").partition(".")
        stamp = date_of(f"{date} {clock}.{fraction[:9] or '0'}")
        found.append(stamp if stamp is not None and stamp > np.datetime64("1904-01-02") else None)
    return found


def _tables(
    segment: _Segment, header: Header, separator: str, decimal: str, late: float, title: str
) -> tuple[list[Table], list[str]]:
    """Return the tables of one segment: one, or one per channel if each has instants of its own."""
    width = max(
        len(split_line(line, separator)) for line in (*segment.rows[:100], separator.join(segment.headings))
    )
    cells = read_cells(segment.rows, separator, decimal)
    cells += [Column("", np.empty(0))] * (width - len(cells))
    labels = [*segment.headings, *[""] * len(cells)][: len(cells)]
    columns, remarks = columns_of(cells, labels, [""] * len(cells))
    if "Notes" in segment.header:
        remarks.append(f"the file notes: {' '.join(cell for cell in segment.header['Notes'] if cell)}")
    if _first(header, "X_Columns", "One").lower() == "multi":
        return _paired_tables(columns, segment.header, late, title), remarks
    declared = _Declared.of(segment.header, len(columns))
    channels = [
        _declare(column, declared, number, late)
        for number, column in enumerate(columns[1:])
        if len(column.values)
    ]
    channels = _without_false_units(channels, remarks)
    remarks += _length_remarks(channels)
    if not channels:
        return [], remarks
    if len(columns[0].values):
        return [Table(channels, _later(columns[0], late), title)], remarks
    return [with_time(Table(channels, None, title))], remarks


def _later(time: Column, late: float) -> Column:
    """Return instants shifted to the start of their segment, unless their writer lets them run on."""
    runs_on = late > 0.0 and float(np.nan_to_num(time.values[0])) >= late / 2.0
    return time if runs_on or not late else replace(time, values=time.values + late)


def _without_false_units(columns: list[Column], remarks: list[str]) -> list[Column]:
    """Return columns without a unit of time that the header gives to every channel: it belongs to the instants."""
    unit = columns[0].unit if columns else ""
    if len(columns) < 2 or any(column.unit != unit for column in columns) or seconds_in(unit) is None:
        return columns
    remarks.append(f"the header gives every channel the unit {unit}, which is that of time: not believed")
    return [column if is_time_name(column.label) else replace(column, unit="") for column in columns]


def _paired_tables(columns: Sequence[Column], header: Header, late: float, title: str) -> list[Table]:
    """Return a table for each pair of instants and channel (`X_Columns` Multi)."""
    pairs = [(columns[place], columns[place + 1]) for place in range(0, len(columns) - 1, 2)]
    declared = _Declared.of(header, len(pairs), step=2)
    tables = []
    for number, (time, column) in enumerate(pairs):
        if len(column.values):
            channel = _declare(column, declared, number, late)
            tables.append(Table([channel], _later(time, late) if len(time.values) else None, title))
    return tables


@dataclass(frozen=True, slots=True)
class _Declared:
    """The entries of a segment header by channel, the start of each channel, and the first start."""

    entries: Header
    stamps: Sequence[np.datetime64 | None]
    earliest: np.datetime64 | None

    @classmethod
    def of(cls, header: Header, channels: int, step: int = 1) -> _Declared:
        """Return the entries of a header.

        With a column of instants per channel, the entries stand above every second column. Some writers leave out the
        empty cells between them.
        """
        entries = {}
        for key, cells in header.items():
            spread = step > 1 and not any(cells[1::step]) and len(cells) > channels
            entries[key] = [*(cells[::step] if spread else cells), *[""] * channels][:channels]
        return cls(entries, _stamps(entries), _earliest(entries))


def _declare(column: Column, declared: _Declared, number: int, late: float) -> Column:
    """Return a column with the entries of its segment header."""

    def entry(key: str) -> str:
        cells = declared.entries.get(key, ())
        return cells[number] if number < len(cells) else ""

    def quantity(key: str) -> float | None:
        text = entry(key).replace(",", ".")
        return float(text) if is_number(text) else None

    label, unit = split_label(column.label)
    over_time = entry("X_Dimension").lower() in ("time", "")
    interval = quantity("Delta_X") if over_time else None
    samples = quantity("Samples")
    stamps = declared.stamps
    behind = _seconds_between(declared.earliest, stamps[number] if number < len(stamps) else None)
    return Column(
        label or column.label,
        column.values,
        unit or entry("Y_Unit_Label"),
        column.overrange,
        interval if interval is not None and interval > 0.0 else None,
        (quantity("X0") or 0.0) + late + behind,
        f"start {entry('Time')}" if behind else "",
        attrs={} if samples is None else {"declared_samples": int(min(max(samples, -(2**53)), 2**53))},
    )


def _length_remarks(columns: Sequence[Column]) -> list[str]:
    """Return remarks on different lengths in header and rows."""
    samples = [(column, column.attrs.get("declared_samples"), len(column.values)) for column in columns]
    return [
        f"{column.label}: the header says {declared} samples, the file has {there}"
        for column, declared, there in samples
        if declared not in (None, there)
    ]
