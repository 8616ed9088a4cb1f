"""Long tables of plain numbers, parsed in pieces: millions of lines of text would take ten times their numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vibroimpact.hardware.formats.table import Floats

LONG = 8_000_000
"""Characters from which a table is parsed in pieces; a shorter one takes little memory as lines."""
_PIECE = 4_000_000
"""Characters of a piece; its lines take some ten times their bytes during parsing."""


def read_pieces(
    content: str,
    begin: int,
    delimiter: str | None,
    decimal: str,
    last_lines: Callable[[list[str]], list[str]],
) -> Floats | None:
    """Return all columns of a full table of plain numbers, shape (column, row); None for other tables.

    The first row begins at `begin`; a delimiter of None means blanks. `last_lines` returns the lines of the last piece
    without cut cells.
    """
    if decimal == delimiter:
        return None
    parts: list[Floats] = []
    while begin < len(content):
        end = _end_of_piece(content, begin)
        lines = content[begin:end].splitlines()
        part = _read(last_lines(lines) if end == len(content) else lines, delimiter, decimal)
        if part is None or (parts and part.shape[0] != parts[0].shape[0]):
            return None
        parts.append(part)
        begin = end
    return np.concatenate(parts, axis=1) if parts else None


def _end_of_piece(content: str, begin: int) -> int:
    """Return the end of a piece: after a line, with the last piece at least as long as the others."""
    if len(content) - begin < 2 * _PIECE:
        return len(content)
    end = content.find("\n", begin + _PIECE)
    return len(content) if end < 0 else end + 1


def _read(lines: Sequence[str], delimiter: str | None, decimal: str) -> Floats | None:
    """Return the columns of full lines of plain numbers; None for other lines."""
    if decimal == ",":
        if any("." in line for line in lines):
            return None
        lines = [line.replace(",", ".") for line in lines]
    if not lines:
        return None
    try:
        table = np.loadtxt(lines, delimiter=delimiter, comments=None, ndmin=2)
    except (ValueError, OverflowError):
        return None
    return np.ascontiguousarray(table.T) if len(table) == len(lines) else None
