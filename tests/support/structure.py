"""Bodies of many modes, driven through the C functions of the Chain and Beam FMUs."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from support.core_doors import library_with_doors
from vibroimpact.fmus.core.contact_laws import contact_law
from vibroimpact.fmus.core.oscillator import SIDES
from vibroimpact.fmus.errors import ComponentError, UsageError

Array = NDArray[np.float64]

#: States of a contact, by the number in `Structure.statuses`.
STATUSES = ("free", "touching", "held", "yielding", "receding")
#: Results of `Structure.advance`.
DONE, RECORD_FULL, IMPACT_LIMIT, REFUSED, UNFINISHED, UNBOUNDED = 0, 2, 3, 4, 8, 9
GIVEN_UP = (5, 6, 7)
MESSAGE_LENGTH = 1024
ROW_WIDTH, ROW_CAPACITY = 8, 512
ROW_IMPACT, ROW_STICK, ROW_PERIOD, ROW_PEAK = 1.0, 2.0, 3.0, 4.0


@dataclass(frozen=True, slots=True)
class Stop:
    """A stop at one point of a structure.

    Attributes
    ----------
    shape : array_like, shape (modes,)
        Displacement of the point for unit modal displacements, kg^(-1/2).
    position : float
        Position of the stop, m.
    law : str
        `restitution`, `kelvin_voigt`, `hertz`, `hunt_crossley` or `none`.
    side : str
        `upper` or `lower`.
    restitution, yield_velocity : float
        Coefficient of restitution; the speed (m/s) above which it falls as speed^(-1/4), 0 for never.
    stiffness, damping, exponent : float
        N/m^exponent; N s/m (kelvin_voigt) or s/m (hunt_crossley); exponent of hunt_crossley.
    relaxation_time : float
        Relaxation time of a compliant stop's surface after separation, s; 0: immediate.
    impulse : array_like or None
        Modal velocities due to a unit impulse, kg^(-1/2); None for `shape`, the variational rule.
    """

    shape: ArrayLike
    position: float = 0.0
    law: str = "restitution"
    side: str = "upper"
    restitution: float = 1.0
    yield_velocity: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    exponent: float = 1.5
    relaxation_time: float = 0.0
    impulse: ArrayLike | None = None

    def _numbers(self) -> _Stop:
        return _Stop(
            contact_law(self.law).number,
            SIDES[self.side],
            self.position,
            self.restitution,
            self.yield_velocity,
            self.stiffness,
            self.damping,
            self.exponent,
            self.relaxation_time,
        )


@dataclass(frozen=True, slots=True)
class Modes:
    """Mass-normalised modes of a structure and the harmonic force on them.

    Attributes
    ----------
    natural : array_like, shape (modes,)
        Natural angular frequencies, ascending, rad/s; w < 0 for a stiffness of -w^2.
    damping_ratio : array_like, shape (modes,), or float
        Damping ratios.
    force : array_like, shape (modes,), or float
        Modal amplitude of the force, N kg^(-1/2).
    angular_frequency, phase : float
        Angular frequency and phase of the force, rad/s and rad.
    coupling : array_like, shape (modes, modes), or None
        Modal damping matrix, 1/s, which replaces the damping ratios if the damping couples the modes.
    """

    natural: ArrayLike
    damping_ratio: ArrayLike = 0.0
    force: ArrayLike = 0.0
    angular_frequency: float = 0.0
    phase: float = 0.0
    coupling: ArrayLike | None = None


class _Stop(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_double)
        for name in (
            *("law", "side", "position", "restitution", "yield_velocity"),
            *("stiffness", "damping", "exponent", "relaxation_time"),
        )
    ]


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    library = library_with_doors()
    numbers, integer, number = ctypes.POINTER(ctypes.c_double), ctypes.c_int, ctypes.c_double
    library.vi_door_structure_new.restype = ctypes.c_void_p
    library.vi_door_structure_new.argtypes = [
        *(integer, numbers, numbers, numbers, number, number, numbers, integer),
        *(ctypes.POINTER(_Stop), numbers, numbers, numbers, numbers, number),
    ]
    library.vi_door_structure_free.argtypes = [ctypes.c_void_p]
    library.vi_door_structure_by_series.argtypes = [ctypes.c_void_p]
    library.vi_door_structure_at_once.argtypes = [ctypes.c_void_p]
    library.vi_door_structure_limit.argtypes = [ctypes.c_void_p, number, integer]
    library.vi_door_structure_record.argtypes = [ctypes.c_void_p, numbers, integer, integer, integer, integer]
    library.vi_door_structure_advance.argtypes = [ctypes.c_void_p, number, numbers, numbers, number]
    library.vi_door_structure_state.argtypes = [
        *(ctypes.c_void_p, numbers, numbers, ctypes.POINTER(integer), numbers, numbers),
    ]
    library.vi_door_structure_complaint.argtypes = [ctypes.c_void_p, integer, ctypes.c_char_p]
    library.vi_door_structure_work.restype = number
    library.vi_door_structure_work.argtypes = [ctypes.c_void_p]
    library.vi_door_structure_rows.argtypes = [ctypes.c_void_p, numbers, integer]
    return library


def _pointer(array: Array | None) -> ctypes._Pointer[ctypes.c_double] | None:
    return None if array is None else array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def _vector(values: ArrayLike, modes: int) -> Array:
    return np.ascontiguousarray(np.broadcast_to(np.asarray(values, dtype=np.float64), (modes,)))


@dataclass(slots=True)
class Rows:
    """Record of a structure: rows of eight numbers, as `record.rows` of the FMUs."""

    blocks: list[Array] = field(default_factory=list)

    def of_kind(self, kind: float) -> Array:
        """Return the rows of one kind, shape (rows, 8)."""
        rows = np.concatenate(self.blocks) if self.blocks else np.empty((0, ROW_WIDTH))
        chosen: Array = rows[rows[:, 0] == kind]
        return chosen


def peaking(modes: int) -> tuple[Array, Array, Array]:
    """Return frequencies, shape and start; shape . q has its maximum, 1, at the time pi, and every 2 pi later."""
    natural: Array = 2.0 * np.arange(modes, dtype=np.float64) + 1.0
    shape: Array = np.where(np.arange(modes) % 2 == 0, 1.0, -1.0) / (1.0 + np.arange(modes, dtype=np.float64))
    share: Array = 1.0 / natural**2
    return natural, shape, -share / share.sum() / shape


class Structure:
    """A body of many modes with stops, from time 0 on.

    Parameters
    ----------
    modes : Modes
        Its modes.
    stops : sequence of Stop
        Its stops, at most 8.
    displacement, velocity : array_like, shape (modes,)
        Modal start state, kg^(1/2) m and kg^(1/2) m/s.
    tolerance : float
        Relative error of contacts with hertz and hunt_crossley stops.
    observed : array_like or None
        Shape of the point whose extremes are recorded; None for the first stop's.
    extrema, periods, energies : bool
        Follow the extremes, write a row for each forcing period, integrate the energies.
    by_series : bool
        Follow long rests and contacts with power laws by series, in place of their exact flows.
    displacement_limit : float
        Displacement beyond which a motion that grows ends, m; 0: no limit.
    ends_unbounded : bool
        Whether a motion that grows ends where it can meet no stop any more.
    at_once : bool
        Take the steps of contacts with power laws from the first contact on.

    Raises
    ------
    UsageError
        Wrong sizes, or a start beyond a rigid stop.

    Examples
    --------
    >>> with Structure(Modes([1.0]), [Stop([1.0], 0.5, restitution=0.8)], [0.0], [1.0]) as body:
    ...     _ = body.advance(10.0)
    ...     round(float(body.impacts[0, 1]), 12)
    0.523598775598
    """

    def __init__(
        self,
        modes: Modes,
        stops: Sequence[Stop] = (),
        displacement: ArrayLike = 0.0,
        velocity: ArrayLike = 0.0,
        *,
        tolerance: float = 1e-10,
        observed: ArrayLike | None = None,
        extrema: bool = False,
        periods: bool = False,
        energies: bool = False,
        by_series: bool = False,
        at_once: bool = False,
        displacement_limit: float = 0.0,
        ends_unbounded: bool = False,
    ) -> None:
        self._library = _library()
        natural = np.atleast_1d(np.asarray(modes.natural, dtype=np.float64))
        self.modes = n = len(natural)
        self._stiffness: Array = natural * np.abs(natural)
        self._handle = None
        self.stops = tuple(stops)
        shapes = np.array([_vector(stop.shape, n) for stop in stops]).reshape(-1, n)
        given = [stop.shape if stop.impulse is None else stop.impulse for stop in stops]
        impulses = np.array([_vector(impulse, n) for impulse in given]).reshape(-1, n)
        coupling = None
        if modes.coupling is not None:
            coupling = np.ascontiguousarray(modes.coupling, dtype=np.float64).reshape(n, n)
        self._handle = self._library.vi_door_structure_new(
            n,
            _pointer(natural),
            _pointer(_vector(modes.damping_ratio, n)),
            _pointer(_vector(modes.force, n)),
            modes.angular_frequency,
            modes.phase,
            _pointer(coupling),
            len(stops),
            (_Stop * max(1, len(stops)))(*(stop._numbers() for stop in stops)),
            _pointer(shapes),
            _pointer(impulses),
            _pointer(_vector(displacement, n)),
            _pointer(_vector(velocity, n)),
            tolerance,
        )
        if not self._handle:
            raise UsageError(
                f"Structure: expected 1 to 64 modes, at most 8 stops and a start on their free sides, "
                f"got {n} modes, {len(stops)} stops."
            )
        point = observed if observed is not None else (shapes[0] if len(shapes) else np.ones(n))
        self._library.vi_door_structure_record(
            self._handle, _pointer(_vector(point, n)), 1, int(extrema), int(periods), int(energies)
        )
        if by_series:
            self._library.vi_door_structure_by_series(self._handle)
        self._library.vi_door_structure_limit(self._handle, displacement_limit, int(ends_unbounded))
        if at_once:
            self._library.vi_door_structure_at_once(self._handle)
        self._rows = Rows()
        self._read()

    def _read(self) -> None:
        n, contacts = self.modes, max(1, len(self.stops))
        self.displacement, self.velocity = np.empty(n), np.empty(n)
        self.forces, facts = np.empty(contacts), np.empty(6)
        status = (ctypes.c_int * contacts)()
        self._library.vi_door_structure_state(
            self._handle,
            _pointer(self.displacement),
            _pointer(self.velocity),
            status,
            _pointer(self.forces),
            _pointer(facts),
        )
        self.time = float(facts[0])
        self.forcing_work, self.damping_loss, self.contact_loss = (float(x) for x in facts[1:4])
        self.displacement_max, self.displacement_min = float(facts[4]), float(facts[5])
        self.statuses = tuple(STATUSES[status[k]] for k in range(len(self.stops)))

    def advance(
        self,
        duration: float,
        *,
        held: ArrayLike = 0.0,
        held_rate: ArrayLike = 0.0,
        most_impacts: float = 0,
    ) -> int:
        """Advance by `duration` s under further modal forces; return `DONE`, `IMPACT_LIMIT`, `UNBOUNDED` or `REFUSED`.

        Parameters
        ----------
        duration : float
            Duration, s, > 0.
        held, held_rate : array_like, shape (modes,)
            Modal forces now and their slopes, N kg^(-1/2) and N kg^(-1/2) / s.
        most_impacts : float
            Number of contact events (impacts, touch-downs, rests) after which it ends; 0: no limit.

        Raises
        ------
        ComponentError
            The motion does not go on, or exceeds the largest numbers; the message has the time.
        """
        force, slope = _vector(held, self.modes), _vector(held_rate, self.modes)
        self._read()
        end = self.time + duration
        result, remaining = UNFINISHED, duration
        while result in (RECORD_FULL, UNFINISHED):
            result = self._library.vi_door_structure_advance(
                self._handle, remaining, _pointer(force), _pointer(slope), most_impacts
            )
            self._read()
            self._take_rows()
            remaining = end - self.time
            if remaining <= 0.0 and result in (RECORD_FULL, UNFINISHED):
                result = DONE
        if result in GIVEN_UP:
            raise ComponentError(self._complaint(result), function="advance", time=self.time)
        return int(result)

    def _complaint(self, result: int) -> str:
        message = ctypes.create_string_buffer(MESSAGE_LENGTH)
        self._library.vi_door_structure_complaint(self._handle, result, message)
        return f"Structure: {message.value.decode()}."

    def _take_rows(self) -> None:
        rows = np.empty((ROW_CAPACITY, ROW_WIDTH))
        count = self._library.vi_door_structure_rows(self._handle, _pointer(rows), ROW_CAPACITY)
        if count:
            self._rows.blocks.append(rows[:count].copy())

    @property
    def impacts(self) -> Array:
        """Impacts so far, shape (impacts, 8).

        Columns: 1, time, phase, velocity, impulse, contact, restitution, duration.
        """
        return self._rows.of_kind(ROW_IMPACT)

    @property
    def peaks(self) -> Array:
        """Largest forces on compliant stops, one for each impact, shape (impacts, 8): 4, time, contact, force."""
        return self._rows.of_kind(ROW_PEAK)

    @property
    def sticks(self) -> Array:
        """Sticks that have ended, shape (sticks, 8): 2, start, end, contact, total impulse of the chatter, 0, 0, 0."""
        return self._rows.of_kind(ROW_STICK)

    @property
    def periods(self) -> Array:
        """Whole forcing periods, shape (periods, 8).

        Columns: 3, start, largest and smallest displacement, strobe displacement and velocity, impacts, 0.
        """
        return self._rows.of_kind(ROW_PERIOD)

    @property
    def energy(self) -> float:
        """Kinetic and elastic energy of the modes, J."""
        return float(0.5 * (self.velocity @ self.velocity) + 0.5 * self._stiffness @ self.displacement**2)

    @property
    def work(self) -> float:
        """Work of all steps so far, in evaluations of one mode."""
        return float(self._library.vi_door_structure_work(self._handle))

    def close(self) -> None:
        """Free the structure."""
        if self._handle:
            self._library.vi_door_structure_free(self._handle)
            self._handle = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()
