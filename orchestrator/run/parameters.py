"""From a scene to its body's FMU: which one, its parameters, and the state that a continuation carries."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from vibroimpact.fmus.core.contact_laws import contact_law
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import BeamBody, ChainBody, OscillatorBody
from vibroimpact.orchestrator.scene.fields import fmu_variables_of
from vibroimpact.orchestrator.scene.keys import MODES
from vibroimpact.orchestrator.scene.measuring_models import Exciter
from vibroimpact.orchestrator.scene.models import Forcing, RestitutionStop
from vibroimpact.orchestrator.scene.places import (
    forcing_location,
    observed_location,
    observed_mass,
    stop_location,
    stop_mass,
)

if TYPE_CHECKING:
    from vibroimpact.fmus.core import Boundary

Floats = NDArray[np.float64]
FMU_NAMES = {"oscillator": "Oscillator", "chain": "Chain", "beam": "Beam"}
SIDE_NUMBERS = {"upper": 1, "lower": 2}
BOUNDARY_NUMBERS = {"clamped-free": 1, "clamped-clamped": 2, "clamped-pinned": 3, "pinned-pinned": 4}
FORCING_NUMBERS = {"force": 1, "uniform": 2, "mode": 3, "base_acceleration": 4}
PROJECTION_NUMBERS = {"variational": 1, "collocation": 2}


def float_parameters(scene: Scene, start: tuple[float, ...] | None) -> dict[str, float]:
    """Return the real parameters of the body's FMU, by variable name, SI.

    Parameters
    ----------
    scene : Scene
        A scene of the short form.
    start : tuple of float or None
        State carried over from the run before, at forcing phase 0: of an oscillator displacement (m) and
        velocity (m/s), else the values of `state_variables`. What lies beyond a rigid stop (the stop moved)
        is put on it, at rest. None: the scene's own start.
    """
    parameters = _own_floats(scene) | contact_floats(scene)
    if scene.forcing is not None:
        parameters |= named_numbers(scene.forcing)
    if scene.exciter is not None:
        parameters |= _exciter_floats(scene, scene.exciter, parameters)
    parameters |= named_numbers(scene.execution)
    if start is not None:
        parameters |= _carried(scene, start)
        if scene.period is not None:
            parameters["forcing.phase"] = 0.0
    return parameters


def exported_floats(scene: Scene) -> dict[str, float]:
    """Return the real parameters of the body's FMU in other tools, which know nothing of the scene.

    They are `float_parameters`, but for a base that moves under an oscillator or a chain. A run gives such a body
    the inertial force, and adds the base to the accelerations itself; an export has the base.
    """
    parameters, forcing = float_parameters(scene, None), scene.forcing
    if forcing is None or forcing.kind != "base_acceleration" or isinstance(scene.body, BeamBody):
        return parameters
    forces = [name for name in parameters if name.startswith("forcing.amplitude")]
    return parameters | dict.fromkeys(forces, 0.0) | {"forcing.base_acceleration": forcing.scalar_amplitude}


def named_numbers(table: BaseModel, size: int = 0) -> dict[str, float]:
    """Return the numbers of a table of a scene by the names that its fields say they have in the FMU, SI.

    Parameters
    ----------
    table : BaseModel
        What it leaves out, and has no default, is left out.
    size : int
        Elements of each array: masses or modes.
    """
    parameters: dict[str, float] = {}
    for variable in fmu_variables_of(type(table)):
        value = getattr(table, variable.key)
        if value is None or (variable.is_told_if_given and variable.attribute not in table.model_fields_set):
            continue
        own = numbered(variable.name, each(value, size)) if variable.is_array else {variable.name: value}
        parameters |= own
    return parameters


def _exciter_floats(scene: Scene, exciter: Exciter, forced: Mapping[str, float]) -> dict[str, float]:
    """Return the force of an exciter: its amplitude is in V, its offset an input of the body, for a run to change.

    A force that falls with the distance is not known before: it is all input, see `measuring.held_exciter`.
    """
    if scene.falling_force:
        parameters = dict.fromkeys(forced.keys() & {"forcing.amplitude"}, 0.0)
        if isinstance(scene.body, BeamBody):
            parameters["sensor[1].location"] = forced["forcing_location"]
        return parameters | {"force": 0.0}
    amplitude = {key: exciter.gain * forced[key] for key in forced.keys() & {"forcing.amplitude"}}
    return amplitude | {"force": exciter.offset}


def _own_floats(scene: Scene) -> dict[str, float]:
    body = scene.body
    if isinstance(body, OscillatorBody):
        return oscillator_floats(body, scene)
    return chain_floats(body, scene) if isinstance(body, ChainBody) else beam_floats(body, scene)


def _carried(scene: Scene, start: tuple[float, ...]) -> dict[str, float]:
    if isinstance(scene.body, OscillatorBody):
        return oscillator_start(scene, start)
    # what finds the shapes of a beam takes time to load, and only a continuation of structures needs it
    from vibroimpact.orchestrator.run.carried_state import on_free_side

    names = [name.replace("[", "_start[") for name in state_variables(scene)]
    return dict(zip(names, on_free_side(scene, scene.body, start), strict=True))


def refuse_unknown_modes(scene: Scene) -> None:
    """Refuse to run a scene of which it is not yet known how many modes it has.

    Raises
    ------
    UsageError
        It has `modes = "auto"`.
    """
    if isinstance(scene.body, BeamBody | ChainBody) and scene.body.modes == "auto":
        raise UsageError(
            f'{scene.source}: body.modes: expected a number of modes, got "auto". run and campaign find it; '
            "accuracy shows what each number costs."
        )


def integer_parameters(scene: Scene) -> dict[str, int]:
    """Return the integer, enumeration and Boolean (`bool`) parameters of the body's FMU."""
    refuse_unknown_modes(scene)
    parameters = {"impact_limit": scene.execution.impact_limit}
    if isinstance(scene.body, ChainBody):
        parameters |= chain_integers(scene.body, scene)
    elif isinstance(scene.body, BeamBody):
        parameters |= beam_integers(scene.body, scene)
    return parameters | contact_integers(scene)


def state_variables(scene: Scene) -> tuple[str, ...]:
    """Return the outputs that are the whole state of a structure: displacements, then velocities.

    Of a chain those of its masses, of a beam those of its modes. Empty for an oscillator, whose state is that
    of the observed point, and for a general scene.
    """
    body = scene.bodies[0]
    if not isinstance(body, ChainBody | BeamBody):
        return ()
    kind = "" if isinstance(body, ChainBody) else "modal_"
    numbers = range(1, body.size + 1)
    return tuple(f"{kind}{name}[{i}]" for name in ("displacement", "velocity") for i in numbers)


def most_elements(scene: Scene) -> int:
    """Return how many masses or modes a structure has, where a sweep varies them the most of them; else 0."""
    is_beam = isinstance(scene.bodies[0], BeamBody)  # the state of a chain is that of its masses
    swept = [max(axis.values) for axis in scene.sweep if axis.key == MODES and is_beam]
    return int(swept[0]) if swept else len(state_variables(scene)) // 2


def padded_state(state: Floats | None, elements: int) -> Floats | None:
    """Return a whole state with 0 for the modes that a point has not: all states of a sweep are of one size.

    Examples
    --------
    >>> padded_state(np.array([1.0, 2.0]), 2).tolist()
    [1.0, 0.0, 2.0, 0.0]
    """
    if state is None or len(state) == 2 * elements:
        return state
    missing = np.zeros(elements - len(state) // 2)
    return np.concatenate([part for half in np.split(state, 2) for part in (half, missing)])


def without_padding(state: tuple[float, ...] | None, elements: int) -> tuple[float, ...] | None:
    """Return a whole state as the body of its point has it, with fewer modes: see `padded_state`."""
    if state is None or not elements:
        return state
    half = len(state) // 2
    return state[:elements] + state[half : half + elements]


def contact_floats(scene: Scene) -> dict[str, float]:
    """Return the real parameters of all contact ports, by variable name, SI."""
    parameters: dict[str, float] = {}
    for k, stop in enumerate(scene.stops, start=1):
        port = f"contact[{k}]"
        parameters |= {name.replace("contact[k]", port): value for name, value in named_numbers(stop).items()}
        if isinstance(scene.body, BeamBody):
            parameters[f"{port}.location"] = stop_location(stop)
    return parameters


def contact_integers(scene: Scene) -> dict[str, int]:
    """Return the integer and enumeration parameters of all contact ports."""
    parameters: dict[str, int] = {}
    for k, stop in enumerate(scene.stops, start=1):
        port = f"contact[{k}]"
        parameters[f"{port}.law"] = contact_law(stop.law).number
        parameters[f"{port}.side"] = SIDE_NUMBERS[stop.side]
        if isinstance(scene.body, ChainBody):
            parameters[f"{port}.mass_number"] = stop_mass(scene.body, stop)
    return parameters


def oscillator_floats(body: OscillatorBody, scene: Scene) -> dict[str, float]:
    """Return the real parameters of the Oscillator, by variable name, SI."""
    parameters = named_numbers(body)
    if scene.forcing is not None:
        # a base that accelerates is an inertial force on the relative coordinate
        scale = 1.0 if scene.forcing.kind == "force" else -body.mass
        parameters["forcing.amplitude"] = scale * scene.forcing.scalar_amplitude
    return parameters


def oscillator_start(scene: Scene, state: tuple[float, ...]) -> dict[str, float]:
    """Return the start state that continues from a displacement (m) and a velocity (m/s).

    A displacement beyond a rigid stop (the stop moved) is put on it, at rest; a compliant one is pressed in.
    """
    displacement, velocity = state
    for stop in scene.stops:
        sign = 1.0 if stop.side == "upper" else -1.0
        if isinstance(stop, RestitutionStop) and sign * (displacement - stop.position) > 0.0:
            displacement, velocity = stop.position, 0.0
    return {"displacement_start": displacement, "velocity_start": velocity}


def numbered(name: str, values: Sequence[float]) -> dict[str, float]:
    """Return values by the variable names `name[1]`, `name[2]`, ...

    >>> numbered("mass", (1.0, 2.0))
    {'mass[1]': 1.0, 'mass[2]': 2.0}
    """
    return {f"{name}[{number}]": value for number, value in enumerate(values, start=1)}


def each(values: float | tuple[float, ...], count: int) -> tuple[float, ...]:
    """Return one number for each of `count`: as given, one for all, or 0 for those at the end left out.

    >>> each(2.0, 3), each((1.0,), 3)
    ((2.0, 2.0, 2.0), (1.0, 0.0, 0.0))
    """
    if not isinstance(values, tuple):
        return (values,) * count
    return values + (0.0,) * (count - len(values))


def chain_floats(body: ChainBody, scene: Scene) -> dict[str, float]:
    """Return the real parameters of the Chain, by variable name, SI."""
    parameters = named_numbers(body, body.size)
    if scene.forcing is not None:
        parameters |= numbered("forcing.amplitude", _amplitudes(body, scene.forcing))
    return parameters


def _amplitudes(body: ChainBody, forcing: Forcing) -> tuple[float, ...]:
    """Return the amplitude of the force on each mass, N."""
    if forcing.kind == "base_acceleration":
        # a base that accelerates is an inertial force on each relative coordinate
        return tuple(-mass * forcing.scalar_amplitude for mass in body.masses)
    return each(forcing.amplitude, body.size)


def chain_integers(body: ChainBody, scene: Scene) -> dict[str, int]:
    """Return the integer parameters of the Chain."""
    modes = 0 if body.modes is None else body.modes
    assert modes != "auto"  # else refused
    return {"masses": body.size, "modes": modes, "observed_mass": observed_mass(body, scene.stops)}


def beam_floats(body: BeamBody, scene: Scene) -> dict[str, float]:
    """Return the real parameters of the Beam, by variable name, SI."""
    parameters = named_numbers(body, body.size)
    if body.frequency is not None:
        parameters["flexural_rigidity"] = rigidity_of_frequency(body)
    if body.rayleigh is not None:
        parameters |= named_numbers(body.rayleigh)
    parameters["sensor_location"] = observed_location(body, scene.stops, scene.sensor)
    parameters["forcing_location"] = forcing_location(body, scene.forcing)
    if scene.forcing is not None:
        parameters["forcing.amplitude"] = scene.forcing.scalar_amplitude
    return parameters


def rigidity_of_frequency(body: BeamBody) -> float:
    """Return the flexural rigidity, N m^2, that gives a beam its first natural frequency (thesis eq. 7.16).

    w_1 = (xi_1 / length)^2 sqrt(rigidity / mass_per_length), xi_1 the first eigenvalue of its boundary.
    """
    from vibroimpact.fmus.core import beam_modes  # loads numpy and the core; few scenes need it

    assert body.frequency is not None
    assert body.mass_per_length is not None
    eigenvalue = float(beam_modes(cast("Boundary", body.boundary.replace("-", "_")), 1).eigenvalues[0])
    angular = 2.0 * math.pi * body.frequency
    return body.mass_per_length * (angular * (body.length / eigenvalue) ** 2) ** 2


def beam_integers(body: BeamBody, scene: Scene) -> dict[str, int]:
    """Return the integer, enumeration and Boolean parameters of the Beam."""
    parameters = {
        "modes": body.size,
        "residual": bool(body.residual),
        "boundary": BOUNDARY_NUMBERS[body.boundary],
        "impact_projection": PROJECTION_NUMBERS[body.impact_projection],
    }
    if scene.forcing is not None:
        parameters["forcing.kind"] = FORCING_NUMBERS[scene.forcing.kind]
        if scene.forcing.mode is not None:
            parameters["forcing.mode"] = scene.forcing.mode
    return parameters
