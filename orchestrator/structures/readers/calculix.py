"""Files of CalculiX: matrices of `*FREQUENCY, SOLVER=MATRIXSTORAGE`, and nodes of its models.

A `.sti` or `.mas` file has a line `row column value` for each entry of the upper triangle, and no header. A `.dof` file
has a line `node.direction` for each unknown. Nodes that an input file does not name belong to expanded shells, beams
and incompatible modes.
"""

from __future__ import annotations

import re
from math import isfinite

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers.found import DIRECTIONS, MOST_UNKNOWNS, Found, square
from vibroimpact.orchestrator.structures.readers.triplets import matrix_of, quoted, read_entries
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

_FREEDOM = re.compile(rb"([0-9]{1,10})\.([1-6])")
MOST_NODES = 10_000_000
"""Largest number of a model's nodes."""


def read(content: bytes, wanted: Wanted) -> Found:
    """Return the matrix of a `.sti` or `.mas` file.

    Raises
    ------
    UsageError
        A line has another form; an entry occurs twice, or one of the diagonal is missing: the file is cut off.
    """
    role = wanted.only()
    entries = read_entries(content)
    last = int(entries["column"][-1]) if len(entries) else 0
    unknowns = square(last, last)
    diagonal = int(np.count_nonzero(entries["row"] == entries["column"]))
    if diagonal != unknowns or entries["row"][-1] != last:
        got = f"{diagonal} up to column {last}"
        raise UsageError(f"expected all entries of the diagonal, the last one at the end, got {got}.")
    return Found({role: matrix_of(entries, unknowns, content, 0, mirrored=1.0)})


def read_freedoms(content: bytes) -> Found:
    """Return the degrees of freedom of a `.dof` file, such as `12.z` for its line `12.3`.

    Raises
    ------
    UsageError
        A line has another form; there are too many.
    """
    names = []
    if not content.endswith(b"\n"):
        raise UsageError("expected a line break at the end, got none. The file may be cut off.")
    for line, text in enumerate(content.split(b"\n"), 1):
        match = _FREEDOM.fullmatch(text.strip())
        if match is not None:
            names.append(f"{int(match[1])}.{DIRECTIONS[int(match[2]) - 1]}")
        elif text.strip():
            got = quoted([text.strip()])
            raise UsageError(f"line {line}: expected a node and a direction such as 12.3, got {got}.")
    if not 1 <= len(names) <= MOST_UNKNOWNS:
        raise UsageError(f"expected 1 to {MOST_UNKNOWNS} degrees of freedom, got {len(names)}.")
    return Found(freedoms=tuple(names))


def read_nodes(content: bytes) -> tuple[Floats, Floats]:
    """Return the numbers of the nodes in an input file, shape (node,), and their coordinates, shape (node, 3).

    Lines after `*NODE` have a number and up to three coordinates; coordinates left out are 0. Files that `*INCLUDE`
    names are not read.

    Raises
    ------
    UsageError
        A line of a node has another form.
    """
    numbers: list[int] = []
    places: list[tuple[float, float, float]] = []
    inside = False
    for line, text in enumerate(content.split(b"\n"), 1):
        if text.startswith(b"*"):
            inside = _begins_nodes(text) if not text.startswith(b"**") else inside
        elif inside and text.strip():
            number, place = _node(text, line)
            numbers.append(number)
            places.append(place)
    if len(numbers) > MOST_NODES:
        raise UsageError(f"expected at most {MOST_NODES} nodes, got {len(numbers)}.")
    return np.array(numbers, dtype=np.float64), np.array(places, dtype=np.float64).reshape(-1, 3)


def _begins_nodes(text: bytes) -> bool:
    """Return whether a keyword begins nodes: `*NODE`, unlike `*NODE PRINT` and `*NODE FILE`."""
    return text.upper().replace(b" ", b"").split(b",")[0].strip() == b"*NODE"


def _node(text: bytes, line: int) -> tuple[int, tuple[float, float, float]]:
    fields = [field.strip() for field in text.rstrip().rstrip(b",").split(b",")]
    try:
        number = int(fields[0])
        place = [float(field or b"0") for field in fields[1:4]] + [0.0] * (4 - len(fields[:4]))
    except ValueError:
        place, number = [], 0
    if len(place) != 3 or not 0 < number < 2**31 or not all(map(isfinite, place)):
        raise UsageError(f"line {line}: expected a node and three coordinates, got {quoted([text.strip()])}.")
    return number, (place[0], place[1], place[2])
