"""From a scene to the parameters of the Chain FMU that are not those of its contacts."""

from __future__ import annotations

from collections.abc import Sequence

from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.models import ChainBody, Forcing
from vibroimpact.orchestrator.scene.places import observed_mass


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
    parameters = {"far_stiffness": body.far_stiffness, "far_damping": body.far_damping}
    parameters |= numbered("mass", body.masses)
    parameters |= numbered("stiffness", each(body.stiffnesses, body.size))
    parameters |= numbered("damping", each(body.dampings, body.size))
    parameters |= numbered("displacement_start", each(body.displacement_start, body.size))
    parameters |= numbered("velocity_start", each(body.velocity_start, body.size))
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
    return {"masses": body.size, "observed_mass": observed_mass(body, scene.stops)}
