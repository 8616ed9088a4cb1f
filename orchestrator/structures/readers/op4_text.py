"""Text OUTPUT4 files: lines of integers before lines of numbers, whose format the head of the matrix gives."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers.fortran_numbers import integer_of, real_of
from vibroimpact.orchestrator.structures.readers.op4_matrix import MOST_MATRICES, Head, Strings, head_of

_FORMAT = re.compile(r"(?:1P,?)?\s*(\d{1,2})[EDFG](\d{1,2})\.\d{1,2}", re.IGNORECASE)
_USUAL_FORMAT = 5, 16
"""Numbers in a line, and characters of each."""
_WIDE = "|I16"
"""Mark of a head whose rows and columns have 16 characters."""


@dataclass(frozen=True, slots=True)
class _Format:
    """Numbers in a line, and characters of each."""

    count: int
    width: int


@dataclass(slots=True)
class _Numbers:
    """Strings of numbers; without values where they are only counted."""

    is_kept: bool
    values: list[float] = field(default_factory=list)
    columns: list[int] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)


class TextFile:
    """A text file.

    Attributes
    ----------
    heads : list of Head
        In the order of the file.

    Raises
    ------
    UsageError
        A line is not what the lines before it announce.
    """

    def __init__(self, content: bytes) -> None:
        self._lines = content.split(b"\n")
        self._number = 0
        self.heads: list[Head] = []
        self._starts: list[int] = []
        self._formats: list[_Format] = []
        while self._number < len(self._lines):
            line = self._line()
            if not line.strip(" \0\x1a"):
                continue
            if len(self.heads) >= MOST_MATRICES:
                raise UsageError(f"line {self._number}: expected at most {MOST_MATRICES} matrices, got more.")
            head, written = self._head(line)
            self.heads.append(head)
            self._starts.append(self._number)
            self._formats.append(written)
            self._read(head, written, _Numbers(False))

    def numbers(self, place: int) -> tuple[Strings, Floats]:
        """Return the strings of a matrix, and all their numbers.

        UsageError: a line has no numbers where they are expected.
        """
        self._number = self._starts[place]
        found = _Numbers(True)
        self._read(self.heads[place], self._formats[place], found)
        columns, rows, counts = (
            np.array(each, dtype=np.int64) for each in (found.columns, found.rows, found.counts)
        )
        return Strings(columns, rows, counts), np.array(found.values, dtype=np.float64)

    def _line(self) -> str:
        if self._number >= len(self._lines):
            raise UsageError(f"line {self._number}: expected more lines, got the end of the file.")
        self._number += 1
        return self._lines[self._number - 1].decode("latin-1").rstrip("\r")

    def _integers(self, widths: tuple[int, ...], expected: str) -> list[int]:
        """Return the integers of the next line."""
        line = self._line()
        try:
            return _integers(line, widths)
        except ValueError:
            raise self._unlike(expected, line) from None

    def _unlike(self, expected: str, got: str) -> UsageError:
        """Return the error of the last line."""
        return UsageError(f"line {self._number}: expected {expected}, got {got[:60].strip()!r}.")

    def _head(self, line: str) -> tuple[Head, _Format]:
        """Return the head of a matrix, and the format of its numbers."""
        widths = (16, 16, 8, 8) if line.rstrip().endswith(_WIDE) else (8, 8, 8, 8)
        name, rest = line[sum(widths) : sum(widths) + 8], line[sum(widths) + 8 :]
        written = rest.strip().removesuffix(_WIDE)
        found = _FORMAT.fullmatch(written)
        count, width = (int(found[1]), int(found[2])) if found else _USUAL_FORMAT
        try:
            columns, rows, form, type_ = _integers(line, widths)
        except ValueError:
            raise self._unlike("the head of a matrix", line) from None
        if (written and not found) or count < 1 or width < 1:
            raise self._unlike("a format of numbers such as 1P,3E23.16", written)
        return head_of(name, columns, rows, form, type_), _Format(count, width)

    def _read(self, head: Head, written: _Format, found: _Numbers) -> None:
        """Read the columns of a matrix; a line of a column after the last ends it."""
        before = 0
        while True:
            column, row, count = self._integers((8, 8, 8), f"a column of {head.name}")
            if column > head.columns:
                self._number += -(-max(0, count) // written.count)
                return
            if not before < column or row < 0 or count < 1:
                got = f"{count} from row {row} of column {column}"
                raise self._unlike(f"numbers of a column of {head.name} above {before}", got)
            before = column
            if row > 0:
                self._string(written, found, (column, row, count))
            else:
                self._strings(head, written, found, column, count)

    def _strings(self, head: Head, written: _Format, found: _Numbers, column: int, words: int) -> None:
        """Read the strings of a sparse column."""
        each = 2 if head.is_double else 1
        while words > 0:
            length, row, own = self._string_head(head)
            words -= length + own
            if length < 1 or length % each or words < 0:
                raise self._unlike("a string within the column", f"{length} words")
            self._string(written, found, (column, row, length // each))

    def _string_head(self, head: Head) -> tuple[int, int, int]:
        """Return the words of a string's numbers, its first row, and the words of its head."""
        expected = f"the length and row of a string of {head.name}"
        if head.is_big:
            length, row = self._integers((8, 8), expected)
            return length - 1, row, 2
        (joined,) = self._integers((16,), expected)
        return (joined >> 16) - 1, joined & 0xFFFF, 1

    def _string(self, written: _Format, found: _Numbers, place: tuple[int, int, int]) -> None:
        """Read the numbers of a string, from its column, first row and count."""
        column, row, count = place
        if not found.is_kept:
            self._number += -(-count // written.count)
            return
        for done in range(0, count, written.count):
            line, here = self._line(), min(written.count, count - done)
            try:
                found.values += _reals(line, written.width, here)
            except ValueError:
                expected = f"{here} numbers of {written.width} characters"
                raise self._unlike(expected, line) from None
        found.columns.append(column)
        found.rows.append(row)
        found.counts.append(count)


def _integers(line: str, widths: tuple[int, ...]) -> list[int]:
    """Return the integers of a line; ValueError: a field has none."""
    found, at = [], 0
    for width in widths:
        found.append(integer_of(line[at : at + width]))
        at += width
    return found


def _reals(line: str, width: int, count: int) -> list[float]:
    """Return the numbers that fill a line; ValueError: it has others, or more characters."""
    if len(line.rstrip()) != width * count:
        raise ValueError("a line of another length")
    return [real_of(line[at : at + width]) for at in range(0, width * count, width)]
