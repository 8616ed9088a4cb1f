"""Periodic orbits of bodies with restitution stops, in C: velocities and distances for given phases of the impacts."""

from __future__ import annotations

import copy
import ctypes
import itertools
from collections.abc import Mapping
from ctypes import POINTER, Structure, byref, c_double, c_int32, c_size_t, c_void_p
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.errors import UsageError

Array = NDArray[np.float64]
MOST_IMPACTS = 64
MOST_SINES = 48


class OrbitEnd(IntEnum):
    """Reason why a call ended; see `door/orbits.h`."""

    done = 0
    refused = 1
    resonant = 2
    singular = 3
    critical = 4
    adrift = 5
    unsolved = 6


class BODY(Structure):
    """A body as C stores it; the fields are explained in `door/orbit_response.h`."""

    ARRAYS = (
        *("natural", "damping_ratio", "order", "cosine", "sine", "held", "shape", "impulse", "direction"),
        *("position", "stop_cosine", "stop_sine", "restitution", "yield_velocity"),
    )
    _fields_ = [
        *((name, c_int32) for name in ("modes", "contacts", "harmonics")),
        ("angular_frequency", c_double),
        *((name, c_void_p) for name in ARRAYS),
        ("coupling", c_void_p),
    ]


class _Wave(Structure):
    _fields_ = [
        ("level", c_double),
        ("answer", c_double * 2),
        *((name, c_double * MOST_SINES) for name in ("cosine", "sine", "steady_cosine", "steady_sine")),
    ]


class _Train(Structure):
    _fields_ = [("impacts", c_int32), ("periods", c_int32), ("contact", c_void_p), ("phase", c_void_p)]


class OrbitBody:
    """A body of mass-normalised modes with restitution stops, in the form that the C functions take.

    Parameters
    ----------
    angular_frequency : float
        Angular frequency of the clock, rad/s. Force and stops move with its period.
    natural, damping_ratio, held : array, shape (modes,)
        Natural angular frequencies (rad/s; modes of 0 first; negative: of a negative spring), damping ratios, constant
        modal forces.
    order : array, shape (harmonics,)
        Whole numbers of turns of the sines in a period of the clock.
    cosine, sine : array, shape (harmonics, modes)
        Modal forces cosine cos(order phase) + sine sin(order phase).
    stop_cosine, stop_sine : array, shape (harmonics, contacts)
        Motion of the stops about their positions, m.
    shape, impulse : array, shape (contacts, modes)
        Displacement of each contact for unit modal displacements; modal velocities that give the contact 1 m/s.
    direction, position, restitution, yield_velocity : array, shape (contacts,)
        +1 for a stop above, -1 below; mean position, m; coefficient of restitution; speed above which it falls, m/s
        (0: constant).
    coupling : array, shape (modes, modes), optional
        Damping that couples the modes, 1/s; it replaces the damping ratios. No damping of modes without a spring.
    """

    def __init__(self, angular_frequency: float, *, coupling: Array | None = None, **arrays: Array) -> None:
        # all arrays in one block: there is one address to ask for
        parts = [arrays[name] for name in BODY.ARRAYS]
        self._block = np.concatenate([part.ravel() for part in parts], dtype=np.float64)
        sizes = (self._block.itemsize * part.size for part in parts[:-1])
        begins = itertools.accumulate(sizes, initial=self._block.ctypes.data)
        contacts, self.modes = arrays["shape"].shape
        self._terms = None
        if coupling is not None and arrays["natural"].any():
            self._terms = self._coupled(angular_frequency, coupling, arrays)
        terms = None if self._terms is None else self._terms.ctypes.data
        self.harmonics = arrays["order"].size
        self.address = BODY(self.modes, contacts, self.harmonics, angular_frequency, *begins, terms)

    def with_frequency(self, angular_frequency: float) -> Self:
        """Return the same body with another frequency of its clock, rad/s; no sine turns with the clock."""
        found = copy.copy(self)
        found.address = BODY.from_buffer_copy(self.address)
        found.address.angular_frequency = angular_frequency
        return found

    def _coupled(self, angular_frequency: float, coupling: Array, arrays: Mapping[str, Array]) -> Array:
        """Return the complex modes of the modes with springs in the form of C, as bytes in an array of numbers."""
        library, tied = _library(), arrays["natural"] != 0.0
        found = np.empty(library.vi_door_orbit_coupling_size() // 8 + 1)
        work = np.empty(library.vi_door_orbit_coupling_work_size() // 8 + 1)
        damping = np.ascontiguousarray(_numbers(coupling, (self.modes, self.modes))[np.ix_(tied, tied)])
        rows = [np.ascontiguousarray(arrays[name][..., tied]) for name in ("natural", "cosine", "sine")]
        rates = angular_frequency * arrays["order"]
        given = (rates, rows[0], damping, rows[1], rows[2], found, work)
        modes = int(np.count_nonzero(tied))
        end = library.vi_door_orbit_couple(modes, rates.size, *(each.ctypes.data for each in given))
        _check(OrbitEnd.refused if end else OrbitEnd.done)
        return found

    def evaluate(self, contacts: NDArray[np.int32], phases: Array, periods: int) -> Evaluation:
        """Return velocities and distances for given phases of the impacts: equations.md 4.7.

        Parameters
        ----------
        contacts : array, shape (impacts,)
            Contact of each impact, from 0.
        phases : array, shape (impacts,)
            rad, ascending, within 2 pi `periods`.
        periods : int
            Forcing periods in the orbit.
        """
        n = phases.size
        train = _train(contacts, phases, periods)
        velocities, distances = np.empty(n), np.empty(n)
        slopes, faster = np.empty((n, n)), np.empty((n, n))
        filled = (velocities, distances, slopes, faster)
        end = _library().vi_door_orbit(self.address, train, *(each.ctypes.data for each in filled))
        return Evaluation(OrbitEnd(end), velocities, distances, slopes, faster)

    def errors(
        self, contacts: NDArray[np.int32], phases: Array, velocities: Array
    ) -> tuple[OrbitEnd, Array, Array]:
        """Return the errors of impacts of a body without a force, whose clock has the period of the orbit: 4.16.

        Parameters
        ----------
        contacts : array, shape (impacts,)
            Contact of each impact, from 0.
        phases, velocities : array, shape (impacts,)
            rad, ascending, within 2 pi; speeds towards the stops before the impacts, m/s.

        Returns
        -------
        tuple of OrbitEnd, array, array
            Distances beyond the stops, m, then speeds less those of the motion, m/s, shape (2 impacts,). Their
            derivatives over the phases, the velocities, and the logarithm of the period, shape (2 impacts, 2 impacts +
            1). The arrays are valid if the end is `done`.
        """
        n = phases.size
        train, speeds = _train(contacts, phases, 1), _numbers(velocities, phases.shape)
        errors, slopes = np.empty(2 * n), np.empty((2 * n, 2 * n + 1))
        arrays = (speeds, errors, slopes)
        end = _library().vi_door_orbit_errors(self.address, train, *(each.ctypes.data for each in arrays))
        return OrbitEnd(end), errors, slopes

    def wave(self, contact: int, periods: int) -> Wave:
        """Return the distance of P(1,q) beyond its stop over the phase of its impact: equations.md 4.3.

        Parameters
        ----------
        contact : int
            From 0.
        periods : int
            q.
        """
        train = _train(np.array([contact], dtype=np.int32), np.zeros(1), periods)
        found = _Wave()
        end = _library().vi_door_orbit_wave(self.address, train, byref(found))
        names = ("cosine", "sine", "steady_cosine", "steady_sine")
        rows = (np.array(getattr(found, name)[: self.harmonics]) for name in names)
        return Wave(OrbitEnd(end), found.level, (found.answer[0], found.answer[1]), *rows)

    def motion(
        self, contacts: NDArray[np.int32], phases: Array, periods: int, velocities: Array
    ) -> tuple[Array, Array]:
        """Return the states after the impacts, shape (impacts, 2 modes), and the monodromy matrix of the first: 4.2."""
        train = _train(contacts, phases, periods)
        states, monodromy = np.empty((phases.size, 2 * self.modes)), np.empty((2 * self.modes,) * 2)
        speeds = _numbers(velocities, phases.shape)
        arrays = (speeds, states, monodromy)
        _check(_library().vi_door_orbit_motion(self.address, train, *(each.ctypes.data for each in arrays)))
        return states, monodromy

    def maximum(
        self, contacts: NDArray[np.int32], phases: Array, periods: int, states: Array
    ) -> tuple[float, float, int]:
        """Return the highest maximum between impacts: its depth beyond the stop (m), phase, and contact (-1: none)."""
        train = _train(contacts, phases, periods)
        what, known = np.empty(3), _numbers(states, (phases.size, 2 * self.modes))
        _check(_library().vi_door_orbit_maximum(self.address, train, known.ctypes.data, what.ctypes.data))
        return float(what[0]), float(what[1]), int(what[2])


@dataclass(frozen=True, slots=True, eq=False)
class Wave:
    """Distance of one impact beyond its stop over its phase: equations.md 4.3.

    Attributes
    ----------
    end : OrbitEnd
        The numbers are valid if `end` is `done`.
    level : float
        Constant part, m.
    answer : tuple of float
        Distance, s, and approach speed that a unit speed of equal impulse adds.
    cosine, sine : array, shape (harmonics,)
        Distance at a constant restitution: level + cosine cos(order phase) + sine sin(order phase), m.
    steady_cosine, steady_sine : array, shape (harmonics,)
        The same of the steady motion relative to the stop, m.
    """

    end: OrbitEnd
    level: float
    answer: tuple[float, float]
    cosine: Array
    sine: Array
    steady_cosine: Array
    steady_sine: Array


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """Velocities and distances for given phases of the impacts.

    Attributes
    ----------
    end : OrbitEnd
        The arrays are valid if `end` is `done`.
    velocities, distances : array, shape (impacts,)
        Speeds towards the stops, relative to them, before the impacts, m/s; distances beyond the stops, m. The
        distances of an orbit are 0.
    distance_slopes, velocity_slopes : array, shape (impacts, impacts)
        Derivatives over the phase of each impact (columns).
    start : array, shape (2 modes,), or None
        State before the first impact, from which a search goes on where stops yield.
    """

    end: OrbitEnd
    velocities: Array
    distances: Array
    distance_slopes: Array
    velocity_slopes: Array
    start: Array | None = None


def _train(contacts: NDArray[np.int32], phases: Array, periods: int) -> _Train:
    contact = np.ascontiguousarray(contacts, dtype=np.int32)
    phase = np.ascontiguousarray(phases, dtype=np.float64)
    if phase.ndim != 1 or contact.shape != phase.shape:
        raise UsageError(
            f"orbit: expected a phase and a contact of each impact, got {phase.shape} and {contact.shape}."
        )
    train = _Train(phase.size, periods, contact.ctypes.data, phase.ctypes.data)
    train.kept = contact, phase  # keeps the arrays alive as long as the train
    return train


def _numbers(array: Array, shape: tuple[int, ...]) -> Array:
    """Return an array in the layout that C reads."""
    found = np.ascontiguousarray(array, dtype=np.float64)
    if found.shape != shape:
        raise UsageError(f"orbit: expected numbers of shape {shape}, got {found.shape}.")
    return found


def _check(end: int) -> None:
    if end != OrbitEnd.done:
        raise UsageError(f"orbit: expected a body and impacts that have an orbit, got {OrbitEnd(end).name}.")


@cache
def _library() -> ctypes.CDLL:
    library = core_library()
    body, train = POINTER(BODY), POINTER(_Train)
    library.vi_door_orbit_coupling_size.restype = c_size_t
    library.vi_door_orbit_coupling_work_size.restype = c_size_t
    library.vi_door_orbit_couple.argtypes = [c_int32, c_int32, *[c_void_p] * 7]
    # plain addresses: converting arrays runs Python code, where Ctrl-C would turn into an error of an argument
    library.vi_door_orbit.argtypes = [body, train, *[c_void_p] * 4]
    library.vi_door_orbit_errors.argtypes = [body, train, *[c_void_p] * 3]
    library.vi_door_orbit_wave.argtypes = [body, train, POINTER(_Wave)]
    library.vi_door_orbit_motion.argtypes = [body, train, *[c_void_p] * 3]
    library.vi_door_orbit_maximum.argtypes = [body, train, *[c_void_p] * 2]
    return library
