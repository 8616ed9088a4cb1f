"""Matrix Market files: coordinate and array; real and integer; general, symmetric and skew-symmetric.

Source: R. F. Boisvert, R. Pozo, K. A. Remington, The Matrix Market Exchange Formats, NISTIR 5935, 1996.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Sparse
from vibroimpact.orchestrator.structures.readers.found import Found, in_columns, square
from vibroimpact.orchestrator.structures.readers.triplets import matrix_of, quoted, read_entries, read_values
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

_MIRRORED = {"general": 0.0, "symmetric": 1.0, "skew-symmetric": -1.0}
"""Factor of the entries in the triangle that a file leaves out."""
_LARGEST = 12
"""Most digits of a size."""


@dataclass(frozen=True, slots=True)
class _Header:
    """First lines of a file: its kind, its sizes, and the byte after them."""

    is_dense: bool
    mirrored: float
    sizes: tuple[int, ...]
    start: int


def read(content: bytes, wanted: Wanted) -> Found:
    """Return the matrix of a file.

    Raises
    ------
    UsageError
        The file is damaged, or its matrix is complex, a pattern, not square or too large.
    """
    role = wanted.only()
    header = _header_of(content)
    return Found({role: _dense(content, header) if header.is_dense else _sparse(content, header)})


def _header_of(content: bytes) -> _Header:
    """Return the header, which ends with the line of sizes; comments begin with `%`."""
    words, start = _next_line(content, 0)
    kinds = [word.decode("latin-1").lower() for word in words]
    right = (
        len(kinds) == 5 and kinds[:2] == ["%%matrixmarket", "matrix"] and kinds[2] in ("coordinate", "array")
    )
    if not right or kinds[3] not in ("real", "double", "integer") or kinds[4] not in _MIRRORED:
        expected = "%%MatrixMarket matrix, coordinate or array, real or integer, " + " or ".join(_MIRRORED)
        raise UsageError(f"line 1: expected {expected}, got {quoted(words)}.")
    line = 1
    while start < len(content):
        words, start = _next_line(content, start)
        line += 1
        if words and not words[0].startswith(b"%"):
            return _Header(kinds[2] == "array", _MIRRORED[kinds[4]], _sizes(words, line, kinds[2]), start)
    raise UsageError("expected a line of sizes, got the end of the file.")


def _next_line(content: bytes, start: int) -> tuple[list[bytes], int]:
    """Return the words of the line at a byte, and the byte after the line."""
    end = content.find(b"\n", start) + 1 or len(content)
    return content[start:end].split(), end


def _sizes(words: list[bytes], line: int, kind: str) -> tuple[int, ...]:
    """Return the number of unknowns, and of the entries in the file."""
    count = 2 if kind == "array" else 3
    if len(words) != count or not all(word.isdigit() and len(word) <= _LARGEST for word in words):
        expected = "rows, columns" + (" and entries" if count == 3 else "")
        raise UsageError(f"line {line}: expected the numbers of {expected}, got {quoted(words)}.")
    sizes = [int(word) for word in words]
    return square(sizes[0], sizes[1]), *sizes[2:]


def _sparse(content: bytes, header: _Header) -> Sparse:
    unknowns, count = header.sizes
    entries = read_entries(content, header.start)
    _refuse_other_count(len(entries), count)
    return matrix_of(entries, unknowns, content, header.start, mirrored=header.mirrored)


def _dense(content: bytes, header: _Header) -> Sparse:
    """Return a matrix whose values are written column by column, of a symmetric one the lower triangle."""
    (unknowns,) = header.sizes
    inside = {
        0.0: unknowns * unknowns,
        1.0: unknowns * (unknowns + 1) // 2,
        -1.0: unknowns * (unknowns - 1) // 2,
    }
    values = read_values(content, header.start)
    _refuse_other_count(len(values), inside[header.mirrored])
    if not header.mirrored:
        return in_columns(values.reshape(unknowns, unknowns).T)
    found = np.zeros((unknowns, unknowns))
    columns, rows = np.triu_indices(unknowns, k=0 if header.mirrored > 0.0 else 1)
    found[columns, rows] = header.mirrored * values
    found[rows, columns] = values
    return in_columns(found)


def _refuse_other_count(got: int, expected: int) -> None:
    """Raise UsageError unless a file has the entries that it declares."""
    if got != expected:
        cut = " The file ends early." if got < expected else ""
        raise UsageError(f"expected {expected} entries, got {got}.{cut}")
