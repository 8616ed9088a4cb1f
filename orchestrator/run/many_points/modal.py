"""Bodies of rigid stops as modes: the numbers that a body's FMU makes of its parameters, as arrays over points.

A mode is q'' + 2 decay q' + stiffness q = force cos(phase) + held, a displacement shape . q, and an impulse at a
contact adds `impulse` to q'. The coordinates are those that a state is kept in: the displacement of an oscillator, the
modal displacements of a beam; of a chain its mass-normalised modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.modes import Boundary, ChainModes, beam_modes, chain_modes
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import BeamBody, ChainBody, OscillatorBody

Floats = NDArray[np.float64]
Numbers = Mapping[str, float]
Columns = Mapping[str, Floats]

OF_THE_RUN = ("forcing.", "contact_tolerance", "force", "displacement_start", "velocity_start", "modal_")
"""Beginnings of the names of parameters that change no mode."""
OF_A_STOP = (".position", ".restitution", ".yield_velocity")
"""Likewise their ends."""


@dataclass(frozen=True, slots=True)
class Structure:
    """The modes of a chain or a beam.

    Attributes
    ----------
    frequencies, damping_ratios : ndarray, shape (mode,)
        rad/s, 1.
    mass : float
        The modal mass, kg; 1 of a chain.
    load : ndarray, shape (mode, amplitude)
        Force on each mode over its mass, for 1 of each amplitude of the forcing.
    held : ndarray, shape (mode,)
        Likewise for a constant force of 1 N.
    observed : ndarray, shape (mode,)
        Shape at the point that is recorded.
    contacts : ndarray, shape (contact, mode)
        At each stop.
    to_state, from_state : ndarray, shape (element, mode) and (mode, element)
        From modes to the displacements that are the body's state, and back.
    """

    frequencies: Floats
    damping_ratios: Floats
    mass: float
    load: Floats
    held: Floats
    observed: Floats
    contacts: Floats
    to_state: Floats
    from_state: Floats


@dataclass(frozen=True, slots=True)
class ModalPoints:
    """Points as modes: arrays of shape (mode, point), (contact, point) or (contact, mode, point).

    Attributes
    ----------
    structures : tuple of Structure
        Of a chain or a beam: those that the points have.
    structure : ndarray of int, shape (point,)
        Which one each has.
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
    structures: tuple[Structure, ...] = ()
    structure: NDArray[np.int64] | None = None

    def states(self, q: Floats, p: Floats, points: NDArray[np.int64]) -> Floats | None:
        """Return the whole states of structures, shape (point, 2 element); None of an oscillator, which needs none.

        Parameters
        ----------
        q, p : ndarray, shape (mode, point)
            Of all points.
        points : ndarray of int
            Those that are wanted.
        """
        if self.structure is None:
            return None
        found = np.empty((len(points), 2 * self.structures[0].to_state.shape[0]))
        for number, structure in enumerate(self.structures):
            own = self.structure[points] == number
            shapes = structure.to_state.T[..., None]
            halves = [_weighted(shapes, coordinates[:, points[own]]) for coordinates in (q, p)]
            found[own] = np.concatenate(halves).T
        return found


def row_of(numbers: Numbers, name: str, count: int) -> Floats:
    """Return an array among parameters, by the names `name[1]`, ...; what is not there is 0."""
    return np.array([numbers.get(f"{name}[{i}]", 0.0) for i in range(1, count + 1)])


def modes_of_chain(numbers: Numbers, masses: int) -> ChainModes:
    """Return the modes of a chain with these parameters of its FMU."""
    return chain_modes(
        row_of(numbers, "mass", masses),
        np.append(row_of(numbers, "stiffness", masses), numbers["far_stiffness"]),
        np.append(row_of(numbers, "damping", masses), numbers["far_damping"]),
    )


def mass_of_beam(numbers: Numbers) -> float:
    """Return the mass of a beam with these parameters of its FMU, kg."""
    density = numbers.get("mass_per_length") or numbers["density"] * numbers["width"] * numbers["thickness"]
    return density * numbers["length"]


def structure_of(scene: Scene, numbers: Numbers, integers: Mapping[str, int]) -> Structure | None:
    """Return the modes of a chain or a beam; None where its damping couples them, or it is not tied to the ground.

    Parameters
    ----------
    scene : Scene
    numbers, integers : mapping
        Parameters of the body's FMU.
    """
    return (
        _chain(scene, numbers, integers)
        if isinstance(scene.body, ChainBody)
        else _beam(scene, numbers, integers)
    )


def _chain(scene: Scene, numbers: Numbers, integers: Mapping[str, int]) -> Structure | None:
    masses = integers["masses"]
    kept = integers["modes"] or masses
    modes = modes_of_chain(numbers, masses)
    if not modes.is_classical or not modes.frequencies[0] > 0.0:
        return None
    shapes = modes.shapes[:, :kept]
    hit = [integers[f"contact[{k}].mass_number"] - 1 for k in range(1, len(scene.stops) + 1)]
    return Structure(
        modes.frequencies[:kept],
        modes.damping_ratios[:kept],
        1.0,
        shapes.T,
        np.zeros(kept),
        shapes[integers["observed_mass"] - 1],
        shapes[hit].reshape(-1, kept),
        shapes,
        shapes.T * row_of(numbers, "mass", masses),
    )


def _beam(scene: Scene, numbers: Numbers, integers: Mapping[str, int]) -> Structure:
    body = cast("BeamBody", scene.body)
    count, length, mass = integers["modes"], numbers["length"], mass_of_beam(numbers)
    area_moment = numbers.get("width", 0.0) * numbers.get("thickness", 0.0) ** 3 / 12.0
    rigidity = numbers.get("flexural_rigidity") or numbers["youngs_modulus"] * area_moment
    modes = beam_modes(cast("Boundary", body.boundary.replace("-", "_")), count)
    natural = modes.eigenvalues**2 * (np.sqrt(rigidity / (mass / length)) / length**2)
    ratios = row_of(numbers, "damping_ratio", count) + 0.5 * (
        numbers.get("rayleigh.mass", 0.0) / natural + numbers.get("rayleigh.stiffness", 0.0) * natural
    )
    places = [numbers["forcing_location"], numbers["sensor_location"]]
    places += [numbers[f"contact[{k}].location"] for k in range(1, len(scene.stops) + 1)]
    shapes = modes.shapes(places)
    load = {
        "force": shapes[0] / mass,
        "uniform": length * modes.participation / mass,
        "mode": (np.arange(1, count + 1) == integers.get("forcing.mode", 0)) / mass,
        "base_acceleration": -modes.participation,
    }[scene.forcing.kind if scene.forcing is not None else "force"]
    same = np.eye(count)
    return Structure(
        natural, ratios, mass, load[:, None], shapes[0] / mass, shapes[1], shapes[2:], same, same
    )


def modal_points(scene: Scene, columns: Columns, integers: Mapping[str, int]) -> ModalPoints:
    """Return points as modes; one that is no body of such modes is all NaN.

    Parameters
    ----------
    scene : Scene
        Of the short form, with restitution stops.
    columns : mapping of str to ndarray, shape (point,)
        Parameters of the body's FMU.
    integers : mapping of str to int
        Those that all points have in common.
    """
    if isinstance(scene.body, OscillatorBody):
        return _oscillators(columns, len(scene.stops))
    names = [name for name in columns if not name.startswith(OF_THE_RUN) and not name.endswith(OF_A_STOP)]
    kinds, which = _kinds(np.stack([columns[name] for name in names]))
    none = _no_structure(scene, integers)
    found = [
        _structure_or(none, scene, dict(zip(names, kind.tolist(), strict=True)), integers) for kind in kinds.T
    ]
    return _structures(columns, tuple(found), which)


def _structure_or(none: Structure, scene: Scene, numbers: Numbers, integers: Mapping[str, int]) -> Structure:
    try:
        with np.errstate(all="ignore"):
            found = structure_of(scene, numbers, integers)
    except (VibroimpactError, ArithmeticError, ValueError):
        return none  # its body says what is wrong
    return none if found is None else found


def _no_structure(scene: Scene, integers: Mapping[str, int]) -> Structure:
    """Return what stands for modes that there are not."""
    elements = integers["masses"] if isinstance(scene.body, ChainBody) else integers["modes"]
    modes = integers["modes"] or elements
    loads = elements if isinstance(scene.body, ChainBody) else 1
    row, square = np.full(modes, np.nan), np.full((modes, elements), np.nan)
    contacts = np.full((len(scene.stops), modes), np.nan)
    return Structure(row, row, 1.0, np.full((modes, loads), np.nan), row, row, contacts, square.T, square)


def _kinds(numbers: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Return the different columns of a table, and which of them each column is."""
    if (numbers == numbers[:, :1]).all():
        return numbers[:, :1], np.zeros(numbers.shape[1], dtype=np.int64)
    kinds, which = np.unique(numbers, axis=1, return_inverse=True)
    return kinds, which.reshape(-1)


def _oscillators(columns: Columns, contacts: int) -> ModalPoints:
    mass, count = columns["mass"], len(columns["mass"])
    none, one = np.zeros(count), np.ones((1, count))
    with np.errstate(all="ignore"):  # what is no number is refused by its body
        return ModalPoints(
            stiffness=(columns["stiffness"] / mass)[None],
            decay=(0.5 * columns["damping"] / mass)[None],
            force=(columns.get("forcing.amplitude", none) / mass)[None],
            held=(columns.get("force", none) / mass)[None],
            shape=np.ones((contacts, 1, count)),
            impulse=np.repeat((1.0 / mass)[None, None], contacts, axis=0),
            observed=one,
            start_q=columns["displacement_start"][None],
            start_p=columns["velocity_start"][None],
        )


def _structures(columns: Columns, structures: tuple[Structure, ...], which: NDArray[np.int64]) -> ModalPoints:
    def each(*values: Floats) -> Floats:
        """Of the structures, shape (..., mode): of the points, shape (..., mode, point)."""
        return np.stack(values, axis=-1)[..., which]

    first = structures[0]
    none, elements = np.zeros(len(which)), first.from_state.shape[1]
    amplitudes = _rows(columns, "forcing.amplitude", first.load.shape[1])
    prefix = "" if "displacement_start[1]" in columns else "modal_"
    start = [_rows(columns, f"{prefix}{name}_start", elements) for name in ("displacement", "velocity")]
    load = each(*(structure.load.T for structure in structures))
    back = each(*(structure.from_state.T for structure in structures))
    contacts = each(*(structure.contacts for structure in structures))
    mass = np.array([structure.mass for structure in structures])[which]
    with np.errstate(all="ignore"):
        return ModalPoints(
            stiffness=each(*(structure.frequencies**2 for structure in structures)),
            decay=each(*(structure.frequencies * structure.damping_ratios for structure in structures)),
            force=_weighted(load, amplitudes),
            held=each(*(structure.held for structure in structures)) * columns.get("force", none),
            shape=contacts,
            impulse=contacts / mass,
            observed=each(*(structure.observed for structure in structures)),
            start_q=_weighted(back, start[0]),
            start_p=_weighted(back, start[1]),
            structures=structures,
            structure=which,
        )


def _rows(columns: Columns, name: str, count: int) -> Floats:
    """Return columns `name[1]`, ..., or the one `name`, shape (count, point); what is not there is 0."""
    none = np.zeros(len(next(iter(columns.values()))))
    if count == 1 and name in columns:
        return columns[name][None]
    return np.stack([columns.get(f"{name}[{i}]", none) for i in range(1, count + 1)])


def _weighted(weights: Floats, values: Floats) -> Floats:
    """Return weights (element, row, point) times values (element, point), summed: the same bits for any points."""
    total: Floats = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        total = total + weight * value
    return total
