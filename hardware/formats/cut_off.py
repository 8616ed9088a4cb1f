"""Rows of a text that was cut off: the rest of its last number may be another number.

`6.569866e-01` without its last three characters is 6.6. A text without a final line break may be whole, as some
writers leave it out, or cut off. The cells above the last one decide, if they are alike.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from vibroimpact.hardware.formats.cells import is_number, split_line
from vibroimpact.hardware.formats.instants import is_date

_ROWS_COMPARED = 1000
_FEWEST_ALIKE = 8
_LONGEST_QUOTE = 40
_MISSING = "nan"
# equally many digits in each cell: those after the decimal sign, and two or more of an exponent
_FIXED = re.compile(r"9+(?:[eEdD][-+]99+)?Z?", re.ASCII)
_EXPONENT = re.compile(r"\d[eEdD][-+]?\d", re.ASCII)


def without_cut_cells(
    rows: Sequence[str], content: str, delimiter: str | None, decimal: str
) -> tuple[list[str], list[str]]:
    """Return the rows of a table without its cut cells, and remarks on them.

    Without a final line break the last cell counts as missing if its form differs from all cells above. If the forms
    above differ among themselves, it counts as missing if it is shorter than all of them, or if its row lacks cells.
    The cells that its row lacks count as missing too. A row without other content is dropped.

    `rows` are the last rows of the text `content`; `delimiter` None means blanks.

    >>> without_cut_cells(["0.1,0.45", "0.2,0.6"], "0.1,0.45\\n0.2,0.6", ",", ".")
    (['0.1,0.45', '0.2,nan'], ["the text ends within a row: its last value, '0.6', counts as missing"])
    """
    kept = list(rows)
    if not kept or content.endswith(("\n", "\r")) or not content.endswith(kept[-1]):
        return kept, []
    cells = _filled(split_line(kept[-1], delimiter))
    if not cells:  # a row of missing values, or a quotation mark that opens the first value
        is_open = '"' in kept[-1]
        return kept[:-1] if is_open else kept, [_left_out(kept[-1])] if is_open else []
    above = [split_line(row, delimiter) for row in kept[-1 - _ROWS_COMPARED : -1]]
    before = _filled(above[-1]) if above else cells
    column = [row[len(cells) - 1] for row in above if len(row) >= len(cells)]
    alike, remarks = True, []
    if not _ends_after_cell(kept[-1], delimiter):
        found = _like_all(cells[-1], column, decimal)
        alike = not _lacks_something(cells[-1], column) if found is None else found
        if found is None and len(cells) < len(before):  # certainly cut off, perhaps in this cell
            alike = False
        elif found is None:
            remarks = [
                f"the text ends without a line break: its last value, {_quote(cells[-1])}, may be cut off"
            ]
    if alike and len(cells) >= len(before):
        return kept, remarks
    whole = cells if alike else cells[:-1]
    if not any(whole):
        return kept[:-1], [_left_out(cells[-1])]
    missing = [_MISSING if cell else "" for cell in before[len(whole) :]] or [_MISSING]
    if decimal == delimiter:  # quotes keep them apart
        whole = [f'"{cell}"' for cell in whole]
    kept[-1] = (" " if delimiter is None else delimiter).join([*whole, *missing])
    what = "its last columns count" if alike else f"its last value, {_quote(cells[-1])}, counts"
    return kept, [f"the text ends within a row: {what} as missing"]


def _left_out(text: str) -> str:
    return f"the text ends within a row: what is left of it, {_quote(text)}, is left out"


def _filled(cells: list[str]) -> list[str]:
    """Return the cells of a row up to the last one with content."""
    return cells[: next((place for place in range(len(cells), 0, -1) if cells[place - 1]), 0)]


def _ends_after_cell(row: str, delimiter: str | None) -> bool:
    """Whether the last cell of a row is certainly whole: a delimiter follows."""
    return row[-1:].isspace() if delimiter is None else row.rstrip(" ").endswith(delimiter)


def _like_all(cell: str, column: Sequence[str], decimal: str) -> bool | None:
    """Whether a cell has the form of all cells above; None if their forms differ, or are too few."""
    shapes = {_shape(other, decimal) for other in column if is_number(other, decimal) or is_date(other)}
    if len(column) < _FEWEST_ALIKE or len(shapes) != 1:
        return None
    (shape,) = shapes
    return _shape(cell, decimal) == shape if _FIXED.fullmatch(shape) else None


def _lacks_something(cell: str, column: Sequence[str]) -> bool:
    """Whether a cell is shorter than all cells above, or lacks an exponent that others have."""
    shortest = min((len(other) for other in column if other), default=0)
    return len(cell) < shortest or (not _EXPONENT.search(cell) and any(map(_EXPONENT.search, column)))


def _shape(cell: str, decimal: str) -> str:
    """Return the part after the decimal sign, with every digit as 9 and every sign of an exponent as a plus."""
    point = max(cell.rfind(decimal), cell.rfind("."))
    return re.sub("[0-9]", "9", cell[point + 1 :]).replace("-", "+") if point >= 0 else ""


def _quote(cell: str) -> str:
    return repr(cell[:_LONGEST_QUOTE])
