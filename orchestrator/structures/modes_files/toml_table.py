"""Modes in TOML: the table of a body with `kind = "modes"`, alone in a file or in `[body]`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.structures.modes_files.given import GivenModes

_BODY = "body"
_KEYS = (
    "kind",
    "name",
    "frequencies",
    "angular_frequencies",
    "damping_ratio",
    "damping_matrix",
    "shapes",
    "participation",
    "origin",
)


def read(content: bytes) -> GivenModes:
    """Return the modes of a table.

    Raises
    ------
    UsageError
        The text is no TOML, has several bodies, or a key that modes do not have.
    """
    try:
        document = parse_toml(content.decode("utf-8-sig"))
    except ValueError as problem:
        raise UsageError(f"expected a TOML file, got one that cannot be read ({problem}).") from problem
    table = _table(document)
    for key in table:
        if key not in _KEYS:
            raise UsageError(f"{key}: expected one of {', '.join(_KEYS)}, got another key.")
    if table.get("kind", "modes") != "modes":
        raise UsageError(f"kind: expected 'modes', got {table['kind']!r}.")
    is_angular = "angular_frequencies" in table
    key = "angular_frequencies" if is_angular else "frequencies"
    if is_angular == ("frequencies" in table):
        got = "both" if is_angular else "neither"
        raise UsageError(f"expected frequencies or angular_frequencies, got {got}.")
    frequencies = _numbers(key, table[key])
    points, shapes = _shapes(table.get("shapes"), len(frequencies))
    written = table.get("damping_ratio", 0.0)
    ratios = _numbers("damping_ratio", written if isinstance(written, list) else [written])
    participation = table.get("participation") or None
    return GivenModes(
        frequencies,
        points,
        shapes,
        ratios if isinstance(written, list) else ratios[0],
        damping=_rows(table.get("damping_matrix")),
        participation=None if participation is None else _numbers("participation", participation),
        origin=_origin(table.get("origin", {})),
        is_angular=is_angular,
    )


def _table(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the table of the only body of a document, or the document itself."""
    body = document.get(_BODY, document)
    if isinstance(body, list):
        body = body[0] if len(body) == 1 else None
    if not isinstance(body, dict):
        raise UsageError("expected one table [body], got another number of them.")
    return body


def _numbers(key: str, value: object) -> list[float]:
    """Return an array of numbers."""
    if not isinstance(value, list) or not all(type(each) in (int, float) for each in value):
        raise UsageError(f"{key}: expected an array of numbers, got {str(value)[:60]!r}.")
    try:
        return [float(each) for each in value]
    except OverflowError:
        raise UsageError(f"{key}: expected finite numbers, got one beyond all of them.") from None


def _rows(value: object) -> list[list[float]] | None:
    """Return the rows of a matrix; None for an empty one."""
    if value in (None, []):
        return None
    if not isinstance(value, list):
        raise UsageError(f"damping_matrix: expected an array of rows, got {str(value)[:60]!r}.")
    return [_numbers(f"damping_matrix[{place}]", row) for place, row in enumerate(value, 1)]


def _shapes(value: object, count: int) -> tuple[tuple[str, ...], np.ndarray[Any, np.dtype[np.float64]]]:
    """Return names of points, and their shapes."""
    if not isinstance(value, dict) or not value:
        raise UsageError("shapes: expected a table of points, got none.")
    rows = []
    for name, row in value.items():
        numbers = _numbers(f"shapes.{name[:60]}", row)
        if len(numbers) != count:
            raise UsageError(
                f"shapes.{name[:60]}: expected {count} numbers, one for each mode, got {len(numbers)}."
            )
        rows.append(numbers)
    return tuple(value), np.array(rows)


def _origin(value: object) -> Mapping[str, Any]:
    """Return a table of the origin whose values have their types."""
    if isinstance(value, dict):
        files = value.get("files", {})
        fits = (
            isinstance(files, dict) and _is_texts(list(files.values())),
            _is_texts(value.get("remarks", [])),
            type(value.get("residual_vectors", 0)) is int,
            type(value.get("error", 0.0)) in (int, float),
        )
        if all(fits):
            return value
    expected = "a table of files, residual_vectors, error and remarks"
    raise UsageError(f"origin: expected {expected}, got {str(value)[:60]!r}.")


def _is_texts(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(each, str) for each in value)
