"""Tables of degrees of freedom: names, or nodes and directions, with coordinates where they are known.

The first line names the columns; commas, semicolons, tabs or blanks separate them. A table has `name`, or `node` and
`direction` (x, y, z, rx, ry, rz, or 1 to 6); coordinates are `x`, `y`, `z`, m. Other columns are not read.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers.found import DIRECTIONS, MOST_UNKNOWNS, NAME, Found

_NAME = re.compile(NAME)
_NAMES = ("name", "freedom", "dof")
_NODES = ("node", "grid", "point")
_DIRECTIONS = ("direction", "component")
_AXES = ("x", "y", "z")
_LONGEST_QUOTE = 40
_DIRECTION: Mapping[str, str] = {
    spelling: direction
    for number, direction in enumerate(DIRECTIONS, 1)
    for spelling in (direction, str(number), f"{'tr'[number > 3]}{(number - 1) % 3 + 1}", f"u{direction}")
}
"""Spellings of the directions in lower case, such as z, 3, t3 and uz."""


def read_table(content: bytes) -> Found:
    """Return the names of the degrees of freedom of a table, a row for each, and their coordinates.

    Raises
    ------
    UsageError
        The table has no column of names, or a row has another form.
    """
    rows = table_rows(content)
    line, heads = next(rows, (1, []))
    columns = {head.strip().lower(): place for place, head in reversed(list(enumerate(heads)))}
    named, node = _first(_NAMES, columns), _first(_NODES, columns)
    direction = _first(_DIRECTIONS, columns)
    if named is None and (node is None or direction is None):
        expected = "a line of the columns' names with name, or node and direction"
        raise UsageError(f"line {line}: expected {expected}, got {_quoted(heads)}.")
    axes = [columns[axis] for axis in _AXES if axis in columns]
    names: list[str] = []
    places: list[list[float]] = []
    for line, cells in rows:
        if len(cells) != len(heads):
            raise UsageError(f"line {line}: expected {len(heads)} columns, got {len(cells)}.")
        if named is not None:
            names.append(_name(cells[named], line))
        elif node is not None and direction is not None:
            names.append(_name(f"{cells[node].strip()}.{_direction(cells[direction], line)}", line))
        places.append([_coordinate(cells[axis], line) for axis in axes])
        if len(names) > MOST_UNKNOWNS:
            raise UsageError(f"line {line}: expected at most {MOST_UNKNOWNS} rows, got more.")
    if not names:
        raise UsageError("expected a row for each degree of freedom, got none.")
    return Found(freedoms=tuple(names), coordinates=_coordinates(places, columns) if axes else None)


def table_rows(content: bytes) -> Iterator[tuple[int, Sequence[str]]]:
    """Yield number and cells of each line that is neither blank nor a comment."""
    mark: str | None = None
    for line, text in enumerate(content.decode("utf-8-sig", "replace").split("\n"), 1):
        if text.strip() and not text.lstrip().startswith("#"):
            if mark is None:
                mark = next((each for each in "\t;," if each in text), "")
            yield line, _cells(text.strip("\r"), mark, line)


def _cells(text: str, mark: str, line: int) -> Sequence[str]:
    """Return the cells of a line, which a mark separates, or blanks without one."""
    try:
        return next(csv.reader([text], delimiter=mark)) if mark else text.split()
    except csv.Error as problem:
        got = f"{_quoted([text])} ({problem})"
        raise UsageError(f"line {line}: expected cells of a table, got {got}.") from problem


def _first(names: Sequence[str], columns: Mapping[str, int]) -> int | None:
    return next((columns[name] for name in names if name in columns), None)


def _name(cell: str, line: int) -> str:
    name = cell.strip()
    if _NAME.fullmatch(name) is None:
        expected = "a name of at most 40 letters, digits, dots and dashes"
        raise UsageError(f"line {line}: expected {expected}, got {_quoted([name])}.")
    return name


def _direction(cell: str, line: int) -> str:
    found = _DIRECTION.get(cell.strip().lower())
    if found is None:
        raise UsageError(
            f"line {line}: expected a direction ({', '.join(DIRECTIONS)}), got {_quoted([cell])}."
        )
    return found


def _coordinate(cell: str, line: int) -> float:
    """Return a coordinate, m; NaN for an empty cell."""
    try:
        found = float(cell) if cell.strip() else float("nan")
    except ValueError:
        found = float("inf")
    if np.isinf(found):
        raise UsageError(f"line {line}: expected a coordinate, got {_quoted([cell])}.")
    return found


def _coordinates(
    places: Sequence[Sequence[float]], columns: Mapping[str, int]
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return the coordinates, shape (freedom, 3); a missing axis is 0."""
    found = np.zeros((len(places), len(_AXES)))
    found[:, [place for place, axis in enumerate(_AXES) if axis in columns]] = places
    return found


def _quoted(cells: Sequence[str]) -> str:
    text = " ".join(cells)
    return ascii(text if len(text) <= _LONGEST_QUOTE else text[:_LONGEST_QUOTE] + "...")
