"""Block Lanczos process for the lowest modes of a structure, by its static flexibility: equations.md 6.14."""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.factors import Flexibility
from vibroimpact.orchestrator.structures.matrices import Sparse

BLOCK = 8
"""Vectors of a block: one solution of the factors serves all, and modes of equal frequency are found together."""
CONVERGED = 1e-10
"""Residual of a mode over its flexibility, below which the mode has converged."""
NOTHING_NEW = 1e-14
"""Length of a new vector over the largest flexibility, below which the vector is rounding."""
LEAST = 1e-12
"""Flexibility of a mode over the largest, below which rounding hides the mode."""
AGREE = 1e-3
"""Difference of both squares of a frequency, above which the strain energy is not that of the mode."""
DEPENDENT = 1e-13
"""Eigenvalue of the correlations of a block, below which its vectors are dependent."""
SURPLUS = 320
"""Vectors beyond four for each mode, after which the process has failed."""
_LOOKS = 3
"""Blocks after a fresh random one, before the modes count as complete."""


class Lanczos:
    """Elastic modes of K phi = w^2 M phi, the lowest first, with full orthogonalisation.

    Parameters
    ----------
    flexibility : Flexibility
    mass : sparse array, shape (freedom, freedom)
    """

    def __init__(self, flexibility: Flexibility, mass: Sparse) -> None:
        self._flexibility, self._mass = flexibility, mass
        self._random = np.random.default_rng(4)
        count = mass.shape[0]
        self._room = np.empty((count, 8 * BLOCK), order="F")
        self._heavy = np.zeros((count, 0))
        self._projected = np.zeros((0, 0))
        self._done = 0
        self._largest = 0.0
        self._append(self._fresh())

    @property
    def _basis(self) -> Floats:
        """Vectors that are orthonormal in the mass, shape (freedom, vector)."""
        return self._room[:, : len(self._projected)]

    def modes(self, count: int) -> tuple[Floats, Floats]:
        """Return w^2, ascending, and mass-normalised shapes, shape (freedom, mode); fewer if no more exist.

        Raises
        ------
        UsageError
            The process does not converge.
        """
        most = 4 * count + SURPLUS
        self._converge(count, most)
        found = self._ritz()[0][:count]
        while True:
            grown = self._append(self._fresh())
            for _ in range(_LOOKS):
                self._step(most)
            self._converge(count, most)
            before, found = found, self._ritz()[0][:count]
            is_same = len(found) == len(before) and np.allclose(found, before, rtol=1e-9, atol=0.0)
            if is_same and (grown == 0 or self._done < self._basis.shape[1]):
                break
        values, ways = self._ritz()
        shapes = self._basis[:, : self._done] @ ways[:, :count]
        squares = self._squares(values[:count], shapes)
        order = np.argsort(squares)
        return squares[order], shapes[:, order]

    def _squares(self, values: Floats, shapes: Floats) -> Floats:
        """Return w^2 from the flexibility of slow modes, and from the strain energy of fast ones: where it is exact."""
        energies, terms = self._flexibility.energies(shapes)
        is_fast = terms * values < self._largest * energies
        # motions without mass may add energy to a fast mode
        is_fast &= np.abs(energies * values - 1.0) < AGREE
        return np.asarray(np.where(is_fast, energies, 1.0 / values))

    def _converge(self, count: int, most: int) -> None:
        """Process blocks until the first modes have converged, or no block is left."""
        while not self._has_converged(count):
            self._step(most)

    def _ritz(self) -> tuple[Floats, Floats]:
        """Return the flexibilities 1/w^2 of the projected structure, descending, and their vectors."""
        values, ways = np.linalg.eigh(self._projected[: self._done, : self._done])
        values, ways = values[::-1], ways[:, ::-1]
        if len(values) and values[-1] < -1e-9 * values[0]:
            raise UsageError(
                "expected stiffness that is positive semi-definite, got a mode of negative stiffness."
            )
        above = values > LEAST * self._largest
        return values[above], ways[:, above]

    def _has_converged(self, count: int) -> bool:
        if self._done == self._basis.shape[1]:
            return True
        values, ways = self._ritz()
        if len(values) < count:
            return False
        rest = np.linalg.norm(self._projected[self._done :, : self._done] @ ways[:, :count], axis=0)
        return bool((rest <= CONVERGED * values[:count]).all())

    def _step(self, most: int) -> None:
        """Process the next block, if there is one."""
        start, end = self._done, min(self._done + BLOCK, self._basis.shape[1])
        if start == end:
            return
        if end > most:
            raise UsageError(f"expected modes that converge within {most} vectors, got others.")
        moved = self._flexibility(self._heavy[:, : end - start])
        near = max(start - 2 * BLOCK, 0)  # nearly all that the basis has of these motions
        own = np.zeros((self._basis.shape[1], end - start))
        own[near:], rest = self._apart(moved, near)
        more, rest = self._apart(rest)
        own += more
        self._done, self._heavy = end, self._heavy[:, end - start :]
        self._largest = max(self._largest, float(np.abs(own).max(initial=0.0)))
        self._projected[:, start:end], self._projected[start:end, :] = own, own.T
        grown = self._append(rest)
        if grown:
            beside = self._heavy[:, -grown:].T @ moved
            self._projected[-grown:, start:end], self._projected[start:end, -grown:] = beside, beside.T

    def _apart(self, moves: Floats, first: int = 0) -> tuple[Floats, Floats]:
        """Return the coefficients of motions in the basis from a vector on, and the rest of the motions."""
        basis = self._basis[:, first:]
        own = basis.T @ (self._mass @ moves)
        return own, moves - basis @ own

    def _append(self, moves: Floats) -> int:
        """Append the new directions of a block to the basis, and return their number."""
        moves = self._normalised(moves, NOTHING_NEW * self._largest)
        moves = self._normalised(self._apart(moves)[1], 0.5)
        grown, start = int(moves.shape[1]), len(self._projected)
        if start + grown > self._room.shape[1]:
            self._room = np.concatenate([self._room, np.empty_like(self._room)], axis=1)
        self._room[:, start : start + grown] = moves
        self._projected = np.pad(self._projected, (0, grown))
        self._heavy = np.hstack([self._heavy, self._mass @ moves])
        return grown

    def _normalised(self, moves: Floats, least: float) -> Floats:
        """Return mass-normalised directions of a block, without motions below a length."""
        sizes = np.sqrt(np.maximum((moves * (self._mass @ moves)).sum(axis=0), 0.0))
        moves = moves[:, sizes > least] / sizes[sizes > least]
        values, ways = np.linalg.eigh(moves.T @ (self._mass @ moves))
        above = values > DEPENDENT
        return np.asarray(moves @ (ways[:, above] / np.sqrt(values[above])))

    def _fresh(self) -> Floats:
        """Return random motions that masses can have."""
        count = self._mass.shape[0]
        found = self._flexibility(self._mass @ self._random.normal(size=(count, min(BLOCK, count))))
        return self._apart(found)[1]
