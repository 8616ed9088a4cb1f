"""Mass, damping and stiffness of a structure over named degrees of freedom."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError

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

    def rigid(self, direction: str) -> Floats:
        """Return the motion of all degrees of freedom for 1 m of the base: those whose name ends in `.direction`."""
        return np.array([1.0 if name.rpartition(".")[2] == direction else 0.0 for name in self.freedoms])
