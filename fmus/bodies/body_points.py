"""A body with rigid stops at the points of a sweep, and the two coordinates that its motion is told in."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Contact, Floats, ImpactingBody

Integers = Mapping[str, int]
Numbers = Mapping[str, float]
Columns = Mapping[str, Floats]

DIRECTIONS = {1: 1.0, 2: -1.0}
"""Direction of a stop by the number of its side: 1 is above, 2 below."""


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


class BodyPoints(ABC):
    """A body at the points of a sweep.

    Parameters
    ----------
    floats : mapping of str to ndarray, shape (point,)
        Real parameters of the body's FMU, SI.
    integers : mapping of str to int
        Integer parameters, which all points have in common.

    Notes
    -----
    A kind of body implements the methods that raise no modes here: its motion in the coordinates of its state, in
    mass-normalised modes, and what keeps it from having such modes.
    """

    def __init__(self, floats: Columns, integers: Integers) -> None:
        self.floats, self.integers = floats, integers

    @cached_property
    def contacts(self) -> int:
        """Number of contact ports that have a stop."""
        return sum(name.startswith("contact[") and name.endswith("].law") for name in self.integers)

    def numbers_at(self, point: int) -> dict[str, float]:
        """Return the real parameters of one point."""
        return {name: float(column[point]) for name, column in self.floats.items()}

    @abstractmethod
    def in_state_coordinates(self) -> ModalPoints:
        """Return the points as modes, in the coordinates that a state is kept in.

        They are the displacement of an oscillator and the modal displacements of a beam, and of a chain its
        mass-normalised modes. A point that is no body of such modes is all NaN.
        """

    @abstractmethod
    def mass_normalised(self, point: int = 0) -> ImpactingBody:
        """Return one point as mass-normalised modes under its harmonic force: equations.md 5.2 and 6.4."""

    @abstractmethod
    def normalised(self, displacements: Floats, point: int = 0) -> Floats:
        """Return displacements of a state in mass-normalised modes.

        Parameters
        ----------
        displacements : array, shape (state, mass or mode)
            m; of an oscillator that of its mass.

        Returns
        -------
        array, shape (state, mode)
            kg^(1/2) m.
        """

    @abstractmethod
    def is_tied(self, point: int = 0) -> bool:
        """Whether springs hold the body at a point: its slowest mode vibrates."""

    def is_classical(self, point: int = 0) -> bool:
        """Whether damping does not couple the modes of a point."""
        return True

    def _contacts(self, shapes: Sequence[Floats], numbers: Numbers) -> tuple[Contact, ...]:
        """Return the contacts of one point, with the mass-normalised shapes of their places."""
        ports = [f"contact[{number}]" for number in range(1, len(shapes) + 1)]
        return tuple(
            Contact(
                shape,
                DIRECTIONS[self.integers[f"{port}.side"]],
                numbers[f"{port}.position"],
                numbers[f"{port}.restitution"],
            )
            for port, shape in zip(ports, shapes, strict=True)
        )


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
