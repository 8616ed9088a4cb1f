"""The matrices of several files over the same degrees of freedom, which their names bring into one order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Sparse
from vibroimpact.orchestrator.structures.readers.found import Found


def united(contents: Mapping[Path, Found]) -> Found:
    """Return the matrices of several files over all their degrees of freedom.

    A matrix is 0 at a degree of freedom that its file does not name. Matrices without names keep their order.

    Raises
    ------
    UsageError
        The matrices differ in size, or a file names a degree of freedom twice.
    """
    for path, content in contents.items():
        refuse_twice(path, content.freedoms)
    names = tuple(dict.fromkeys(name for content in contents.values() for name in content.freedoms))
    row_of = {name: row for row, name in enumerate(names)}
    matrices: dict[str, Sparse] = {}
    coordinates = np.full((len(names), 3), np.nan)
    for content in contents.values():
        rows = np.array([row_of[name] for name in content.freedoms], dtype=np.int64)
        matrices |= {role: _spread(one, rows, len(names)) for role, one in content.matrices.items()}
        if content.coordinates is not None:
            coordinates[rows] = content.coordinates
    _refuse_other_sizes(contents, matrices)
    known = any(content.coordinates is not None for content in contents.values())
    return Found(matrices, names, coordinates if known else None)


def refuse_twice(path: Path, names: Sequence[str]) -> None:
    """Raise UsageError if a file names a degree of freedom twice."""
    if len(set(names)) < len(names):
        seen: set[str] = set()
        for place, name in enumerate(names, 1):
            if name in seen:
                raise UsageError(
                    f"{path}: expected each degree of freedom once, got {name!r} again ({place})."
                )
            seen.add(name)


def _spread(matrix: Sparse, rows: NDArray[np.int64], size: int) -> Sparse:
    """Return a matrix whose rows and columns have other numbers; without numbers the same matrix."""
    from scipy.sparse import coo_array

    if not len(rows) or (len(rows) == size and np.array_equal(rows, np.arange(size))):
        return matrix
    entries = matrix.tocoo()
    return coo_array((entries.data, (rows[entries.row], rows[entries.col])), shape=(size, size)).tocsc()


def _refuse_other_sizes(contents: Mapping[Path, Found], matrices: Mapping[str, Sparse]) -> None:
    """Raise UsageError unless all matrices have the size of the first file's."""
    first = next(iter(contents))
    unknowns = int(matrices[next(iter(contents[first].matrices))].shape[0])
    for path, content in contents.items():
        for role in content.matrices:
            got = int(matrices[role].shape[0])
            if got != unknowns:
                expected = f"expected {unknowns} unknowns, as in {first.name}"
                raise UsageError(f"{path}: {expected}, got {got} in the {role} matrix.")


def in_order(path: Path, names: Sequence[str], table: Found) -> Floats | None:
    """Return the coordinates of a table in the order of the matrices' names, shape (freedom, 3).

    Raises
    ------
    UsageError
        The table has other names.
    """
    row_of = {name: row for row, name in enumerate(table.freedoms)}
    missing = next((name for name in names if name not in row_of), None)
    if missing is not None or len(names) != len(row_of):
        got = f"{len(row_of)} names" if missing is None else f"none named {missing!r}"
        raise UsageError(f"{path}: expected the {len(names)} degrees of freedom of the matrices, got {got}.")
    return None if table.coordinates is None else table.coordinates[[row_of[name] for name in names]]
