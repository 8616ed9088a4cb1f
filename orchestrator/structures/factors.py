"""Static flexibility of a structure by the factors of its stiffness, beside its rigid-body modes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.confinement import available_memory
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.checking import scaled
from vibroimpact.orchestrator.structures.matrices import Matrices, Sparse
from vibroimpact.orchestrator.structures.ordering import elimination_order

BYTES_PER_ENTRY = 11
"""Memory of an entry of SuperLU's factors, bytes: 8, its share of indices and of room to work, measured for solids."""
ROUNDING = 16.0 * float(np.finfo(np.float64).eps)
"""Sum over the moduli of its terms, below which it is rounding."""
DIGITS = 5e-14
"""Strain energy over the moduli of its terms, below which a motion is rigid: rounding of the 14 digits of CalculiX."""
CLEARLY_HELD = 1e-11
"""Eigenvalue of a stiffness with a diagonal of 1, above which no motion is rigid."""
FEW_DIGITS = range(8, 13)
"""Decimal digits of all entries of a stiffness that count as the rounding of a program: Nastran writes 10.

With fewer digits numbers may be written by hand, and exact; with more, `DIGITS` holds.
"""
GAP = 100.0
"""Strain energy of the first elastic mode over the rounding of few digits, above which the motions below are rigid."""
MOST_LOOKED_AT = 2048
"""Most entries whose digits are counted."""
SHIFTS = (1e-14, 1e-11, 1e-8)
"""Stiffness that holds rigid-body modes while they are sought, over the diagonal; larger ones for fewer digits."""
MOST_RIGID = 64
_PASSES = 20
_DIGITS_OF_DOUBLES = 17


class Flexibility:
    """Displacements for static loads, on the complement of the rigid-body modes.

    Parameters
    ----------
    matrices : Matrices
        As `checked`.

    Attributes
    ----------
    rigid : ndarray, shape (freedom, mode)
        Rigid-body modes, mass-normalised.
    entries : int
        Number of entries of the factors, to some per cent.
    remarks : tuple of str

    Raises
    ------
    UsageError
        The factors do not fit into the memory. The stiffness has a motion of negative energy.
        More than 64 motions have no energy, or one has no mass either.
    """

    def __init__(self, matrices: Matrices) -> None:
        self._mass = matrices.mass
        self.remarks: tuple[str, ...] = ()
        order, self.entries = elimination_order(matrices.stiffness, matrices.freedoms)
        _refuse_beyond_memory(self.entries, len(order))
        self._order, self._names = order, [matrices.freedoms[place] for place in order]
        self._matrix, self._scale = scaled(matrices.stiffness[order][:, order].tocsc())
        self._free = np.arange(len(order))
        self._digits = decimal_digits(matrices.stiffness.data)
        self._few = 0.5 * 10.0 ** (1 - self._digits) if self._digits in FEW_DIGITS else 0.0
        self._factors = _factors(self._matrix)
        motions = np.zeros((len(order), 0))
        if self._factors is None or self._is_doubtful():
            self._factors, motions = None, self._rigid_motions()
            holding, self._free = _held(motions)
            # each motion moves one of them: bodies of unlike mass apart from each other
            motions = np.asarray(np.linalg.solve(motions[holding].T, motions.T).T)
            self._factors = _factors(self._matrix[self._free][:, self._free].tocsc())
            if self._factors is None:
                raise UsageError(
                    "expected stiffness that is singular for rigid-body modes alone, got another."
                )
        self.rigid = self._mass_normalised(motions)
        self._momentum = self._mass @ self.rigid

    def __call__(self, loads: Floats) -> Floats:
        """Return the displacements for loads, less their motion as a rigid body, both of shape (freedom, load)."""
        moves = self.rigid.T @ loads
        balanced = loads - self._momentum @ moves
        terms = np.abs(loads) + np.abs(self._momentum) @ np.abs(moves)
        balanced[np.abs(balanced) <= ROUNDING * terms] = 0.0
        found, places = np.zeros_like(balanced), self._order[self._free]
        scale = self._scale[self._free, None]
        found[places] = scale * self._factors.solve(scale * balanced[places])
        return np.asarray(found - self.rigid @ (self._momentum.T @ found))

    # ---- rigid-body modes ----

    def _is_doubtful(self) -> bool:
        """Return whether the stiffness may leave motions without energy: its smallest eigenvalue by three passes."""
        moves = np.random.default_rng(1).normal(size=(len(self._names), min(4, len(self._names))))
        for _ in range(3):
            moves, _ = np.linalg.qr(self._factors.solve(moves))
            if not np.isfinite(moves).all():
                return True
        return bool(
            np.linalg.eigvalsh(moves.T @ (self._matrix @ moves))[0] < max(CLEARLY_HELD, GAP * self._few)
        )

    def _rigid_motions(self) -> Floats:
        """Return orthonormal motions without strain energy, in scaled coordinates, shape (freedom, motion)."""
        for shift in (*SHIFTS, GAP * self._few):
            motions, energies = self._soft_motions(shift)
            lowest = float(energies.min(initial=0.0))
            if -4.0 * lowest > max(shift, DIGITS):
                continue
            rounding = max(_rounding(energies), self._few)
            above = float(energies[energies > rounding].min(initial=np.inf))
            if self._few and above < GAP * rounding and (energies <= rounding).any():
                rounding = _rounding(energies)
                self.remarks += (
                    f"The {self._digits} digits of the stiffness do not tell slow modes from rigid-body modes.",
                )
            elif rounding > DIGITS and (energies <= rounding).any():
                self.remarks += (
                    f"The stiffness has few digits: rigid-body modes have {rounding:.0e} of the energy of its terms.",
                )
            return motions[:, energies <= rounding]
        place = int(np.abs(motions[:, energies.argmin()] * self._scale).argmax())
        raise UsageError(
            "expected stiffness that is positive semi-definite, got negative energy for a motion, mostly of "
            f"{self._names[place]}."
        )

    def _soft_motions(self, shift: float) -> tuple[Floats, Floats]:
        """Return the softest motions, the stiffest of which has strain energy, and their relative energies."""
        from scipy.sparse import diags_array

        count = len(self._names)
        factors = _factors((self._matrix + diags_array(np.full(count, shift))).tocsc())
        if factors is None:
            raise UsageError("expected stiffness that is positive semi-definite, got another.")
        random, block, rigid = np.random.default_rng(2), 8, -1
        moves = random.normal(size=(count, min(block, count)))
        for _ in range(_PASSES):
            moves, _ = np.linalg.qr(factors.solve(moves))
            _, ways = np.linalg.eigh(moves.T @ (self._matrix @ moves))
            moves = moves @ ways
            energies = self._energies(moves)
            found = int((energies <= max(_rounding(energies), self._few)).sum())
            full = found == moves.shape[1] < count
            if full and found > MOST_RIGID:
                raise UsageError(f"expected at most {MOST_RIGID} rigid-body modes, got more.")
            if full:
                more = min(moves.shape[1], count - moves.shape[1])
                moves = np.hstack([moves, random.normal(size=(count, more))])
            elif found == rigid:
                break
            rigid = found
        return moves, energies

    def energies(self, shapes: Floats) -> tuple[Floats, Floats]:
        """Return twice the strain energy x'Kx of motions, shape (freedom, motion), and the sum of its moduli."""
        return self._sums(shapes[self._order] / self._scale[:, None])

    def _sums(self, moves: Floats) -> tuple[Floats, Floats]:
        """Return x'Kx and |x|'|K||x| of motions in scaled coordinates."""
        sizes = np.abs(moves)
        return (moves * (self._matrix @ moves)).sum(axis=0), (sizes * (abs(self._matrix) @ sizes)).sum(axis=0)

    def _energies(self, moves: Floats) -> Floats:
        """Return x'Kx over |x|'|K||x| for each unit motion, in coordinates whose stiffness is about 1."""
        energies, terms = self._sums(moves)
        return np.asarray(energies / np.maximum(terms, 1.0))

    def _mass_normalised(self, motions: Floats) -> Floats:
        moves = np.empty_like(motions)
        moves[self._order] = self._scale[:, None] * motions
        masses = moves.T @ (self._mass @ moves)
        size = np.sqrt(np.abs(masses.diagonal()))
        mass, scale = abs(self._mass), np.empty(len(self._names))
        scale[self._order] = self._scale
        terms = (np.abs(moves) * (mass @ np.abs(moves))).sum(axis=0)
        # a motion without mass has the rounding of its displacements, which heavy unknowns may turn into mass
        rounded = (ROUNDING * np.abs(motions).max(axis=0, initial=0.0)) ** 2 * float(scale @ (mass @ scale))
        values, ways = np.linalg.eigh(masses / np.where(size > 0.0, np.outer(size, size), 1.0))
        if moves.shape[1] and (values[0] < 1e-12 or (size**2 <= ROUNDING * terms + rounded).any()):
            place = int(np.abs(motions @ ways[:, 0]).argmax())
            raise UsageError(
                f"expected mass or stiffness for each motion, got neither for one, mostly of {self._names[place]}."
            )
        return np.asarray(moves @ (ways / size[:, None] / np.sqrt(values)))


def decimal_digits(values: Floats) -> int:
    """Return the fewest significant decimal digits that hold all of some numbers: up to 17 for doubles.

    >>> decimal_digits(np.array([1.5, -2.25, 1.234567891e5]))
    10
    """
    looked_at = values[:: max(1, len(values) // MOST_LOOKED_AT)].tolist()
    digits = 1
    for value in looked_at:
        while digits < _DIGITS_OF_DOUBLES and float(f"{value:.{digits - 1}e}") != value:
            digits += 1
    return digits


def _rounding(energies: Floats) -> float:
    """Return the relative energy up to which a motion is rigid, by the digits of the stiffness: some are negative."""
    return max(DIGITS, -8.0 * float(energies.min(initial=0.0)))


def _held(motions: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the degrees of freedom that hold the rigid motions best, one for each motion, and all others."""
    from scipy.linalg import qr

    count, rigid = motions.shape
    if rigid == 0:
        return np.arange(0), np.arange(count)
    _, _, order = qr(motions.T, mode="economic", pivoting=True)
    return order[:rigid], np.sort(order[rigid:])


def _factors(matrix: Sparse) -> Any:
    """Return the factors of a symmetric matrix in the order of its rows; None if it is singular."""
    from scipy.sparse.linalg import splu

    if matrix.shape[0] == 0:
        return _Nothing()
    try:
        return splu(
            matrix,
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True, "Equil": False},
        )
    except RuntimeError:
        return None
    except MemoryError as problem:
        raise UsageError(
            f"expected factors of the stiffness within the memory, got larger ones for {matrix.shape[0]} unknowns."
        ) from problem


class _Nothing:
    """Factors of a matrix without rows."""

    def solve(self, right: Floats) -> Floats:
        """Return no displacements."""
        return right


def _refuse_beyond_memory(entries: int, unknowns: int) -> None:
    """Raise UsageError if factors do not fit into the available memory."""
    most, needed = available_memory(), BYTES_PER_ENTRY * entries
    if needed > most:
        raise UsageError(
            f"expected factors of the stiffness within the available memory of {most / 1e9:.2g} GB, got "
            f"{needed / 1e9:.2g} GB for {unknowns} unknowns."
        )
