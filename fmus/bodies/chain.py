"""Masses in a row at the points of a sweep: equations.md 5."""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.bodies.body_points import Numbers, row_of
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.bodies.structure import Structure, StructurePoints
from vibroimpact.fmus.core.modes import ChainModes, chain_modes


class ChainPoints(StructurePoints):
    """Chains: mass-normalised modes; a state is that of the masses."""

    START = ""

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Modes, elements of a state, amplitudes of the forcing: see `StructurePoints`."""
        masses = self.integers["masses"]
        return self.integers["modes"] or masses, masses, masses

    def structure_of(self, numbers: Numbers) -> Structure | None:
        """Return the modes of one point: see `StructurePoints`."""
        kept, masses, _ = self.sizes
        modes = self._modes(numbers)
        if not modes.is_classical or not modes.frequencies[0] > 0.0:
            return None
        shapes = modes.shapes[:, :kept]
        hit = [self.integers[f"contact[{k}].mass_number"] - 1 for k in range(1, self.contacts + 1)]
        return Structure(
            modes.frequencies[:kept],
            modes.damping_ratios[:kept],
            1.0,
            shapes.T,
            np.zeros(kept),
            shapes[self.integers["observed_mass"] - 1],
            shapes[hit].reshape(-1, kept),
            shapes,
            shapes.T * row_of(numbers, "mass", masses),
        )

    def _modes(self, numbers: Numbers) -> ChainModes:
        masses = self.integers["masses"]
        return chain_modes(
            row_of(numbers, "mass", masses),
            np.append(row_of(numbers, "stiffness", masses), numbers["far_stiffness"]),
            np.append(row_of(numbers, "damping", masses), numbers["far_damping"]),
        )

    def normalised(self, displacements: Floats, point: int = 0) -> Floats:
        """Return displacements of a state in mass-normalised modes: see `BodyPoints`."""
        numbers, (kept, masses, _) = self.numbers_at(point), self.sizes
        shapes = self._modes(numbers).shapes[:, :kept]
        return np.asarray((displacements * row_of(numbers, "mass", masses)) @ shapes)

    def is_tied(self, point: int = 0) -> bool:
        """Whether springs hold the body at a point."""
        return bool(self._modes(self.numbers_at(point)).frequencies[0] > 0.0)

    def is_classical(self, point: int = 0) -> bool:
        """Whether damping does not couple the modes of a point."""
        return self._modes(self.numbers_at(point)).is_classical
