"""Text OUTPUT4 files: lines of integers before lines of numbers, whose format the head of the matrix gives.

The numbers of a string are passed over at first, since its lines have a known length. numpy reads those of one matrix.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers.fortran_numbers import integer_of, real_of
from vibroimpact.orchestrator.structures.readers.op4_matrix import (
    MOST_MATRICES,
    Head,
    Integers,
    Strings,
    head_of,
)

_FORMAT = re.compile(r"(?:1P,?)?\s*(\d{1,2})[EDFG](\d{1,2})\.\d{1,2}", re.IGNORECASE)
_USUAL_FORMAT = 5, 16
"""Numbers in a line, and characters of each."""
_WIDE = "|I16"
"""Mark of a head whose rows and columns have 16 characters."""
_NEWLINE = b"\n"
_TRAILING = b" \r\0\x1a"
_IN_NUMBERS = np.isin(np.arange(256), np.frombuffer(b" +-.0123456789DEde", np.uint8))
"""Whether a byte is in a number, by the byte."""
_AT_ONCE = 100_000
"""Numbers that are converted at once."""


@dataclass(frozen=True, slots=True)
class _Format:
    """Numbers in a line, and characters of each."""

    count: int
    width: int

    @property
    def line(self) -> int:
        """Bytes of a full line with its end."""
        return self.count * self.width + len(_NEWLINE)


def _no_integers() -> array[int]:
    return array("q")


@dataclass(slots=True)
class _Matrix:
    """Strings of a matrix: columns, first rows, counts, and the byte of the first number of each."""

    written: _Format
    columns: array[int] = field(default_factory=_no_integers)
    rows: array[int] = field(default_factory=_no_integers)
    counts: array[int] = field(default_factory=_no_integers)
    places: array[int] = field(default_factory=_no_integers)


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
        self._content = _trimmed(content)
        self._start, self._next = 0, 0
        self.heads: list[Head] = []
        self._matrices: list[_Matrix] = []
        while self._next < len(self._content):
            line = self._line()
            if not line:
                continue
            if len(self.heads) >= MOST_MATRICES:
                raise self._unlike(f"at most {MOST_MATRICES} matrices")
            head, written = self._head(line)
            self.heads.append(head)
            self._matrices.append(_Matrix(written))
            self._read(head, self._matrices[-1])

    def numbers(self, place: int) -> tuple[Strings, Floats]:
        """Return the strings of a matrix, and all their numbers.

        UsageError: a line has no numbers where they are expected.
        """
        found = self._matrices[place]
        columns, rows, counts, places = (
            np.array(each, dtype=np.int64) for each in (found.columns, found.rows, found.counts, found.places)
        )
        strings, written = Strings(columns, rows, counts), found.written
        line, number = np.divmod(strings.within(), written.count)
        at = np.repeat(places, counts) + line * written.line + number * written.width
        letters = np.frombuffer(self._content, np.uint8)
        ends = at[number == written.count - 1] + written.width
        wrong = ends[letters[ends] != ord(_NEWLINE)]
        if len(wrong):
            raise self._unlike(_numbers_of(written), int(wrong[0]) - written.line + 1)
        values = np.empty(len(at))
        for first in range(0, len(at), _AT_ONCE):
            here = slice(first, first + _AT_ONCE)
            values[here] = self._reals(letters, at[here], written)
        return strings, values

    def _reals(self, letters: NDArray[np.uint8], at: Integers, written: _Format) -> Floats:
        """Return the numbers that begin at some bytes."""
        fields = letters[at[:, None] + np.arange(written.width)]
        if _IN_NUMBERS[fields].all():
            fields[(fields | 32) == ord("d")] = ord("e")
            try:
                return np.ascontiguousarray(fields).view(f"S{written.width}")[:, 0].astype(np.float64)
            except ValueError:  # a number without a letter before its exponent, or none
                pass
        found = []
        for place in at.tolist():
            try:
                found.append(real_of(self._content[place : place + written.width].decode("latin-1")))
            except ValueError:
                raise self._unlike(_numbers_of(written), place) from None
        return np.array(found)

    def _line(self) -> str:
        """Return the next line."""
        if self._next >= len(self._content):
            raise UsageError("expected more lines, got the end of the file.")
        end = self._content.index(_NEWLINE, self._next)
        self._start, self._next = self._next, end + 1
        return self._content[self._start : end].decode("latin-1")

    def _integers(self, widths: Sequence[int], expected: str) -> list[int]:
        """Return the integers of the next line."""
        line = self._line()
        try:
            return _integers(line, widths)
        except ValueError:
            raise self._unlike(expected) from None

    def _unlike(self, expected: str, place: int | None = None) -> UsageError:
        """Return the error of a line that begins at, or holds, a byte; of the last line by default."""
        place = self._start if place is None else place
        number = self._content.count(_NEWLINE, 0, place) + 1
        got = self._content[place : self._content.find(_NEWLINE, place)][:60].decode("latin-1").strip()
        return UsageError(f"line {number}: expected {expected}, got {got!r}.")

    def _head(self, line: str) -> tuple[Head, _Format]:
        """Return the head of a matrix, and the format of its numbers."""
        widths = (16, 16, 8, 8) if line.endswith(_WIDE) else (8, 8, 8, 8)
        name, rest = line[sum(widths) : sum(widths) + 8], line[sum(widths) + 8 :]
        written = rest.removesuffix(_WIDE).strip()
        found = _FORMAT.fullmatch(written)
        count, width = (int(found[1]), int(found[2])) if found else _USUAL_FORMAT
        try:
            columns, rows, form, type_ = _integers(line, widths)
        except ValueError:
            raise self._unlike("the head of a matrix") from None
        if (written and not found) or count < 1 or width < 1:
            raise self._unlike("a format of numbers such as 1P,3E23.16 in the head of a matrix")
        return head_of(name, columns, rows, form, type_), _Format(count, width)

    def _read(self, head: Head, found: _Matrix) -> None:
        """Take the columns of a matrix; a line of a column after the last ends it."""
        before = 0
        while True:
            column, row, count = self._integers((8, 8, 8), f"a column of {head.name}")
            if column > head.columns:
                if count > 0:
                    self._line()
                return
            if not before < column or row < 0 or count < 1:
                raise self._unlike(f"numbers of a column of {head.name} above {before}")
            before = column
            if row > 0:
                self._string(found, column, row, count)
            else:
                self._strings(head, found, column, count)

    def _strings(self, head: Head, found: _Matrix, column: int, words: int) -> None:
        """Take the strings of a sparse column."""
        each = 2 if head.is_double else 1
        while words > 0:
            length, row, own = self._string_head(head)
            words -= length + own
            if length < 1 or length % each or words < 0:
                raise self._unlike(f"a string within column {column} of {head.name}")
            self._string(found, column, row, length // each)

    def _string_head(self, head: Head) -> tuple[int, int, int]:
        """Return the words of a string's numbers, its first row, and the words of its head."""
        expected = f"the length and row of a string of {head.name}"
        if head.is_big:
            length, row = self._integers((8, 8), expected)
            return length - 1, row, 2
        (joined,) = self._integers((16,), expected)
        return (joined >> 16) - 1, joined & 0xFFFF, 1

    def _string(self, found: _Matrix, column: int, row: int, count: int) -> None:
        """Take a string of numbers, and pass over them."""
        found.columns.append(column)
        found.rows.append(row)
        found.counts.append(count)
        found.places.append(self._next)
        self._pass_over(found.written, count)

    def _pass_over(self, written: _Format, count: int) -> None:
        """Pass over the lines of some numbers."""
        lines, rest = divmod(count, written.count)
        end = self._next + lines * written.line + (rest * written.width if rest else -1)
        if self._content[end : end + 1] != _NEWLINE:
            raise self._unlike(f"{count} {_numbers_of(written)}", min(self._next, len(self._content) - 1))
        self._next = end + 1


def _trimmed(content: bytes) -> bytes:
    """Return a text whose lines have no blanks at their ends, with a newline after the last."""
    if any(letter + _NEWLINE in content for letter in (b" ", b"\r")) or content[-1:] in (
        b"\0",
        b"\x1a",
        b" ",
    ):
        content = _NEWLINE.join(line.rstrip(_TRAILING) for line in content.split(_NEWLINE))
    return content if content.endswith(_NEWLINE) else content + _NEWLINE


def _numbers_of(written: _Format) -> str:
    return f"numbers of {written.width} characters, {written.count} in a line"


def _integers(line: str, widths: Sequence[int]) -> list[int]:
    """Return the integers of a line; ValueError: a field has none."""
    found, at = [], 0
    for width in widths:
        found.append(integer_of(line[at : at + width]))
        at += width
    return found
