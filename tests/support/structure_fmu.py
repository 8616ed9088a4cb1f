"""A body's FMU with the record of its impacts and sticks, taken along the way."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from support.component_fmu import ComponentFmu

ROW_IMPACT, ROW_STICK = 1.0, 2.0


def forced(amplitude: float, angular_frequency: float, phase: float = 0.0) -> dict[str, float]:
    """Return the parameters of a harmonic force, for a beam or an oscillator."""
    return {
        "forcing.amplitude": amplitude,
        "forcing.angular_frequency": angular_frequency,
        "forcing.phase": phase % (2.0 * math.pi),
    }


class StructureFmu(ComponentFmu):
    """One initialized instance that records its impacts and sticks; its time is the end of the last step."""

    def __init__(self, component: str, parameters: Mapping[str, float], start_time: float = 0.0) -> None:
        self._taken: list[np.ndarray] = []
        recording = {**parameters, "record.impacts": True}
        super().__init__(component, recording, start_time=start_time, early_return=True)

    def advance(self, end: float) -> StructureFmu:
        """Advance to `end`, over early returns, and take the record."""
        while self.time < end:
            self.step(end - self.time)
            self._taken.append(self.rows())
        return self

    def recorded(self, kind: float) -> np.ndarray:
        """Return the rows of one kind, shape (n, 8)."""
        table = np.concatenate(self._taken)
        return table[table[:, 0] == kind]

    @property
    def impacts(self) -> np.ndarray:
        """Time, phase, velocity before, impulse and contact of each impact, shape (n, 5)."""
        return self.recorded(ROW_IMPACT)[:, 1:6]

    @property
    def sticks(self) -> np.ndarray:
        """Start, end and contact of each stick that has ended, shape (n, 3)."""
        return self.recorded(ROW_STICK)[:, 1:4]
