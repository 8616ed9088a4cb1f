"""Euler-Bernoulli beams at the points of a sweep: equations.md 6."""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.bodies.body_points import Numbers, row_of
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.bodies.structure import Structure, StructurePoints
from vibroimpact.fmus.core.modes import BOUNDARIES, beam_modes

FORCE, UNIFORM, MODE, BASE_ACCELERATION = range(1, 5)
"""Numbers of `forcing.kind`."""
_BOUNDARY_OF = {number: boundary for boundary, number in BOUNDARIES.items()}


class BeamPoints(StructurePoints):
    """Beams: modes whose modal mass is the mass of the beam; they are its state."""

    START = "modal_"

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Modes, elements of a state, amplitudes of the forcing: see `StructurePoints`."""
        modes = self.integers["modes"]
        return modes, modes, 1

    def structure_of(self, numbers: Numbers) -> Structure:
        """Return the modes of one point: see `StructurePoints`."""
        integers, length, mass = self.integers, numbers["length"], _mass_of(numbers)
        count = integers["modes"]
        area_moment = numbers.get("width", 0.0) * numbers.get("thickness", 0.0) ** 3 / 12.0
        rigidity = numbers.get("flexural_rigidity") or numbers["youngs_modulus"] * area_moment
        modes = beam_modes(_BOUNDARY_OF[integers["boundary"]], count)
        natural = modes.eigenvalues**2 * (np.sqrt(rigidity / (mass / length)) / length**2)
        ratios = row_of(numbers, "damping_ratio", count) + 0.5 * (
            numbers.get("rayleigh.mass", 0.0) / natural + numbers.get("rayleigh.stiffness", 0.0) * natural
        )
        places = [numbers["forcing_location"], numbers["sensor_location"]]
        places += [numbers[f"contact[{k}].location"] for k in range(1, self.contacts + 1)]
        shapes = modes.shapes(places)
        load = {
            FORCE: shapes[0] / mass,
            UNIFORM: length * modes.participation / mass,
            MODE: (np.arange(1, count + 1) == integers.get("forcing.mode", 0)) / mass,
            BASE_ACCELERATION: -modes.participation,
        }[integers.get("forcing.kind", FORCE)]
        same = np.eye(count)
        return Structure(
            natural, ratios, mass, load[:, None], shapes[0] / mass, shapes[1], shapes[2:], same, same
        )

    def normalised(self, displacements: Floats, point: int = 0) -> Floats:
        """Return displacements of a state in mass-normalised modes: see `BodyPoints`."""
        return np.asarray(displacements * np.sqrt(_mass_of(self.numbers_at(point))))

    def is_tied(self, point: int = 0) -> bool:
        """Whether springs hold the body at a point."""
        return True


def _mass_of(numbers: Numbers) -> float:
    """Return the mass of a beam, kg."""
    density = numbers.get("mass_per_length") or numbers["density"] * numbers["width"] * numbers["thickness"]
    return density * numbers["length"]
