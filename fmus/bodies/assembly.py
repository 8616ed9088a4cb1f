"""Several bodies that springs and dashpots join, as one set of modes: equations.md 6.12, and 1.9 for negative ones."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.beam import BeamPoints
from vibroimpact.fmus.bodies.impacting_body import Floats, Integers, Numbers
from vibroimpact.fmus.bodies.structure import couples, ratios_of
from vibroimpact.fmus.core.modes import BOUNDARIES, beam_modes, signed_modes, spring_modes
from vibroimpact.fmus.errors import UsageError

TAKES_PART = 1e-8
"""Displacement times sqrt(mass) above which a coordinate sets the sign of a mode, as in a chain."""
ELONGATES = 1e-9
"""Elongation of a spring by a motion, relative to its row, below which the motion leaves the spring alone."""
CANCELS = 8.0 * float(np.finfo(np.float64).eps)
"""Difference of two displacements by a rigid-body mode, relative to their moduli, up to which it is rounding."""
COMMUTES = 32.0 * float(np.finfo(np.float64).eps)
"""Entry of C M^-1 K - K M^-1 C, relative to the moduli of its terms, up to which it is rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Element:
    """A spring beside a dashpot; `shape` is its elongation for 1 m of each coordinate."""

    shape: Floats
    stiffness: float
    damping: float


class Part(ABC):
    """One body of an assembly: coordinates with masses, and its elements over these coordinates.

    Attributes
    ----------
    masses : ndarray, shape (coordinate,)
        kg.
    displacements, velocities : ndarray, shape (coordinate,)
        The start, m and m/s.
    """

    masses: Floats
    displacements: Floats
    velocities: Floats

    @property
    @abstractmethod
    def elements(self) -> list[Element]:
        """The springs and dashpots of the body."""

    @property
    def is_rigid(self) -> NDArray[np.bool_]:
        """Whether each coordinate is a given rigid-body mode, shape (coordinate,)."""
        return np.zeros(len(self.masses), dtype=bool)

    @property
    def damping(self) -> Floats | None:
        """Damping matrix besides the dashpots, shape (coordinate, coordinate)."""
        return None

    @property
    @abstractmethod
    def participation(self) -> Floats:
        """Motion of each coordinate that 1 m of the base is, shape (coordinate,)."""

    @abstractmethod
    def point(self, place: float) -> Floats:
        """Return the displacement of a place for 1 m of each coordinate, shape (coordinate,)."""


class MassesPart(Part):
    """An oscillator or a chain: element i lies between mass i - 1 (the ground for the first) and mass i.

    Parameters
    ----------
    masses : array, shape (mass,)
        kg.
    stiffnesses, dampings : array, shape (mass + 1,)
        N/m and N s/m; the last ties the last mass to the ground.
    displacements, velocities : array, shape (mass,)
        The start, m and m/s.
    """

    def __init__(
        self,
        masses: Sequence[float],
        stiffnesses: Sequence[float],
        dampings: Sequence[float],
        displacements: Sequence[float],
        velocities: Sequence[float],
    ) -> None:
        self.masses = np.array(masses, dtype=np.float64)
        self.displacements = np.array(displacements, dtype=np.float64)
        self.velocities = np.array(velocities, dtype=np.float64)
        self._pairs = list(zip(stiffnesses, dampings, strict=True))

    @property
    def elements(self) -> list[Element]:
        """The springs and dashpots of the body; an element at the far end only where it has numbers."""
        count = len(self.masses)
        beside = np.eye(count + 1, count) - np.eye(count + 1, count, -1)
        found = [Element(shape, *pair) for shape, pair in zip(beside, self._pairs, strict=True)]
        return [each for each in found if each.stiffness != 0.0 or each.damping != 0.0]

    @property
    def participation(self) -> Floats:
        """1 for each mass."""
        return np.ones(len(self.masses))

    def point(self, place: float) -> Floats:
        """Return the unit vector of a mass, counted from 1."""
        return np.asarray(np.eye(len(self.masses))[int(place) - 1])


class BeamPart(Part):
    """A beam, from the parameters of its FMU; its modes are the coordinates."""

    def __init__(self, numbers: Numbers, integers: Integers) -> None:
        found = BeamPoints(numbers, integers, 0).structure_of(numbers)
        boundary = {number: name for name, number in BOUNDARIES.items()}[integers["boundary"]]
        count = integers["modes"]
        self._modes = beam_modes(boundary, count)
        self._natural, self._ratios = found.frequencies, found.damping_ratios
        self.masses = np.full(count, found.mass)
        self.displacements, self.velocities = (
            np.array([numbers.get(f"modal_{name}_start[{i}]", 0.0) for i in range(1, count + 1)])
            for name in ("displacement", "velocity")
        )

    @property
    def elements(self) -> list[Element]:
        """The spring and the dashpot of each mode."""
        stiffness = self.masses * self._natural**2
        damping = 2.0 * self.masses * self._natural * self._ratios
        rows = np.eye(len(self.masses))
        return [Element(*each) for each in zip(rows, stiffness.tolist(), damping.tolist(), strict=True)]

    @property
    def participation(self) -> Floats:
        """Mean of each shape over the length."""
        return self._modes.participation

    def point(self, place: float) -> Floats:
        """Return the shapes at a place, a fraction of the length."""
        return np.asarray(self._modes.shapes(place)[0])


class ModesPart(Part):
    """Given modes, which are the coordinates, each with a mass of 1 kg.

    Parameters
    ----------
    natural, ratios : array, shape (mode,)
        Natural angular frequencies, rad/s, and damping ratios.
    damping : ndarray, shape (mode, mode)
        Further modal damping phi' C phi, symmetric, 1/s.
    shapes : ndarray, shape (point, mode)
        Mass-normalised shapes at the points, kg^(-1/2).
    participation : array, shape (mode,)
        phi' M r, kg^(1/2), for 1 m of the base.
    displacements, velocities : array, shape (mode,)
        The start of the modes, kg^(1/2) m and kg^(1/2) m/s.
    """

    def __init__(
        self,
        natural: Sequence[float],
        ratios: Sequence[float],
        damping: Floats,
        shapes: Floats,
        participation: Sequence[float],
        displacements: Sequence[float],
        velocities: Sequence[float],
    ) -> None:
        self.masses = np.ones(len(natural))
        self.displacements = np.array(displacements, dtype=np.float64)
        self.velocities = np.array(velocities, dtype=np.float64)
        self._natural, self._ratios = np.array(natural), np.array(ratios)
        self._damping, self._shapes = damping, shapes
        self._participation = np.array(participation, dtype=np.float64)

    @property
    def elements(self) -> list[Element]:
        """The spring and the dashpot of each mode."""
        stiffness, damping = self._natural**2, 2.0 * self._natural * self._ratios
        rows = np.eye(len(self.masses))
        return [Element(*each) for each in zip(rows, stiffness.tolist(), damping.tolist(), strict=True)]

    @property
    def is_rigid(self) -> NDArray[np.bool_]:
        """Modes with a frequency of 0."""
        return np.asarray(self._natural == 0.0)

    @property
    def damping(self) -> Floats | None:
        """The further modal damping, if there is some."""
        return self._damping if self._damping.any() else None

    @property
    def participation(self) -> Floats:
        """As given."""
        return self._participation

    def point(self, place: float) -> Floats:
        """Return the shapes at a point, counted from 1."""
        return np.asarray(self._shapes[int(place) - 1])


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A spring beside a dashpot between two points, each a part (from 0) and a place on it; None is the ground."""

    first: tuple[int, float] | None
    second: tuple[int, float] | None
    stiffness: float
    damping: float


class Assembly:
    """The modes of several bodies with joints: K phi = w^2 M phi, phi' M phi = 1.

    Parameters
    ----------
    parts : sequence of Part
    joints : sequence of Joint

    Attributes
    ----------
    masses : ndarray, shape (coordinate,)
        kg.
    frequencies : ndarray, shape (mode,)
        rad/s, ascending; 0 for each group of masses that nothing ties to the ground, w < 0 for a stiffness of -w^2.
    shapes : ndarray, shape (coordinate, mode)
        kg^(-1/2).
    damping : ndarray, shape (mode, mode)
        Modal damping matrix phi' C phi, 1/s.

    Raises
    ------
    UsageError
        There are more than 64 coordinates, or the numbers have no modes in double precision.
    """

    def __init__(self, parts: Sequence[Part], joints: Sequence[Joint]) -> None:
        self.parts = tuple(parts)
        self.masses = np.concatenate([part.masses for part in parts])
        self._first = np.cumsum([0, *(len(part.masses) for part in parts)])
        self._is_rigid = np.concatenate([part.is_rigid for part in parts])
        elements = [
            Element(self._own(number, each.shape), each.stiffness, each.damping)
            for number, part in enumerate(parts)
            for each in part.elements
        ]
        elements += [Element(self._elongation(each), each.stiffness, each.damping) for each in joints]
        self.elements = tuple(elements)
        self.frequencies, self.shapes = self._modes()
        self.damping = self._modal_damping()

    def _own(self, part: int, shape: Floats) -> Floats:
        """Return a shape over the coordinates of a part as one over all coordinates."""
        found = np.zeros(len(self.masses))
        found[self._first[part] : self._first[part + 1]] = shape
        return found

    def point(self, place: tuple[int, float] | None) -> Floats:
        """Return the displacement of a point for 1 m of each coordinate; 0 for the ground."""
        if place is None:
            return np.zeros(len(self.masses))
        part, where = place
        return self._own(part, self.parts[part].point(where))

    def _elongation(self, joint: Joint) -> Floats:
        """Return the elongation of a joint for 1 m of each coordinate; 0 for rigid-body modes that keep its length."""
        first, second = self.point(joint.first), self.point(joint.second)
        found = first - second
        cancels = np.abs(found) <= CANCELS * (np.abs(first) + np.abs(second))
        return np.where(self._is_rigid & cancels, 0.0, found)

    def in_modes(self, shape: Floats) -> Floats:
        """Return the displacement that belongs to a shape over the coordinates for 1 kg^(1/2) m of each mode."""
        return _times(shape, self.shapes)

    def modal(self, motion: Floats) -> Floats:
        """Return a motion of the coordinates in mass-normalised modes: phi' M motion."""
        return _times(self.masses * motion, self.shapes)

    # ---- modes ----

    def _modes(self) -> tuple[Floats, Floats]:
        """Return the angular frequencies, ascending, and the shapes, shape (coordinate, mode)."""
        rigid = self._rigid()
        root = np.sqrt(self.masses)
        if any(each.stiffness < 0.0 for each in self.elements):
            return self._signed_modes(rigid, root)
        springs = [
            np.sqrt(each.stiffness) * each.shape / root for each in self.elements if each.stiffness > 0.0
        ]
        count = len(self.masses)
        frequencies, vectors = spring_modes(np.array(springs).reshape(-1, count))
        kept = count - len(rigid)
        if len(frequencies) < kept:
            raise UsageError("body: expected stiffnesses and masses within some 30 decades, got wider ones.")
        # rounding in a closed path of springs may look like further springs
        frequencies, vectors = frequencies[len(frequencies) - kept :], vectors[len(vectors) - kept :]
        shapes = np.concatenate([rigid, vectors / root]).T
        return np.concatenate([np.zeros(len(rigid)), frequencies]), shapes * self._signs(shapes, root)

    def _signed_modes(self, rigid: Floats, root: Floats) -> tuple[Floats, Floats]:
        """Return `_modes` where springs are negative: motions without a spring are moved above all others."""
        elements = [each for each in self.elements if each.stiffness != 0.0]
        rows = [np.sqrt(abs(each.stiffness)) * each.shape / root for each in elements]
        signs = [1.0 if each.stiffness > 0.0 else -1.0 for each in elements]
        above = 2.0 * np.sqrt(sum(float(row @ row) for row in rows))
        springs = np.array([*rows, *(above * root * shape for shape in rigid)])
        frequencies, vectors = signed_modes(springs, np.array([*signs, *np.ones(len(rigid))]))
        kept, negative = len(root) - len(rigid), int((frequencies < 0.0).sum())
        moves = vectors[:kept] / root
        shapes = np.concatenate([moves[:negative], rigid, moves[negative:]]).T
        found = np.concatenate([frequencies[:negative], np.zeros(len(rigid)), frequencies[negative:kept]])
        return found, shapes * self._signs(shapes, root)

    def _rigid(self) -> Floats:
        """Return the shapes of motions that no spring resists, mass-normalised, shape (motion, coordinate)."""
        springs = [each.shape for each in self.elements if each.stiffness != 0.0]
        group = np.arange(len(self.masses))
        for shape in springs:
            joined = group[shape != 0.0]
            group[np.isin(group, joined)] = joined.min(initial=len(group))
        found = []
        for number in np.unique(group):
            own = group == number
            if self._is_rigid[own].any():
                found += self._unsprung(own, springs)
            elif all(shape[own].sum() == 0.0 for shape in springs):
                found.append(own / np.sqrt(self.masses[own].sum()))
        return np.array(found).reshape(-1, len(self.masses))

    def _unsprung(self, own: NDArray[np.bool_], springs: Sequence[Floats]) -> list[Floats]:
        """Return the motions of a group that its springs do not resist, where it has given rigid-body modes."""
        root = np.sqrt(self.masses[own])
        rows = np.array([shape[own] for shape in springs if shape[own].any()]).reshape(-1, len(root)) / root
        found = []
        for motion in _without_elongation(rows):
            whole = np.zeros(len(self.masses))
            whole[own] = motion / root
            found.append(whole)
        return found

    def _signs(self, shapes: Floats, root: Floats) -> Floats:
        """Return 1 or -1 for each mode, so that its first coordinate that takes part moves to the positive side."""
        takes_part = np.abs(shapes * root[:, None]) > TAKES_PART
        first = shapes[takes_part.argmax(axis=0), np.arange(shapes.shape[1])]
        return np.where(first < 0.0, -1.0, 1.0)

    # ---- damping ----

    def _modal_damping(self) -> Floats:
        count = len(self.masses)
        found = np.zeros((count, count))
        for each in self.elements:
            if each.damping != 0.0:
                elongation = self.in_modes(each.shape)
                found = found + each.damping * elongation[:, None] * elongation
        for number, part in enumerate(self.parts):
            if part.damping is not None:
                shapes = self.shapes[self._first[number] : self._first[number + 1]]
                forces = np.array([_times(row, shapes) for row in part.damping])
                found = found + np.array([_times(mode, forces) for mode in shapes.T])
        return found

    @property
    def damping_ratios(self) -> Floats:
        """Damping ratio of each mode, from the diagonal of the modal damping; 0 without a spring."""
        return ratios_of(self.damping, self.frequencies)

    @cached_property
    def is_coupled(self) -> bool:
        """Whether the damping couples the modes, or damps a mode without a spring, which has no damping ratio."""
        drags_free_mode = bool((self.damping.diagonal()[self.frequencies == 0.0] != 0.0).any())
        return drags_free_mode or not self._commutes() or couples(self.damping)

    def _commutes(self) -> bool:
        """Return whether C M^-1 K = K M^-1 C within rounding."""
        stiffness, damping = self._matrix("stiffness"), self._matrix("damping")
        for first, part in zip(self._first, self.parts, strict=False):
            if part.damping is not None:
                end = first + len(part.masses)
                damping[first:end, first:end] += part.damping
        one = damping[:, :, None] * (stiffness / self.masses[:, None])[None]
        other = stiffness[:, :, None] * (damping / self.masses[:, None])[None]
        size = (np.abs(one) + np.abs(other)).sum(axis=1)
        return bool((np.abs((one - other).sum(axis=1)) <= COMMUTES * size).all())

    def _matrix(self, name: str) -> Floats:
        """Return the matrix of the stiffnesses or of the dampings over the coordinates."""
        count = len(self.masses)
        found = np.zeros((count, count))
        for each in self.elements:
            found = found + getattr(each, name) * each.shape[:, None] * each.shape
        return found


def _times(row: Floats, matrix: Floats) -> Floats:
    """Return the product of a row and a matrix, summed in the order of the row: the same bits on each machine."""
    found = np.zeros(matrix.shape[1])
    for place in np.flatnonzero(row):
        found = found + row[place] * matrix[place]
    return found


def _without_elongation(rows: Floats) -> list[Floats]:
    """Return orthonormal vectors that the rows of springs do not elongate, by elimination with complete pivoting.

    Sums have a fixed order: the same bits on each machine.
    """
    count = rows.shape[1]
    left = rows / np.abs(rows).max(axis=1, initial=0.0)[:, None]
    pivots: list[int] = []
    for step in range(min(rows.shape)):
        rest = np.abs(left[step:])
        row, column = divmod(int(rest.argmax()), count)
        if rest[row, column] <= ELONGATES:
            break
        left[[step, step + row]] = left[[step + row, step]]
        left[step] /= left[step, column]
        others = np.arange(len(left)) != step
        left[others] -= left[others, column][:, None] * left[step]
        left[others, column] = 0.0
        pivots.append(column)
    found: list[Floats] = []
    for free in sorted(set(range(count)) - set(pivots)):
        motion = np.zeros(count)
        motion[free] = 1.0
        motion[pivots] = -left[: len(pivots), free]
        for _ in range(2):
            for other in found:
                motion = motion - _times(motion, other[:, None])[0] * other
        found.append(motion / np.sqrt(_times(motion, motion[:, None])[0]))
    return found
