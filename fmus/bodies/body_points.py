"""A body with rigid stops at the points of a sweep, and the two coordinates that its motion is told in."""

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

    A mode is q'' + 2 decay q' + stiffness q = force cos(phase) + held, a displacement shape . q, and an impulse at a
    contact adds `impulse` to q'.

    Attributes
    ----------
    to_state : tuple of ndarray, shape (element, mode)
        Of a chain or a beam: from modes to the displacements that are the body's state, for each kind of its points.
    kind : ndarray of int, shape (point,)
        Which one each point has.
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
    to_state: tuple[Floats, ...] = ()
    kind: NDArray[np.int64] | None = None

    def states(self, q: Floats, p: Floats, points: NDArray[np.int64]) -> Floats | None:
        """Return the whole states of structures, shape (point, 2 element); None of an oscillator, which needs none.

        Parameters
        ----------
        q, p : ndarray, shape (mode, point)
            Of all points.
        points : ndarray of int
            Those that are wanted.
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
        Real parameters of the body's FMU, SI. Of arrays there are `in_state_coordinates`, of numbers the others.
    integers : mapping of str to int
        Integer parameters, which all points have in common.
    stops : int
        Number of contact ports with a stop.
    """

    floats: Mapping[str, Any]
    integers: Integers
    stops: int

    @abstractmethod
    def in_state_coordinates(self) -> ModalPoints:
        """Return the points as modes, in the coordinates that a state is kept in.

        They are the displacement of an oscillator and the modal displacements of a beam, and of a chain its
        mass-normalised modes. A point that is no body of such modes is all NaN.
        """

    @abstractmethod
    def mass_normalised(self) -> ImpactingBody:
        """Return a body without a flaw as mass-normalised modes under its harmonic force: equations.md 5.2, 6.4."""

    @abstractmethod
    def normalised(self, displacements: Floats) -> Floats:
        """Return displacements of states (m, shape (state, element)) in mass-normalised modes, kg^(1/2) m."""

    @property
    @abstractmethod
    def flaw(self) -> str:
        """What keeps it from flying in modes: "coupled" by its damping, or "loose"; empty where nothing does."""

    # ---- contacts, in the coordinates of the state ----

    @abstractmethod
    def contact_shapes(self) -> Floats:
        """Return the displacement of each contact for 1 m of each element of the state, shape (contact, element)."""

    def contact_mobilities(self, shapes: Floats) -> Floats:
        """Return how an impulse at contacts of these shapes changes the velocities, but for a factor; same shape."""
        return shapes

    @abstractmethod
    def contact_masses(self) -> Floats:
        """Return the mass that each stop feels when it is hit, kg, shape (contact,): equations.md 5.3 and 6.6."""

    # ---- contacts that the FMU knows nothing of ----

    def is_pushed(self) -> bool:
        """Whether inputs of an FMU without stops can act as forces at all places of stops."""
        return True

    def variables_at_contacts(self, what: str) -> tuple[str, ...]:
        """Return the variables at each contact of an FMU without stops: displacement, velocity or force."""
        return (what,) * self.stops

    def floats_of_contacts(self) -> dict[str, float]:
        """Return parameters with which an FMU without stops shows its motion, and takes a force, where they are."""
        return {}


def row_of(numbers: Numbers, name: str, count: int) -> Floats:
    """Return an array among parameters, by the names `name[1]`, ...; what is not there is 0."""
    return np.array([numbers.get(f"{name}[{i}]", 0.0) for i in range(1, count + 1)])


def rows_of(columns: Columns, name: str, count: int) -> Floats:
    """Return columns `name[1]`, ..., or the one `name`, shape (count, point); what is not there is 0."""
    none = np.zeros(len(next(iter(columns.values()))))
    if count == 1 and name in columns:
        return columns[name][None]
    return np.stack([columns.get(f"{name}[{i}]", none) for i in range(1, count + 1)])


def weighted(weights: Floats, values: Floats) -> Floats:
    """Return weights (element, row, point) times values (element, point), summed: the same bits for any points."""
    total: Floats = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        total = total + weight * value
    return total
