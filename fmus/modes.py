"""Modes of chains and beams, found by the same C functions as the FMUs Chain and Beam use: equations.md 5 and 6."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import numpy.typing as npt

from vibroimpact.fmus.core import core_library
from vibroimpact.fmus.errors import UsageError

Array = npt.NDArray[np.float64]
Numbers = Sequence[float] | Array
Boundary = Literal["clamped_free", "clamped_clamped", "clamped_pinned", "pinned_pinned"]

#: The ends of a beam, each with the number that the FMU's enumeration BeamBoundary gives it.
BOUNDARIES: dict[str, int] = {
    "clamped_free": 1,
    "clamped_clamped": 2,
    "clamped_pinned": 3,
    "pinned_pinned": 4,
}
#: Of a rectangular section in Timoshenko's theory.
SHEAR_COEFFICIENT = 5.0 / 6.0
HIGHEST_DERIVATIVE = 3


@dataclass(frozen=True, slots=True, eq=False)
class ChainModes:
    """Modes of a chain of N masses, mass-normalised: modal coordinates are in kg^(1/2) m.

    The first mass that takes part in a mode moves to the positive side in it.

    Attributes
    ----------
    natural : array, shape (N,)
        Natural angular frequencies, ascending, rad/s; 0 for masses that no spring ties to the ground.
    damping_ratio : array, shape (N,)
        Of each mode; of the diagonal of `damping` where that couples the modes.
    shapes : array, shape (N, N)
        `shapes[i, j]`: displacement of mass i in mode j, kg^(-1/2).
    classical : bool
        The damping does not couple the modes, C M^-1 K = K M^-1 C, and every mode has a damping ratio.
    damping : array, shape (N, N)
        Modal damping matrix, 1/s.
    """

    natural: Array
    damping_ratio: Array
    shapes: Array
    classical: bool
    damping: Array


@dataclass(frozen=True, slots=True, eq=False)
class BeamModes:
    """The first modes of an Euler-Bernoulli beam, on the length 0 <= s = x / L <= 1.

    Shapes have unit mean square over the length, so that every modal mass is the beam's mass.

    Attributes
    ----------
    boundary : str
        The ends, s = 0 first.
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
            s, 0 to 1.
        derivative : int
            Order 0 to 3.

        Returns
        -------
        array, shape (number of points, count)
            To some 1e-15 xi_j^derivative, in every mode; the tip of a clamped-free beam is exactly +-2.

        Raises
        ------
        UsageError
            A point outside of the beam, or another derivative.

        Examples
        --------
        >>> print(beam_modes("clamped_free", 3).shapes([0.0, 1.0]))
        [[ 0.  0.  0.]
         [ 2. -2.  2.]]
        """
        s = _numbers("BeamModes.shapes: points", points)
        _check_points("BeamModes.shapes", s)
        if derivative not in range(HIGHEST_DERIVATIVE + 1):
            raise UsageError(
                f"BeamModes.shapes: derivative: expected 0 to {HIGHEST_DERIVATIVE}, got {derivative}."
            )
        values = np.empty((s.size, self.eigenvalues.size))
        _library().vi_door_beam_shapes(
            BOUNDARIES[self.boundary], self.eigenvalues.size, s.size, s, derivative, values
        )
        return values

    def natural_frequencies(self, flexural_rigidity: float, mass_per_length: float, length: float) -> Array:
        """Return the natural angular frequencies in rad/s: equations.md 6.1.

        Parameters
        ----------
        flexural_rigidity, mass_per_length, length : float
            E I in N m^2, kg/m, m.

        Examples
        --------
        >>> inertia, area = 0.02 * 0.002**3 / 12, 0.02 * 0.002
        >>> w = beam_modes("clamped_free", 1).natural_frequencies(70e9 * inertia, 2700 * area, 0.25)
        >>> round(float(w[0]) / (2 * np.pi), 4)
        26.3207
        """
        return np.asarray(self.eigenvalues**2 * np.sqrt(flexural_rigidity / mass_per_length) / length**2)

    def static_stiffness(self, point: float) -> float:
        """Return the static stiffness at s = `point` in units of E I / L^3, from the exact deflection.

        Clamped-free 3 / s^3, clamped-clamped 3 / (s (1-s))^3, clamped-pinned 12 / (s^3 (1-s)^2 (4-s)),
        pinned-pinned 3 / (s (1-s))^2; infinite at a support.

        Examples
        --------
        >>> beam_modes("clamped_free", 1).static_stiffness(1.0)
        3.0
        """
        _check_points("BeamModes.static_stiffness", np.array([point], dtype=float))
        return float(_library().vi_door_beam_static_stiffness(BOUNDARIES[self.boundary], point))

    def frequency_error(
        self,
        slenderness: float,
        poisson_ratio: float = 0.3,
        shear_coefficient: float = SHEAR_COEFFICIENT,
    ) -> Array:
        """Return the estimated relative errors of the frequencies by this theory: equations.md 6.7.

        They are Timoshenko's frequency drop to leading order, which is that of the pinned-pinned beam; above
        0.02 a mode has left the validity of Euler-Bernoulli's theory.

        Parameters
        ----------
        slenderness : float
            Radius of gyration of the section over the length; thickness / (sqrt(12) L) for a rectangle.
        poisson_ratio, shear_coefficient : float
            Of the material, of the section.

        Returns
        -------
        array, shape (count,)

        Examples
        --------
        >>> modes = beam_modes("pinned_pinned", 5)
        >>> round(float(modes.frequency_error(0.01 / np.sqrt(12.0))[4]), 7)
        0.0042357
        """
        e_over_g = 2.0 * (1.0 + poisson_ratio)
        if not (slenderness >= 0.0 and e_over_g >= 0.0 and shear_coefficient > 0.0):
            raise UsageError(
                "BeamModes.frequency_error: expected slenderness >= 0, poisson_ratio >= -1, "
                f"shear_coefficient > 0, got {slenderness}, {poisson_ratio}, {shear_coefficient}."
            )
        error = _library().vi_door_beam_validity
        modes = range(1, self.eigenvalues.size + 1)
        number = BOUNDARIES[self.boundary]
        return np.array([error(number, j, slenderness, e_over_g, shear_coefficient) for j in modes])

    def collocation(self, points: Numbers, at: int) -> Array:
        """Return the modal velocities of a unit impulse at a grid point by collocation: thesis (7.60) to (7.62).

        They give velocity 1 to grid point `at` and 0 to the others. Such an impulse can create energy:
        equations.md 6.8.

        Parameters
        ----------
        points : array, shape (count,)
            The grid, as many points as modes.
        at : int
            Index of the point that is hit.

        Returns
        -------
        array, shape (count,)

        Raises
        ------
        UsageError
            The grid is singular (a point twice, a point on a support), or has another number of points.

        Examples
        --------
        >>> modes = beam_modes("clamped_free", 3)
        >>> grid = [1 / 3, 2 / 3, 1.0]
        >>> velocity = modes.shapes(grid) @ modes.collocation(grid, 2)
        >>> print(abs(np.round(velocity, 12)))
        [0. 0. 1.]
        """
        where, s = "BeamModes.collocation", _numbers("BeamModes.collocation: points", points)
        _check_points(where, s)
        most, count = _library().vi_door_most_modes(), self.eigenvalues.size
        if s.size != count or count > most or at not in range(count):
            raise UsageError(
                f"{where}: expected as many points as modes, at most {most}, and the index of one, "
                f"got {s.size} points, {count} modes and at = {at}."
            )
        direction = np.empty(count)
        status = _library().vi_door_beam_collocation(BOUNDARIES[self.boundary], count, s, at, direction)
        if status != 0:
            raise UsageError(
                f"{where}: points: expected a grid on which no combination of the modes vanishes, got {s}. "
                "Take each point once, and none on a support."
            )
        return direction


def chain_modes(
    masses: Numbers,
    stiffnesses: Numbers,
    dampings: Numbers,
    far_stiffness: float = 0.0,
    far_damping: float = 0.0,
) -> ChainModes:
    """Return the modes of a chain; element i lies between mass i - 1 (the ground for the first) and mass i.

    Frequencies are right to a few roundings each, for masses and stiffnesses over any number of decades; shapes
    to a few roundings of the mode's length in displacement times sqrt(mass).

    Parameters
    ----------
    masses : array, shape (N,)
        kg, > 0; at most 64.
    stiffnesses, dampings : array, shape (N,)
        N/m and N s/m, >= 0.
    far_stiffness, far_damping : float
        Of an element between the last mass and the ground, N/m and N s/m.

    Raises
    ------
    UsageError
        A number is out of its range, or the lengths differ.

    Examples
    --------
    >>> modes = chain_modes([1.0, 1.0], [1.0, 1.0], [0.1, 0.1])
    >>> print(modes.natural.round(6), modes.classical)
    [0.618034 1.618034] True
    """
    m = _numbers("chain_modes: masses", masses)
    k = np.append(_numbers("chain_modes: stiffnesses", stiffnesses), far_stiffness)
    c = np.append(_numbers("chain_modes: dampings", dampings), far_damping)
    _check_chain(m, k, c)
    natural, ratio, shapes, damping = (np.zeros(m.shape * rank) for rank in (1, 1, 2, 2))
    status = _library().vi_door_chain_modes(m.size, m, k, c, natural, ratio, shapes, damping)
    if status < 0:
        raise UsageError(
            "chain_modes: expected numbers whose ratios stay within the range of doubles, "
            f"got masses {m}, stiffnesses {k}."
        )
    _protect(natural, ratio, shapes, damping)
    return ChainModes(natural, ratio, shapes, status == 1, damping)


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
        Another boundary, or no mode.

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
    _protect(eigenvalues, participation)
    return BeamModes(boundary, eigenvalues, participation)


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    library = core_library()
    numbers = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
    integer, number = ctypes.c_int, ctypes.c_double
    library.vi_door_chain_modes.argtypes = [integer, *[numbers] * 7]
    library.vi_door_beam_modes.argtypes = [integer, integer, numbers, numbers]
    library.vi_door_beam_shapes.argtypes = [integer, integer, integer, numbers, integer, numbers]
    library.vi_door_beam_static_stiffness.argtypes = [integer, number]
    library.vi_door_beam_static_stiffness.restype = number
    library.vi_door_beam_validity.argtypes = [integer, integer, number, number, number]
    library.vi_door_beam_validity.restype = number
    library.vi_door_beam_collocation.argtypes = [integer, integer, numbers, integer, numbers]
    return library


def _numbers(where: str, values: float | Numbers) -> Array:
    array = np.ascontiguousarray(np.atleast_1d(np.asarray(values, dtype=np.float64)))
    if array.ndim != 1:
        raise UsageError(f"{where}: expected a row of numbers, got an array of shape {array.shape}.")
    return array


def _check_points(where: str, points: Array) -> None:
    if not np.all((points >= 0.0) & (points <= 1.0)):
        raise UsageError(f"{where}: expected points 0 <= s <= 1 (fractions of the length), got {points}.")


def _check_chain(m: Array, k: Array, c: Array) -> None:
    most = _library().vi_door_most_modes()
    if not (1 <= m.size <= most and k.size == c.size == m.size + 1):
        raise UsageError(
            f"chain_modes: expected 1 to {most} masses and as many stiffnesses and dampings, "
            f"got {m.size}, {k.size - 1} and {c.size - 1}."
        )
    rules: list[tuple[str, Array, str, Callable[[Array], npt.NDArray[np.bool_]]]] = [
        ("masses", m, "> 0", lambda x: x > 0.0),
        ("stiffnesses", k, ">= 0", lambda x: x >= 0.0),
        ("dampings", c, ">= 0", lambda x: x >= 0.0),
    ]
    for name, values, rule, holds in rules:
        if not np.all(np.isfinite(values) & holds(values)):
            raise UsageError(f"chain_modes: {name}: expected finite numbers {rule}, got {values}.")


def _protect(*arrays: Array) -> None:
    for array in arrays:
        array.setflags(write=False)
