"""One mass on a spring at the points of a sweep: equations.md 1."""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.bodies.body_points import BodyPoints, ModalPoints
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody


class OscillatorPoints(BodyPoints):
    """Oscillators: one mode, whose coordinate is the displacement."""

    def in_state_coordinates(self) -> ModalPoints:
        """Return the points as modes, in the coordinates of their states: see `BodyPoints`."""
        columns, contacts = self.floats, self.contacts
        mass, count = columns["mass"], len(columns["mass"])
        none, one = np.zeros(count), np.ones((1, count))
        with np.errstate(all="ignore"):  # what is no number is refused by its body
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

    def mass_normalised(self, point: int = 0) -> ImpactingBody:
        """Return one point as mass-normalised modes under its harmonic force: see `BodyPoints`."""
        numbers = self.numbers_at(point)
        mass, stiffness, damping = (numbers[name] for name in ("mass", "stiffness", "damping"))
        root = np.sqrt(mass)
        shape = np.array([1.0 / root])
        return ImpactingBody(
            np.array([np.sqrt(stiffness / mass)]),
            np.array([0.5 * damping / np.sqrt(stiffness * mass)]),
            np.array([numbers["forcing.amplitude"] / root]),
            np.array([numbers.get("force", 0.0) / root]),
            numbers["forcing.angular_frequency"],
            numbers.get("forcing.phase", 0.0),
            self._contacts([shape] * self.contacts, numbers),
            shape,
        )

    def normalised(self, displacements: Floats, point: int = 0) -> Floats:
        """Return displacements of a state in mass-normalised modes: see `BodyPoints`."""
        return np.asarray(displacements * np.sqrt(float(self.floats["mass"][point])))

    def is_tied(self, point: int = 0) -> bool:
        """Whether springs hold the body at a point."""
        return bool(self.floats["stiffness"][point] > 0.0)
