"""Modes for tests, beyond `fmus.core`: modes of chains, and the beam quantities that only the FMU uses."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.fmus.core import BeamModes, core_library
from vibroimpact.fmus.core.modes import BOUNDARIES

Array = NDArray[np.float64]

#: VI_MODES of the core library.
MOST_MODES = 64
#: Shear coefficient of a rectangular section in Timoshenko's theory.
SHEAR_COEFFICIENT = 5.0 / 6.0

_ROW = ctypes.c_double * MOST_MODES
_LONGER_ROW = ctypes.c_double * (MOST_MODES + 1)


class _Chain(ctypes.Structure):
    _fields_: ClassVar = [
        ("masses", ctypes.c_int),
        ("mass", _ROW),
        ("stiffness", _LONGER_ROW),
        ("damping", _LONGER_ROW),
    ]


class _ChainModes(ctypes.Structure):
    _fields_: ClassVar = [
        ("natural", _ROW),
        ("damping_ratio", _ROW),
        ("shape", _ROW * MOST_MODES),
        ("classical", ctypes.c_bool),
        ("damping", _ROW * MOST_MODES),
    ]


@dataclass(frozen=True, slots=True, eq=False)
class ChainModes:
    """Modes of a chain of N masses, as in `chain_modes.h`; matrices are (mass, mode) and (mode, mode)."""

    natural: Array
    damping_ratio: Array
    shapes: Array
    classical: bool
    damping: Array


def chain_modes(
    masses: ArrayLike,
    stiffnesses: ArrayLike,
    dampings: ArrayLike,
    far_stiffness: float = 0.0,
    far_damping: float = 0.0,
) -> ChainModes:
    """Return the modes of a chain; element i lies between mass i - 1 (the ground for the first) and mass i."""
    m = np.asarray(masses, dtype=np.float64)
    n = m.size
    chain = _Chain(n, _ROW(*m))
    chain.stiffness[: n + 1] = [*np.asarray(stiffnesses, dtype=np.float64), far_stiffness]
    chain.damping[: n + 1] = [*np.asarray(dampings, dtype=np.float64), far_damping]
    modes, find = _ChainModes(), core_library().vi_chain_find_modes
    find.restype = ctypes.c_bool
    if not find(ctypes.byref(chain), ctypes.byref(modes)):
        raise ValueError(f"no modes of a chain with masses {m}")
    return ChainModes(
        np.array(modes.natural)[:n],
        np.array(modes.damping_ratio)[:n],
        np.array(modes.shape)[:n, :n],
        modes.classical,
        np.array(modes.damping)[:n, :n],
    )


def natural_frequencies(
    modes: BeamModes, flexural_rigidity: float, mass_per_length: float, length: float
) -> Array:
    """Return the natural angular frequencies of a beam, rad/s: equations.md 6.1."""
    return np.asarray(modes.eigenvalues**2 * np.sqrt(flexural_rigidity / mass_per_length) / length**2)


def static_stiffness(modes: BeamModes, point: float) -> float:
    """Return the static stiffness of a beam at s = `point` in units of E I / L^3, from the exact deflection."""
    s, t = np.float64(point), np.float64(1.0 - point)
    with np.errstate(divide="ignore"):
        return float(
            {
                "clamped_free": 3.0 / s**3,
                "clamped_clamped": 3.0 / (s * t) ** 3,
                "clamped_pinned": 12.0 / (s**3 * t**2 * (4.0 - s)),
                "pinned_pinned": 3.0 / (s * t) ** 2,
            }[modes.boundary]
        )


def frequency_error(modes: BeamModes, slenderness: float, poisson_ratio: float = 0.3) -> Array:
    """Return the relative frequency errors of a beam, for which its FMU gives warnings: equations.md 6.7."""
    error, number = core_library().vi_beam_validity, ctypes.c_double
    error.restype, error.argtypes = number, [ctypes.c_int, ctypes.c_int, number, number, number]
    ratio, boundary = 2.0 * (1.0 + poisson_ratio), BOUNDARIES[modes.boundary]
    counted = range(1, modes.eigenvalues.size + 1)
    return np.array([error(boundary, j, slenderness, ratio, SHEAR_COEFFICIENT) for j in counted])


def collocation(modes: BeamModes, points: ArrayLike, at: int) -> Array:
    """Return the modal velocities of a unit impulse at a grid point by collocation: thesis (7.60) to (7.62).

    Raises
    ------
    ValueError
        The grid is singular: a doubled point, or a point on a support.
    """
    s, pointer = np.ascontiguousarray(points, dtype=np.float64), ctypes.POINTER(ctypes.c_double)
    direction = np.empty(modes.eigenvalues.size)
    found = core_library().vi_beam_collocation(
        BOUNDARIES[modes.boundary], s.size, s.ctypes.data_as(pointer), at, direction.ctypes.data_as(pointer)
    )
    if not found:
        raise ValueError(f"no combination of the modes is 1 at point {at} of {s} and 0 at the others")
    return direction
