"""Modes as a file gives them, checked, with shapes normalised by their modal masses and ordered by frequency."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.modes_files.real_shapes import Shapes, real_shapes
from vibroimpact.orchestrator.structures.readers.found import NAME

MOST_MODES = 1000
MOST_POINTS = 1_000_000
MOST_NUMBERS = 50_000_000
"""Largest numbers of modes, points and shape values of a file; a file with more is refused."""
_NAME = re.compile(NAME)
_SKEW = 1e-9
"""Largest relative difference of the triangles of a damping matrix; a larger one is refused."""


@dataclass(frozen=True, slots=True, eq=False)
class GivenModes:
    """Modes in the order of a file.

    Attributes
    ----------
    frequencies : sequence of float
        Natural frequencies, Hz, or rad/s if `is_angular`.
    points : tuple of str
    shapes : ndarray of float or complex, shape (point, mode)
    damping_ratios : float or sequence of float
        One for all modes, or one for each.
    modal_masses : ndarray of float or complex, or None
        Shapes are divided by their square roots; None for mass-normalised shapes.
    damping : sequence or None
        Rows of the modal damping matrix, 1/s.
    participation : sequence of float or None
    origin : mapping
        The table `origin` of a body.
    is_angular : bool
    remarks : tuple of str
    coordinates : mapping of str to tuple of float
        Known places x, y, z of points, m.
    """

    frequencies: Sequence[float]
    points: tuple[str, ...]
    shapes: Shapes
    damping_ratios: float | Sequence[float] = 0.0
    modal_masses: Sequence[complex] | None = None
    damping: Sequence[Sequence[float]] | None = None
    participation: Sequence[float] | None = None
    origin: Mapping[str, Any] | None = None
    is_angular: bool = False
    remarks: tuple[str, ...] = ()
    coordinates: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)


def checked_modes(given: GivenModes) -> Modes:
    """Return the modes of a file, whose shapes are real and mass-normalised.

    Raises
    ------
    UsageError
        Numbers are not finite, out of range, or do not fit the number of modes. A name is no name of a point. Complex
        shapes are far from real.
    """
    factor = 1.0 if given.is_angular else 2.0 * np.pi
    natural = _numbers("frequency", [factor * float(each) for each in given.frequencies])
    count = len(natural)
    if not 1 <= count <= MOST_MODES:
        raise UsageError(f"expected 1 to {MOST_MODES} modes, got {count}.")
    if (natural < 0.0).any():
        raise UsageError(f"frequency: expected numbers >= 0, got {min(given.frequencies)}.")
    written = given.damping_ratios
    ratios = _each("damping_ratio", [written] * count if isinstance(written, float) else written, count)
    shapes, remarks = _shapes(given, count)
    order = np.argsort(natural, kind="stable")
    damping = None if given.damping is None else _damping(given.damping, count)[np.ix_(order, order)]
    participation = None
    if given.participation is not None:
        participation = _each("participation", given.participation, count)[order]
    origin = given.origin or {}
    residual_vectors, error = origin.get("residual_vectors", 0), origin.get("error")
    if not 0 <= residual_vectors <= count or not (error is None or 0.0 <= error < np.inf):
        expected = f"0 to {count} residual vectors and an error >= 0"
        raise UsageError(f"origin: expected {expected}, got {residual_vectors} and {error}.")
    if residual_vectors and (order != np.arange(count)).any():
        raise UsageError("expected ascending frequencies beside residual vectors, got another order.")
    return Modes(
        natural[order],
        ratios[order],
        damping,
        dict(zip(given.points, shapes[:, order], strict=True)),
        participation,
        residual_vectors,
        error,
        dict(origin.get("files", {})),
        (*origin.get("remarks", ()), *given.remarks, *remarks),
        {name: place for name, place in given.coordinates.items() if np.isfinite(place).all()},
    )


def _numbers(key: str, values: Sequence[float]) -> Floats:
    """Return finite numbers as an array."""
    found = np.array(values, dtype=np.float64)
    if not np.isfinite(found).all():
        raise UsageError(f"{key}: expected finite numbers, got {found[~np.isfinite(found)][0]}.")
    return found


def _each(key: str, values: Sequence[float], count: int) -> Floats:
    """Return finite numbers, one for each mode."""
    if len(values) != count:
        raise UsageError(f"{key}: expected {count} numbers, one for each mode, got {len(values)}.")
    return _numbers(key, values)


def _damping(rows: Sequence[Sequence[float]], count: int) -> Floats:
    """Return a symmetric matrix."""
    if len(rows) != count:
        raise UsageError(f"damping_matrix: expected {count} rows, one for each mode, got {len(rows)}.")
    found = np.array([_each(f"damping_matrix[{place}]", row, count) for place, row in enumerate(rows, 1)])
    if np.abs(found - found.T).max() > _SKEW * np.abs(found).max():
        raise UsageError("damping_matrix: expected a symmetric matrix, got one that is not.")
    return np.asarray(0.5 * (found + found.T))


def _shapes(given: GivenModes, count: int) -> tuple[Floats, tuple[str, ...]]:
    """Return real and mass-normalised shapes, with the remark on those that were complex."""
    points, shapes = given.points, given.shapes
    if not 1 <= len(points) <= MOST_POINTS or len(points) * count > MOST_NUMBERS:
        raise UsageError(f"expected shapes at 1 to {MOST_POINTS} points, got {len(points)}.")
    if len(set(points)) < len(points):
        raise UsageError(f"expected each point once, got {_twice(points)!r} again.")
    for name in points:
        if _NAME.fullmatch(name) is None:
            raise UsageError(
                f"expected a point's name of at most 40 letters, digits, dots and dashes, got {name[:60]!r}."
            )
    if shapes.shape != (len(points), count):
        sizes = " x ".join(str(size) for size in shapes.shape)
        raise UsageError(f"shapes: expected {len(points)} points x {count} modes, got {sizes}.")
    if given.modal_masses is not None:
        with np.errstate(all="ignore"):  # what overflows is refused below
            shapes = shapes / np.sqrt(_masses(given.modal_masses, count))
    if not np.isfinite(shapes).all():
        point, mode = np.argwhere(~np.isfinite(shapes))[0]
        raise UsageError(f"{points[point]}: expected finite numbers, got another in mode {mode + 1}.")
    return real_shapes(shapes)


def _masses(values: Sequence[complex], count: int) -> Shapes:
    """Return the modal masses, which are positive, or complex and not 0."""
    if len(values) != count:
        raise UsageError(f"modal_mass: expected {count} numbers, one for each mode, got {len(values)}.")
    found = np.array(values)
    for number, mass in enumerate(values, 1):
        is_right = mass != 0.0 if isinstance(mass, complex) else mass > 0.0
        if not (np.isfinite(mass) and is_right):
            hint = "It is 1 for mass-normalised shapes."
            raise UsageError(f"mode {number}: expected a modal mass > 0, got {mass:g}. {hint}")
    return found


def _twice(names: Sequence[str]) -> str:
    """Return the first name that occurs twice."""
    return next(name for name, times in Counter(names).items() if times > 1)
