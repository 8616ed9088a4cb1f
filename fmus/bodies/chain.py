"""Chains of masses at the points of a sweep: equations.md 5."""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.bodies.body_points import row_of
from vibroimpact.fmus.bodies.impacting_body import Floats, Numbers
from vibroimpact.fmus.bodies.structure import Structure, StructurePoints
from vibroimpact.fmus.core.modes import ChainModes, chain_modes


class ChainPoints(StructurePoints):
    """Chains: the modes are mass-normalised, and the state holds the motion of the masses."""

    START = ""

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of modes, of elements of a state, and of amplitudes of the forcing: see `StructurePoints`."""
        masses = self.integers["masses"]
        return self.integers["modes"] or masses, masses, masses

    def structure_of(self, numbers: Numbers) -> Structure:
        """Return the modes of one point: see `StructurePoints`."""
        kept, masses, _ = self.sizes
        modes = self._modes(numbers)
        shapes = modes.shapes[:, :kept]
        is_one_spring = kept == 1 and modes.frequencies[0] > 0.0
        return Structure(
            modes.frequencies[:kept],
            modes.damping_ratios[:kept],
            1.0,
            shapes.T,
            np.zeros(kept),
            shapes[self.integers["observed_mass"] - 1],
            shapes[self._hit].reshape(-1, kept),
            shapes,
            shapes.T * row_of(numbers, "mass", masses),
            None if modes.is_classical or is_one_spring else modes.coupling[:kept, :kept],
        )

    def _modes(self, numbers: Numbers) -> ChainModes:
        masses = self.integers["masses"]
        return chain_modes(
            row_of(numbers, "mass", masses),
            np.append(row_of(numbers, "stiffness", masses), numbers["far_stiffness"]),
            np.append(row_of(numbers, "damping", masses), numbers["far_damping"]),
        )

    def normalised(self, displacements: Floats) -> Floats:
        """Return displacements of a state in mass-normalised modes: see `BodyPoints`."""
        numbers, (kept, masses, _) = self.floats, self.sizes
        shapes = self._modes(numbers).shapes[:, :kept]
        return np.asarray((displacements * row_of(numbers, "mass", masses)) @ shapes)

    @property
    def _hit(self) -> list[int]:
        """Number of the mass at each contact, from 0."""
        return [self.integers[f"contact[{k}].mass_number"] - 1 for k in range(1, self.stops + 1)]

    def _masses(self) -> Floats:
        return row_of(self.floats, "mass", self.integers["masses"])

    def contact_shapes(self) -> Floats:
        """Return the shapes of the contacts, shape (contact, mass): 1 at the contact's mass, else 0."""
        return np.eye(self.integers["masses"])[self._hit]

    def contact_mobilities(self, shapes: Floats) -> Floats:
        """Return the shapes divided by the masses, shape (contact, mass)."""
        return shapes / self._masses()

    def contact_masses(self) -> Floats:
        """Return the mass of each contact, kg."""
        return self._masses()[self._hit]

    def variables_at_contacts(self, what: str) -> tuple[str, ...]:
        """Return the variables of the mass of each contact."""
        return tuple(f"{what}[{hit + 1}]" for hit in self._hit)
