"""Texts of a number for each entry of a matrix, read by numpy; an error names the line."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Sparse
from vibroimpact.orchestrator.structures.readers.found import MOST_ENTRIES, in_columns

Entries = NDArray[Any]
"""Entries with the fields row, column (both from 1) and value."""
_ENTRY = np.dtype([("row", "i4"), ("column", "i4"), ("value", "f8")])
_VALUE = np.dtype([("value", "f8")])
_WHOLE = re.compile(rb"[+-]?[0-9]{1,10}")
_NUMBER = re.compile(rb"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_LONGEST_QUOTE = 40


def read_entries(content: bytes, start: int = 0) -> Entries:
    """Return rows, columns and values of the lines `row column value` from a byte on.

    Raises
    ------
    UsageError
        A line has another form, or a value is not finite.
    """
    found = _read(content, start, _ENTRY, "a row, a column and a number")
    _refuse(~np.isfinite(found["value"]), content, start, "a finite number")
    return found


def read_values(content: bytes, start: int) -> NDArray[np.float64]:
    """Return the numbers of the lines of one number each from a byte on.

    Raises
    ------
    UsageError
        A line has another form, or a number is not finite.
    """
    found = _read(content, start, _VALUE, "a number")["value"]
    _refuse(~np.isfinite(found), content, start, "a finite number")
    return np.asarray(found, dtype=np.float64)


def _read(content: bytes, start: int, kind: np.dtype[Any], expected: str) -> Entries:
    if not content.endswith(b"\n"):
        raise UsageError("expected a line break at the end, got none. The file may be cut off.")
    stream = io.BytesIO(content)
    stream.seek(start)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "loadtxt: input contained no data")
            warnings.filterwarnings("error", category=DeprecationWarning)  # a fraction as a row
            text = io.TextIOWrapper(stream, encoding="ascii", newline="\n")
            found = np.loadtxt(text, dtype=kind, comments=None, ndmin=1)
    except (ValueError, DeprecationWarning) as problem:
        for line, fields in _lines(content, start):
            if not _fits(fields, len(kind.fields or ())):
                raise UsageError(f"line {line}: expected {expected}, got {quoted(fields)}.") from problem
        raise UsageError(f"expected lines of {expected}, got others ({problem}).") from problem
    if len(found) > MOST_ENTRIES:
        raise UsageError(f"expected at most {MOST_ENTRIES} entries, got more.")
    return found


def _fits(fields: list[bytes], count: int) -> bool:
    """Return whether the fields of a line are row, column and value, or a value alone."""
    whole = all(_WHOLE.fullmatch(one) and -(2**31) <= int(one) < 2**31 for one in fields[:-1])
    return len(fields) == count and whole and _NUMBER.fullmatch(fields[-1]) is not None


def _lines(content: bytes, start: int) -> Iterator[tuple[int, list[bytes]]]:
    """Yield number and fields of each line from a byte on that is not blank."""
    first = content.count(b"\n", 0, start) + 1
    for line, text in enumerate(io.BytesIO(content[start:]), first):
        fields = text.split()
        if fields:
            yield line, fields


def _refuse(wrong: NDArray[np.bool_], content: bytes, start: int, expected: str) -> None:
    """Raise UsageError for the first wrong line that is not blank."""
    if wrong.any():
        at = int(np.argmax(wrong))
        line, fields = next(each for place, each in enumerate(_lines(content, start)) if place == at)
        raise UsageError(f"line {line}: expected {expected}, got {quoted(fields)}.")


def quoted(fields: list[bytes]) -> str:
    """Return the beginning of a line for a message.

    >>> quoted([b"1", b"2", b"x"])
    "'1 2 x'"
    """
    text = b" ".join(fields).decode("latin-1")
    return ascii(text if len(text) <= _LONGEST_QUOTE else text[:_LONGEST_QUOTE] + "...")


def matrix_of(
    entries: Entries, unknowns: int, content: bytes, start: int, *, mirrored: float = 0.0
) -> Sparse:
    """Return the matrix of entries that a text holds from a byte on.

    Parameters
    ----------
    entries : ndarray
        Rows, columns and values of `read_entries`.
    unknowns : int
    content, start : bytes and int
        The text, whose line an error names.
    mirrored : float
        Factor of the entries in the other triangle: 1 for a symmetric matrix, -1 for a skew one. 0: the text holds both
        triangles.

    Raises
    ------
    UsageError
        An entry is outside of the matrix, or occurs twice.
    """
    from scipy.sparse import coo_array

    rows, columns, values = entries["row"] - 1, entries["column"] - 1, entries["value"]
    outside = (np.minimum(rows, columns) < 0) | (np.maximum(rows, columns) >= unknowns)
    _refuse(outside, content, start, f"a row and a column from 1 to {unknowns}")
    if mirrored:
        other = rows != columns
        if mirrored < 0.0:
            _refuse(~other & (values != 0.0), content, start, "0 on the diagonal of a skew-symmetric matrix")
        rows, columns = np.concatenate([rows, columns[other]]), np.concatenate([columns, rows[other]])
        values = np.concatenate([values, mirrored * values[other]])
    found = coo_array((values, (rows, columns)), shape=(unknowns, unknowns)).tocsc()
    if found.nnz < len(values):
        _refuse_twice(entries, bool(mirrored), content, start)
    return in_columns(found)


def _refuse_twice(entries: Entries, mirrored: bool, content: bytes, start: int) -> None:
    """Raise UsageError for the first entry that occurs before, also as its mirror image."""
    rows, columns = entries["row"].astype(np.int64), entries["column"].astype(np.int64)
    if mirrored:
        rows, columns = np.maximum(rows, columns), np.minimum(rows, columns)
    keys = rows << 32 | columns
    again = np.ones(len(keys), dtype=bool)
    again[np.unique(keys, return_index=True)[1]] = False
    _refuse(again, content, start, "each entry once")
