"""Modes of beams, found by the same C functions as the FMU Beam uses: equations.md 6."""

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

#: The ends of a beam, each with the number that the FMU's enumeration BeamBoundary gives it.
BOUNDARIES: dict[Boundary, int] = {name: number for number, name in enumerate(get_args(Boundary), 1)}
HIGHEST_DERIVATIVE = 3


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
    for array in (eigenvalues, participation):
        array.setflags(write=False)
    return BeamModes(boundary, eigenvalues, participation)


@cache
def _library() -> ctypes.CDLL:
    library = core_library()
    numbers = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
    integer = ctypes.c_int
    library.vi_door_beam_modes.argtypes = [integer, integer, numbers, numbers]
    library.vi_door_beam_shapes.argtypes = [integer, integer, integer, numbers, integer, numbers]
    return library
