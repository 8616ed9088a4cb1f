"""From a scene to the parameters of the Oscillator FMU that are not those of its contacts."""

from __future__ import annotations

from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.models import OscillatorBody, RestitutionStop


def oscillator_floats(body: OscillatorBody, scene: Scene) -> dict[str, float]:
    """Return the real parameters of the Oscillator, by variable name, SI."""
    parameters = {
        "mass": body.mass,
        "damping": body.damping,
        "stiffness": body.stiffness,
        "displacement_start": body.displacement_start,
        "velocity_start": body.velocity_start,
    }
    for key in ("frequency_slope", "damping_slope", "damping_reciprocal"):
        if key in body.model_fields_set:
            parameters[f"amplitude.{key}"] = getattr(body, key)
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
