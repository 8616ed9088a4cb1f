"""Matrices of small finite-element models: chains, Hermite beams, solids of eight-node elements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sparse

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.orchestrator.structures.matrices import Matrices


def chain_matrices(
    masses: Sequence[float], stiffnesses: Sequence[float], dampings: Sequence[float] = ()
) -> Matrices:
    """Return a chain of masses, with one spring more than masses: the last ties the far end to the ground."""
    count = len(masses)
    rows = np.eye(count + 1, count) - np.eye(count + 1, count, -1)

    def summed(values: Sequence[float]) -> sparse.csc_array:
        return sparse.csc_array(rows.T @ np.diag(values) @ rows)

    damping = summed(dampings) if len(dampings) else None
    names = tuple(f"{number}.x" for number in range(1, count + 1))
    return Matrices(summed(stiffnesses), sparse.csc_array(np.diag(masses)), damping, names)


def hermite_beam(
    elements: int, length: float = 1.0, rigidity: float = 1.0, mass: float = 1.0, clamped: bool = True
) -> Matrices:
    """Return a beam of cubic elements; `mass` is that of a length, and node 0 is clamped."""
    h = length / elements
    stiff = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], dtype=float)
    heavy = np.array(
        [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]], dtype=float
    )
    unit = np.array([1.0, h, 1.0, h])
    size = 2 * (elements + 1)
    found = np.zeros((2, size, size))
    for element in range(elements):
        place = slice(2 * element, 2 * element + 4)
        found[0, place, place] += rigidity / h**3 * np.outer(unit, unit) * stiff
        found[1, place, place] += mass * h / 420.0 * np.outer(unit, unit) * heavy
    names = [f"{node}.{direction}" for node in range(elements + 1) for direction in ("z", "ry")]
    first = 2 if clamped else 0
    stiffness, masses = (sparse.csc_array(each[first:, first:]) for each in found)
    return Matrices(stiffness, masses, None, tuple(names[first:]))


def solid(cells: tuple[int, int, int], size: float, held: bool = True) -> Matrices:
    """Return a steel block of cubes of a size, m; `held`: its nodes at z = 0 are fixed. Nodes are counted from 0."""
    stiff, heavy = _cube(size)
    x, y, z = np.meshgrid(*(np.arange(each) for each in cells), indexing="ij")
    wide, deep = cells[0] + 1, cells[1] + 1
    corners = [(dx, dy, dz) for dz in (0, 1) for dy in (0, 1) for dx in (0, 1)]
    nodes = np.stack([(((z + dz) * deep + y + dy) * wide + x + dx).ravel() for dx, dy, dz in corners], axis=1)
    places = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 24)
    rows, columns = np.repeat(places, 24, axis=1).ravel(), np.tile(places, (1, 24)).ravel()
    count = 3 * wide * deep * (cells[2] + 1)
    first = 3 * wide * deep if held else 0
    found = []
    for each in (stiff, heavy):
        whole = sparse.coo_array((np.tile(each.ravel(), len(nodes)), (rows, columns)), shape=(count, count))
        found.append(whole.tocsc()[first:, first:].tocsc())
    names = tuple(f"{place // 3}.{'xyz'[place % 3]}" for place in range(first, count))
    return Matrices(found[0], found[1], None, names)


def _cube(size: float) -> tuple[Floats, Floats]:
    """Return the stiffness and mass of a steel cube by two Gauss points in each direction."""
    modulus, ratio, density = 210e9, 0.3, 7850.0
    first, shear = modulus * ratio / ((1 + ratio) * (1 - 2 * ratio)), modulus / (2 * (1 + ratio))
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += first
    corners = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
    stiff, heavy, weight = np.zeros((24, 24)), np.zeros((24, 24)), (size / 2) ** 3
    for point in corners / np.sqrt(3.0):
        factors = 1 + corners * point
        slopes = [
            corners[:, i] * factors[:, (i + 1) % 3] * factors[:, (i + 2) % 3] / (4 * size) for i in range(3)
        ]
        strain, motion = np.zeros((6, 24)), np.zeros((3, 24))
        for i in range(3):
            strain[i, i::3] = slopes[i]
            motion[i, i::3] = factors.prod(axis=1) / 8
        for row, (i, j) in enumerate(((0, 1), (1, 2), (0, 2)), 3):
            strain[row, i::3], strain[row, j::3] = slopes[j], slopes[i]
        stiff += weight * strain.T @ law @ strain
        heavy += weight * density * motion.T @ motion
    return stiff, heavy
