"""Oscillators, one mass on a spring, at the points of a sweep: equations.md 1."""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.bodies.body_points import BodyPoints, ModalPoints
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody, contacts_of


class OscillatorPoints(BodyPoints):
    """Oscillators: the displacement is the coordinate of the only mode."""

    def in_state_coordinates(self) -> ModalPoints:
        """Return the points as modes, in the coordinates of their states: see `BodyPoints`."""
        columns, contacts = self.floats, self.stops
        mass, count = columns["mass"], len(columns["mass"])
        none, one = np.zeros(count), np.ones((1, count))
        with np.errstate(all="ignore"):  # the body itself rejects NaN parameters
            return ModalPoints(
                stiffness=(columns["stiffness"] / mass)[None],
                decay=(0.5 * columns["damping"] / mass)[None],
                force=(columns.get("forcing.amplitude", none) / mass)[None],
                held=(columns.get("force", none) / mass)[None],
                shape=np.ones((contacts, 1, count)),
                impulse=np.repeat((1.0 / mass)[None, None], contacts, axis=0),
                observed=one,
                start_q=columns["displacement_start"][None],
                start_p=columns["velocity_start"][None],
            )

    def mass_normalised(self) -> ImpactingBody:
        """Return one point as a mass-normalised mode under its harmonic force: see `BodyPoints`."""
        numbers = self.floats
        mass, stiffness, damping = numbers["mass"], numbers["stiffness"], numbers["damping"]
        root = np.sqrt(mass)
        shape = np.array([1.0 / root])
        return ImpactingBody(
            np.array([np.sqrt(stiffness / mass)]),
            np.array([_damping_ratio(mass, stiffness, damping)]),
            np.array([numbers["forcing.amplitude"] / root]),
            np.array([numbers.get("force", 0.0) / root]),
            numbers["forcing.angular_frequency"],
            numbers.get("forcing.phase", 0.0),
            contacts_of([shape] * self.stops, numbers, self.integers),
            shape,
        )

    @property
    def natural_frequencies(self) -> Floats:
        """The natural angular frequency of one point: see `BodyPoints`."""
        return np.array([np.sqrt(self.floats["stiffness"] / self.floats["mass"])])

    def normalised(self, displacements: Floats) -> Floats:
        """Return displacements of a state in mass-normalised modes: see `BodyPoints`."""
        return np.asarray(displacements * np.sqrt(self.floats["mass"]))

    def contact_shapes(self) -> Floats:
        """Return a shape of 1 for each contact."""
        return np.ones((self.stops, 1))

    def contact_masses(self) -> Floats:
        """Return the mass at each contact, kg."""
        return np.full(self.stops, self.floats["mass"])


def _damping_ratio(mass: float, stiffness: float, damping: float) -> float:
    """Return the damping ratio; without a spring it is 0, or infinite with damping."""
    if damping == 0.0:
        return 0.0
    return float(0.5 * damping / np.sqrt(stiffness * mass)) if stiffness > 0.0 else float(np.inf)
