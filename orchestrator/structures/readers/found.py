"""The matrices that a file holds, and their way from one process to another: JSON and raw bytes, never a pickle."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Sparse

MOST_UNKNOWNS = 1_000_000
MOST_ENTRIES = 100_000_000
"""Limits of one matrix; ten times the unknowns that the reduction is made for."""
NAME = r"[A-Za-z0-9_-][A-Za-z0-9_.-]{0,39}"
"""Name of a degree of freedom, as a regular expression."""
_NAME = re.compile(NAME)
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""Displacements along, and rotations around, the axes: directions 1 to 6 of a node."""


@dataclass(frozen=True, slots=True)
class Found:
    """Content of one file.

    Attributes
    ----------
    matrices : mapping of str to sparse array in columns
        By their roles: `stiffness`, `mass`, `damping`.
    freedoms : tuple of str
        Names of the degrees of freedom in order; empty where the file has none.
    coordinates : ndarray or None, shape (freedom, 3)
        Places of their nodes; NaN where unknown.
    """

    matrices: Mapping[str, Sparse] = field(default_factory=dict)
    freedoms: tuple[str, ...] = ()
    coordinates: Floats | None = None


def square(rows: int, columns: int) -> int:
    """Return the number of unknowns of a matrix.

    >>> square(3, 2)
    Traceback (most recent call last):
    vibroimpact.fmus.errors.UsageError: expected a square matrix, got one of 3 x 2.
    """
    if rows != columns:
        raise UsageError(f"expected a square matrix, got one of {rows} x {columns}.")
    if not 1 <= rows <= MOST_UNKNOWNS:
        raise UsageError(f"expected 1 to {MOST_UNKNOWNS} unknowns, got {rows}.")
    return rows


def in_columns(matrix: Any) -> Sparse:
    """Return a real matrix as a sparse array in columns without zeros, its rows in order, once each.

    Raises
    ------
    UsageError
        The matrix is not square, too large, complex, or has entries that are not finite.
    ValueError
        The places of the entries of a sparse matrix are damaged.
    """
    from scipy.sparse import csc_array, issparse

    if matrix.ndim != 2:
        raise UsageError(f"expected a matrix, got an array of {matrix.ndim} dimensions.")
    square(*matrix.shape)
    if matrix.dtype.kind not in "fiub":
        kind = "complex numbers" if matrix.dtype.kind == "c" else str(matrix.dtype)
        raise UsageError(f"expected real numbers, got {kind}.")
    if issparse(matrix) and matrix.format in ("csc", "csr", "bsr"):
        matrix.check_format(full_check=True)
    found = csc_array(matrix, dtype=np.float64)
    if found.nnz > MOST_ENTRIES:
        raise UsageError(f"expected at most {MOST_ENTRIES} entries, got {found.nnz}.")
    found.sum_duplicates()
    found.eliminate_zeros()
    refuse_not_finite(found)
    return found


def refuse_not_finite(found: Sparse) -> None:
    """Raise UsageError for a matrix with an entry that is not finite."""
    wrong = np.flatnonzero(~np.isfinite(found.data))
    if wrong.size:
        at = int(wrong[0])
        row, column = int(found.indices[at]) + 1, int(np.searchsorted(found.indptr, at, side="right"))
        raise UsageError(f"row {row}, column {column}: expected a finite number, got {found.data[at]}.")


def packed(found: Found) -> tuple[dict[str, Any], list[Any]]:
    """Return a content as facts for JSON, and its arrays."""
    facts = {
        "sizes": {role: matrix.shape[0] for role, matrix in found.matrices.items()},
        "freedoms": list(found.freedoms),
        "coordinates": found.coordinates is not None,
    }
    arrays = [] if found.coordinates is None else [np.ascontiguousarray(found.coordinates, dtype=np.float64)]
    for matrix in found.matrices.values():
        arrays += [matrix.data, matrix.indices.astype(np.int32), matrix.indptr.astype(np.int64)]
    return facts, arrays


def unpacked(facts: Mapping[str, Any], buffers: Sequence[bytearray]) -> Found:
    """Return the content that `packed` has taken apart, checked: the bytes of a file may have made it.

    ValueError, TypeError, KeyError, IndexError or StopIteration: the facts have another form.
    """
    rest = iter(buffers)
    coordinates = None
    if facts["coordinates"]:
        coordinates = np.frombuffer(next(rest), dtype=np.float64).reshape(-1, 3)
    matrices = {str(role): _matrix(int(size), rest) for role, size in facts["sizes"].items()}
    names = tuple(facts["freedoms"])
    if not all(_NAME.fullmatch(name) for name in names):
        raise ValueError("a degree of freedom with another name")
    counts = {len(matrix.indptr) - 1 for matrix in matrices.values()} if names else set()
    counts |= set() if coordinates is None else {len(coordinates)}
    if counts - {len(names)}:
        raise ValueError("degrees of freedom, coordinates and matrices differ in number")
    return Found(matrices, names, coordinates)


def _matrix(size: int, buffers: Iterator[bytearray]) -> Sparse:
    """Return the next matrix, whose places are checked."""
    from scipy.sparse import csc_array

    data = np.frombuffer(next(buffers), dtype=np.float64)
    rows = np.frombuffer(next(buffers), dtype=np.int32)
    starts = np.frombuffer(next(buffers), dtype=np.int64)
    if starts[-1] <= np.iinfo(np.int32).max:
        starts = starts.astype(np.int32)
    found = csc_array((data, rows, starts), shape=(size, size))
    found.check_format(full_check=True)
    return found
