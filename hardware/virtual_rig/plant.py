"""The plant of a virtual rig, driven by an output and measured by inputs."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ticks = NDArray[np.int64]
TICK = 1e-9
"""Unit of all instants of a rig, s; integer ticks compare exactly, without rounding."""


class Plant(Protocol):
    """A simulated or recorded plant that runs for as long as a rig is served."""

    now: int
    """The time reached, in ticks."""
    seed: int
    """Seed of the noise on its signals."""
    fineness: float
    """Steps that it makes by itself in a second of its time."""

    @property
    def state(self) -> dict[str, float]:
        """The present values of the signals for inputs, by name."""

    def truth(self, volts: float) -> dict[str, float]:
        """Return the values that the control service reports, with the given voltage at the exciter."""

    def noise_of(self, signal: str) -> float:
        """Return the rms of the noise on a signal, V; the empty name stands for the voltage of an output."""

    def advance(self, instants: Ticks, volts: Floats) -> dict[str, Floats]:
        """Advance to instants, with a voltage held before each; return the signals there, by name.

        Instants are ticks, ascending, after `now`; volts are those of the driving output until each instant. All have
        shape (sample,).
        """

    def restart(self, tick: int) -> None:
        """Note that an input task has its first edge at a tick."""

    def close(self) -> None:
        """Release its resources."""
