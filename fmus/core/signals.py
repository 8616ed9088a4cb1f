"""Signals of time: chirps, pulses, tables and random ones, by the C functions of the FMU Structure."""

from __future__ import annotations

import ctypes
import math
from enum import IntEnum
from functools import cache
from operator import index
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.fmus.core.arrays import address, row_of
from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.errors import UsageError

Array = NDArray[np.float64]

#: Most instants of a table, coefficients of a piece, and bytes of a message.
TABLE_ROOM = 8192
COEFFICIENTS = 17
_MESSAGE_LENGTH = 1024


class SignalKind(IntEnum):
    """Kind of a signal, with its number in the FMU."""

    chirp_linear = 1
    chirp_logarithmic = 2
    half_sine = 3
    triangle = 4
    trapezoid = 5
    table = 6
    random = 7
    table_cubic = 8


class Pieces(NamedTuple):
    """Polynomials that follow each other.

    Attributes
    ----------
    start : ndarray, shape (piece, 2)
        Start of each piece, s: the number and its rounding.
    length : ndarray, shape (piece,)
        Length of each piece, s; inf: the piece has no end.
    coefficient : ndarray, shape (piece, COEFFICIENTS)
        Coefficients of the powers of the seconds since the start.
    """

    start: Array
    length: Array
    coefficient: Array


class _Settings(ctypes.Structure):
    NUMBERS = ("start", "duration", "angular_frequency", "end_angular_frequency", "phase", "rise")
    _fields_ = [
        ("kind", ctypes.c_int64),
        *((name, ctypes.c_double) for name in NUMBERS),
        ("seed", ctypes.c_uint64),
        ("count", ctypes.c_int64),
        ("time", ctypes.c_void_p),
        ("value", ctypes.c_void_p),
    ]


class Signal:
    """A signal of amplitude 1, which is 0 before its start and after its end; docs/equations.md 8.9 and 8.10.

    Parameters
    ----------
    kind : SignalKind
    start, duration : float
        s. A random signal without a duration has no end; tables have none.
    angular_frequency, end_angular_frequency : float
        rad/s: of a chirp at its start and end; ends of the band of a random signal, by default those of its density.
    phase : float
        Phase of a chirp at its start, rad: the chirp begins with cos(phase).
    rise : float
        Rise of a trapezoid, and its fall, s.
    seed : int
        Seed of a random signal, 0 to 2^64 - 1.
    places, values : array_like, shape (row,)
        Instants of a table, s after `start`, and values there. Of a random signal: angular frequencies, rad/s, and its
        one-sided density, s/rad. Without them the density is the same in all the band, with variance 1.

    Raises
    ------
    UsageError
        A number is out of its range; instants do not ascend; a density is negative or does not cover the band.

    Examples
    --------
    >>> pulse = Signal(SignalKind.half_sine, duration=2.0)
    >>> pulse.values([-0.5, 0.0, 1.0, 2.0]).round(12).tolist()
    [0.0, 0.0, 1.0, 0.0]
    """

    def __init__(
        self,
        kind: SignalKind,
        *,
        start: float = 0.0,
        duration: float = 0.0,
        angular_frequency: float = 0.0,
        end_angular_frequency: float = 0.0,
        phase: float = 0.0,
        rise: float = 0.0,
        seed: int = 0,
        places: ArrayLike = (),
        values: ArrayLike = (),
    ) -> None:
        at, value = (np.ascontiguousarray(row, dtype=np.float64) for row in (places, values))
        if at.ndim != 1 or at.shape != value.shape:
            raise UsageError(
                f"signal.table: expected two rows of one length, got {at.shape} and {value.shape}."
            )
        if not 0 <= index(seed) < 2**64:
            raise UsageError(f"signal.seed: expected 0 to 2^64 - 1, got {seed}.")
        numbers = (start, duration, angular_frequency, end_angular_frequency, phase, rise)
        settings = _Settings(int(kind), *numbers, seed, at.size, address(at), address(value))
        self._memory = np.zeros(_library().vi_door_signal_size(), dtype=np.uint8)
        message = ctypes.create_string_buffer(_MESSAGE_LENGTH)
        if _library().vi_door_signal_start(address(self._memory), settings, message):
            raise UsageError(f"{message.value.decode('utf-8', 'replace')}.")

    def values(self, times: ArrayLike, low: ArrayLike = 0.0) -> Array:
        """Return the signal at `times` + `low`, s; `low` has the digits that a double lacks.

        Parameters
        ----------
        times, low : array_like, shape (sample,)
            s; a single `low` holds for all.

        Returns
        -------
        ndarray, shape (sample,)
        """
        at = row_of("signal.values", times)
        rounding = np.ascontiguousarray(np.broadcast_to(np.asarray(low, dtype=np.float64), at.shape))
        values = np.empty_like(at)
        rows = (address(row) for row in (at, rounding, values))
        _library().vi_door_signal_values(address(self._memory), at.size, *rows)
        return values

    def pieces(self, begin: float, end: float, most: int = 100_000) -> Pieces:
        """Return the pieces from `begin` on until one reaches `end`, s, and `most` of them at most.

        Raises
        ------
        UsageError
            An end is not finite.
        """
        if not (math.isfinite(begin) and math.isfinite(end)):
            raise UsageError(f"signal.pieces: expected finite times, got {begin} and {end}.")
        pieces = Pieces(np.empty((most, 2)), np.empty(most), np.empty((most, COEFFICIENTS)))
        rows = (address(row) for row in pieces)
        count = _library().vi_door_signal_pieces(address(self._memory), begin, end, most, *rows)
        return Pieces(*(row[:count] for row in pieces))


@cache
def _library() -> ctypes.CDLL:
    library = core_library()
    number, size, pointer = ctypes.c_double, ctypes.c_size_t, ctypes.c_void_p
    library.vi_door_signal_size.argtypes, library.vi_door_signal_size.restype = [], size
    library.vi_door_signal_start.argtypes = [pointer, ctypes.POINTER(_Settings), ctypes.c_char_p]
    library.vi_door_signal_values.argtypes = [pointer, size, pointer, pointer, pointer]
    library.vi_door_signal_values.restype = None
    library.vi_door_signal_pieces.argtypes = [pointer, number, number, size, pointer, pointer, pointer]
    library.vi_door_signal_pieces.restype = size
    return library
