"""Binary OUTPUT4 files: records of Fortran, one for the head of a matrix and one for each of its columns."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers.op4_matrix import (
    MOST_MATRICES,
    Head,
    Integers,
    Strings,
    head_of,
)

_MARK = 4
"""Bytes of a record's length, before and after its content."""
_WORDS = {24: 4, 48: 8}
"""Bytes of a word, by the length of a head's record."""
_HEAD, _COLUMN = 6, 3
"""Words of a head, and words before the numbers of a column."""


@dataclass(slots=True)
class _Columns:
    """Columns of a matrix, each with its first row (0 before strings), the byte of its numbers and their words."""

    columns: list[int] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    places: list[int] = field(default_factory=list)
    words: list[int] = field(default_factory=list)


def is_binary(content: bytes) -> bool:
    """Return whether a file begins with the record of a matrix's head.

    >>> is_binary(b"\\x18\\0\\0\\0"), is_binary(b"\\0\\0\\0\\x30"), is_binary(b"       2")
    (True, True, False)
    """
    return _order_of(content) is not None


def _order_of(content: bytes) -> str | None:
    for order in "<>":
        if len(content) >= _MARK and struct.unpack_from(f"{order}i", content)[0] in _WORDS:
            return order
    return None


class BinaryFile:
    """A binary file.

    Attributes
    ----------
    heads : list of Head
        In the order of the file.

    Raises
    ------
    UsageError
        A record contradicts itself, its matrix or the length of the file.
    """

    def __init__(self, content: bytes) -> None:
        order = _order_of(content)
        if order is None:
            raise UsageError("byte 0: expected the head of a matrix, got another record.")
        self._content, self._order = content, order
        self._word = _WORDS[struct.unpack_from(f"{order}i", content)[0]]
        self._integer = f"{order}i{self._word}"
        self.heads: list[Head] = []
        self._columns: list[_Columns] = []
        records = self._records()
        for at, end in records:
            if len(self.heads) >= MOST_MATRICES:
                raise UsageError(f"byte {at}: expected at most {MOST_MATRICES} matrices, got more.")
            head = self._head(at, end)
            self.heads.append(head)
            self._columns.append(self._columns_of(head, records))

    def _records(self) -> Iterator[tuple[int, int]]:
        """Yield the first byte and the end of each record's content."""
        length_at = struct.Struct(f"{self._order}i").unpack_from
        at, size = 0, len(self._content)
        while at < size:
            (length,) = length_at(self._content, at) if at + _MARK <= size else (0,)
            end = at + _MARK + length
            if length <= 0 or length % self._word:
                raise UsageError(f"byte {at}: expected the length of a record, got {length}.")
            if end + _MARK > size:
                raise UsageError(f"byte {at}: expected a record of {length} bytes, got the end of the file.")
            (again,) = length_at(self._content, end)
            if again != length:
                raise UsageError(f"byte {end}: expected {length}, the length of the record, got {again}.")
            yield at + _MARK, end
            at = end + _MARK

    def _integers(self, at: int, count: int) -> tuple[int, ...]:
        letter = "q" if self._word == 8 else "i"
        return struct.unpack_from(f"{self._order}{count}{letter}", self._content, at)

    def _head(self, at: int, end: int) -> Head:
        length = _HEAD * self._word
        if end - at != length:
            raise UsageError(f"byte {at}: expected the head of a matrix, got a record of {end - at} bytes.")
        columns, rows, form, type_ = self._integers(at, 4)
        name = self._content[at + 4 * self._word : end].decode("latin-1")
        return head_of(name, columns, rows, form, type_)

    def _columns_of(self, head: Head, records: Iterator[tuple[int, int]]) -> _Columns:
        """Return the columns of a matrix; a record after the last column ends it."""
        found, before, first = _Columns(), 0, _COLUMN * self._word
        for at, end in records:
            place = f"byte {at}: {head.name}"
            if end - at < first:
                raise UsageError(f"{place}: expected a column, got a record of {end - at} bytes.")
            column, row, count = self._integers(at, _COLUMN)
            if column > head.columns:
                return found
            words = (end - at) // self._word - _COLUMN
            if count < 1 or words != count:
                raise UsageError(f"{place}: expected {count} words of a column, got {words}.")
            if not before < column or row < 0 or (row and count % self._words_of(head)):
                got = f"{count} words from row {row} of column {column}"
                raise UsageError(f"{place}: expected whole numbers of a column above {before}, got {got}.")
            before = column
            found.columns.append(column)
            found.rows.append(row)
            found.places.append(at + first)
            found.words.append(count)
        raise UsageError(f"{head.name}: expected the end of the matrix, got the end of the file.")

    def _words_of(self, head: Head) -> int:
        """Return the words of one number; a word of eight bytes holds one of either precision."""
        return 2 if self._word == _MARK and head.is_double else 1

    def numbers(self, place: int) -> tuple[Strings, Floats]:
        """Return the strings of a matrix, and all their numbers.

        UsageError: a string reaches out of its column.
        """
        head, found = self.heads[place], self._columns[place]
        columns, rows, places, words = (
            np.array(each, dtype=np.int64) for each in (found.columns, found.rows, found.places, found.words)
        )
        is_sparse = rows == 0
        dense = [each[~is_sparse] for each in (columns, rows, places, words)]
        strings = self._strings(head, columns[is_sparse], places[is_sparse], words[is_sparse])
        joined = [np.concatenate(each) for each in zip(dense, strings, strict=True)]
        order = np.argsort(joined[0], kind="stable")
        columns, rows, places, words = (each[order] for each in joined)
        ordered = Strings(columns, rows, words // self._words_of(head))
        bytes_of = self._word * self._words_of(head)
        at = np.repeat(places, ordered.counts) + bytes_of * ordered.within()
        return ordered, self._at_bytes(f"f{bytes_of}", at).astype(np.float64)

    def _at_bytes(self, kind: str, at: Integers) -> Floats:
        """Return the numbers of a kind that begin at some bytes; all of these are 4 beyond a multiple of 8, or of 4."""
        size = np.dtype(kind).itemsize
        first = _MARK % self._word
        count = max(0, (len(self._content) - first - size) // self._word + 1)
        every: Floats = np.ndarray(
            (count,), f"{self._order}{kind}", self._content, offset=first, strides=(self._word,)
        )
        return every[(at - first) // self._word]

    def _strings(
        self, head: Head, columns: Integers, at: Integers, words: Integers
    ) -> tuple[Integers, Integers, Integers, Integers]:
        """Return column, first row, place and words of all strings, from one string of every column at a time."""
        ends = at + words * self._word
        parts = [(np.empty(0, np.int64),) * 4]
        for _ in range(head.rows + 1):
            is_open = at < ends
            columns, at, ends = columns[is_open], at[is_open], ends[is_open]
            if not len(at):
                found = [np.concatenate(each) for each in zip(*parts, strict=True)]
                return found[0], found[1], found[2], found[3]
            lengths, rows, starts = self._string_heads(head, at, ends)
            most = (ends - starts) // self._word
            wrong = (lengths < 1) | (lengths % self._words_of(head) != 0) | (lengths > most)
            if wrong.any():
                which = int(np.argmax(wrong))
                expected = f"column {columns[which]}: expected a string within the column"
                raise UsageError(f"{expected}, got one of {lengths[which]} words.")
            parts.append((columns, rows, starts, lengths))
            at = starts + lengths * self._word
        raise UsageError(f"expected at most {head.rows} strings in a column, got more.")

    def _string_heads(self, head: Head, at: Integers, ends: Integers) -> tuple[Integers, Integers, Integers]:
        """Return words, first row and place of the numbers of the strings that begin at some bytes."""
        kind = f"i{self._word}"
        first = self._at_bytes(kind, at).astype(np.int64)
        if not head.is_big:
            return (first >> 16) - 1, first & 0xFFFF, at + self._word
        row = self._at_bytes(kind, np.minimum(at + self._word, ends - self._word)).astype(np.int64)
        return first - 1, row, at + 2 * self._word
