"""Nastran files of matrices, written from their formats: OUTPUT4 of binary and text, and DMIG cards."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
Layout = Literal["dense", "sparse", "big"]
Style = Literal["small", "large", "free", "free large"]
LAYOUTS: tuple[Layout, ...] = ("dense", "sparse", "big")
STYLES: tuple[Style, ...] = ("small", "large", "free", "free large")
DIGITS = {"small": 2, "large": 9, "free": 2, "free large": 9}
"""Digits after the point of a number of each style."""
_COMPONENTS = {"x": 1, "y": 2, "z": 3, "rx": 4, "ry": 5, "rz": 6}


def strings_of(column: Matrix, layout: Layout) -> Iterator[tuple[int, Matrix]]:
    """Yield the first row, from 1, and the numbers of each string of a column; a dense one has one string."""
    there = np.flatnonzero(column)
    if not len(there):
        return
    if layout == "dense":
        yield int(there[0]) + 1, column[there[0] : there[-1] + 1]
        return
    for run in np.split(there, np.flatnonzero(np.diff(there) > 1) + 1):
        yield int(run[0]) + 1, column[run]


def written_rows(rows: int, layout: Layout) -> int:
    """Return the number of rows in a head: negative for strings with a row of their own."""
    return -rows if layout == "big" else rows


def fortran_number(value: float, width: int, digits: int, letter: str = "E") -> str:
    """Return a number as Fortran writes it: an exponent of three digits has no letter."""
    mantissa, _, exponent = f"{value:.{digits}E}".partition("E")
    if len(exponent) > 3:
        letter = ""
    return f"{mantissa}{letter}{exponent}".rjust(width)


def op4_binary(
    matrices: Mapping[str, Matrix],
    layout: Layout = "dense",
    *,
    order: str = "<",
    word: int = 4,
    double: bool = True,
    form: int = 6,
    kind: int | None = None,
) -> bytes:
    """Return a binary OUTPUT4 file; `kind` is the type of numbers that the head says, by default the true one."""
    integer = "i" if word == 4 else "q"
    real = "d" if double or word == 8 else "f"
    each = 2 if word == 4 and double else 1

    def record(content: bytes) -> bytes:
        mark = struct.pack(f"{order}i", len(content))
        return mark + content + mark

    def packed(*values: int) -> bytes:
        return struct.pack(f"{order}{len(values)}{integer}", *values)

    def reals(values: Matrix) -> bytes:
        return struct.pack(f"{order}{len(values)}{real}", *values)

    parts: list[bytes] = []
    for name, matrix in matrices.items():
        rows, columns = matrix.shape
        head = packed(columns, written_rows(rows, layout), form, kind or (2 if double else 1))
        parts.append(record(head + name.ljust(2 * word).encode()))
        for place in range(columns):
            content, first = b"", 0
            for row, values in strings_of(matrix[:, place], layout):
                length = len(values) * each
                if layout == "dense":
                    first = row
                elif layout == "big":
                    content += packed(length + 1, row)
                else:
                    content += packed(row + (length + 1 << 16))
                content += reals(values)
            if content:
                parts.append(record(packed(place + 1, first, len(content) // word) + content))
        parts.append(record(packed(columns + 1, 1, each) + reals(np.ones(1))))
    return b"".join(parts)


def op4_text(
    matrices: Mapping[str, Matrix],
    layout: Layout = "dense",
    *,
    digits: int = 16,
    letter: str = "E",
    double: bool = True,
    form: int = 6,
    kind: int | None = None,
) -> bytes:
    """Return a text OUTPUT4 file; numbers have some digits after the point."""
    width, each = digits + 7, 2 if double else 1
    per_line = 80 // width

    def lines_of(values: Matrix) -> Iterator[str]:
        numbers = [fortran_number(value, width, digits, letter) for value in values]
        for at in range(0, len(numbers), per_line):
            yield "".join(numbers[at : at + per_line])

    lines: list[str] = []
    for name, matrix in matrices.items():
        rows, columns = matrix.shape
        said = kind or (2 if double else 1)
        head = f"{columns:8d}{written_rows(rows, layout):8d}{form:8d}{said:8d}{name:8}"
        lines.append(f"{head}1P,{per_line}{letter}{width}.{digits}")
        for place in range(columns):
            own: list[str] = []
            first, words = 0, 0
            for row, values in strings_of(matrix[:, place], layout):
                length = len(values) * each
                if layout == "dense":
                    first, words = row, len(values)
                elif layout == "big":
                    own.append(f"{length + 1:8d}{row:8d}")
                    words += length + 2
                else:
                    own.append(f"{row + (length + 1 << 16):12d}")
                    words += length + 1
                own += lines_of(values)
            lines += [f"{place + 1:8d}{first:8d}{words:8d}", *own] if own else []
        lines += [f"{columns + 1:8d}{1:8d}{1:8d}", *lines_of(np.ones(1))]
    return "".join(f"{line}\n" for line in lines).encode()


def freedom_of(name: str) -> tuple[int, int]:
    """Return node and component of a degree of freedom."""
    node, _, direction = name.partition(".")
    return int(node), _COMPONENTS.get(direction, 0)


def _card(name: str, fields: Sequence[Any], style: Style) -> str:
    """Return a card with its continuations."""
    large = style in ("large", "free large")
    count, width = (4, 16) if large else (8, 8)
    lines = []
    for at in range(0, len(fields), count):
        part = [str(each) for each in fields[at : at + count]]
        first = (name if at == 0 else "") + ("*" if large else "")
        if style.startswith("free"):
            lines.append(",".join([first or "+", *part]))
        else:
            lines.append(f"{first:8}" + "".join(f"{each:>{width}}" for each in part))
    return "\n".join(lines) + "\n"


def _number(value: float, style: Style) -> str:
    """Return a number as Nastran writes it: small fields leave out the letter of the exponent."""
    mantissa, _, exponent = f"{value:.{DIGITS[style]}E}".partition("E")
    letter = "" if style in ("small", "free") else "D"
    power = f"{int(exponent):+d}" if not letter else exponent
    return f"{mantissa}{letter}{power}"


def dmig(
    name: str,
    matrix: Matrix,
    freedoms: Sequence[str],
    style: Style = "large",
    *,
    symmetric: bool = True,
    form: int | None = None,
    kind: int = 2,
) -> bytes:
    """Return the cards of a matrix; of a symmetric one its upper triangle."""
    head = [name, 0, form or (6 if symmetric else 1), kind, 0, "", "", len(freedoms)]
    text = _card("DMIG", head, "free" if style.startswith("free") else "small")
    for place, freedom in enumerate(freedoms):
        rows = np.flatnonzero(matrix[: place + 1 if symmetric else None, place])
        if len(rows):
            entries: list[Any] = []
            for row in rows.tolist():
                entries += [*freedom_of(freedoms[row]), _number(matrix[row, place], style), ""]
            text += _card("DMIG", [name, *freedom_of(freedom), "", *entries], style)
    return text.encode()
