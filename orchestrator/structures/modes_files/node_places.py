"""Datasets 15 and 2411 of universal files: the places of nodes."""

from __future__ import annotations

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes_files.nodal_data import MOST_LABEL, reals_of
from vibroimpact.orchestrator.structures.readers.fortran_numbers import integer_of

SINGLE, DOUBLE = 15, 2411
"""Datasets of nodes: a line for each, or two with double precision."""
Place = tuple[float, float, float]
_INTEGERS, _SINGLE_WIDTH, _DOUBLE_WIDTH = 40, 13, 25


def places_of(kind: int, first: int, lines: list[str], length: float) -> dict[int, Place]:
    """Return the place of each node by its label, m.

    Parameters
    ----------
    kind : int
        15 or 2411.
    first : int
        Number of the first line in the file.
    lines : list of str
    length : float
        Units of length of the file per metre.

    Raises
    ------
    UsageError
        A line is damaged.
    """
    found: dict[int, Place] = {}
    step = 1 if kind == SINGLE else 2
    for start in range(0, len(lines), step):
        record = lines[start : start + step]
        try:
            label = integer_of(record[0][:10])
            if not 0 < label <= MOST_LABEL:
                raise ValueError(f"expected a label of a node, got {label}")
            numbers = record[0][_INTEGERS:] if kind == SINGLE else record[1]
            x, y, z = reals_of(numbers, _SINGLE_WIDTH if kind == SINGLE else _DOUBLE_WIDTH, 3)
        except (ValueError, IndexError) as problem:
            raise UsageError(f"line {first + start}: dataset {kind}: {problem}.") from None
        found[label] = x / length, y / length, z / length
    return found
