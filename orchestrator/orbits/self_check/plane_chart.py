"""The plane of states of a body of one mode, in coordinates in which an impact is one point: equations.md 4.14."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies import Contact
from vibroimpact.fmus.bodies.impacting_body import Floats

ON_STOP = 2e-9
"""Distance from a stop, over the width of the plane, below which a state counts as one on the stop."""


LEAST_KEPT = 1e-3
"""Share of a velocity that an impact keeps at least: none would make all states before impacts a rest in the chart."""


@dataclass(frozen=True, slots=True)
class Wall:
    """A stop of a body of one mode.

    Attributes
    ----------
    at : float
        Displacement of the state at the stop.
    side : float
        +1: it bounds the displacement from above, -1: from below.
    speed : float
        Speed of the contact, m/s, at velocity 1 of the state.
    contact : Contact
    """

    at: float
    side: float
    speed: float
    contact: Contact

    def kept(self, velocity: Floats) -> Floats:
        """Return the share of velocities towards the stop that an impact leaves; 1 for other velocities."""
        towards = np.maximum(self.side * velocity, 0.0)
        kept = np.maximum(self.contact.restitution_at(self.speed * towards), LEAST_KEPT)
        return np.where(towards > 0.0, kept, 1.0)


@dataclass(frozen=True, slots=True)
class PlaneChart:
    """Coordinates of the plane of states in which states before and after an impact are one point.

    The strobe map is continuous in them, also where it ends at an impact. Between two stops the coordinates are
    sin(pi X + i V), beside one stop (d - i V)^2. V at a stop is the velocity after the impact.

    Attributes
    ----------
    low, high : float
        Displacements between which all fixed points are; stops, where there are some.
    radius : float
        Velocity beyond which there are none.
    walls : tuple of Wall
        The nearest stop of each side: one or two.
    """

    low: float
    high: float
    radius: float
    walls: tuple[Wall, ...]

    def points(self, states: Floats) -> NDArray[np.complex128]:
        """Return the coordinates of states, shape (state, 2), as complex numbers, shape (state,)."""
        share = np.clip((states[:, 0] - self.low) / (self.high - self.low), 0.0, 1.0)
        share = np.where(share < ON_STOP, 0.0, np.where(share > 1.0 - ON_STOP, 1.0, share))
        velocity = states[:, 1].copy()
        for wall in self.walls:
            near = share if wall.side > 0.0 else 1.0 - share
            velocity *= 1.0 - near * (1.0 - wall.kept(states[:, 1]))
        velocity /= self.radius
        if len(self.walls) == 2:
            return np.asarray(np.sin(np.pi * (share - 0.5) + 1j * velocity))
        side = self.walls[0].side
        away = 1.0 - share if side > 0.0 else share
        return np.asarray((away - 1j * side * velocity) ** 2)
