"""Modes of beams and chains, from the same C functions as in the FMUs: equations.md 5 and 6."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.errors import UsageError

Array = npt.NDArray[np.float64]
Numbers = Sequence[float] | Array
Boundary = Literal["clamped_free", "clamped_clamped", "clamped_pinned", "pinned_pinned"]

#: Boundaries of a beam, each with its number in the FMU's enumeration BeamBoundary.
BOUNDARIES: dict[Boundary, int] = {name: number for number, name in enumerate(get_args(Boundary), 1)}
HIGHEST_DERIVATIVE = 3


@dataclass(frozen=True, slots=True, eq=False)
class BeamModes:
    """The first modes of an Euler-Bernoulli beam, over the length 0 <= s = x / L <= 1.

    Shapes have unit mean square over the length, so that every modal mass is the beam's mass.

    Attributes
    ----------
    boundary : str
        Supports of both ends, s = 0 first.
    eigenvalues : array, shape (count,)
        xi_j: natural angular frequency = xi_j^2 sqrt(E I / (mass_per_length L^4)); thesis table 7.1.
    participation : array, shape (count,)
        Integral of each shape over s; thesis table 7.3.
    """

    boundary: Boundary
    eigenvalues: Array
    participation: Array

    def shapes(self, points: float | Numbers, derivative: int = 0) -> Array:
        """Return the mode shapes, or a derivative over s, at points: equations.md 6.3.

        Parameters
        ----------
        points : float or array of floats
            Places s, 0 to 1.
        derivative : int
            Order of the derivative, 0 to 3.

        Returns
        -------
        array, shape (number of points, count)
            Errors are about 1e-15 xi_j^derivative, in every mode; the tip of a clamped-free beam is exactly +-2.

        Raises
        ------
        UsageError
            A point is outside of the beam, or the order is none of 0 to 3.

        Examples
        --------
        >>> print(beam_modes("clamped_free", 3).shapes([0.0, 1.0]))
        [[ 0.  0.  0.]
         [ 2. -2.  2.]]
        """
        s = np.ascontiguousarray(np.atleast_1d(np.asarray(points, dtype=np.float64)))
        if s.ndim != 1:
            raise UsageError(
                f"BeamModes.shapes: points: expected a row of numbers, got an array of shape {s.shape}."
            )
        if not np.all((s >= 0.0) & (s <= 1.0)):
            raise UsageError(
                f"BeamModes.shapes: expected points 0 <= s <= 1 (fractions of the length), got {s}."
            )
        if derivative not in range(HIGHEST_DERIVATIVE + 1):
            raise UsageError(
                f"BeamModes.shapes: derivative: expected 0 to {HIGHEST_DERIVATIVE}, got {derivative}."
            )
        values = np.empty((s.size, self.eigenvalues.size))
        _library().vi_door_beam_shapes(
            BOUNDARIES[self.boundary], self.eigenvalues.size, s.size, s, derivative, values
        )
        return values


def beam_modes(boundary: Boundary, count: int) -> BeamModes:
    """Return the first modes of an Euler-Bernoulli beam.

    Parameters
    ----------
    boundary : str
        clamped_free, clamped_clamped, clamped_pinned or pinned_pinned; s = 0 first.
    count : int
        Number of modes, >= 1.

    Raises
    ------
    UsageError
        The boundary is unknown, or the count is below 1.

    Examples
    --------
    >>> modes = beam_modes("clamped_free", 3)
    >>> print(modes.eigenvalues.round(6), modes.participation.round(8))
    [1.875104 4.694091 7.854757] [0.78299176 0.4339359  0.2544253 ]
    """
    if boundary not in BOUNDARIES or count < 1:
        raise UsageError(
            f"beam_modes: expected a boundary ({', '.join(BOUNDARIES)}) and count >= 1, "
            f"got {boundary!r} and {count}."
        )
    eigenvalues, participation = np.empty(count), np.empty(count)
    _library().vi_door_beam_modes(BOUNDARIES[boundary], count, eigenvalues, participation)
    for array in (eigenvalues, participation):
        array.setflags(write=False)
    return BeamModes(boundary, eigenvalues, participation)


@dataclass(frozen=True, slots=True, eq=False)
class ResidualVectors:
    """Static remainder of a beam's first modes under forces at given points, as shapes orthogonal to these modes."""

    boundary: Boundary
    """Supports of both ends, s = 0 first."""
    natural: int
    """Number of natural modes that are kept."""
    points: Array
    """Places s of the forces, shape (point,)."""
    eigenvalues: Array
    """xi, ascending, shape (point,): natural angular frequency = xi^2 sqrt(E I / (mass_per_length L^4))."""
    participation: Array
    """Integral of each shape over s, shape (point,)."""

    def shapes(self, points: float | Numbers) -> Array:
        """Return the shapes, of unit mean square over the length, at points s, 0 to 1; shape (number of points, point).

        Raise UsageError for a point outside of the beam.
        """
        s = _row(points)
        values = np.empty((s.size, self.points.size))
        if _library().vi_door_beam_residual_shapes(
            BOUNDARIES[self.boundary], self.natural, self.points.size, self.points, s.size, s, values
        ):
            raise UsageError(f"ResidualVectors.shapes: expected points 0 <= s <= 1, got {s}.")
        return values


def residual_vectors(boundary: Boundary, natural: int, points: float | Numbers) -> ResidualVectors:
    """Return the static remainder of a beam's first modes under forces at given points: equations.md 6.6.

    With these shapes the beam's static compliance at the points is that of all its modes. At least one natural mode is
    kept. There are at most 8 points s, all distinct and not on a support; s = 0 is the first end of the boundary.
    Raise UsageError for an unknown boundary, no mode, or points that are numerically equal.

    Examples
    --------
    >>> tip = residual_vectors("clamped_free", 2, 1.0)
    >>> kept = beam_modes("clamped_free", 2)
    >>> stiff = (kept.shapes(1.0) ** 2 / kept.eigenvalues**4).sum()
    >>> whole = stiff + (tip.shapes(1.0) ** 2 / tip.eigenvalues**4).sum()
    >>> print(round(stiff, 6), round(whole, 6))
    0.331801 0.333333
    """
    s = _row(points)
    eigenvalues, participation = np.empty(s.size), np.empty(s.size)
    if boundary not in BOUNDARIES or _library().vi_door_beam_residual(
        BOUNDARIES[boundary], natural, s.size, s, eigenvalues, participation
    ):
        raise UsageError(
            f"residual_vectors: expected a boundary ({', '.join(BOUNDARIES)}), natural >= 1 and 1 to 8 points that "
            f"move and can be told apart, got {boundary!r}, {natural} and {s}."
        )
    for array in (s, eigenvalues, participation):
        array.setflags(write=False)
    return ResidualVectors(boundary, natural, s, eigenvalues, participation)


@dataclass(frozen=True, slots=True, eq=False)
class ChainModes:
    """The modes of a chain of masses, mass-normalised: equations.md 5.2.

    Attributes
    ----------
    frequencies : array, shape (masses,)
        Natural angular frequencies, ascending, rad/s.
    damping_ratios : array, shape (masses,)
        Damping ratios; the diagonal terms alone where the damping couples the modes.
    shapes : array, shape (masses, masses)
        Displacement of each mass (rows) for a unit of each mode, kg^(-1/2).
    coupling : array, shape (masses, masses)
        Damping between the modes, 1/s: diagonal, but for rounding, where `is_classical`.
    is_classical : bool
        Whether the damping leaves the modes uncoupled.
    """

    frequencies: Array
    damping_ratios: Array
    shapes: Array
    coupling: Array
    is_classical: bool


def chain_modes(masses: Numbers, stiffnesses: Numbers, dampings: Numbers) -> ChainModes:
    """Return the modes of a chain: ground, spring and dashpot, mass, spring and dashpot, mass, ... [, ground].

    Parameters
    ----------
    masses : array of floats, shape (masses,)
        kg, > 0; 1 to 64 masses.
    stiffnesses, dampings : array of floats, shape (masses + 1,)
        N/m and N s/m, >= 0; the last ties the far end to the ground.

    Raises
    ------
    UsageError
        The numbers describe no chain.

    Examples
    --------
    >>> modes = chain_modes([1.0, 2.0, 0.5], [3.0, 1.0, 2.0, 0.0], [0.12, 0.04, 0.08, 0.0])
    >>> print(modes.frequencies.round(8), modes.is_classical)
    [0.53645647 2.         2.28302747] True
    """
    mass, stiffness, damping = _row(masses), _row(stiffnesses), _row(dampings)
    count = mass.size
    frequencies, ratios = np.empty(count), np.empty(count)
    shapes, coupling = np.empty((count, count)), np.empty((count, count))
    fits = stiffness.size == damping.size == count + 1
    end = (
        _library().vi_door_chain_modes(count, mass, stiffness, damping, frequencies, ratios, shapes, coupling)
        if fits
        else -1
    )
    if end < 0:
        raise UsageError(
            "chain_modes: expected 1 to 64 masses > 0 and one spring and dashpot more, >= 0, "
            f"got {mass}, {stiffness} and {damping}."
        )
    return ChainModes(frequencies, ratios, shapes, coupling, end == 0)


def spring_modes(springs: Array) -> tuple[Array, Array]:
    """Return the angular frequencies above 0, ascending, and the unit vectors of a structure of springs.

    Parameters
    ----------
    springs : array, shape (spring, coordinate)
        Row of each spring: sqrt(stiffness / mass) at each coordinate, with the sign of its elongation; 1 to 64
        coordinates. The stiffness matrix over the masses is the transpose of this matrix times itself.

    Returns
    -------
    frequencies : array, shape (mode,)
        rad/s; as many as the springs hold.
    vectors : array, shape (mode, coordinate)

    Raises
    ------
    UsageError
        A number is not finite, or there are more than 64 coordinates.

    Examples
    --------
    >>> frequencies, vectors = spring_modes(np.array([[3.0, 0.0], [0.0, 2.0]]))
    >>> print(frequencies, abs(vectors).tolist())
    [2. 3.] [[0.0, 1.0], [1.0, 0.0]]
    """
    rows = np.ascontiguousarray(springs, dtype=np.float64)
    count, columns = rows.shape
    values, vectors = np.empty(columns), np.empty((columns, columns))
    rank = _library().vi_door_spring_modes(count, columns, rows, values, vectors)
    if rank < 0:
        raise UsageError(
            f"spring_modes: expected finite numbers of 1 to 64 coordinates, got {columns} of them."
        )
    return values[:rank].copy(), vectors[:rank].copy()


def signed_modes(springs: Array, signs: Array) -> tuple[Array, Array]:
    """Return the angular frequencies, ascending, and the unit vectors of springs of which some are negative.

    Parameters
    ----------
    springs : array, shape (spring, coordinate)
        Row of each spring, as of `spring_modes`, from the modulus of its stiffness.
    signs : array, shape (spring,)
        1, or -1 for a negative spring.

    Returns
    -------
    frequencies : array, shape (coordinate,)
        rad/s; w < 0 for an eigenvalue -w^2.
    vectors : array, shape (coordinate, coordinate)
        A row for each frequency.

    Raises
    ------
    UsageError
        A number is not finite, there are more than 64 coordinates, or no vectors are found.

    Examples
    --------
    >>> frequencies, vectors = signed_modes(np.array([[3.0, 0.0], [0.0, 2.0]]), np.array([-1.0, 1.0]))
    >>> print(frequencies, abs(vectors).tolist())
    [-3.  2.] [[1.0, 0.0], [0.0, 1.0]]
    """
    rows, of_rows = (np.ascontiguousarray(each, dtype=np.float64) for each in (springs, signs))
    count, columns = rows.shape
    values, vectors = np.empty(columns), np.empty((columns, columns))
    if _library().vi_door_signed_modes(count, columns, rows, of_rows, values, vectors) != 0:
        raise UsageError(
            f"signed_modes: expected finite numbers of 1 to 64 coordinates, got {columns} of them, or others."
        )
    return values, vectors


def _row(points: float | Numbers) -> Array:
    return np.array(np.atleast_1d(np.asarray(points, dtype=np.float64)).ravel())


@cache
def _library() -> ctypes.CDLL:
    library = core_library()
    numbers = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
    integer = ctypes.c_int
    library.vi_door_beam_modes.argtypes = [integer, integer, numbers, numbers]
    library.vi_door_beam_shapes.argtypes = [integer, integer, integer, numbers, integer, numbers]
    library.vi_door_beam_residual.argtypes = [integer, integer, integer, numbers, numbers, numbers]
    library.vi_door_chain_modes.argtypes = [integer, *[numbers] * 7]
    library.vi_door_spring_modes.argtypes = [integer, integer, *[numbers] * 3]
    library.vi_door_signed_modes.argtypes = [integer, integer, *[numbers] * 4]
    library.vi_door_beam_residual_shapes.argtypes = [
        integer,
        integer,
        integer,
        numbers,
        integer,
        numbers,
        numbers,
    ]
    return library
