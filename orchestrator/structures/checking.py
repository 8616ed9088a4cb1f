"""Checks of matrices: symmetric, finite, positive, and which degrees of freedom they leave unused."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Matrices, Sparse

MOST_UNKNOWNS = 200_000
"""Largest number of degrees of freedom."""
SKEW = 1e-6
"""Largest difference of two mirrored entries over sqrt(a_ii a_jj): digits that a text file has lost."""
NEGATIVE = 1e-7
"""Eigenvalue of a matrix with a diagonal of 1, below whose negative a motion counts as one of negative energy."""
STEPS = 40
"""Steps of the Lanczos process for the smallest eigenvalue: those of 40 unknowns are exact."""
_MOST_NAMED = 4


def checked(matrices: Matrices) -> tuple[Matrices, tuple[str, ...]]:
    """Return the matrices made exactly symmetric, without unused degrees of freedom, and remarks.

    A degree of freedom is unused if neither matrix has an entry there. One without mass needs stiffness.

    Raises
    ------
    UsageError
        Sizes do not fit, a number is not finite, or a matrix is not symmetric (damping: gyroscopic).
        A mass or a stiffness is negative. The text names the matrix and a degree of freedom.
    """
    names = matrices.freedoms
    _check_names(names)
    stiffness = _symmetric("stiffness", matrices.stiffness, names)
    mass = _symmetric("mass", matrices.mass, names)
    damping = None if matrices.damping is None else _symmetric("damping", matrices.damping, names)
    _check_positive("stiffness", stiffness, names)
    _check_positive("mass", mass, names)
    used = (stiffness.diagonal() > 0.0) | (mass.diagonal() > 0.0)
    damped = np.arange(0) if damping is None else np.unique(damping.nonzero()[0])
    if not used[damped].all():
        places = damped[~used[damped]]
        raise UsageError(
            f"expected stiffness or mass wherever there is damping, got none at {_some(names, places)}."
        )
    if not (mass.diagonal() > 0.0).any():
        raise UsageError("expected a mass matrix with numbers above 0, got one without any.")
    if used.all():
        return Matrices(stiffness, mass, damping, names, matrices.coordinates), ()
    kept = np.flatnonzero(used)
    left_out = np.flatnonzero(~used)
    remark = f"{len(left_out)} degrees of freedom without stiffness and mass are left out: {_some(names, left_out)}."
    square = np.ix_(kept, kept)
    return Matrices(
        stiffness[square].tocsc(),
        mass[square].tocsc(),
        None if damping is None else damping[square].tocsc(),
        tuple(names[place] for place in kept),
        None if matrices.coordinates is None else matrices.coordinates[kept],
    ), (remark,)


def _check_names(names: tuple[str, ...]) -> None:
    if not 1 <= len(names) <= MOST_UNKNOWNS:
        raise UsageError(f"expected 1 to {MOST_UNKNOWNS} degrees of freedom, got {len(names)}.")
    if len(set(names)) < len(names):
        seen: set[str] = set()
        twice = next(name for name in names if name in seen or seen.add(name))  # type: ignore[func-returns-value]
        raise UsageError(f"expected each degree of freedom once, got {twice!r} twice.")


def _symmetric(name: str, matrix: Sparse, names: tuple[str, ...]) -> Sparse:
    """Return a matrix of finite numbers with its mirrored entries made equal."""
    from scipy.sparse import csc_array

    if matrix.shape != (len(names), len(names)):
        rows, columns = matrix.shape
        raise UsageError(
            f"expected {name} for {len(names)} degrees of freedom, got a matrix of {rows} x {columns}."
        )
    if np.iscomplexobj(matrix.data):
        raise UsageError(f"expected {name} of real numbers, got complex ones.")
    found = csc_array(matrix, dtype=np.float64)
    found.sum_duplicates()
    if not np.isfinite(found.data).all():
        place = int(np.flatnonzero(~np.isfinite(found.data))[0])
        raise UsageError(
            f"expected {name} of finite numbers, got {found.data[place]} at {names[found.indices[place]]}."
        )
    mirrored = found.T.tocsc()
    if _equal(found, mirrored):
        return found
    skew = (found - mirrored).tocoo()
    size = np.sqrt(np.abs(found.diagonal()))
    allowed = SKEW * size[skew.row] * size[skew.col]
    if name == "damping":  # its diagonal may be 0 where two dampers cancel
        allowed = np.full(len(skew.data), SKEW * np.abs(found.data).max(initial=0.0))
    worst = int((np.abs(skew.data) - allowed).argmax())
    if abs(skew.data[worst]) > allowed[worst]:
        row, column = names[skew.row[worst]], names[skew.col[worst]]
        raise UsageError(_not_symmetric(name, found, f"{row}, {column}"))
    return ((found + mirrored) * 0.5).tocsc()


def _equal(one: Sparse, other: Sparse) -> bool:
    one.sort_indices()
    other.sort_indices()
    return bool(
        len(one.data) == len(other.data)
        and (one.indices == other.indices).all()
        and (one.data == other.data).all()
    )


def _not_symmetric(name: str, matrix: Sparse, where: str) -> str:
    from scipy.sparse import tril, triu

    if tril(matrix, -1).nnz == 0 or triu(matrix, 1).nnz == 0:
        return f"expected {name} with both triangles of a symmetric matrix, got one alone."
    kind = " (gyroscopic terms are not modelled)" if name == "damping" else ""
    return f"expected {name} that is symmetric{kind}, got two numbers for {where}."


def _check_positive(name: str, matrix: Sparse, names: tuple[str, ...]) -> None:
    """Raise UsageError where a motion would have negative energy."""
    own = matrix.diagonal()
    if (own < 0.0).any():
        place = int(own.argmin())
        raise UsageError(f"expected {name} with a diagonal >= 0, got {own[place]:g} at {names[place]}.")
    beside = np.unique(matrix.nonzero()[1])
    if (own[beside] == 0.0).any():
        place = int(beside[(own[beside] == 0.0).argmax()])
        raise UsageError(
            f"expected {name} without entries beside a 0 on its diagonal, got some at {names[place]}."
        )
    lowest, motion = _smallest(scaled(matrix)[0])
    if lowest < -NEGATIVE:
        place = int(np.abs(motion).argmax())
        raise UsageError(
            f"expected {name} that is positive semi-definite, got negative energy for a motion, mostly of "
            f"{names[place]}."
        )


def scaled(matrix: Sparse) -> tuple[Sparse, Floats]:
    """Return S A S with a diagonal of 1/2 to 2, or 0, and S, of powers of 2: nothing is rounded."""
    from scipy.sparse import csc_array

    own = matrix.diagonal()
    _, twos = np.frexp(np.where(own > 0.0, own, 1.0))
    scale = np.ldexp(1.0, -(twos // 2))
    found = csc_array((matrix.data.copy(), matrix.indices, matrix.indptr), matrix.shape)
    found.data *= scale[found.indices]
    found.data *= np.repeat(scale, np.diff(found.indptr))
    return found, scale


def _smallest(matrix: Sparse) -> tuple[float, Floats]:
    """Return the smallest eigenvalue that a Lanczos process finds, and its vector."""
    size = matrix.shape[0]
    steps = min(size, STEPS)
    basis, vector = np.zeros((steps, size)), np.random.default_rng(0).normal(size=size)
    projected = np.zeros((steps, steps))
    for step in range(steps):
        length = np.linalg.norm(vector)
        if length < 1e-12 * (1.0 if step else 0.0):
            steps = step
            break
        basis[step] = vector / length
        moved = matrix @ basis[step]
        own = basis[: step + 1] @ moved
        projected[: step + 1, step] = projected[step, : step + 1] = own
        vector = moved - own @ basis[: step + 1]
        vector -= (basis[: step + 1] @ vector) @ basis[: step + 1]
    values, ways = np.linalg.eigh(projected[:steps, :steps])
    return float(values[0]), ways[:, 0] @ basis[:steps]


def _some(names: tuple[str, ...], places: Iterable[int]) -> str:
    listed = list(places)
    more = ", ..." if len(listed) > _MOST_NAMED else ""
    return ", ".join(names[place] for place in listed[:_MOST_NAMED]) + more
