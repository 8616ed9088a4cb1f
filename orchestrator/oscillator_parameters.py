"""From a scene to the parameters of its body's FMU."""

from __future__ import annotations

from vibroimpact.orchestrator.scene import Scene

LAW_NUMBERS = {"none": 0, "restitution": 1, "external": 5}
SIDE_NUMBERS = {"upper": 1, "lower": 2}


def float_parameters(scene: Scene, start: tuple[float, float] | None) -> dict[str, float]:
    """Return the real parameters of the Oscillator FMU, by variable name, SI.

    Parameters
    ----------
    scene : Scene
        The scene.
    start : tuple of float or None
        Displacement (m) and velocity (m/s) carried over from the run before, at forcing phase 0; a
        displacement beyond a stop (the stop moved) is put on it, at rest. None: the scene's own start.
    """
    body, forcing = scene.body, scene.forcing
    parameters = {
        "mass": body.mass,
        "damping": body.damping,
        "stiffness": body.stiffness,
        "displacement_start": body.displacement_start,
        "velocity_start": body.velocity_start,
    }
    if forcing is not None:
        # a base that accelerates is an inertial force on the relative coordinate
        scale = 1.0 if forcing.kind == "force" else -body.mass
        parameters["forcing.amplitude"] = scale * forcing.amplitude
        parameters["forcing.angular_frequency"] = forcing.angular_frequency
        parameters["forcing.phase"] = forcing.phase
    for k, stop in enumerate(scene.stops, start=1):
        parameters[f"contact[{k}].position"] = stop.position
        parameters[f"contact[{k}].restitution"] = stop.restitution
    if start is not None:
        displacement, velocity = on_free_side(scene, start)
        parameters["displacement_start"] = displacement
        parameters["velocity_start"] = velocity
        if scene.period is not None:
            parameters["forcing.phase"] = 0.0
    return parameters


def on_free_side(scene: Scene, start: tuple[float, float]) -> tuple[float, float]:
    """Return the state, put at rest on the stop when it lies beyond one."""
    displacement, velocity = start
    for stop in scene.stops:
        sign = 1.0 if stop.side == "upper" else -1.0
        if sign * (displacement - stop.position) > 0.0:
            displacement, velocity = stop.position, 0.0
    return displacement, velocity


def integer_parameters(scene: Scene, law: str | None = None) -> dict[str, int]:
    """Return the integer and enumeration parameters; `law` replaces those of all stops."""
    parameters = {"impact_limit": scene.execution.impact_limit}
    for k, stop in enumerate(scene.stops, start=1):
        parameters[f"contact[{k}].law"] = LAW_NUMBERS[law or stop.law]
        parameters[f"contact[{k}].side"] = SIDE_NUMBERS[stop.side]
    return parameters
