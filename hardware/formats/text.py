"""CSV and other tables of text: the delimiter, the decimal sign, headings and units are found from the data."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.wording import option
from vibroimpact.hardware.formats.cells import (
    has_thousands,
    is_date,
    is_day,
    is_marker,
    is_number,
    read_cells,
    split_line,
)
from vibroimpact.hardware.formats.cut_off import without_cut_cells
from vibroimpact.hardware.formats.labels import (
    is_known_unit,
    is_time_name,
    is_time_unit,
    seconds_in,
    split_label,
)
from vibroimpact.hardware.formats.table import MOST_COLUMNS, Column, RawFile, Table

_COMMENTS = ("#", "%", "//", "!")
_QUOTED = re.compile(r'"([^"]{1,60})"')
_FIRST = "column_1"
_SUMMARIES = frozenset(
    {
        "mean",
        "average",
        "avg",
        "rms",
        "std",
        "stdev",
        "std dev",
        "sigma",
        "variance",
        "median",
        "min",
        "minimum",
    }
    | {"max", "maximum", "sum", "total", "count", "n", "range", "peak", "pk-pk", "peak-peak", "crest"}
    | {"mittelwert", "mittel", "effektivwert", "standardabweichung", "summe", "anzahl", "moyenne", "somme"}
)
"""Words before a number that is one of a whole column, in the lines below a table."""
_COUNTS = frozenset(
    {"index", "no", "no.", "nr", "nr.", "#", "sample", "samples", "row", "point", "scan", "record"}
)
"""Headings of a column that counts the rows."""
_LINES_TRIED = 60
_LONGEST_HEADER = 1000
_MOST_STRANGE = 0.01
DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "bar": "|", "blank": None}


@dataclass(frozen=True, slots=True)
class Dialect:
    """How the rows of a text are written: what is between cells, the decimal sign, and whether words are among them."""

    delimiter: str | None
    decimal: str
    words: bool = False

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line."""
        return split_line(line, self.delimiter)

    def is_row(self, line: str) -> bool:
        """Whether a line is a row of numbers, markers and dates, with at least one that says something.

        Where there are columns of words, a row begins with a number, a time or a day.
        """
        cells = self.cells(line)
        kinds = [is_number(cell, self.decimal) or is_date(cell) for cell in cells]
        if self.words:
            return any(kinds) and (kinds[0] or is_day(cells[0]))
        return any(kinds) and all(kind or is_marker(cell) for kind, cell in zip(kinds, cells, strict=True))


def read_text(content: str, delimiter: str | None = "", decimal: str = "") -> RawFile:
    """Read a table of text; delimiter (None: blanks) and decimal sign are found from the rows where they are empty.

    Raises
    ------
    DatasetError
        There are no rows of numbers.
    """
    lines = content.splitlines()
    dialect, remarks = find_dialect(lines, delimiter, decimal)
    first = next(place for place, line in enumerate(lines) if _is_plain(line) and dialect.is_row(line))
    body = [(place, line) for place, line in enumerate(lines[first:], first) if _is_plain(line)]
    body, summary = _without_summary(body, dialect)
    rows, dropped = _rows(body, dialect)
    dropped += summary
    rows, cut = without_cut_cells(rows, content, dialect.delimiter, dialect.decimal)
    remarks += dropped + cut
    cells = read_cells(rows, dialect.delimiter, dialect.decimal)
    if len(cells) > MOST_COLUMNS:
        raise DatasetError(f"expected at most {MOST_COLUMNS} columns, got {len(cells)}. Is it turned over?")
    labels, units, late = _all_headings(lines[:first], rows, len(cells), dialect.delimiter)
    columns, more = columns_of(cells, labels, units)
    names = {mark: f"{word}s" for word, mark in DELIMITERS.items()}
    written = f"text, cells between {names.get(dialect.delimiter, repr(dialect.delimiter))}"
    comma = ", decimal comma" if dialect.decimal == "," else ""
    filled = [column for column in columns if len(column.values)]
    tables = _pairs(filled) or [without_count(with_time(Table(filled)))]
    if tables[0].time is not None and tables[0].time.label == _FIRST:
        more.append(
            f"the first column has no heading and ascends: it is taken as the instants ({option('time_column')})"
        )
    if len(tables) > 1:
        more.append(
            f"{len(tables)} columns have instants, each for those that follow it ({option('time_column')})"
        )
    return RawFile(written + comma, tables, remarks + late + more)


def _is_plain(line: str) -> bool:
    """Whether a line is neither empty nor a comment."""
    return bool(line.strip()) and not line.lstrip().startswith(_COMMENTS)


def find_dialect(
    lines: Sequence[str], delimiter: str | None = "", decimal: str = ""
) -> tuple[Dialect, list[str]]:
    """Return how the rows are written, and remarks on what is doubtful about it.

    That dialect is chosen in which most lines are rows of one width; of equals the one with more columns.
    """
    tried = _tried_lines(lines)
    _refuse_thousands(tried)
    delimiters = DELIMITERS.values() if delimiter == "" else (delimiter,)
    signs = (".", ",") if not decimal else (decimal,)
    tries = [Dialect(mark, sign) for sign in signs for mark in delimiters if mark != sign]
    best, (count, width) = _best_of(tries, tried)
    if 2 * count < len(tried):  # a column of words may be among the numbers
        lax, (rows, more) = _best_of([replace(dialect, words=True) for dialect in tries], tried)
        if rows > 2 * count:
            best, width = lax, more
    if best is None:
        raise DatasetError(
            "expected rows of numbers, got none. Is it text? "
            f"Give {option('delimiter')} and {option('decimal')} if it is."
        )
    doubtful = best.delimiter == "," and width == 2 and not any("." in line for line in tried)
    if doubtful and not decimal and not delimiter:
        return best, [
            f"one comma in each row is read as between two columns; if it is decimal, {option('decimal', ',')}"
        ]
    return best, []


def _refuse_thousands(lines: Sequence[str]) -> None:
    """Refuse numbers with separators of thousands, where a delimiter that is no such separator shows them."""
    for line in lines:
        marks = [mark for mark in ("\t", ";", "|") if mark in line]
        cells = [cell for mark in marks for cell in split_line(line, mark)] + _QUOTED.findall(line)
        found = next((cell for cell in cells if has_thousands(cell)), None)
        if found is not None:
            raise _thousands(f"the row {line.strip()[:40]!r}", found)


def _thousands(where: str, cell: str) -> DatasetError:
    return DatasetError(
        f"{where}: expected numbers without separators of thousands, got {cell[:40]!r}. Save the table without them."
    )


def _best_of(dialects: Sequence[Dialect], lines: Sequence[str]) -> tuple[Dialect | None, tuple[int, int]]:
    """Return the dialect in which most lines are rows of one width, and how many of what width.

    Of equals that one counts which makes numbers of more cells, then that of more cells.
    """
    best: Dialect | None = None
    score = (0, 0, 0)
    for dialect in dialects:
        rows = [dialect.cells(line) for line in lines if dialect.is_row(line)]
        if rows:
            width, count = Counter(map(len, rows)).most_common(1)[0]
            numbers = sum(is_number(cell, dialect.decimal) for row in rows for cell in row)
            if (count, numbers, width) > score:
                best, score = dialect, (count, numbers, width)
    return best, (score[0], score[2])


def _tried_lines(lines: Sequence[str]) -> list[str]:
    """Return lines from the start, where the header is, and from the middle, where the data are."""
    start = [line for line in lines[:_LONGEST_HEADER] if _is_plain(line)]
    middle = len(lines) // 2
    return start[:_LINES_TRIED] + [line for line in lines[middle : middle + _LINES_TRIED] if _is_plain(line)]


def _rows(body: Sequence[tuple[int, str]], dialect: Dialect) -> tuple[list[str], list[str]]:
    """Return the rows; lines of words between them are left out, with a remark; too many are refused."""
    words = [
        (place, line)
        for place, line in body
        if not any(is_number(cell, dialect.decimal) or is_date(cell) for cell in dialect.cells(line))
        and not all(is_marker(cell) for cell in dialect.cells(line))
    ]
    if len(words) > max(1, _MOST_STRANGE * len(body)):
        place, line = words[0]
        raise DatasetError(
            f"line {place + 1}: expected a row of numbers as before, got {line.strip()[:40]!r}, and "
            f"{len(words) - 1} more such lines. Cut the file where its table ends."
        )
    skipped = {place for place, _ in words}
    remarks = [
        f"line {place + 1} holds no numbers and is left out: {line.strip()[:60]!r}" for place, line in words
    ]
    return [line for place, line in body if place not in skipped], remarks[:5]


def _without_summary(
    body: list[tuple[int, str]], dialect: Dialect
) -> tuple[list[tuple[int, str]], list[str]]:
    """Return the lines without those of means, scatter and the like that end a table, and a remark on them."""
    end = len(body)
    while end > 1 and dialect.cells(body[end - 1][1])[0].strip().lower() in _SUMMARIES:
        end -= 1
    if end == len(body):
        return body, []
    words = "; ".join(line.strip()[:30] for _, line in body[end:][:3])
    lines = "line" if len(body) == end + 1 else "lines"
    return body[:end], [f"the last {len(body) - end} {lines} sum up the table and are left out: {words}"]


def headings(header: Sequence[str], width: int, delimiter: str | None) -> tuple[list[str], list[str]]:
    """Return names and units of as many columns as `width`, as far as the lines before the first row give them.

    Marks of comments are taken off. The delimiter is that of the rows; headings may use another.
    """
    lines = [text for line in header if (text := _uncommented(line))][-8:]
    found = [cells for cells in (_heading_cells(line, width, delimiter) for line in lines) if cells]
    units = [""] * width
    if found and _are_units(found[-1]):
        units = [cell.strip("[](){}<> ") for cell in found.pop()]
    if not found:
        return [""] * width, units
    pairs = [split_label(cell) for cell in found[-1]]
    own_units = [own or (name if is_time_unit(name) else "") for name, own in pairs]
    return [name for name, _ in pairs], [own or below for own, below in zip(own_units, units, strict=True)]


def _all_headings(
    header: Sequence[str], rows: Sequence[str], width: int, delimiter: str | None
) -> tuple[list[str], list[str], list[str]]:
    """Return names and units of all columns, also where some begin below the headings, and remarks on these."""
    labels, units = headings(header, width, delimiter)
    narrow = len(split_line(rows[0], delimiter)) if rows else width
    if any(labels) or narrow >= width:
        return labels, units, []
    begun = next(place for place, row in enumerate(rows, 1) if len(split_line(row, delimiter)) > narrow)
    labels, units = headings(header, narrow, delimiter)
    several = f"columns {narrow + 1} to {width} begin" if width > narrow + 1 else f"column {width} begins"
    verb = "have" if width > narrow + 1 else "has"
    remarks = (
        [f"{several} in row {begun} of the table, and {verb} no heading ({option('name')})"]
        if any(labels)
        else []
    )
    more = [""] * (width - narrow)
    return labels + more, units + more, remarks


def _uncommented(line: str) -> str:
    text = line.strip()
    for mark in _COMMENTS:
        text = text.removeprefix(mark)
    return text.strip("# \r\n")


def _heading_cells(line: str, width: int, delimiter: str | None) -> list[str]:
    """Return the cells of a heading of this width, at any delimiter that gives it."""
    for mark in (delimiter, "\t", ",", ";", None):
        cells = [cell.strip().strip(",;").strip() for cell in split_line(line, mark)]
        for form in (cells, [cell for cell in cells if cell]):
            if len(form) == width and any(form):
                return form
            # a row may end in a delimiter, or its last heading be left out
            if 2 <= len(form) == width - 1 and mark == delimiter and mark is not None and any(form):
                return [*form, ""]
    return []


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a line is one of units: all in brackets, or two and all of them known; one may be a short name."""
    filled = [cell for cell in cells if cell]
    if all(cell[0] in "[({<" and cell[-1] in "])}>" for cell in filled):
        return True
    plain = [cell for cell in filled if cell != "-"]
    return len(plain) > 1 and all(is_known_unit(cell) and not is_time_name(cell) for cell in plain)


def columns_of(
    cells: Sequence[Column], labels: Sequence[str], units: Sequence[str]
) -> tuple[list[Column], list[str]]:
    """Return the columns of numbers, without those of words, and remarks on them."""
    columns, remarks = [], []
    for place, (column, label, unit) in enumerate(zip(cells, labels, units, strict=True), 1):
        name = label or f"column_{place}"
        grouped = next((text for _, text in column.strange if has_thousands(text)), None)
        if grouped is not None:
            raise _thousands(name, grouped)
        if len(column.values) and _is_text(column):
            words = [text for _, text in column.strange][:3]
            remarks.append(f"{name}: a column of words is left out: {'; '.join(words)}")
            column = replace(column, values=column.values[:0])
        elif column.strange:
            row, text = column.strange[0]
            if len(column.strange) > max(3, _MOST_STRANGE * len(column.values)):
                raise DatasetError(
                    f"{name}: expected numbers, got {len(column.strange)} other cells, the first {text!r} in row "
                    f"{row + 1}. Is the delimiter or the decimal sign another one "
                    f"({option('delimiter')}, {option('decimal')})?"
                )
            remarks.append(
                f"{name}: {len(column.strange)} cells are no numbers and count as missing, the first is "
                f"{text!r} in row {row + 1}"
            )
        columns.append(replace(column, label=name, unit=unit or ("s" if column.dated else "")))
    return columns, remarks


def _is_text(column: Column) -> bool:
    """Whether a column is one of words: remarks, names."""
    return 2 * len(column.strange) >= max(1, int(np.isfinite(column.values).sum()) + len(column.strange))


def without_count(table: Table) -> Table:
    """Return the table without a first column that counts its rows, where another one has the instants."""
    first = table.columns[0] if table.columns and table.time is not None and table.time_place > 0 else None
    if first is None or first.label.strip().lower() not in _COUNTS or len(table.columns) < 2:
        return table
    steps = np.diff(first.values)
    if not len(steps) or not np.all(steps == 1.0):
        return table
    return replace(table, columns=table.columns[1:], time_place=table.time_place - 1)


def with_time(table: Table) -> Table:
    """Return the table with the column of its instants told apart, where one is clear.

    Clear is a heading that means time, or a first column without heading that ascends from row to row and is
    followed by others.
    """
    for place, column in enumerate(table.columns):
        if column.dated or is_time_name(column.label) or _is_time_by_unit(column, place):
            return _apart(table, place)
    if len(table.columns) > 1 and table.columns[0].label == _FIRST and _ascends(table.columns[0]):
        return _apart(table, 0)
    return table


def _pairs(columns: Sequence[Column]) -> list[Table]:
    """Return a table for each column of instants with those that follow it, where there are several: `t1 a1 t2 a2`."""
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
    return replace(table, columns=others, time=table.columns[place], time_place=place) if others else table


def _is_time_by_unit(column: Column, place: int) -> bool:
    return place == 0 and seconds_in(column.unit) is not None and _ascends(column)


def _ascends(column: Column) -> bool:
    values = column.values[np.isfinite(column.values)]
    return len(values) > 1 and float(np.mean(np.diff(values) >= 0.0)) > 0.99 and bool(values[-1] > values[0])
