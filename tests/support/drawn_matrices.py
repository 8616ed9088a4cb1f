"""Random structures of springs and masses as matrices: free bodies, equal bodies, unknowns without mass or unused."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from support.drawn_structures import pick

Floats = NDArray[np.float64]
MOST_UNKNOWNS = 300
DIRECTIONS = ("x", "y", "z")
EXACT_DECADES = 4
"""Decades of stiffness over which rigid-body modes are those of the springs' geometry alone."""


@dataclass(frozen=True)
class DrawnMatrices:
    """Springs and masses: `elongations` has a row of each spring over the unknowns, shape (spring, unknown).

    `unit` is the stiffness and the mass of a usual spring and mass, `decades` the spread of the stiffnesses.
    """

    elongations: Floats
    springs: Floats
    mass: Floats
    damping: Floats | None
    names: tuple[str, ...]
    unit: tuple[float, float]
    decades: float

    @cached_property
    def stiffness(self) -> Floats:
        """The stiffness matrix, symmetric to the last bit."""
        found = self.elongations.T @ (self.springs[:, None] * self.elongations)
        return np.asarray(0.5 * (found + found.T))

    @cached_property
    def used(self) -> NDArray[np.int64]:
        """The unknowns with stiffness or mass."""
        return np.flatnonzero((self.stiffness.diagonal() > 0.0) | (self.mass.diagonal() > 0.0))

    @cached_property
    def rigid(self) -> int:
        """The number of motions that no spring resists, by the geometry of the springs."""
        return len(self.used) - _rank(self.elongations)

    @cached_property
    def is_loose(self) -> bool:
        """Whether a motion has neither stiffness nor mass."""
        size = np.sqrt(np.where(self.mass.diagonal() > 0.0, self.mass.diagonal(), 1.0))
        return _rank(np.vstack([self.elongations, self.mass / np.outer(size, size)])) < len(self.used)

    @property
    def natural(self) -> float:
        """The angular frequency of a usual spring and mass, rad/s."""
        stiffness, mass = self.unit
        return float(np.sqrt(stiffness / mass))


def _rank(rows: Floats) -> int:
    return int(np.linalg.matrix_rank(rows, tol=1e-9)) if rows.size else 0


def drawn_matrices(random: np.random.Generator) -> DrawnMatrices:
    """Return a structure of 1 to 300 unknowns, in one to some bodies."""
    bodies = pick(random, 1, 1, 1, 2, 3) if random.random() < 0.97 else 70
    most = {1: MOST_UNKNOWNS, 2: 100, 3: 60}.get(bodies, 2)
    parts = [_springs(random, int(np.exp(random.uniform(0.0, np.log(most + 0.99))))) for _ in range(bodies)]
    if random.random() < 0.25:
        parts = [parts[0]] * len(parts)  # equal bodies have equal frequencies
    if random.random() < 0.3:
        parts.append(np.zeros((0, int(random.integers(1, 4)))))
    count = sum(part.shape[1] for part in parts)
    rows, first, elongations = 0, 0, np.zeros((sum(len(part) for part in parts), count))
    for part in parts:
        elongations[rows : rows + len(part), first : first + part.shape[1]] = part
        rows, first = rows + len(part), first + part.shape[1]
    unit = float(10.0 ** random.uniform(-2, 8)), float(10.0 ** random.uniform(-3, 3))
    decades = pick(random, 0.0, 0.0, 1.0, 4.0) if random.random() < 0.9 else 12.0
    springs = unit[0] * 10.0 ** random.uniform(-decades / 2, decades / 2, rows)
    mass = unit[1] * _masses(random, elongations)
    damping = _damping(random, elongations, mass, unit) if random.random() < 0.4 else None
    numbers = random.permutation(1000)[:count] + 1
    names = tuple(f"{number}.{pick(random, *DIRECTIONS)}" for number in numbers.tolist())
    return DrawnMatrices(elongations, springs, mass, damping, names, unit, decades)


def _springs(random: np.random.Generator, count: int) -> Floats:
    """Return the elongations of the springs of a body: a tree, closed paths, and springs to the ground."""
    rows: list[Floats] = []
    arm = random.random() < 0.2

    def spring(one: int, other: int | None) -> None:
        row = np.zeros(count)
        row[one] = 1.0
        if other is not None and other != one:
            row[other] = -(np.round(random.uniform(0.5, 2.0), 1) if arm else 1.0)
        rows.append(row)

    for place in range(1, count):
        spring(place, place - 1 - int(random.integers(min(place, 3))))
    for _ in range(int(random.integers(0, count // 3 + 1))):
        one, other = random.integers(0, count, 2).tolist()
        if one != other:
            spring(one, other)
    if random.random() < 0.6:
        for place in random.integers(0, count, 1 + int(random.integers(0, count))).tolist():
            spring(place, None)
    return np.array(rows).reshape(-1, count)


def _masses(random: np.random.Generator, elongations: Floats) -> Floats:
    """Return a mass matrix; unknowns without a spring have a mass or are unused, some others have none."""
    count = elongations.shape[1]
    decades = pick(random, 0.0, 0.0, 2.0, 12.0)
    own = 10.0 ** random.uniform(-decades / 2, decades / 2, count)
    own[random.random(count) < pick(random, 0.0, 0.0, 0.2, 0.5)] = 0.0
    if random.random() < 0.5:
        own[~elongations.any(axis=0)] = 0.0
    own[int(np.abs(elongations).sum(axis=0).argmax())] += 1.0
    found = np.diag(own)
    if random.random() < 0.3:  # as of elements: 1/6 [2 1; 1 2] of the mass between two unknowns
        for row in elongations:
            ends = np.flatnonzero(row)
            found[np.ix_(ends, ends)] += (np.eye(len(ends)) + 1.0) / 6.0
    return found


def _damping(
    random: np.random.Generator, elongations: Floats, mass: Floats, unit: tuple[float, float]
) -> Floats:
    """Return a full damping matrix, or dashpots beside some springs, over unknowns that are used."""
    count = elongations.shape[1]
    size = pick(random, 1e-3, 0.02, 0.3) * np.sqrt(unit[0] * unit[1])
    if random.random() < 0.4:
        used = elongations.any(axis=0) | (mass.diagonal() > 0.0)
        full = random.normal(size=(min(count, 6), count)) * used / np.sqrt(count)
        return np.asarray(size * (full.T @ full + (full.T @ full).T) / 2.0)
    beside = size * (random.random(len(elongations)) < 0.5)
    return np.asarray(elongations.T @ (beside[:, None] * elongations))


def drawn_points(random: np.random.Generator, drawn: DrawnMatrices) -> dict[str, dict[str, float]]:
    """Return named points: one unknown, the gap between two, or weights."""
    names = [drawn.names[place] for place in drawn.used.tolist()]
    found: dict[str, dict[str, float]] = {}
    for number in range(int(random.integers(0, 3))):
        one, other = (pick(random, *names) for _ in range(2))
        weights: list[dict[str, float]] = [{one: 1.0}, {other: -0.5}]
        if one != other:
            weights += [{one: 1.0, other: -1.0}, {one: 0.5, other: 0.5}]
        found[f"point_{number}"] = pick(random, *weights)
    return found


def keys_of_body(random: np.random.Generator, drawn: DrawnMatrices) -> dict[str, Any]:
    """Return the keys of a body by matrices besides its files."""
    keys: dict[str, Any] = {"kind": "matrices", "modes": pick(random, 1, 3, 6, 12, 20, 64, "auto")}
    keys |= pick(random, {}, {"residual": False}, {"residual": True})
    keys |= pick(random, {}, {"damping_ratio": 0.02})
    if random.random() < 0.3:
        factors = {"mass": 0.02 * drawn.natural, "stiffness": 0.01 / drawn.natural}
        keys["rayleigh"] = pick(
            random, factors, {"mass": factors["mass"]}, {"stiffness": factors["stiffness"]}
        )
    directions = sorted({drawn.names[place].rpartition(".")[2] for place in drawn.used.tolist()})
    keys |= pick(random, {}, {"base": pick(random, *directions)})
    points = drawn_points(random, drawn)
    return keys | ({"points": points} if points else {})
