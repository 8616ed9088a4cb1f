"""From a scene to its body: the parameters of its FMU, the carried state of a continuation, the modes."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies import POINTS_OF_FMU, BodyPoints, Columns
from vibroimpact.fmus.core.contact_laws import contact_laws
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.forces import force_floats, force_integers
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.fields import named_numbers
from vibroimpact.orchestrator.scene.keys import MODES
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.measuring_models import Exciter

Floats = NDArray[np.float64]
PROBES = (2.0**-20, 0.0812537291, -0.0316227766, 1.4142135e-9)
"""Relative changes of a value, with many different bits, that test whether a parameter copies the value."""
SIDE_NUMBERS = {"upper": 1, "lower": 2}


def float_parameters(scene: Scene, start: tuple[float, ...] | None) -> dict[str, float]:
    """Return the real parameters of the body's FMU, by variable name, SI.

    Parameters
    ----------
    scene : Scene
        A scene of the short form.
    start : tuple of float or None
        State carried over from the run before, at forcing phase 0: displacement (m) and velocity (m/s) of an
        oscillator, else the values of `state_variables`. A state beyond a rigid stop that has moved is put back, see
        `free_state`. None: the scene's own start.
    """
    body, forcing = scene.body, None if scene.lists_forces else scene.forcing
    parameters = named_numbers(body, body.size) | body.fmu_floats(forcing, scene.stops, scene.sensor)
    parameters |= contact_floats(scene)
    if forcing is not None:
        parameters |= named_numbers(forcing)
    if scene.lists_forces:
        parameters |= force_floats(scene, begins_anew=start is None)
    if scene.exciter is not None:
        parameters |= _exciter_floats(scene, scene.exciter, parameters)
    parameters |= named_numbers(scene.execution)
    if start is not None:
        parameters |= dict(zip(scene.body.start_names, free_state(scene, start, parameters), strict=True))
        if scene.period is not None and not scene.lists_forces:
            parameters["forcing.phase"] = 0.0
    return parameters


def exported_floats(scene: Scene) -> dict[str, float]:
    """Return the real parameters of the body's FMU for other tools, which do not have the scene.

    They equal `float_parameters`, except for a moving base of an oscillator or a chain. A run gives such a body the
    inertial force and adds the base to the accelerations itself; an export has the base.
    """
    parameters = float_parameters(scene, None)
    forcing = None if scene.lists_forces else scene.forcing
    if forcing is None or forcing.kind != "base_acceleration" or scene.body.KNOWS_BASE:
        return parameters
    forces = [name for name in parameters if name.startswith("forcing.amplitude")]
    return parameters | dict.fromkeys(forces, 0.0) | {"forcing.base_acceleration": forcing.scalar_amplitude}


def _exciter_floats(scene: Scene, exciter: Exciter, forced: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters of an exciter's force, N: the amplitude from volts, and the offset as input of the body.

    A force that falls with the distance is not known in advance: all of it is input, see `measuring.held_exciter`.
    """
    if scene.falling_force:
        parameters = dict.fromkeys(forced.keys() & {"forcing.amplitude"}, 0.0)
        if "forcing_location" in forced:
            parameters["sensor[1].location"] = forced["forcing_location"]
        return parameters | {"force": 0.0}
    amplitude = {key: exciter.gain * forced[key] for key in forced.keys() & {"forcing.amplitude"}}
    return amplitude | {"force": exciter.offset}


def refuse_unknown_modes(scene: Scene) -> None:
    """Raise UsageError unless the number of modes of a scene is known, not still `modes = "auto"`."""
    if scene.body.finds_modes:
        raise UsageError(
            f'{scene.source}: body.modes: expected a number of modes, got "auto". run and campaign find it; '
            "accuracy shows what each number costs."
        )


def integer_parameters(scene: Scene) -> dict[str, int]:
    """Return the integer, enumeration and Boolean (`bool`) parameters of the body's FMU."""
    refuse_unknown_modes(scene)
    parameters = {"impact_limit": scene.execution.impact_limit}
    if scene.lists_forces:
        parameters |= scene.body.fmu_integers(None, scene.stops) | force_integers(scene)
    else:
        parameters |= scene.body.fmu_integers(scene.forcing, scene.stops)
    for k, stop in enumerate(scene.stops, start=1):
        parameters[f"contact[{k}].law"] = contact_laws()[stop.law].number
        parameters[f"contact[{k}].side"] = SIDE_NUMBERS[stop.side]
    return parameters


def state_variables(scene: Scene) -> tuple[str, ...]:
    """Return the outputs that are the whole state of a structure: displacements, then velocities.

    The outputs belong to the masses of a chain or to the modes of a beam. They are empty for a general scene, and for
    an oscillator, whose state is the motion of the observed point.
    """
    return scene.body.state_variables if scene.is_one_body else ()


def most_elements(scene: Scene) -> int:
    """Return the number of masses or modes of a structure, the largest of a sweep; 0 for other bodies."""
    grows = scene.is_one_body and scene.body.KEEPS_MODES
    swept = [max(axis.values) for axis in scene.sweep if axis.key == MODES and grows]
    return int(swept[0]) if swept else len(state_variables(scene)) // 2


def padded_state(state: Floats | None, elements: int) -> Floats | None:
    """Return a whole state with 0 for missing modes, so that all states of a sweep have one size.

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
    """Return a whole state with only the modes of the body of its point: see `padded_state`."""
    if state is None or not elements:
        return state
    half = len(state) // 2
    return state[:elements] + state[half : half + elements]


def contact_floats(scene: Scene) -> dict[str, float]:
    """Return the numbers of all stops as parameters of their contact ports, by variable name, SI."""
    parameters: dict[str, float] = {}
    for k, stop in enumerate(scene.stops, start=1):
        port = f"contact[{k}]"
        parameters |= {
            name.replace("contact[k]", port).replace("stop[k]", f"stop[{k}]"): value
            for name, value in named_numbers(stop).items()
        }
    return parameters


def free_state(
    scene: Scene, state: tuple[float, ...], floats: Mapping[str, float] | None = None
) -> tuple[float, ...]:
    """Return a state put back where it is beyond a rigid stop: N displacements (m), then N velocities (m/s).

    An oscillator beyond its stop is put on the stop, at rest; a structure is pushed back: see `carried_state`.
    """
    if scene.body.IS_STRUCTURE:
        from vibroimpact.orchestrator.run.carried_state import on_free_side  # few scenes need it

        known = {} if floats is None else floats
        phases = [known.get(f"stop[{k}].phase", 0.0) for k in range(1, len(scene.stops) + 1)]
        return on_free_side(body_points(scene, floats), scene.stops, state, phases)
    displacement, velocity = state
    for stop in scene.stops:
        sign = 1.0 if stop.side == "upper" else -1.0
        if LAWS[stop.law].is_rigid and sign * (displacement - stop.position) > 0.0:
            displacement, velocity = stop.position, 0.0
    return displacement, velocity


def body_points(scene: Scene, columns: Columns | Mapping[str, float] | None = None) -> BodyPoints:
    """Return the body of a scene as one object: modes, contacts, forcing and the observed point.

    Parameters
    ----------
    scene : Scene
        A scene of the short form.
    columns : mapping of str to ndarray, shape (point,), or to float, or None
        Real parameters of the body's FMU at many points of the sweep or at one; None: the parameters of the scene.
    """
    floats = float_parameters(scene, None) if columns is None else columns
    return POINTS_OF_FMU[scene.body.FMU](floats, integer_parameters(scene), len(scene.stops))


def own_parameters(scene: Scene, keys: Sequence[str]) -> list[str] | None:
    """Return the parameter of the body's FMU that copies the value of each key; None where a key sets other ones."""
    given = float_parameters(scene, None)
    names = []
    for key in keys:
        found = {_alone(scene, key, probe, given) for probe in PROBES}
        if len(found) > 1 or "" in found:
            return None
        names.append(found.pop())
    return names


def _alone(scene: Scene, key: str, probe: float, given: Mapping[str, float]) -> str:
    """Return the only parameter that changes with a key and equals its value bit for bit; empty if there is none."""
    value = scene.value(key)
    other = value * (1.0 + probe) if value else probe
    found = float_parameters(scene.at({key: other}), None)
    if found.keys() != given.keys():
        return ""
    changed = [name for name in found if _bits(found[name]) != _bits(given[name])]
    return changed[0] if len(changed) == 1 and _bits(found[changed[0]]) == _bits(other) else ""


def _bits(value: float) -> bytes:
    return struct.pack("d", value)
