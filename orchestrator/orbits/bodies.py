"""From a scene to the modes and contacts that its orbits follow from: the numbers that its FMU gets."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits import Contact, ImpactingBody
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.many_points.modal import mass_of_beam, modes_of_chain, row_of, structure_of
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import BeamBody, ChainBody, OscillatorBody
from vibroimpact.orchestrator.scene.models import RestitutionStop

Floats = NDArray[np.float64]
_SIDES = {1: 1.0, 2: -1.0}


def impacting_body(scene: Scene) -> ImpactingBody:
    """Return the modes, the force and the contacts of a scene: of an Oscillator, a Chain or a Beam on rigid stops.

    Parameters
    ----------
    scene : Scene
        Of the short form; its sweep is not looked at.

    Raises
    ------
    UsageError
        Its orbits are not those of modes that fly between restitution stops under one harmonic force.
    """
    _refuse(scene)
    numbers, integers = float_parameters(scene, None), integer_parameters(scene)
    body = scene.body
    if isinstance(body, OscillatorBody):
        return _oscillator(scene, numbers)
    return (
        _chain(scene, numbers, integers) if isinstance(body, ChainBody) else _beam(scene, numbers, integers)
    )


def _refuse(scene: Scene) -> None:
    def refused(where: str, expected: str, got: str) -> UsageError:
        return UsageError(f"{scene.source}: {where}: expected {expected}, got {got}.")

    if not scene.is_lone_body:
        kind = "a replay" if scene.replay is not None else "a scene of components"
        raise refused("body", "an oscillator, a chain or a beam whose orbits are followed", kind)
    if scene.forcing is None or scene.period is None:
        raise refused("forcing", "a harmonic force, which orbits are periodic with", "none")
    if not scene.stops:
        raise refused("stop", "a restitution stop", "none")
    for number, stop in enumerate(scene.stops, start=1):
        if not isinstance(stop, RestitutionStop):
            raise refused(f"stop[{number}].law", '"restitution": impacts without duration', f'"{stop.law}"')
        if stop.yield_velocity > 0.0:
            raise refused(
                f"stop[{number}].yield_velocity", "0 where orbits are followed", f"{stop.yield_velocity:g}"
            )
    if scene.falling_force:
        raise refused(
            "exciter.distance", "0 where orbits are followed", "a force that falls with the distance"
        )


def _harmonic(numbers: dict[str, float]) -> tuple[float, float]:
    return numbers["forcing.angular_frequency"], numbers.get("forcing.phase", 0.0)


def _contacts(
    scene: Scene, numbers: dict[str, float], integers: dict[str, int], shapes: list[Floats]
) -> list[Contact]:
    found = []
    for number, shape in enumerate(shapes, start=1):
        port = f"contact[{number}]"
        if not shape @ shape > 0.0:
            raise UsageError(
                f"{scene.source}: stop[{number}]: expected a point that moves, got one that is held."
            )
        side = _SIDES[integers[f"{port}.side"]]
        found.append(Contact(shape, side, numbers[f"{port}.position"], numbers[f"{port}.restitution"]))
    return found


def _oscillator(scene: Scene, numbers: dict[str, float]) -> ImpactingBody:
    mass, stiffness, damping = (numbers[name] for name in ("mass", "stiffness", "damping"))
    if not stiffness > 0.0:
        raise UsageError(
            f"{scene.source}: body.stiffness: expected a spring where orbits are followed, got none."
        )
    natural, root = np.sqrt(stiffness / mass), np.sqrt(mass)
    shape = np.array([1.0 / root])
    integers = integer_parameters(scene)
    return ImpactingBody(
        np.array([natural]),
        np.array([0.5 * damping / np.sqrt(stiffness * mass)]),
        np.array([numbers["forcing.amplitude"] / root]),
        np.array([numbers.get("force", 0.0) / root]),
        *_harmonic(numbers),
        tuple(_contacts(scene, numbers, integers, [shape] * len(scene.stops))),
        shape,
    )


def modal_displacements(scene: Scene, displacements: Floats) -> Floats:
    """Return displacements of the masses of a chain, or of the modes of a beam, in mass-normalised modes.

    Parameters
    ----------
    scene : Scene
    displacements : array, shape (state, mass or mode)
        m; of an oscillator that of its mass.

    Returns
    -------
    array, shape (state, mode)
        kg^(1/2) m.
    """
    numbers, integers = float_parameters(scene, None), integer_parameters(scene)
    found: Floats
    if isinstance(scene.body, ChainBody):
        masses = integers["masses"]
        kept = integers["modes"] or masses
        shapes = modes_of_chain(numbers, masses).shapes[:, :kept]
        found = (displacements * row_of(numbers, "mass", masses)) @ shapes
    elif isinstance(scene.body, BeamBody):
        found = displacements * np.sqrt(mass_of_beam(numbers))
    else:
        found = displacements * np.sqrt(numbers["mass"])
    return found


def _chain(scene: Scene, numbers: dict[str, float], integers: dict[str, int]) -> ImpactingBody:
    modes = modes_of_chain(numbers, integers["masses"])
    if not modes.is_classical:
        raise UsageError(
            f"{scene.source}: body.dampings: expected damping that does not couple the modes where orbits are "
            "followed, got one that does. Dampings in proportion to the stiffnesses do not."
        )
    if not modes.frequencies[0] > 0.0:
        raise UsageError(
            f"{scene.source}: body.stiffnesses: expected a chain tied to the ground, got one that is loose."
        )
    return _structure(scene, numbers, integers)


def _beam(scene: Scene, numbers: dict[str, float], integers: dict[str, int]) -> ImpactingBody:
    body = cast("BeamBody", scene.body)
    if body.impact_projection != "variational":
        raise UsageError(
            f'{scene.source}: body.impact_projection: expected "variational" where orbits are followed, '
            f'got "{body.impact_projection}".'
        )
    return _structure(scene, numbers, integers)


def _structure(scene: Scene, numbers: dict[str, float], integers: dict[str, int]) -> ImpactingBody:
    found = structure_of(scene, numbers, integers)
    assert found is not None  # a chain that has none is refused
    root = np.sqrt(found.mass)
    amplitudes = row_of(numbers, "forcing.amplitude", found.load.shape[1])
    if "forcing.amplitude" in numbers:
        amplitudes = np.array([numbers["forcing.amplitude"]])
    return ImpactingBody(
        found.frequencies,
        found.damping_ratios,
        found.load @ amplitudes * root,
        numbers.get("force", 0.0) * found.held * root,
        *_harmonic(numbers),
        tuple(_contacts(scene, numbers, integers, list(found.contacts / root))),
        found.observed / root,
    )
