"""Mass, damping and stiffness of a structure over named degrees of freedom."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError

AXES = ("x", "y", "z")
"""Directions of displacements, in which the names of degrees of freedom end."""
GOLDEN = 0.6180339887498949
"""Golden ratio less one."""
Sparse = Any
"""A matrix of scipy.sparse, which carries no types."""


@dataclass(frozen=True, slots=False, eq=False)
class Matrices:
    """The matrices of M x'' + C x' + K x = f.

    Attributes
    ----------
    stiffness, mass : sparse array in columns, shape (freedom, freedom)
        Symmetric, N/m and kg.
    damping : sparse array or None
        N s/m; None without a matrix of its own.
    freedoms : tuple of str
        The name of each degree of freedom, such as `"12.z"`.
    coordinates : ndarray or None, shape (freedom, 3)
        The place of the node of each degree of freedom, m; NaN where it is not known.
    """

    stiffness: Sparse
    mass: Sparse
    damping: Sparse | None
    freedoms: tuple[str, ...]
    coordinates: Floats | None = None

    @cached_property
    def _places(self) -> dict[str, int]:
        return {name: place for place, name in enumerate(self.freedoms)}

    def combination(self, weights: Mapping[str, float]) -> Floats:
        """Return the displacement of a point for 1 m of each degree of freedom, shape (freedom,).

        Raises
        ------
        UsageError
            A degree of freedom is unknown.
        """
        found = np.zeros(len(self.freedoms))
        for name, weight in weights.items():
            if name not in self._places:
                some = ", ".join(self.freedoms[:4])
                raise UsageError(f"expected a degree of freedom such as {some}, got {name!r}.")
            found[self._places[name]] = weight
        return found

    @cached_property
    def _at_nodes(self) -> NDArray[np.bool_]:
        """Whether each degree of freedom is that of a node: one with a known place, or any where no place is known."""
        if self.coordinates is None or np.isnan(self.coordinates).all():
            return np.ones(len(self.freedoms), dtype=np.bool_)
        return np.asarray(~np.isnan(self.coordinates).any(axis=1), dtype=np.bool_)

    def rigid(self, direction: str) -> Floats:
        """Return the motion of all degrees of freedom for 1 m of the base: those whose name ends in `.direction`.

        Degrees of freedom within an element have no place (incompatible modes of C3D8I), and do not follow the base.
        """
        moves = np.array([name.rpartition(".")[2] == direction for name in self.freedoms])
        return np.where(moves & self._at_nodes, 1.0, 0.0)

    def masses(self) -> dict[str, float]:
        """Return the mass that moves with 1 m of the base along each of x, y and z that has degrees of freedom, kg."""
        moves = {direction: self.rigid(direction) for direction in AXES}
        return {name: float(along @ (self.mass @ along)) for name, along in moves.items() if along.any()}

    def centre(self) -> tuple[float, ...]:
        """Return the centre of mass x, y, z, m, of the direction that moves most mass; empty where a place is unknown.

        Row sums of the mass matrix stand for the masses of nodes, which is exact for solid elements.
        """
        moved = self.masses()
        if self.coordinates is None or not moved:
            return ()
        along = self.rigid(max(moved, key=lambda name: moved[name]))
        at_nodes = along > 0.0
        masses, places = (self.mass @ along)[at_nodes], self.coordinates[at_nodes]
        if np.isnan(places).any() or not masses.sum() > 0.0:
            return ()
        return tuple((masses @ places / masses.sum()).tolist())

    def places_of(self, points: Mapping[str, Mapping[str, float]]) -> dict[str, tuple[float, float, float]]:
        """Return the known places of points that are one degree of freedom."""
        found: dict[str, tuple[float, float, float]] = {}
        for name, weights in points.items():
            place = self._places.get(next(iter(weights)), -1) if len(weights) == 1 else -1
            if self.coordinates is not None and place >= 0 and not np.isnan(self.coordinates[place]).any():
                x, y, z = self.coordinates[place].tolist()
                found[name] = x, y, z
        return found

    def spread(self, most: int) -> tuple[str, ...]:
        """Return the names of a number of degrees of freedom, those of nodes that spread over all nodes."""
        nodes: dict[str, list[str]] = {}
        for name, is_at_node in zip(self.freedoms, self._at_nodes.tolist(), strict=True):
            if is_at_node:
                nodes.setdefault(name.rpartition(".")[0] or name, []).append(name)
        groups = list(nodes.values())
        count = min(len(groups), most * len(groups) // max(1, sum(map(len, groups))))
        # multiples of the golden ratio fill [0, 1) evenly, and follow no row of a mesh
        shares = np.arange(count) * GOLDEN % 1.0 if count < len(groups) else np.arange(count) / count
        kept = sorted({int(share * len(groups)) for share in shares.tolist()})
        return tuple(name for place in kept for name in groups[place])
