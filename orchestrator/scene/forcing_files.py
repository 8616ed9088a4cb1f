"""Tables of forces in CSV files: instants and values in two columns."""

from __future__ import annotations

import math
from pathlib import Path

from vibroimpact.orchestrator.scene.forcing_models import MOST_ROWS
from vibroimpact.orchestrator.scene.problems import Problem, quoted

MOST_BYTES = 2**20
"""Largest size of a file: 8192 rows of two numbers have at most 400 kB."""
Rows = tuple[tuple[float, ...], tuple[float, ...]]


def rows_of_file(path: Path, where: str) -> Rows | Problem:
    """Return the two columns of a CSV file, or the problem of a file that is none, for the key `where`.

    Columns are separated by a comma, a semicolon or blanks. Empty lines and lines that begin with `#` are left out, as
    is a first line without numbers.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        text = content.decode("utf-8-sig")
    except OSError as error:
        return Problem(where, "a file that can be read", f"{quoted(str(path))}: {error.strerror}")
    except UnicodeDecodeError:
        return Problem(where, "a file of text in UTF-8", quoted(str(path)))
    if len(content) > MOST_BYTES:
        return Problem(where, f"a file of at most {MOST_BYTES} bytes", "a larger one")
    found: list[tuple[float, float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        row = _numbers(line)
        if row is None and not found and number == 1:
            continue
        if row is None:
            return Problem(where, f"two finite numbers in line {number}", quoted(line[:80]))
        found.append(row)
    if not 2 <= len(found) <= MOST_ROWS:
        return Problem(where, f"2 to {MOST_ROWS} rows of two numbers", f"{len(found)}")
    times, values = zip(*found, strict=True)
    return times, values


def _numbers(line: str) -> tuple[float, float] | None:
    """Return the two finite numbers of a line; None where it has others."""
    try:
        first, second = map(float, line.replace(",", " ").replace(";", " ").split())
    except ValueError:
        return None
    return (first, second) if math.isfinite(first) and math.isfinite(second) else None
