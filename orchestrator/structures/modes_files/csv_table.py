"""Modes in a table of text: a row for the frequencies, one for each point, and a column for each mode.

The first cell of a row is `frequency` (Hz) or `angular_frequency` (rad/s), `damping_ratio`, `modal_mass` (kg),
`participation` (kg^(1/2)), or the name of a point. Commas, semicolons, tabs or blanks separate the cells.
"""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes_files.given import MOST_NUMBERS, GivenModes
from vibroimpact.orchestrator.structures.readers.fortran_numbers import real_of
from vibroimpact.orchestrator.structures.readers.freedoms import table_rows

_FREQUENCY, _ANGULAR = "frequency", "angular_frequency"
_KEYS = (_FREQUENCY, _ANGULAR, "damping_ratio", "modal_mass", "participation")


def read(content: bytes) -> GivenModes:
    """Return the modes of a table.

    Raises
    ------
    UsageError
        A row has another number of cells or no numbers, or the row of the frequencies is missing.
    """
    named: dict[str, list[float]] = {}
    points: dict[str, list[float]] = {}
    for line, (name, *cells) in table_rows(content):
        name = name.strip()
        rows = named if name.lower() in _KEYS else points
        name = name.lower() if rows is named else name
        if name in rows:
            raise UsageError(f"line {line}: expected one row of {name[:60]!r}, got another.")
        rows[name] = [_number(cell, line) for cell in cells]
        columns = len(next(iter((named or points).values())))
        if len(cells) != columns:
            raise UsageError(f"line {line}: expected {columns} numbers, one for each mode, got {len(cells)}.")
        if (len(named) + len(points)) * columns > MOST_NUMBERS:
            raise UsageError(f"line {line}: expected at most {MOST_NUMBERS} numbers, got more.")
    is_angular = _ANGULAR in named
    if is_angular == (_FREQUENCY in named):
        raise UsageError(
            f"expected a row {_FREQUENCY} or {_ANGULAR}, got {'both' if is_angular else 'neither'}."
        )
    if not points:
        raise UsageError("expected a row for each point, got none.")
    return GivenModes(
        named[_ANGULAR if is_angular else _FREQUENCY],
        tuple(points),
        np.array(list(points.values())),
        named.get("damping_ratio", 0.0),
        modal_masses=named.get("modal_mass"),
        participation=named.get("participation"),
        is_angular=is_angular,
    )


def _number(cell: str, line: int) -> float:
    """Return a number, also with a comma for its point."""
    try:
        return real_of(cell.strip().replace(",", "."))
    except ValueError as problem:
        raise UsageError(f"line {line}: {problem}.") from None
