"""The files of one import, each with the user's settings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.messages import message, reworded
from vibroimpact.hardware.formats.reading import read_file
from vibroimpact.hardware.formats.table import RawFile
from vibroimpact.hardware.formats.text import DELIMITERS
from vibroimpact.hardware.recordings.columns import chosen_tables
from vibroimpact.hardware.recordings.segments import joined, split_at_restarts
from vibroimpact.hardware.recordings.settings import ImportSettings, settings_beside
from vibroimpact.hardware.recordings.unix_time import counted_from_start

_LONGEST_LINE = 500
_PER_COLUMN = frozenset({"name", "unit", "scale", "offset"})


@dataclass(slots=True)
class Source:
    """One file: its raw content, and the user's settings."""

    path: Path
    settings: ImportSettings
    """Their lists go through the columns of this file."""
    raw: RawFile
    """With the selected columns, and instants in s."""

    @property
    def columns(self) -> int:
        """Number of data columns in all tables."""
        return sum(len(table.columns) for table in self.raw.tables)


def read_source(path: Path, given: ImportSettings, common: ImportSettings | None = None) -> Source:
    """Return one file with its selected columns.

    `given` are the settings of the command line; `spread` assigns those for single columns. `common` replaces the
    settings file beside the file. DatasetError, with the file's name: the file cannot be read.
    """
    own = settings_beside(path) if common is None else common
    own = own.model_copy(update={key: getattr(given, key) for key in given.model_fields_set - _PER_COLUMN})
    with naming(path):
        delimiter = "" if own.delimiter is None else DELIMITERS[own.delimiter]
        raw = read_file(path, delimiter=delimiter, decimal=own.decimal or "", dates=own.dates or "")
        chosen, counted, date = counted_from_start(chosen_tables(raw, own), own.rate)
        tables, joints = joined(chosen)
        pieces = [split_at_restarts(table) for table in tables]
    remarks = [
        *([raw.damage] if raw.damage else []),
        *raw.remarks,
        *counted,
        *joints,
        *(line for _, lines in pieces for line in lines),
    ]
    found = [table for split, _ in pieces for table in split]
    return Source(path, own, replace(raw, tables=found, remarks=remarks, attrs={**date, **raw.attrs}))


def shortened(line: str) -> str:
    """Return a line of at most `_LONGEST_LINE` characters: names in files may have millions."""
    return line if len(line) <= _LONGEST_LINE else f"{line[: _LONGEST_LINE - 3]}..."


@contextmanager
def naming(path: Path, besides: str = "") -> Iterator[None]:
    """Let the lines of an error begin with the name of their file, and end with its other damage.

    A DatasetError also replaces the error of an unreadable file, or of one too large for the memory.
    """
    try:
        yield
    except DatasetError as problem:

        def named(text: str) -> str:
            return "\n".join(f"{path}: {line}" for line in map(shortened, text.splitlines()))

        more = f" Besides, {besides}." if besides else ""
        raise DatasetError(reworded(message(problem.message, more), named)) from problem
    except OSError as problem:
        raise DatasetError(
            f"{path}: expected a readable file, got an error: {problem.strerror or problem}."
        ) from problem
    except MemoryError as problem:
        raise DatasetError(f"{path}: expected a file that fits into memory, got a larger one.") from problem


def spread(sources: Sequence[Source], given: ImportSettings) -> None:
    """Distribute the command line's values for columns, in order, to the files of these columns.

    UsageError: there are fewer columns than names, units, scales or offsets.
    """
    edges = np.cumsum([0, *(source.columns for source in sources)]).tolist()
    for key in sorted(_PER_COLUMN & given.model_fields_set):
        values = getattr(given, key)
        _check_count(key, len(values), edges[-1], "command line: ")
        for source, (begin, end) in zip(sources, pairwise(edges), strict=True):
            part = values if len(values) == 1 and key != "name" else values[begin:end]
            if part:
                source.settings = source.settings.model_copy(update={key: tuple(part)})
    for source in sources:
        for key in sorted(_PER_COLUMN):
            _check_count(key, len(getattr(source.settings, key)), source.columns, f"{source.path}: ")


def _check_count(key: str, got: int, columns: int, where: str) -> None:
    if got > max(columns, 1):
        raise UsageError(
            f"{where}{key}: expected at most {columns}, one for each column, got {got}. "
            "The column of instants is not counted."
        )
