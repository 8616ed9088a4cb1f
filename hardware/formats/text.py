"""CSV and other tables of text: delimiter, decimal sign, headings and units are found from the data."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.hardware.formats.cells import (
    column_of,
    has_thousands,
    is_marker,
    is_number,
    read_cells,
    split_line,
)
from vibroimpact.hardware.formats.clock_columns import (
    FIRST_WITHOUT_HEADING,
    in_pairs,
    with_time,
    without_count,
)
from vibroimpact.hardware.formats.cut_off import without_cut_cells
from vibroimpact.hardware.formats.instants import is_date, is_day
from vibroimpact.hardware.formats.instruments import instrument_of
from vibroimpact.hardware.formats.labels import is_known_unit, is_time_name, is_time_unit, split_label
from vibroimpact.hardware.formats.long_tables import LONG, read_pieces
from vibroimpact.hardware.formats.table import MOST_COLUMNS, Column, RawFile, Table
from vibroimpact.hardware.formats.written_numbers import with_plain_numbers

_COMMENTS = ("#", "%", "//", "!")
_GROUP = re.compile(r"(?<![\d.,:])[1-9]\d{0,2}(?:\.\d{3})++(?![\d.:])")
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
"""Words before a number that summarises a whole column, in the lines below a table."""
_LINES_TRIED = 60
_LONGEST_HEADER = 1000
_LONG_HEAD = 200_000
"""Characters at the start and in the middle of a long text, from which its dialect is found."""
_MOST_STRANGE = 0.01
DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "bar": "|", "blank": None}


@dataclass(frozen=True, slots=True)
class Dialect:
    """The form of a text's rows: delimiter, decimal sign, and whether there are columns of words."""

    delimiter: str | None
    decimal: str
    words: bool = False

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line."""
        return split_line(line, self.delimiter)

    def is_row(self, line: str) -> bool:
        """Whether a line is a row of numbers, markers and dates, with at least one number or date.

        With columns of words, a row begins with a number, a time or a day.
        """
        cells = self.cells(line)
        kinds = [is_number(cell, self.decimal) or is_date(cell) for cell in cells]
        if self.words:
            return any(kinds) and (kinds[0] or is_day(cells[0]))
        return any(kinds) and all(kind or is_marker(cell) for kind, cell in zip(kinds, cells, strict=True))


def read_text(content: str, delimiter: str | None = "", decimal: str = "", dates: str = "") -> RawFile:
    """Return a table of text, in the form of its instrument if `dialects/` has it.

    The delimiter stands between cells (None: blanks), `dates` is `day-first` or `month-first`. Empty arguments are
    found from the rows. DatasetError: there are no rows of numbers.
    """
    content = with_plain_numbers(content)
    instrument = instrument_of(content)
    if instrument is not None:
        content = instrument.prepared(content)
        form = instrument.form
        delimiter = DELIMITERS[form.delimiter] if delimiter == "" and form.delimiter else delimiter
        decimal = decimal or form.decimal
    parsed = _parsed(content, delimiter, decimal, dates)
    if instrument is None:
        columns, remarks = [column for column in parsed.columns if len(column.values)], parsed.remarks
        tables = _tables(columns)
    else:
        columns, more = instrument.described(parsed.columns)
        remarks = parsed.remarks + more
        tables = instrument.tables(columns) or _tables(columns)
    names = {mark: f"{word}s" for word, mark in DELIMITERS.items()}
    maker = "" if instrument is None else f"{instrument.form.maker}, "
    cells = names.get(parsed.dialect.delimiter, repr(parsed.dialect.delimiter))
    comma = ", decimal comma" if parsed.dialect.decimal == "," else ""
    written = f"{maker}text, cells between {cells}{comma}"
    return RawFile(written, tables, remarks + _remarks_on(tables))


@dataclass(frozen=True, slots=True)
class _Parsed:
    """The dialect, all columns with names and units, including empty ones, and remarks."""

    dialect: Dialect
    columns: list[Column]
    remarks: list[str]


def _parsed(content: str, delimiter: str | None, decimal: str, dates: str) -> _Parsed:
    """Return the columns of a text by the general rules."""
    long = _parsed_in_pieces(content, delimiter, decimal) if len(content) >= LONG else None
    if long is not None:
        return long
    lines = content.splitlines()
    dialect, remarks = find_dialect(lines, delimiter, decimal)
    first = next(place for place, line in enumerate(lines) if _is_plain(line) and dialect.is_row(line))
    body = [(place, line) for place, line in enumerate(lines[first:], first) if _is_plain(line)]
    body, summary = _without_footer(body, dialect)
    rows, dropped = _rows(body, dialect)
    dropped += summary
    rows, cut = without_cut_cells(rows, content, dialect.delimiter, dialect.decimal)
    remarks += dropped + cut + _grouped(rows, dialect)
    cells = read_cells(rows, dialect.delimiter, dialect.decimal, dates)
    labels, units, late = _all_headings(lines[:first], rows, len(cells), dialect.delimiter)
    columns, more = columns_of(cells, labels, units)
    return _Parsed(dialect, columns, remarks + late + more)


def _parsed_in_pieces(content: str, delimiter: str | None, decimal: str) -> _Parsed | None:
    """Return the columns of a long table with only plain numbers below its headings; None for another text."""
    head = content[:_LONG_HEAD].splitlines(keepends=True)[:-1]
    middle = content.find("\n", len(content) // 2) + 1
    beyond = content[middle : middle + _LONG_HEAD].splitlines()[:_LINES_TRIED]
    tried = [line for line in head if _is_plain(line)][:_LINES_TRIED] + list(filter(_is_plain, beyond))
    try:
        dialect, remarks = _dialect_of(tried, delimiter, decimal)
    except DatasetError:
        return None
    first = next((at for at, line in enumerate(head) if _is_plain(line) and dialect.is_row(line)), None)
    if first is None:
        return None
    cut: list[str] = []

    def last_lines(lines: list[str]) -> list[str]:
        rows, cut_remarks = without_cut_cells(lines, content, dialect.delimiter, dialect.decimal)
        cut.extend(cut_remarks)
        return rows

    begin = sum(map(len, head[:first]))
    values = read_pieces(content, begin, dialect.delimiter, dialect.decimal, last_lines)
    if values is None or len(values) > MOST_COLUMNS:
        return None
    header = [line.rstrip("\r\n") for line in head[:first]]
    labels, units = headings(header, len(values), dialect.delimiter)
    columns, more = columns_of([column_of("", one) for one in values], labels, units)
    return _Parsed(dialect, columns, remarks + cut + more)


def _tables(columns: Sequence[Column]) -> list[Table]:
    """Return the tables of columns, with instants set apart by the general rules."""
    return in_pairs(columns) or [without_count(with_time(Table(columns)))]


def _remarks_on(tables: Sequence[Table]) -> list[str]:
    """Return remarks on columns that are taken as instants without a heading."""
    remarks: list[str] = []
    if tables[0].time is not None and tables[0].time.label == FIRST_WITHOUT_HEADING:
        remarks.append(
            message(
                "the first column has no heading and ascends: it is taken as the instants (",
                *(Argument("time_column"), ")"),
            )
        )
    if len(tables) > 1:
        remarks.append(
            message(
                f"{len(tables)} columns have instants, each for those that follow it (",
                *(Argument("time_column"), ")"),
            )
        )
    return remarks


def _is_plain(line: str) -> bool:
    """Whether a line is neither empty nor a comment."""
    return bool(line.strip()) and not line.lstrip().startswith(_COMMENTS)


def find_dialect(
    lines: Sequence[str], delimiter: str | None = "", decimal: str = ""
) -> tuple[Dialect, list[str]]:
    """Return the dialect of the rows, and remarks on doubts about it.

    The dialect with most lines as rows of one width is chosen; of equals, the one with more columns.
    """
    return _dialect_of(_tried_lines(lines), delimiter, decimal)


def _dialect_of(tried: Sequence[str], delimiter: str | None, decimal: str) -> tuple[Dialect, list[str]]:
    """Return the dialect of some lines, and remarks on doubts about it."""
    delimiters = DELIMITERS.values() if delimiter == "" else (delimiter,)
    signs = (".", ",") if not decimal else (decimal,)
    is_quoted = 2 * sum(line.count('"') > 1 for line in tried) > len(tried)
    # a comma may be both if quotes distinguish the two
    tries = [Dialect(mark, sign) for sign in signs for mark in delimiters if mark != sign or is_quoted]
    best, (count, width) = _best_of(tries, tried)
    if 2 * count < len(tried):  # there may be a column of words among the numbers
        lax, (rows, more) = _best_of([replace(dialect, words=True) for dialect in tries], tried)
        if rows > 2 * count:
            best, width = lax, more
    if best is None:
        raise DatasetError(
            message(
                "expected rows of numbers, got none. Is it text? Give ",
                *(Argument("delimiter"), " and ", Argument("decimal"), " if it is."),
            )
        )
    doubtful = (best.delimiter, best.decimal, width) == (",", ".", 2) and not any(
        "." in line for line in tried
    )
    if doubtful and not decimal and not delimiter:
        return best, [
            message(
                "one comma in each row is read as between two columns; if it is decimal, ",
                Argument("decimal", ","),
            )
        ]
    return best, []


def _grouped(rows: Sequence[str], dialect: Dialect) -> list[str]:
    """Return remarks on points that count as separators of thousands, since commas are decimal."""
    if dialect.decimal != ",":
        return []
    remarks: list[str] = []
    if dialect.delimiter == ",":
        remarks.append(
            message("commas between quotes are decimal signs (", Argument("decimal", "."), " if not)")
        )
    found = next((match for row in rows if "." in row and (match := _GROUP.search(row))), None)
    if found is not None:
        remarks.append(
            f"points in numbers are separators of thousands, since commas are decimal: {found[0]} is "
            f"{found[0].replace('.', '')}"
        )
    return remarks


def _thousands(where: str, cell: str) -> DatasetError:
    return DatasetError(
        f"{where}: expected numbers without separators of thousands, got {cell[:40]!r}. Save the table without them."
    )


def _best_of(dialects: Sequence[Dialect], lines: Sequence[str]) -> tuple[Dialect | None, tuple[int, int]]:
    """Return the dialect in which most lines are rows of one width, and their number and width.

    Of equals, the dialect with more numbers wins, then the one with more cells.
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
    """Return lines from the start, with the header, and from the middle, with the data."""
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


def _without_footer(body: list[tuple[int, str]], dialect: Dialect) -> tuple[list[tuple[int, str]], list[str]]:
    """Return the lines without final lines of means, counts and the like, and a remark on these."""
    end = len(body)
    while end > 1 and _first_cell(body[end - 1][1], dialect) in _SUMMARIES:
        end -= 1
    verb = "sum up the table"
    below = end
    while below > 1 and _first_cell(body[below - 1][1], dialect)[:1].isalpha():
        below -= 1
    if (
        below < end
        and _begins_with_number(body[0][1], dialect)
        and _is_footer(body[below:], len(body), dialect)
    ):
        end, verb = below, "stand below the table"
    if end == len(body):
        return body, []
    words = "; ".join(line.strip()[:30] for _, line in body[end:][:3])
    lines = "line" if len(body) == end + 1 else "lines"
    return body[:end], [f"the last {len(body) - end} {lines} {verb} and are left out: {words}"]


def _is_footer(lines: Sequence[tuple[int, str]], total: int, dialect: Dialect) -> bool:
    """Whether lines of words at the end of a table have numbers, or are many; `_rows` handles others."""
    numbers = any(is_number(cell, dialect.decimal) for _, line in lines for cell in dialect.cells(line))
    return numbers or len(lines) > max(1, _MOST_STRANGE * total)


def _first_cell(line: str, dialect: Dialect) -> str:
    """Return the first cell of a line in lower case; empty for a marker, which may stand in a row."""
    cell = dialect.cells(line)[0].strip().lower()
    return "" if is_marker(cell) else cell


def _begins_with_number(line: str, dialect: Dialect) -> bool:
    """Whether a row begins with a number, a time or a day."""
    cell = dialect.cells(line)[0]
    return is_number(cell, dialect.decimal) or is_date(cell) or is_day(cell)


def headings(header: Sequence[str], width: int, delimiter: str | None) -> tuple[list[str], list[str]]:
    """Return names and units of `width` columns, as far as the lines before the first row give them.

    Comment marks are removed. The delimiter belongs to the rows; headings may use another.
    """
    lines = [line for line in header if _uncommented(line)][-8:]
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
    """Return names and units of all columns, even if some begin below the headings, and remarks on these."""
    labels, units = headings(header, width, delimiter)
    narrow = len(split_line(rows[0], delimiter)) if rows else width
    if any(labels) or narrow >= width:
        return labels, units, []
    first_row = next(place for place, row in enumerate(rows, 1) if len(split_line(row, delimiter)) > narrow)
    labels, units = headings(header, narrow, delimiter)
    several = f"columns {narrow + 1} to {width} begin" if width > narrow + 1 else f"column {width} begins"
    verb = "have" if width > narrow + 1 else "has"
    remark = message(
        f"{several} in row {first_row} of the table, and {verb} no heading (", Argument("name"), ")"
    )
    more = [""] * (width - narrow)
    return labels + more, units + more, [remark] if any(labels) else []


def _uncommented(line: str) -> str:
    text = line.strip()
    for mark in _COMMENTS:
        text = text.removeprefix(mark)
    return text.strip("# \r\n")


def _heading_cells(line: str, width: int, delimiter: str | None) -> list[str]:
    """Return the cells of a heading of this width, at any delimiter that gives it."""
    ends = delimiter is not None and line.rstrip("\r\n").endswith(delimiter)
    for mark in (delimiter, "\t", ",", ";", None):
        cells = [cell.strip().strip(",;").strip() for cell in split_line(_uncommented(line), mark)]
        for form in (cells, [cell for cell in cells if cell]):
            if len(form) == width and any(form):
                return form
            # a row may end in a delimiter, or its last heading may be missing
            is_short = len(form) == width - 1 and (ends or len(form) >= 2)
            if is_short and mark == delimiter and mark is not None and any(form):
                return [*form, ""]
    return []


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a line has units: all in brackets, or several and all known; a single one may be a short name."""
    filled = [cell for cell in cells if cell]
    if all(cell[0] in "[({<" and cell[-1] in "])}>" for cell in filled):
        return True
    plain = [cell for cell in filled if cell != "-"]
    return len(plain) > 1 and all(is_known_unit(cell) and not is_time_name(cell) for cell in plain)


def columns_of(
    cells: Sequence[Column], labels: Sequence[str], units: Sequence[str]
) -> tuple[list[Column], list[str]]:
    """Return the columns of numbers, without columns of words, and remarks on these."""
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
                    message(
                        f"{name}: expected numbers, got {len(column.strange)} other cells, the first {text!r} in row "
                        f"{row + 1}. Is the delimiter or the decimal sign another one (",
                        *(Argument("delimiter"), ", ", Argument("decimal"), ")?"),
                    )
                )
            remarks.append(
                f"{name}: {len(column.strange)} cells are no numbers and count as missing, the first is "
                f"{text!r} in row {row + 1}"
            )
        columns.append(replace(column, label=name, unit="s" if column.dated else unit))
    return columns, remarks


def _is_text(column: Column) -> bool:
    """Whether a column has mostly words: remarks, names."""
    return 2 * len(column.strange) >= max(1, int(np.isfinite(column.values).sum()) + len(column.strange))
