"""Exports of instruments, recognised by the tables of `dialects/`: a file for each maker, a form for each export.

A form says how to recognise an export, and where it has headings, units, rate and instants. The general reader of
texts finds the rest; it reads the exports of all other makers alone.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.hardware.formats.cells import is_number, split_line
from vibroimpact.hardware.formats.labels import is_known_unit, seconds_in, split_label
from vibroimpact.hardware.formats.table import Column, Table

_FOLDER = Path(__file__).parent / "dialects"
_HEAD = 8_000
"""Characters at the start of a text, in which a form is recognised."""
_MARKS = {"tab": "\t", "semicolon": ";", "comma": ","}
_NUMBER = re.compile(r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d{1,3})?", re.ASCII)


@dataclass(frozen=True, slots=True)
class Form:
    """One export of a maker; texts are regular expressions for lines, and their first group is used."""

    maker: str
    signature: Sequence[str]
    """Expressions that an export of this form must all match."""
    delimiter: str = ""
    decimal: str = ""
    """As in the options of these names; empty: found from the rows."""
    replaced: Sequence[Sequence[str]] = ()
    """Pairs of an expression and its replacement, applied before the rows are read."""
    first_column: int = 1
    """Cells before this one are settings next to the rows; 1 is the first."""
    headings: str = ""
    """Headings of all columns."""
    names: str = ""
    units: str = ""
    """Names and units of the last columns."""
    time_unit: str = ""
    unit_words: Mapping[str, str] = field(default_factory=dict)
    """The maker's words for units."""
    headings_are_units: bool = False
    """A heading that is only a unit is the unit of its column."""
    time: str = ""
    """Heading of the instants."""
    time_column: int = 0
    """Place of the instants without a heading; 1 is the first."""
    interval: str = ""
    rate: str = ""
    start: str = ""
    """`interval`, `rate` and `start` are numbers in the header; the second group is their unit, if there is one."""
    counts: bool = False
    """The first column counts the samples."""
    left_out: str = ""
    """Headings of columns that are no measurements."""
    pairs: bool = False
    """Columns are pairs of instants and values."""


@lru_cache(maxsize=1)
def forms() -> tuple[Form, ...]:
    """Return the forms of all makers, in the order of their files."""
    found = []
    for path in sorted(_FOLDER.glob("*.toml")):
        document = parse_toml(path.read_text(encoding="utf-8"))
        maker, words = str(document.pop("maker")), document.pop("unit_words", {})
        for table in document.pop("form"):
            given: dict[str, Any] = {"maker": maker, "unit_words": words, **table}
            found.append(Form(**given))
    return tuple(found)


def instrument_of(content: str) -> Instrument | None:
    """Return the instrument that wrote a text; None if no maker's form is recognised.

    >>> instrument_of("Time (s),Force (N)\\n0,1\\n") is None
    True
    """
    head = content[:_HEAD]
    form = next(
        (form for form in forms() if all(re.search(line, head, re.M) for line in form.signature)), None
    )
    return None if form is None else Instrument(form, head)


@dataclass(frozen=True, slots=True)
class Instrument:
    """A form, and the start of a text in this form."""

    form: Form
    head: str

    def prepared(self, content: str) -> str:
        """Return the text for the general reader: replaced, and without settings next to the rows, as in the form."""
        for expression, text in self.form.replaced:
            content = re.sub(expression, text, content, flags=re.M)
        if self.form.first_column == 1:
            return content
        mark = _MARKS[self.form.delimiter]
        lines = [self._without_settings(line, mark) for line in content.splitlines()]
        # a text without a final line break may have been cut off
        return "\n".join(lines) + ("\n" if content.endswith(("\n", "\r")) else "")

    def _without_settings(self, line: str, mark: str) -> str:
        cells = line.split(mark)
        first = self.form.first_column
        is_row = len(cells) > first and is_number(cells[first - 1], self.form.decimal or ".")
        return mark.join(cells[first - 1 :]) if is_row else line

    def described(self, columns: Sequence[Column]) -> tuple[list[Column], list[str]]:
        """Return columns of the general reader with names, units and clock of the form, and remarks."""
        named = self._with_headings(columns)
        filled = [column for column in named if len(column.values)]
        left_out = [column.label for column in filled if self._has(self.form.left_out, column.label)]
        filled = [column for column in filled if column.label not in left_out]
        filled = self._with_last("names", filled)
        filled = self._with_last("units", filled)
        remarks = [f"{', '.join(left_out)[:120]}: no measurements, and left out"] if left_out else []
        return self._with_interval([self._with_own_unit(column) for column in filled]), remarks

    def _with_headings(self, columns: Sequence[Column]) -> list[Column]:
        cells = self._cells(self.form.headings)
        if not cells:
            return list(columns)
        named = []
        for place, column in enumerate(columns):
            name, unit = (
                split_label(cells[place]) if place < len(cells) and cells[place] else (column.label, "")
            )
            named.append(replace(column, label=name, unit="s" if column.dated else unit))
        return named

    def _with_last(self, what: str, columns: Sequence[Column]) -> list[Column]:
        """Return the columns, the last of them with the names or units of the header."""
        cells = [cell.strip("()[] ") for cell in self._cells(getattr(self.form, what))[: len(columns)]]
        kept = list(columns)
        for place, cell in enumerate(cells, len(columns) - len(cells)):
            if cell:
                column = kept[place]
                is_name = what == "names"
                kept[place] = replace(column, label=cell) if is_name else replace(column, unit=cell)
        return kept

    def _with_own_unit(self, column: Column) -> Column:
        """Return a column with a known unit, translated from the words of the maker."""
        unit = self.form.unit_words.get(column.unit, column.unit)
        if not unit and self.form.headings_are_units:
            word = self.form.unit_words.get(column.label, column.label)
            unit = word if is_known_unit(word) else ""
        return replace(column, unit=unit)

    def _with_interval(self, columns: Sequence[Column]) -> list[Column]:
        interval, rate = self._seconds(self.form.interval), self._seconds(self.form.rate)
        if rate:
            interval = 1.0 / rate
        if not interval or not interval > 0.0:
            return list(columns)
        start = self._seconds(self.form.start) or 0.0
        return [replace(column, interval=interval, start=start) for column in columns]

    def tables(self, columns: Sequence[Column]) -> list[Table] | None:
        """Return the tables of columns if the form knows their instants, else None."""
        form = self.form
        if form.pairs:
            if not all(map(self._is_clock, columns[::2])) or len(columns) < 2 or len(columns) % 2:
                return None
            return [Table([columns[at + 1]], self._clock(columns[at])) for at in range(0, len(columns), 2)]
        if form.counts and len(columns) > 1 and columns[0].interval is not None:
            return [self._counted(columns[0], columns[1:])]
        place = form.time_column - 1
        if form.time:
            places = [at for at, column in enumerate(columns) if self._has(form.time, column.label)]
            place = places[0] if len(places) == 1 else -1  # several are pairs, which the general rules find
        if not 0 <= place < len(columns) or len(columns) < 2 or not self._is_clock(columns[place]):
            return None
        others = [column for at, column in enumerate(columns) if at != place]
        if columns[place].interval is not None and _is_coarse(columns[place]):
            return [Table(others)]
        return [Table(others, self._clock(columns[place]), time_place=place)]

    def _is_clock(self, column: Column) -> bool:
        """Whether a column may have instants: its unit is one of time, or empty; dates are in s already."""
        return column.dated or not column.unit or seconds_in(column.unit) is not None

    def _clock(self, column: Column) -> Column:
        """Return a column of instants with its unit; dates are in s."""
        if column.dated:
            return column
        unit = (self._cells(self.form.time_unit) or [""])[0]
        unit = column.unit or self.form.unit_words.get(unit, unit) or split_label(column.label)[1] or "s"
        label = "time" if re.fullmatch(r"column_\d+", column.label) else column.label
        return replace(column, label=label, unit=unit if seconds_in(unit) is not None else "s")

    def _counted(self, count: Column, columns: Sequence[Column]) -> Table:
        """Return columns of counted samples: evenly spaced, or at instants if some samples are missing."""
        interval, begin = count.interval or 0.0, count.values[0]
        if len(count.values) == len(columns[0].values) and bool(np.all(np.diff(count.values) == 1.0)):
            start = count.start + interval * float(begin)
            return Table([replace(column, start=start) for column in columns])
        instants = Column(count.label, count.start + interval * count.values, "s")
        return Table([replace(column, interval=None) for column in columns], instants)

    def _cells(self, expression: str) -> list[str]:
        """Return the cells that an expression finds in the header; empty without a match."""
        match = re.search(expression, self.head, re.M) if expression else None
        if match is None:
            return []
        text = match[1].strip().rstrip(",;")
        mark = _MARKS.get(self.form.delimiter) or next((mark for mark in "\t;," if mark in text), ",")
        return [cell.strip() for cell in split_line(text, mark)]

    def _seconds(self, expression: str) -> float | None:
        """Return a number of the header, in s (or Hz) if it has a unit."""
        match = re.search(expression, self.head, re.M) if expression else None
        number = _NUMBER.match(match[1].strip()) if match is not None else None
        if match is None or number is None:
            return None
        unit = (match[2] or "") if match.re.groups > 1 else ""
        unit = self.form.unit_words.get(unit, unit)
        factor = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6}.get(unit) or seconds_in(unit) or 1.0
        return float(number[0].replace(",", ".")) * factor

    def _has(self, expression: str, label: str) -> bool:
        return bool(expression) and re.search(expression, label) is not None


def _is_coarse(clock: Column) -> bool:
    """Whether a clock of the day is printed too coarsely for its samples: some share an instant."""
    return clock.dated and bool(np.any(np.diff(clock.values) == 0.0))
