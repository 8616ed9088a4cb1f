"""Euler-Bernoulli beams at the points of a sweep: equations.md 6."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.fmus.bodies.body_points import row_of
from vibroimpact.fmus.bodies.impacting_body import Floats, Numbers
from vibroimpact.fmus.bodies.structure import Structure, StructurePoints
from vibroimpact.fmus.core.modes import BOUNDARIES, beam_modes

FORCE, UNIFORM, MODE, BASE_ACCELERATION = range(1, 5)
"""Numbers of `forcing.kind`."""
_BOUNDARY_OF = {number: boundary for boundary, number in BOUNDARIES.items()}


class BeamPoints(StructurePoints):
    """Beams: every mode has the mass of the beam as modal mass, and the modal displacements are the state."""

    START = "modal_"

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of modes, of elements of a state, and of amplitudes of the forcing: see `StructurePoints`."""
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
        places += [numbers[f"contact[{k}].location"] for k in range(1, self.stops + 1)]
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

    @property
    def natural_frequencies(self) -> Floats:
        """Natural angular frequencies of one point, without residual vectors: see `BodyPoints`."""
        vectors = len(set(self._places())) if self.integers.get("residual") else 0
        return self.structure_of(self.floats).frequencies[: self.integers["modes"] - vectors]

    def normalised(self, displacements: Floats) -> Floats:
        """Return displacements of a state in mass-normalised modes: see `BodyPoints`."""
        return np.asarray(displacements * np.sqrt(_mass_of(self.floats)))

    def _places(self) -> list[float]:
        """Return the position of each contact, as a fraction of the length."""
        return [float(self.floats[f"contact[{k}].location"]) for k in range(1, self.stops + 1)]

    def contact_shapes(self) -> Floats:
        """Return the shapes of the modes at each contact, shape (contact, mode)."""
        boundary = _BOUNDARY_OF[self.integers["boundary"]]
        return beam_modes(boundary, self.integers["modes"]).shapes(self._places())

    def contact_masses(self) -> Floats:
        """Return the mass of the modes at each contact, kg: equations.md 6.6."""
        numbers = self.floats
        line = numbers.get("mass_per_length") or numbers["width"] * numbers["thickness"] * numbers["density"]
        return np.asarray(line * numbers["length"] / (self.contact_shapes() ** 2).sum(axis=1))

    def is_pushed(self) -> bool:
        """Whether the FMU's only force input can act at the place of all stops."""
        where = set(self._places())
        forced_there = self.integers.get("forcing.kind") == FORCE
        return len(where) == 1 and (not forced_there or where == {self.floats["forcing_location"]})

    def variables_at_contacts(self, what: str) -> tuple[str, ...]:
        """Return the variables of a sensor at each contact; the one force input acts at all contacts."""
        if what == "force":
            return super().variables_at_contacts(what) if self.is_pushed() else ()
        places = self._places()
        where = list(dict.fromkeys(places))
        return tuple(f"sensor[{where.index(place) + 1}].{what}" for place in places)

    def floats_of_contacts(self) -> dict[str, float]:
        """Return the places of the sensors, and the place of the force where it can act at all contacts."""
        where = list(dict.fromkeys(self._places()))
        found = {f"sensor[{k}].location": place for k, place in enumerate(where, start=1)}
        return found | ({"forcing_location": where[0]} if self.is_pushed() else {})


def _mass_of(numbers: Numbers) -> float:
    """Return the mass of a beam, kg."""
    density = numbers.get("mass_per_length") or numbers["density"] * numbers["width"] * numbers["thickness"]
    return density * numbers["length"]


def rigidity_of_frequency(boundary: int, length: float, mass_per_length: float, frequency: float) -> float:
    """Return the flexural rigidity, N m^2, for a given first natural frequency of a beam (thesis eq. 7.16).

    w_1 = (xi_1 / length)^2 sqrt(rigidity / mass_per_length); xi_1 is the first eigenvalue of the boundary.

    Parameters
    ----------
    boundary : int
        Number of the FMU's enumeration BeamBoundary.
    length, mass_per_length, frequency : float
        m, kg/m, Hz.
    """
    eigenvalue = float(beam_modes(_BOUNDARY_OF[boundary], 1).eigenvalues[0])
    angular = 2.0 * math.pi * frequency
    return mass_per_length * (angular * (length / eigenvalue) ** 2) ** 2
