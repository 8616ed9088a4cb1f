"""Lyapunov exponents of a motion from its impacts, in C: the stretching of small changes by flights and impacts."""

from __future__ import annotations

from ctypes import POINTER, Structure, c_int64, c_void_p
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.core.orbits import BODY, OrbitBody, OrbitEnd
from vibroimpact.fmus.errors import UsageError

Array = NDArray[np.float64]


class _Run(Structure):
    _fields_ = [
        ("impacts", c_int64),
        *((name, c_void_p) for name in ("contact", "phase", "elapsed", "velocity")),
    ]


class Stretching:
    """Directions carried along a motion from impact to impact, and their stretching.

    Parameters
    ----------
    body : OrbitBody
    contacts, phases, velocities : array, shape (impacts,)
        Contact of each impact, from 0; forcing phase, rad; speed towards the stop before the impact, m/s, > 0.
    elapsed : array, shape (impacts,)
        Time since the impact before, s.
    state : array, shape (2 modes,)
        Modal displacements and velocities after the first impact; an error in them decays with the modes.
    """

    def __init__(
        self,
        body: OrbitBody,
        contacts: NDArray[np.int32],
        phases: Array,
        elapsed: Array,
        velocities: Array,
        state: Array,
    ) -> None:
        self._body = body
        self._contacts = np.ascontiguousarray(contacts, dtype=np.int32)
        self._rows = [np.ascontiguousarray(each, dtype=np.float64) for each in (phases, elapsed, velocities)]
        addresses = [self._contacts.ctypes.data, *(row.ctypes.data for row in self._rows)]
        self._run = _Run(self._contacts.size, *addresses)
        self._state = np.array(state, dtype=np.float64)
        self._directions = np.eye(2 * body.modes)

    def along(self, first: int, last: int) -> Array:
        """Continue along impacts `first` to `last` - 1; return the logarithms of the stretching of each direction.

        Raises
        ------
        UsageError
            The body has no such impacts.
        """
        stretch = np.zeros(2 * self._body.modes)
        arrays = (each.ctypes.data for each in (self._state, self._directions, stretch))
        end = OrbitEnd(_function()(self._body.address, self._run, first, last, *arrays))
        if end is not OrbitEnd.done:
            raise UsageError(
                f"lyapunov: expected impacts of a body that answers its force, got {end.name} ones."
            )
        return stretch


@cache
def _function() -> Any:
    function = core_library().vi_door_exponents
    function.argtypes = [POINTER(BODY), POINTER(_Run), c_int64, c_int64, *[c_void_p] * 3]
    return function
