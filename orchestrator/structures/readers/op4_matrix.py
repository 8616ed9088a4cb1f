"""One matrix of an OUTPUT4 file: its head, and its columns as strings of numbers in consecutive rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Sparse
from vibroimpact.orchestrator.structures.readers.found import refuse_not_finite, square

Integers = NDArray[np.int64]
NAMELESS = "?"
"""Name of a matrix whose own name is no text."""
MOST_MATRICES = 1000
"""Largest number of matrices in a file; a file with more is refused."""
_LONG_COLUMN = 65536
"""Number of rows from which a string's row needs a word of its own."""
_FORMS = {
    1: "square",
    2: "rectangular",
    3: "diagonal",
    4: "lower triangular",
    5: "upper triangular",
    6: "symmetric",
    8: "identity",
    9: "rectangular",
}
_IN_FULL = frozenset({1, 2, 6})
_DOUBLE, _COMPLEX, _TYPES = frozenset({2, 4}), frozenset({3, 4}), frozenset({1, 2, 3, 4})


@dataclass(frozen=True, slots=True)
class Head:
    """The head of a matrix.

    Attributes
    ----------
    name : str
    rows, columns : int
    form : int
        6 is symmetric, with both triangles in the file.
    type : int
        1 and 2 are real numbers of single and double precision, 3 and 4 complex ones.
    is_big : bool
        A string has its row in a word of its own ("bigmat").
    """

    name: str
    rows: int
    columns: int
    form: int
    type: int
    is_big: bool

    @property
    def is_double(self) -> bool:
        """Whether numbers have double precision."""
        return self.type in _DOUBLE


@dataclass(frozen=True, slots=True)
class Strings:
    """Strings of numbers of a matrix, ascending by column; columns and first rows count from 1.

    Attributes
    ----------
    columns, rows, counts : ndarray of int, shape (string,)
    """

    columns: Integers
    rows: Integers
    counts: Integers

    def within(self) -> Integers:
        """Return the place of each number in its string, from 0."""
        return np.arange(self.counts.sum()) - np.repeat(np.cumsum(self.counts) - self.counts, self.counts)


def head_of(written: str, columns: int, rows: int, form: int, type_: int) -> Head:
    """Return the head of a matrix from its name and numbers in the file.

    Raises
    ------
    UsageError
        A number is out of its range.
    """
    name = written.replace("\0", "").replace(" ", "").upper()
    if not (name.isascii() and name.isprintable() and name):
        name = NAMELESS
    if columns < 0 or type_ not in _TYPES or form not in _FORMS:
        numbers = f"{columns} columns, form {form}, type {type_}"
        raise UsageError(f"{name}: expected columns, a form 1 to 9 and a type 1 to 4, got {numbers}.")
    return Head(name, abs(rows), columns, form, type_, rows < 0 or rows >= _LONG_COLUMN)


def refuse_unfit(head: Head) -> None:
    """Raise UsageError unless a matrix is real, square and written in full."""
    if head.type in _COMPLEX:
        raise UsageError("expected a matrix of real numbers, got complex ones.")
    if head.form not in _IN_FULL:
        got = f"form {head.form} ({_FORMS[head.form]})"
        raise UsageError(f"expected a square matrix in full, form 1 or 6, got {got}.")
    square(head.rows, head.columns)


def in_full(head: Head, strings: Strings, values: Floats) -> Sparse:
    """Return a matrix from all its strings and their numbers.

    Raises
    ------
    UsageError
        A number is outside of the matrix, at a place that has one already, or not finite.
    """
    from scipy.sparse import csc_array

    ends = strings.rows + strings.counts - 1
    outside = (strings.rows < 1) | (strings.rows > head.rows) | (ends > head.rows)
    _refuse(strings, outside, f"rows 1 to {head.rows}")
    again = np.zeros(len(ends), dtype=bool)
    again[1:] = (np.diff(strings.columns) == 0) & (strings.rows[1:] <= ends[:-1])
    _refuse(strings, again, "ascending rows, each once")
    rows, columns = (np.repeat(each, strings.counts) - 1 for each in (strings.rows, strings.columns))
    rows += strings.within()
    there = values != 0.0
    starts = np.searchsorted(columns[there], np.arange(head.columns + 1))
    found = csc_array((values[there], rows[there], starts), shape=(head.rows, head.columns))
    refuse_not_finite(found)
    return found


def _refuse(strings: Strings, wrong: NDArray[np.bool_], expected: str) -> None:
    """Raise UsageError at the first wrong string."""
    if wrong.any():
        at = int(np.argmax(wrong))
        column, row, count = (int(each[at]) for each in (strings.columns, strings.rows, strings.counts))
        raise UsageError(f"column {column}: expected {expected}, got rows {row} to {row + count - 1}.")
