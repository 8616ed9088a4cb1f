"""Nastran bulk data with matrices at grid points (DMIG), in punch files (`.pch`) and decks (`.bdf`).

Cards have fields of 8 or 16 characters, or fields between commas. Coordinates come from GRID cards of the same file.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Sparse
from vibroimpact.orchestrator.structures.readers.fortran_numbers import integer_of, real_of
from vibroimpact.orchestrator.structures.readers.found import DIRECTIONS, Found, refuse_not_finite, square
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

MOST_LABEL = 10**9
"""Largest label of a node; a larger one is refused."""
_SMALL, _LARGE, _END = 8, 16, 72
"""Characters of a field, of a field of double width, and of the fields of a line."""
_SYMMETRIC, _SQUARE = 6, 1
_REAL = frozenset({1, 2})
_PER_NODE = 8
"""The number of a degree of freedom is this times its node, plus its component from 0 to 6."""
_PER_ENTRY = 4
"""Fields of an entry of a column: its node, its component, its real and its imaginary part."""

Coordinates = tuple[float, float, float]


@dataclass(slots=True)
class _Matrix:
    """A matrix as its cards give it: rows and columns by the numbers of their degrees of freedom."""

    symmetric: bool
    refusal: str
    rows: array[int] = field(default_factory=lambda: array("q"))
    columns: array[int] = field(default_factory=lambda: array("q"))
    values: array[float] = field(default_factory=lambda: array("d"))


@dataclass(frozen=True, slots=True)
class _Card:
    """A card with its continuations: all fields after the name of the card, and the line of each."""

    name: str
    fields: list[str]
    lines: list[int]


def read(content: bytes, wanted: Wanted) -> Found:
    """Return the wanted matrices of DMIG cards, with their degrees of freedom.

    The degrees of freedom are those of any wanted matrix, ascending by node and component, named `node.direction`
    such as `12.z`. A scalar point is named by its label alone. Coordinates are those of GRID cards in the basic
    system, NaN for other nodes. Other cards are left out.

    Raises
    ------
    UsageError
        A card is damaged, a wanted matrix is not there, complex or rectangular, or a place has two numbers.
    """
    nodes: dict[int, Coordinates] = {}
    matrices: dict[str, _Matrix] = {}
    for card in _cards(content):
        if card.name == "GRID":
            _take_node(card, nodes)
        else:
            _take_card(card, matrices)
    roles = wanted.among(matrices)
    for name in roles.values():
        if matrices[name].refusal:
            raise UsageError(f"{name}: {matrices[name].refusal}.")
    return _assembled({role: (name, matrices[name]) for role, name in roles.items()}, nodes)


def _cards(content: bytes) -> Iterator[_Card]:
    """Yield DMIG and GRID cards with their continuations."""
    card: _Card | None = None
    for number, raw in enumerate(content.split(b"\n"), 1):
        if raw[:1] == b"$" or not raw.strip():
            continue
        continues = raw[:1] in b"*+," or not raw[:_SMALL].strip()
        if continues and card is None:
            continue
        if not continues:
            if card is not None:
                yield card
                card = None
            if raw[:4].upper() not in (b"DMIG", b"GRID"):
                continue
        name, fields = _fields(raw.decode("latin-1"))
        if continues and card is not None:
            card.fields.extend(fields)
            card.lines.extend([number] * len(fields))
        elif name in ("DMIG", "GRID"):
            card = _Card(name, fields, [number] * len(fields))
    if card is not None:
        yield card


def _fields(line: str) -> tuple[str, list[str]]:
    """Return the name of a line and its fields: eight, or four of double width."""
    line = line.partition("$")[0].rstrip()
    if "," in line:
        name, *fields = (part.strip() for part in line.split(","))
        count = 4 if name.endswith("*") else 8
        return name.rstrip("*").upper(), (fields + [""] * count)[:count]
    if "\t" in line:
        line = line.expandtabs(_SMALL)
    name = line[:_SMALL].strip()
    width = _LARGE if name[:1] == "*" or name[-1:] == "*" else _SMALL
    return name.rstrip("*").upper(), [line[at : at + width].strip() for at in range(_SMALL, _END, width)]


def _take_node(card: _Card, nodes: dict[int, Coordinates]) -> None:
    """Take the coordinates of a GRID card in the basic system."""
    try:
        label = integer_of(card.fields[0])
        if card.fields[1] in ("", "0"):
            x, y, z = (real_of(each) if each else 0.0 for each in (*card.fields[2:5], "", "")[:3])
            nodes[label] = x, y, z
    except ValueError as problem:
        raise UsageError(f"line {card.lines[0]}: GRID: {problem}.") from None


def _take_card(card: _Card, matrices: dict[str, _Matrix]) -> None:
    """Take a DMIG card: the head of a matrix, or one of its columns."""
    name = card.fields[0].upper()
    try:
        if card.fields[1] in ("", "0"):
            if name in matrices:
                raise ValueError("expected one head of the matrix, got another")
            matrices[name] = _head(card.fields)
        elif name not in matrices:
            raise ValueError("expected the head of the matrix, got a column")
        elif not matrices[name].refusal:
            _take_column(card, matrices[name])
    except ValueError as problem:
        raise UsageError(f"line {card.lines[0]}: {name}: {problem}.") from None


def _head(fields: list[str]) -> _Matrix:
    """Return an empty matrix by its head, with the reason why it cannot be read."""
    form, type_ = integer_of(fields[2]), integer_of(fields[3])
    refusal = ""
    if form not in (_SYMMETRIC, _SQUARE):
        refusal = f"expected form 6 (symmetric) or 1 (square), got {form}"
    elif type_ not in _REAL:
        refusal = f"expected real numbers, type 1 or 2, got type {type_}"
    return _Matrix(form == _SYMMETRIC, refusal)


def _freedom(node: str, component: str) -> int:
    """Return the number of a degree of freedom; ValueError: it is none."""
    label, place = integer_of(node), integer_of(component or "0")
    if not (1 <= label <= MOST_LABEL and 0 <= place <= len(DIRECTIONS)):
        raise ValueError(f"expected a node and a component from 0 to 6, got {label} and {place}")
    return _PER_NODE * label + place


def _take_column(card: _Card, matrix: _Matrix) -> None:
    """Take the entries of a column."""
    fields, first = card.fields, _PER_ENTRY
    column = _freedom(fields[1], fields[2])
    for at in range(first, len(fields), _PER_ENTRY):
        node, component, value, imaginary = fields[at : at + _PER_ENTRY]
        if not (node or component or value):
            continue
        try:
            row, number = _freedom(node, component), real_of(value)
            if imaginary and real_of(imaginary) != 0.0:
                raise ValueError(f"expected a real number, got the imaginary part {imaginary!r}")
        except ValueError as problem:
            raise UsageError(f"line {card.lines[at]}: {fields[0]}: {problem}.") from None
        matrix.rows.append(row)
        matrix.columns.append(column)
        matrix.values.append(number)


def _assembled(matrices: Mapping[str, tuple[str, _Matrix]], nodes: Mapping[int, Coordinates]) -> Found:
    """Return the matrices over their common degrees of freedom."""
    numbers = [
        np.frombuffer(each, np.int64) for _, one in matrices.values() for each in (one.rows, one.columns)
    ]
    there = np.unique(np.concatenate([np.empty(0, np.int64), *numbers]))
    square(len(there), len(there))
    places = None
    if nodes:
        unknown = (np.nan,) * 3
        places = np.array([nodes.get(number // _PER_NODE, unknown) for number in there.tolist()])
    freedoms = tuple(_name(number) for number in there.tolist())
    found = {role: _sparse(name, one, there, freedoms) for role, (name, one) in matrices.items()}
    return Found(found, freedoms, places)


def _name(number: int) -> str:
    """Return the name of a degree of freedom.

    >>> _name(8 * 12 + 3), _name(8 * 12 + 4), _name(8 * 7)
    ('12.z', '12.rx', '7')
    """
    node, component = divmod(number, _PER_NODE)
    return f"{node}.{DIRECTIONS[component - 1]}" if component else str(node)


def _sparse(name: str, matrix: _Matrix, there: NDArray[np.int64], freedoms: tuple[str, ...]) -> Sparse:
    """Return a matrix with both triangles."""
    from scipy.sparse import coo_array

    rows = np.searchsorted(there, np.frombuffer(matrix.rows, np.int64))
    columns = np.searchsorted(there, np.frombuffer(matrix.columns, np.int64))
    values: Floats = np.frombuffer(matrix.values, np.float64)
    if matrix.symmetric:
        beside = rows != columns
        rows, columns, values = (
            np.concatenate((rows, columns[beside])),
            np.concatenate((columns, rows[beside])),
            np.concatenate((values, values[beside])),
        )
    order = np.lexsort((rows, columns))
    again = (np.diff(rows[order]) == 0) & (np.diff(columns[order]) == 0)
    if again.any():
        at = order[int(np.argmax(again))]
        place = f"({freedoms[rows[at]]}, {freedoms[columns[at]]})"
        hint = " A symmetric matrix has one triangle." if matrix.symmetric else ""
        raise UsageError(f"{name}: expected one number at {place}, got two.{hint}")
    found = coo_array((values, (rows, columns)), shape=(len(there),) * 2).tocsc()
    found.eliminate_zeros()
    try:
        refuse_not_finite(found)
    except UsageError as refused:
        raise refused.named(name) from None
    return found
