"""Bodies of several modes at the points of a sweep: points of equal structure share one computation."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.body_points import BodyPoints, ModalPoints, row_of, rows_of, weighted
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody, Numbers, contacts_of
from vibroimpact.fmus.errors import VibroimpactError

OF_THE_RUN = (
    *("forcing.", "contact_tolerance", "force", "displacement_start", "velocity_start", "modal_"),
    *("displacement_limit", "mode.displacement_start", "mode.velocity_start"),
    *("mode.sine", "sine[", "mode.signal", "signal[", "table."),
)
"""Prefixes of parameter names that do not change the modes."""
OF_A_STOP = (".position", ".restitution", ".yield_velocity")
"""Suffixes of parameter names that do not change the modes."""
DIAGONAL = 1e-9
"""Off-diagonal modal damping, relative to the two diagonal terms, up to which the damping leaves modes uncoupled."""
ROUNDING = 1e-14
"""The same for two modes of a body with coupled modes, in lanes: rounding of the modal damping."""


@dataclass(frozen=True, slots=True)
class Structure:
    """Modes of a chain, a beam, or several bodies."""

    frequencies: Floats
    """Natural angular frequencies, rad/s, shape (mode,)."""
    damping_ratios: Floats
    """Damping ratios, shape (mode,)."""
    mass: float
    """Modal mass, kg; 1 where modes are mass-normalised."""
    load: Floats
    """Modal force over modal mass, per unit of each amplitude of the forcing, shape (mode, amplitude)."""
    held: Floats
    """Modal force over modal mass of a constant force of 1 N, shape (mode,)."""
    observed: Floats
    """Value of each shape at the recorded point, shape (mode,)."""
    contacts: Floats
    """Value of each shape at each stop, shape (contact, mode)."""
    to_state: Floats
    """Matrix from modes to the displacements in the state, shape (element, mode)."""
    from_state: Floats
    """Inverse of `to_state`, shape (mode, element)."""
    coupling: Floats | None = None
    """Damping that couples the modes, or damps one without a spring, 1/s, shape (mode, mode); None: ratios alone."""

    @property
    def decays(self) -> Floats:
        """Half the damping of each mode by itself, 1/s, shape (mode,)."""
        if self.coupling is None:
            return np.abs(self.frequencies) * self.damping_ratios
        return np.asarray(0.5 * self.coupling.diagonal())

    @property
    def is_coupled(self) -> bool:
        """Whether modes damp each other."""
        return self.coupling is not None and couples(self.coupling)

    @property
    def between(self) -> Floats:
        """Damping between the modes, 1/s, shape (mode, mode); 0 beside the diagonal where it is rounding."""
        own = np.diag(2.0 * self.decays)
        if self.coupling is None or not self.is_coupled:
            return own
        size = np.add.outer(self.coupling.diagonal(), self.coupling.diagonal())
        return np.where(np.abs(self.coupling) > ROUNDING * size, self.coupling, own)


def couples(damping: Floats) -> bool:
    """Return whether a modal damping matrix couples the modes, by more than `DIAGONAL`.

    >>> couples(np.diag([0.1, 0.0])), couples(np.array([[0.1, 0.01], [0.01, 0.1]]))
    (False, True)
    """
    own = np.abs(damping.diagonal())
    off = np.abs(damping - np.diag(damping.diagonal()))
    return bool((off > DIAGONAL * (own[:, None] + own)).any())


def ratios_of(damping: Floats, frequencies: Floats) -> Floats:
    """Return the damping ratios on the diagonal of a modal damping matrix (1/s); 0 without a spring.

    >>> ratios_of(np.diag([0.1, 0.4]), np.array([0.0, 2.0])).tolist()
    [0.0, 0.1]
    """
    moves = frequencies != 0.0
    sizes = np.where(moves, np.abs(frequencies), 1.0)
    return np.where(moves, damping.diagonal() / (2.0 * sizes), 0.0)


class StructurePoints(BodyPoints):
    """Bodies of several modes: a subclass computes the modes from the parameters of one point."""

    START: str
    """Prefix of the names of start values, which set masses or modes."""

    @abstractmethod
    def structure_of(self, numbers: Numbers) -> Structure:
        """Return the modes of one point; a frequency of 0 where nothing ties masses to the ground."""

    @property
    @abstractmethod
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of modes, of elements of a state, and of amplitudes of the forcing."""

    @cached_property
    def _kinds(self) -> tuple[tuple[Structure, ...], NDArray[np.int64]]:
        """Distinct structures among the points, and the number of the structure of each point, shape (point,)."""
        names = [n for n in self.floats if not n.startswith(OF_THE_RUN) and not n.endswith(OF_A_STOP)]
        kinds, which = _different(np.stack([self.floats[name] for name in names]))
        return tuple(
            self._structure_or_nan(dict(zip(names, one.tolist(), strict=True))) for one in kinds.T
        ), which

    def _structure_or_nan(self, numbers: Numbers) -> Structure:
        """Return the modes of one point; all NaN if it has none."""
        try:
            with np.errstate(all="ignore"):
                return self.structure_of(numbers)
        except (VibroimpactError, ArithmeticError, ValueError):
            return self._no_structure()  # the body itself reports the problem

    def _no_structure(self) -> Structure:
        modes, elements, loads = self.sizes
        row, square = np.full(modes, np.nan), np.full((modes, elements), np.nan)
        contacts = np.full((self.stops, modes), np.nan)
        return Structure(row, row, 1.0, np.full((modes, loads), np.nan), row, row, contacts, square.T, square)

    def in_state_coordinates(self) -> ModalPoints:
        """Return the points as modes, in the coordinates of their states: see `BodyPoints`."""
        columns, (structures, which) = self.floats, self._kinds

        def each(*values: Floats) -> Floats:
            """Return values of structures, each of shape (..., mode), for all points: shape (..., mode, point)."""
            return np.stack(values, axis=-1)[..., which]

        _, elements, loads = self.sizes
        none = np.zeros(len(which))
        start = [
            rows_of(columns, f"{self.START}{name}_start", elements) for name in ("displacement", "velocity")
        ]
        load = each(*(structure.load.T for structure in structures))
        back = each(*(structure.from_state.T for structure in structures))
        contacts = each(*(structure.contacts for structure in structures))
        mass = np.array([structure.mass for structure in structures])[which]
        coupled = any(structure.is_coupled for structure in structures)
        with np.errstate(all="ignore"):
            return ModalPoints(
                stiffness=each(*(structure.frequencies**2 for structure in structures)),
                decay=each(*(structure.decays for structure in structures)),
                force=weighted(load, rows_of(columns, "forcing.amplitude", loads)),
                held=each(*(structure.held for structure in structures)) * columns.get("force", none),
                shape=contacts,
                impulse=contacts / mass,
                observed=each(*(structure.observed for structure in structures)),
                start_q=weighted(back, start[0]),
                start_p=weighted(back, start[1]),
                coupling=each(*(structure.between for structure in structures)) if coupled else None,
                to_state=tuple(structure.to_state for structure in structures),
                kind=which,
            )

    @property
    def natural_frequencies(self) -> Floats:
        """Natural angular frequencies of one point: see `BodyPoints`."""
        return self.structure_of(self.floats).frequencies

    def mass_normalised(self) -> ImpactingBody:
        """Return one point as mass-normalised modes under its harmonic force: see `BodyPoints`."""
        numbers = self.floats
        found = self.structure_of(numbers)
        root = np.sqrt(found.mass)
        amplitudes = row_of(numbers, "forcing.amplitude", found.load.shape[1])
        if "forcing.amplitude" in numbers:
            amplitudes = np.array([numbers["forcing.amplitude"]])
        return ImpactingBody(
            found.frequencies,
            found.damping_ratios,
            found.load @ amplitudes * root,
            numbers.get("force", 0.0) * found.held * root,
            numbers["forcing.angular_frequency"],
            numbers.get("forcing.phase", 0.0),
            contacts_of(found.contacts / root, numbers, self.integers),
            found.observed / root,
            found.coupling,
        )


def _different(numbers: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Return the distinct columns of a table, and the number of the distinct column at each place."""
    if (numbers == numbers[:, :1]).all():
        return numbers[:, :1], np.zeros(numbers.shape[1], dtype=np.int64)
    kinds, which = np.unique(numbers, axis=1, return_inverse=True)
    return kinds, which.reshape(-1)
