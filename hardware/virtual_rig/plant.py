"""The plant of a virtual rig: what an output drives and what inputs see."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ticks = NDArray[np.int64]
TICK = 1e-9
"""Unit of all instants of a rig, s: whole numbers of it are equal or not, with no rounding in between."""


class Plant(Protocol):
    """What goes on for as long as a rig is served."""

    now: int
    """The time reached, in ticks."""
    seed: int
    """Of the noise on its signals."""
    fineness: float
    """Steps that it makes in a second by itself, where that is sampled."""

    @property
    def state(self) -> dict[str, float]:
        """What inputs could see now, by the name of the signal."""

    def truth(self, volts: float) -> dict[str, float]:
        """Return what the control service says of it, where a voltage drives it."""

    def noise_of(self, signal: str) -> float:
        """Return the rms of the noise on a signal, V; the empty one is the voltage of an output."""

    def advance(self, instants: Ticks, volts: Floats) -> dict[str, Floats]:
        """Go on to instants, a voltage held before each; return what inputs could see there, by the name of the signal.

        Instants are ticks, ascending, after `now`; volts are of the output that drives it, until each instant. All have
        shape (sample,).
        """

    def begin_anew(self, tick: int) -> None:
        """Hear that an input task has its first edge at a tick."""

    def close(self) -> None:
        """Free what it holds."""
