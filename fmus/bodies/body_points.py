"""A body with rigid stops at the points of a sweep, in two coordinate systems for its motion."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody, Integers, Numbers

Columns = Mapping[str, Floats]


@dataclass(frozen=True, slots=True)
class ModalPoints:
    """Points as modes: arrays of shape (mode, point), (contact, point) or (contact, mode, point).

    A mode obeys q'' + 2 decay q' + stiffness q = force cos(phase) + held. A displacement is shape . q. A unit impulse
    at a contact adds `impulse` to q'.

    Attributes
    ----------
    further_force : ndarray, shape (sine, mode, point), or None
        Forces of sines besides the first; None without one.
    further_frequency, further_phase : ndarray, shape (sine, point), or None
        Their angular frequencies, rad/s, and phases at time 0, rad.
    coupling : ndarray, shape (mode, mode, point), or None
        Damping between the modes, 1/s, with 2 decay on the diagonal; None: no point has modes that damp each other.
    to_state : tuple of ndarray, shape (element, mode)
        For a chain or a beam: matrix from modes to the displacements in the state, for each kind of structure.
    kind : ndarray of int, shape (point,)
        Number of the structure of each point.
    """

    stiffness: Floats
    decay: Floats
    force: Floats
    held: Floats
    shape: Floats
    impulse: Floats
    observed: Floats
    start_q: Floats
    start_p: Floats
    coupling: Floats | None = None
    to_state: tuple[Floats, ...] = ()
    kind: NDArray[np.int64] | None = None
    further_force: Floats | None = None
    further_frequency: Floats | None = None
    further_phase: Floats | None = None

    def states(self, q: Floats, p: Floats, points: NDArray[np.int64]) -> Floats | None:
        """Return the states of chains and beams, shape (point, 2 element); None for an oscillator.

        Parameters
        ----------
        q, p : ndarray, shape (mode, point)
            Modal coordinates and velocities of all points.
        points : ndarray of int
            Numbers of the points whose states are returned.
        """
        if self.kind is None:
            return None
        found = np.empty((len(points), 2 * self.to_state[0].shape[0]))
        for number, to_state in enumerate(self.to_state):
            own = self.kind[points] == number
            shapes = to_state.T[..., None]
            halves = [weighted(shapes, coordinates[:, points[own]]) for coordinates in (q, p)]
            found[own] = np.concatenate(halves).T
        return found


@dataclass(frozen=True)
class BodyPoints(ABC):
    """A body at the points of a sweep, or at one point.

    Attributes
    ----------
    floats : mapping of str to ndarray, shape (point,), or to float
        Real parameters of the body's FMU, SI. `in_state_coordinates` needs arrays, the other methods need numbers.
    integers : mapping of str to int
        Integer parameters, common to all points.
    stops : int
        Number of contact ports with a stop.
    """

    floats: Mapping[str, Any]
    integers: Integers
    stops: int

    @abstractmethod
    def in_state_coordinates(self) -> ModalPoints:
        """Return the points as modes, in the coordinates of a state.

        These are the displacement of an oscillator, the modal displacements of a beam, and the mass-normalised modes of
        a chain. A point whose parameters have no such modes is all NaN.
        """

    @abstractmethod
    def mass_normalised(self) -> ImpactingBody:
        """Return a body tied to the ground as mass-normalised modes under its harmonic force: equations.md 5.2, 6.4."""

    @property
    @abstractmethod
    def natural_frequencies(self) -> Floats:
        """Natural angular frequencies of one point without damping, rad/s, shape (mode,), ascending."""

    @abstractmethod
    def normalised(self, displacements: Floats) -> Floats:
        """Return displacements of states (m, shape (state, element)) in mass-normalised modes, kg^(1/2) m."""

    # ---- contacts, in the coordinates of the state ----

    @abstractmethod
    def contact_shapes(self) -> Floats:
        """Return the displacement of each contact for 1 m of each element of the state, shape (contact, element)."""

    def contact_mobilities(self, shapes: Floats) -> Floats:
        """Return the change of the velocities by an impulse at contacts of these shapes, up to a factor; same shape."""
        return shapes

    @abstractmethod
    def contact_masses(self) -> Floats:
        """Return the effective mass at each stop, kg, shape (contact,): equations.md 5.3 and 6.6."""

    # ---- contacts that the FMU does not know ----

    def is_pushed(self) -> bool:
        """Whether force inputs of an FMU without stops can act at all places of stops."""
        return True

    def variables_at_contacts(self, what: str) -> tuple[str, ...]:
        """Return the variables at each contact of an FMU without stops: displacement, velocity or force."""
        return (what,) * self.stops

    def floats_of_contacts(self) -> dict[str, float]:
        """Return the parameters that place the sensors, and the force, of an FMU without stops at the contacts."""
        return {}


def row_of(numbers: Numbers, name: str, count: int) -> Floats:
    """Return an array of parameters named `name[1]`, ...; absent elements are 0."""
    return np.array([numbers.get(f"{name}[{i}]", 0.0) for i in range(1, count + 1)])


def rows_of(columns: Columns, name: str, count: int) -> Floats:
    """Return columns `name[1]`, ..., or the single `name`, shape (count, point); absent columns are 0."""
    none = np.zeros(len(next(iter(columns.values()))))
    if count == 1 and name in columns:
        return columns[name][None]
    return np.stack([columns.get(f"{name}[{i}]", none) for i in range(1, count + 1)])


def weighted(weights: Floats, values: Floats) -> Floats:
    """Return the sum of weights (element, row, point) times values (element, point); points do not change its bits."""
    total: Floats = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        total = total + weight * value
    return total
