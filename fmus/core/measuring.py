"""Measuring chains: sensors, load cells, exciters, noise and converters, by the C functions of their FMUs."""

from __future__ import annotations

import ctypes
import math
from functools import cache
from operator import index

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.fmus.core.arrays import address, row_of
from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.errors import UsageError

Array = NDArray[np.float64]

#: Sides of a body where an exciter may be, each with its number in the FMU.
EXCITER_SIDES = {"lower": 1, "upper": 2}
MOST_BITS = 32
#: Upper limits of a load cell's parameters (Hz, 1, s), and the smallest value besides 0.
CELL_LIMITS = {"natural_frequency": 1e7, "damping_ratio": 1e3, "contact_duration": 1e3}
CELL_LEAST = 1e-9
#: Relative rounding error by which an impact may lie before or after a block.
_SAME_INSTANT = 1e-12


class _Settings(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_double)
        for name in (
            "sensitivity",
            "natural_frequency",
            "damping_ratio",
            "offset",
            "drift",
            "contact_duration",
        )
    ]


class LoadCell:
    """A load cell: its output voltage for the force on it, with the oscillation of the cell.

    y'' + 2 damping_ratio w y' + w^2 y = w^2 force, w = 2 pi natural_frequency; the output is
    sensitivity y + offset + drift time. An impact on a rigid stop becomes a half sine, which starts at the impact and
    has its impulse. The peak is pi impulse / (2 contact_duration).

    Parameters
    ----------
    sensitivity : float
        Sensitivity, V/N.
    natural_frequency : float
        Hz, 0 or 1e-9 to 1e7; 0: the cell does not oscillate, and y is the force.
    damping_ratio : float
        0 to 1000.
    offset, drift : float
        Output for no force at time 0, V, and its rate of change, V/s.
    contact_duration : float
        Duration of an impact, s, 0 or 1e-9 to 1000; 0: the cell takes no impacts.

    Raises
    ------
    UsageError
        A number is out of its range.

    Examples
    --------
    >>> cell = LoadCell(0.01, contact_duration=1e-3)
    >>> cell.follow([0.0, 0.5e-3, 1e-3], [0.0, 0.0, 0.0], [0.0], [2e-3 / np.pi]).round(12).tolist()
    [0.0, 0.01, 0.0]
    """

    def __init__(
        self,
        sensitivity: float,
        natural_frequency: float = 0.0,
        damping_ratio: float = 0.0,
        offset: float = 0.0,
        drift: float = 0.0,
        contact_duration: float = 0.0,
    ) -> None:
        for name, value in (("sensitivity", sensitivity), ("offset", offset), ("drift", drift)):
            _check(math.isfinite(value), f"LoadCell: {name}", "a finite number", value)
        for name, value in (
            ("natural_frequency", natural_frequency),
            ("damping_ratio", damping_ratio),
            ("contact_duration", contact_duration),
        ):
            largest = CELL_LIMITS[name]
            least = 0.0 if name == "damping_ratio" else CELL_LEAST
            good = value == 0.0 or least <= value <= largest
            _check(good, f"LoadCell: {name}", f"0 {f'or {least:g} ' if least else ''}to {largest:g}", value)
        self._settings = _Settings(
            sensitivity, natural_frequency, damping_ratio, offset, drift, contact_duration
        )
        self._cell = ctypes.create_string_buffer(_library().vi_door_cell_size())
        self._reached: float | None = None

    @property
    def time(self) -> float | None:
        """End of the last block, s; None before the first block."""
        return self._reached

    def follow(
        self, times: ArrayLike, forces: ArrayLike, impact_times: ArrayLike = (), impulses: ArrayLike = ()
    ) -> Array:
        """Return the output at given instants, continuing from the block before.

        The output is exact for a force that is linear between the instants, also from the last instant of the block
        before. The first block begins at its first instant or impact, in equilibrium with its first force.

        Parameters
        ----------
        times : array_like, shape (sample,)
            s, ascending, not before the end of the block before.
        forces : array_like, shape (sample,)
            Forces on the cell at these instants, N, without impacts.
        impact_times, impulses : array_like, shape (impact,)
            Instants of impacts on a rigid stop, s, ascending, after the block before and not after the end of this
            block; impulses, N s.

        Returns
        -------
        ndarray, shape (sample,)
            Output, V.

        Raises
        ------
        UsageError
            A number is not finite, instants are out of order, an impact is outside of the block, or impacts come with
            contact_duration 0. More than 2048 impacts are within one contact_duration: the cell is of no further use.
        """
        at, force = row_of("LoadCell: times", times), row_of("LoadCell: forces", forces)
        hits, impulse = row_of("LoadCell: impact_times", impact_times), row_of("LoadCell: impulses", impulses)
        self._check_block(at, force, hits, impulse)
        volts = np.empty_like(at)
        if not len(at):
            return volts
        library = _library()
        if self._reached is None:
            start = min(at[0], hits[0]) if len(hits) else at[0]
            library.vi_door_cell_start(self._cell, self._settings, start, force[0])
        status = library.vi_door_cell_follow(
            self._cell,
            len(at),
            address(at),
            address(force),
            len(hits),
            address(hits),
            address(impulse),
            address(volts),
        )
        self._reached = float(at[-1])
        if status:
            raise UsageError(
                "LoadCell: impact_times: expected at most 2048 impacts within one contact_duration "
                f"({self._settings.contact_duration:g} s), got more. Take a shorter contact_duration."
            )
        _check(
            bool(np.all(np.isfinite(volts))),
            "LoadCell: forces",
            "what the cell can show",
            "numbers too large",
        )
        return volts

    def _check_block(self, at: Array, force: Array, hits: Array, impulse: Array) -> None:
        _check(len(at) == len(force), "LoadCell: forces", f"as many as times ({len(at)})", len(force))
        _check(
            len(hits) == len(impulse),
            "LoadCell: impulses",
            f"as many as impact_times ({len(hits)})",
            len(impulse),
        )
        for name, row in (("times", at), ("impact_times", hits)):
            _check(not np.any(np.diff(row) < 0.0), f"LoadCell: {name}", "ascending instants", "others")
        begin = -math.inf if self._reached is None else self._reached
        if len(at):
            _check(at[0] >= begin, "LoadCell: times", f"none before {begin:.12g} s", at[0])
        if not len(hits):
            return
        duration = self._settings.contact_duration
        _check(duration > 0.0, "LoadCell: contact_duration", "a number > 0 where impacts come", duration)
        end = at[-1] if len(at) else begin
        room = _SAME_INSTANT * (1.0 + abs(end))
        inside = hits[0] >= begin - room and hits[-1] <= end + room
        outside = hits[0] if hits[0] < begin - room else hits[-1]
        _check(inside, "LoadCell: impact_times", f"impacts from {begin:.12g} to {end:.12g} s", outside)


def gaussian(seed: int, channel: int, first: int, count: int) -> Array:
    """Return Gaussian numbers of mean 0 and variance 1 that depend only on their place in a sequence.

    They have the same bits on every machine, and for any length of the calls.

    Parameters
    ----------
    seed, channel : int
        0 to 2^64 - 1; each pair has its own sequence.
    first, count : int
        First place in the sequence, and number of places, >= 0.

    Returns
    -------
    ndarray, shape (count,)

    Raises
    ------
    UsageError
        A number is out of its range.

    Examples
    --------
    >>> bool(np.array_equal(gaussian(1, 0, 0, 8)[5:], gaussian(1, 0, 5, 3)))
    True
    """
    seed, channel, first, count = index(seed), index(channel), index(first), index(count)
    for name, value in (("seed", seed), ("channel", channel), ("first", first)):
        _check(0 <= value < 2**64, f"gaussian: {name}", "0 to 2^64 - 1", value)
    _check(0 <= count <= 2**64 - first, "gaussian: count", ">= 0, and no number beyond 2^64", count)
    numbers = np.empty(count)
    _library().vi_door_gaussian(seed, channel, first, count, address(numbers))
    return numbers


def digitised(volts: ArrayLike, highest: float, bits: int) -> Array:
    """Return voltages as rounded by an analog-to-digital converter.

    Parameters
    ----------
    volts : array_like, shape (sample,)
        Voltages, V.
    highest : float
        End of the range +-highest, V, > 0.
    bits : int
        Number of bits, 1 to 32.

    Returns
    -------
    ndarray, shape (sample,)
        The nearest of the 2^bits levels -highest, -highest + step, ..., highest - step; NaN stays NaN.

    Raises
    ------
    UsageError
        A number is out of its range.

    Examples
    --------
    >>> digitised([-7.0, 0.3, 7.0], 4.0, 3).tolist()
    [-4.0, 0.0, 3.0]
    """
    _check(0.0 < highest < math.inf, "digitised: highest", "a finite number > 0", highest)
    bits = index(bits)
    _check(1 <= bits <= MOST_BITS, "digitised: bits", f"1 to {MOST_BITS}", bits)
    row = row_of("digitised: volts", volts, finite=False)
    levels = np.empty_like(row)
    _library().vi_door_digitised(len(row), address(row), highest, bits, address(levels))
    return levels


def sensor_reading(values: ArrayLike, gain: float, offset: float = 0.0, highest: float = 0.0) -> Array:
    """Return gain * value + offset, clipped at +-highest.

    Parameters
    ----------
    values : array_like, shape (sample,)
        Values in the unit of the sensor.
    gain, offset : float
        V per unit, V.
    highest : float
        Limit of the reading, V, >= 0; 0: no limit.

    Returns
    -------
    ndarray, shape (sample,)
        Readings, V; NaN stays NaN.

    Raises
    ------
    UsageError
        A number is out of its range.

    Examples
    --------
    >>> sensor_reading([0.001, 0.02], 1e3, 0.5, 10.0).tolist()
    [1.5, 10.0]
    """
    for name, value in (("gain", gain), ("offset", offset)):
        _check(math.isfinite(value), f"sensor_reading: {name}", "a finite number", value)
    _check(0.0 <= highest < math.inf, "sensor_reading: highest", "a finite number >= 0", highest)
    row = row_of("sensor_reading: values", values, finite=False)
    volts = np.empty_like(row)
    _library().vi_door_reading(len(row), address(row), gain, offset, highest, address(volts))
    return volts


def exciter_force(
    volts: ArrayLike,
    displacement: ArrayLike,
    gain: float,
    offset: float = 0.0,
    distance: float = 0.0,
    side: str = "lower",
) -> Array:
    """Return the force of an exciter: (gain volts + offset) / (1 + s displacement / distance)^2.

    s is 1 for an exciter below the body, -1 for one above it.

    Parameters
    ----------
    volts : array_like, shape (sample,)
        Drive voltages, V.
    displacement : array_like, shape (sample,)
        Displacement of the body at the force, m; a single number holds for all samples.
    gain, offset : float
        N/V and N, at displacement 0.
    distance : float
        Distance between body and exciter at displacement 0, m, >= 0; 0: the force does not depend on the displacement.
    side : str
        `lower`: the exciter is below the body, nearer for negative displacements; or `upper`.

    Returns
    -------
    ndarray, shape (sample,)
        Forces, N.

    Raises
    ------
    UsageError
        A number is out of its range, or the body touches the exciter.

    Examples
    --------
    >>> exciter_force([1.0, 1.0], [0.0, 0.01], 2.0, distance=0.01).tolist()
    [2.0, 0.5]
    """
    for name, value in (("gain", gain), ("offset", offset)):
        _check(math.isfinite(value), f"exciter_force: {name}", "a finite number", value)
    _check(0.0 <= distance < math.inf, "exciter_force: distance", "a finite number >= 0", distance)
    _check(side in EXCITER_SIDES, "exciter_force: side", "lower or upper", repr(side))
    row = row_of("exciter_force: volts", volts, finite=False)
    place = row_of("exciter_force: displacement", displacement)
    _check(
        len(place) in (1, len(row)), "exciter_force: displacement", f"one number or {len(row)}", len(place)
    )
    place = np.ascontiguousarray(np.broadcast_to(place, row.shape))
    forces = np.empty_like(row)
    done = _library().vi_door_magnet(
        len(row), address(row), address(place), gain, offset, distance, EXCITER_SIDES[side], address(forces)
    )
    if done < len(row):
        raise UsageError(
            f"exciter_force: displacement: expected a body that does not touch it ({side}, {distance:g} m away), "
            f"got {place[done]:g} m at sample {done}."
        )
    return forces


@cache
def _library() -> ctypes.CDLL:
    library = core_library()
    number, size, pointer, word = ctypes.c_double, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_uint64
    library.vi_door_cell_size.argtypes, library.vi_door_cell_size.restype = [], size
    library.vi_door_cell_start.argtypes = [pointer, ctypes.POINTER(_Settings), number, number]
    library.vi_door_cell_start.restype = None
    library.vi_door_cell_follow.argtypes = [
        pointer, size, pointer, pointer, size, pointer, pointer, pointer,
    ]  # fmt: skip
    library.vi_door_gaussian.argtypes = [word, word, word, size, pointer]
    library.vi_door_gaussian.restype = None
    library.vi_door_digitised.argtypes = [size, pointer, number, ctypes.c_int, pointer]
    library.vi_door_digitised.restype = None
    library.vi_door_reading.argtypes = [size, pointer, number, number, number, pointer]
    library.vi_door_reading.restype = None
    library.vi_door_magnet.argtypes = [
        size, pointer, pointer, number, number, number, ctypes.c_int, pointer,
    ]  # fmt: skip
    library.vi_door_magnet.restype = size
    return library


def _check(good: bool, what: str, expected: str, got: object) -> None:
    if not good:
        raise UsageError(f"{what}: expected {expected}, got {got}.")
