"""A forced oscillator with a stop: flow, next contact and motion, by the C functions of its FMU.

Analyses fit and follow orbits with these functions; the physics has no second implementation.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.errors import UsageError

SIDES = {"upper": 1, "lower": 2}
Array = NDArray[np.float64]


class _Oscillator(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_double) for name in ("mass", "damping", "stiffness", "amplitude", "angular_frequency")
    ]


@dataclass(frozen=True, slots=True)
class Oscillator:
    """A forced oscillator: mass x'' + damping x' + stiffness x = amplitude cos(phase).

    Attributes
    ----------
    mass, damping, stiffness : float
        kg, N s/m, N/m.
    amplitude : float
        Force amplitude, N.
    angular_frequency : float
        Angular frequency of the force, rad/s; 0: a constant force.
    """

    mass: float = 1.0
    damping: float = 0.0
    stiffness: float = 1.0
    amplitude: float = 0.0
    angular_frequency: float = 0.0

    def _as_structure(self) -> _Oscillator:
        return _Oscillator(self.mass, self.damping, self.stiffness, self.amplitude, self.angular_frequency)


@dataclass(frozen=True, slots=True)
class Contact:
    """A contact: seconds from now, and the speed of approach (m/s)."""

    time: float
    velocity: float


@cache
def _library() -> ctypes.CDLL:
    library = core_library()
    pair, number = ctypes.POINTER(ctypes.c_double), ctypes.c_double
    library.vi_door_flow.argtypes = [
        ctypes.POINTER(_Oscillator), number, pair, number, number, number, pair,
    ]  # fmt: skip
    library.vi_door_next_contact.argtypes = [
        ctypes.POINTER(_Oscillator), number, pair, number, ctypes.c_int, number, pair,
    ]  # fmt: skip
    library.vi_door_motion.argtypes = [
        ctypes.POINTER(_Oscillator), number, pair, number, ctypes.c_int, number, ctypes.c_int,
        *3 * (ctypes.c_void_p,),
    ]  # fmt: skip
    return library


def _pair(first: float = 0.0, second: float = 0.0) -> ctypes.Array[ctypes.c_double]:
    return (ctypes.c_double * 2)(first, second)


def flow(
    oscillator: Oscillator,
    state: tuple[float, float],
    duration: float,
    *,
    phase: float = 0.0,
    held: float = 0.0,
    held_rate: float = 0.0,
) -> tuple[float, float]:
    """Return displacement (m) and velocity (m/s) after `duration` s without a stop: equations.md 1.4.

    Parameters
    ----------
    state : tuple of float
        Displacement (m) and velocity (m/s) now.
    duration : float
        Seconds, >= 0.
    phase : float
        Forcing phase now, rad.
    held, held_rate : float
        Further acceleration held + held_rate * time, m/s^2 and m/s^3.

    Raises
    ------
    UsageError
        An argument is not finite or out of its range.

    Examples
    --------
    >>> x, v = flow(Oscillator(), (1.0, 0.0), 3.141592653589793)
    >>> round(x, 12)
    -1.0
    """
    end = _pair()
    body = oscillator._as_structure()
    if _library().vi_door_flow(body, phase, _pair(*state), held, held_rate, duration, end) != 0:
        raise UsageError(
            "flow: expected finite arguments, mass > 0, and damping, stiffness, "
            f"angular_frequency, duration >= 0, got {oscillator}, state {state}, duration {duration}."
        )
    return end[0], end[1]


def next_contact(
    oscillator: Oscillator,
    state: tuple[float, float],
    position: float,
    duration: float,
    *,
    side: str = "upper",
    phase: float = 0.0,
) -> Contact | None:
    """Return the first contact with a stop within `duration` s, or None: equations.md 2, certified.

    The parameters are those of `flow`, and the stop's `position` (m) and `side` ("upper", "lower").

    Examples
    --------
    >>> contact = next_contact(Oscillator(), (0.0, 1.0), 0.5, 10.0)
    >>> round(contact.time, 12), round(contact.velocity, 12)
    (0.523598775598, 0.866025403784)
    """
    found = _pair()
    body = oscillator._as_structure()
    status = _library().vi_door_next_contact(
        body, phase, _pair(*state), position, SIDES.get(side, 0), duration, found
    )
    if status < 0 or side not in SIDES:
        raise UsageError(
            f"next_contact: expected finite arguments and side upper or lower, got {oscillator}, "
            f"state {state}, position {position}, side {side!r}, duration {duration}."
        )
    return Contact(found[0], found[1]) if status else None


def motion(
    oscillator: Oscillator,
    state: tuple[float, float],
    instants: ArrayLike,
    *,
    position: float | None = None,
    side: str = "upper",
    restitution: float = 1.0,
    phase: float = 0.0,
) -> tuple[Array, Array]:
    """Return displacements and velocities at many instants, through all impacts with a stop in between.

    Parameters
    ----------
    oscillator, state, phase
        See `flow`.
    instants : array_like, shape (sample,)
        Seconds from now, >= 0, ascending.
    position : float or None
        Position of the stop, m; None: no stop.
    side : str
        Side of the stop, `upper` or `lower`.
    restitution : float
        Coefficient of restitution, 0 to 1.

    Returns
    -------
    displacement, velocity : ndarray, shape (sample,)
        m and m/s; at an impact the velocity after it.

    Raises
    ------
    UsageError
        An argument is not finite or out of its range.

    Examples
    --------
    >>> x, v = motion(Oscillator(), (0.5, 1.0), [0.0, 3.141592653589793], position=2.0)
    >>> x.round(12).tolist(), v.round(12).tolist()
    ([0.5, -0.5], [1.0, -1.0])
    """
    times = np.ascontiguousarray(np.atleast_1d(np.asarray(instants, dtype=np.float64)))
    displacement, velocity = np.empty_like(times), np.empty_like(times)
    body = oscillator._as_structure()
    hits = _library().vi_door_motion(
        body,
        phase,
        _pair(*state),
        0.0 if position is None else position,
        0 if position is None else SIDES.get(side, 0),
        restitution,
        len(times),
        times.ctypes.data,
        displacement.ctypes.data,
        velocity.ctypes.data,
    )
    if hits < 0 or side not in SIDES:
        raise UsageError(
            "motion: expected finite arguments, ascending instants >= 0, side upper or lower and "
            f"0 <= restitution <= 1, got {oscillator}, state {state}, position {position}, side {side!r}, "
            f"restitution {restitution}."
        )
    return displacement, velocity
