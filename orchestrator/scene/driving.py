"""The highest frequency that drives a scene, in a document before its checks: equations.md 6.14."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

_KEY = re.compile(r"(?P<name>\w+)(\[(?P<place>[1-9][0-9]{0,3})\])?")
_HIGHEST = 1e150
"""Frequency above which a number is none, rad/s: its square overflows."""
_DEVIATIONS = 4.0
"""Deviations of a normal distribution without limits that count."""

Row = Mapping[str, Any]


def highest_drive(document: Row) -> float:
    """Return the highest angular frequency of forces, base accelerations and moving stops, rad/s; 0 without one.

    Sines, chirps, bands and pulses count, also with the ends of their swept numbers. Tables and recordings do not.

    Examples
    --------
    >>> highest_drive({"forcing": {"amplitude": 1.0, "angular_frequency": 3.0}})
    3.0
    >>> swept = {"forcing.angular_frequency": {"start": 1.0, "stop": 5.0, "points": 9}}
    >>> highest_drive({"forcing": {"amplitude": 1.0}, "sweep": swept})
    5.0
    """
    swept = _table(document.get("sweep"))
    forces = [each for row in _rows(document, "forcing", swept) for each in _of_force(row)]
    stops = [row.get("motion_angular_frequency") for row in _rows(document, "stop", swept)]
    return max(map(_positive, [*forces, *stops]), default=0.0)


def _of_force(row: Row) -> Iterator[object]:
    """Yield angular frequencies up to which a force has most of its energy."""
    signal = row.get("signal", "sine")
    if signal == "sine":
        yield row.get("angular_frequency")
        yield 2.0 * math.pi * _positive(row.get("frequency"))
    elif signal == "chirp":
        yield row.get("angular_frequency")
        yield row.get("end_angular_frequency")
    elif signal == "pulse":
        yield from (unit * math.pi / length for unit, length in _lengths(row))
    elif signal == "random":
        yield from _list(row.get("band"))
        yield from (pair[0] for pair in _list(row.get("density")) if isinstance(pair, list) and pair)


def _lengths(row: Row) -> Iterator[tuple[float, float]]:
    """Yield the length of a pulse, and of its flank, with the turns in them over pi."""
    for unit, key in ((2.0, "duration"), (1.0, "rise")):
        length = _positive(row.get(key))
        if length > 0.0:
            yield unit, length


def _rows(document: Row, table: str, swept: Row) -> Iterator[Row]:
    """Yield the rows of a table as they are, and with each end of each of their swept numbers."""
    written = document.get(table)
    for number, row in enumerate(written if isinstance(written, list) else [written], start=1):
        if not isinstance(row, dict):
            continue
        yield row
        for text, axis in swept.items():
            for owner in (f"{table}[{number}].", *([f"{table}."] if number == 1 else ())):
                key = _KEY.fullmatch(text.removeprefix(owner)) if text.startswith(owner) else None
                if key is not None:
                    yield from (_changed(row, key["name"], key["place"], end) for end in _ends(axis))


def _changed(row: Row, name: str, place: str | None, value: object) -> Row:
    """Return a row with another number, or another element of an array."""
    if place is None:
        return {**row, name: value}
    own = _list(row.get(name))
    return {**row, name: [*own[: int(place) - 1], value, *own[int(place) :]]}


def _ends(axis: object) -> Iterator[object]:
    """Yield the numbers of an entry of `[sweep]` among which its largest and its smallest are."""
    table = _table(axis)
    yield from _list(table.get("values"))
    yield from (table.get(key) for key in ("start", "stop", "low", "high"))
    mean, deviation = _positive(table.get("mean")), _positive(table.get("deviation"))
    yield from (mean - _DEVIATIONS * deviation, mean + _DEVIATIONS * deviation)


def _table(raw: object) -> Row:
    return raw if isinstance(raw, dict) else {}


def _list(raw: object) -> list[Any]:
    return raw if isinstance(raw, list) else []


def _positive(value: object) -> float:
    """Return a number above 0; 0 of anything else, which the checks of the scene refuse."""
    return float(value) if type(value) in (int, float) and 0.0 < value < _HIGHEST else 0.0  # type: ignore[operator,arg-type]
