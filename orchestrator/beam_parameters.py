"""From a scene to the parameters of the Beam FMU that are not those of its contacts."""

from __future__ import annotations

from vibroimpact.orchestrator.chain_parameters import each, numbered
from vibroimpact.orchestrator.places import forcing_location, observed_location
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene_models import BeamBody

BOUNDARY_NUMBERS = {"clamped-free": 1, "clamped-clamped": 2, "clamped-pinned": 3, "pinned-pinned": 4}
FORCING_NUMBERS = {"force": 1, "uniform": 2, "mode": 3, "base_acceleration": 4}
PROJECTION_NUMBERS = {"variational": 1, "collocation": 2}
_GIVEN = (
    *("width", "thickness", "youngs_modulus", "density"),
    *("flexural_rigidity", "mass_per_length"),
)


def beam_floats(body: BeamBody, scene: Scene) -> dict[str, float]:
    """Return the real parameters of the Beam, by variable name, SI."""
    parameters = {"length": body.length, "poisson_ratio": body.poisson_ratio}
    parameters |= {name: getattr(body, name) for name in _GIVEN if getattr(body, name) is not None}
    parameters |= numbered("damping_ratio", each(body.damping_ratio, body.size))
    if body.rayleigh is not None:
        parameters["rayleigh.mass"] = body.rayleigh.mass
        parameters["rayleigh.stiffness"] = body.rayleigh.stiffness
    parameters |= numbered("modal_displacement_start", each(body.displacement_start, body.size))
    parameters |= numbered("modal_velocity_start", each(body.velocity_start, body.size))
    parameters["sensor_location"] = observed_location(body, scene.stops, scene.sensor)
    parameters["forcing_location"] = forcing_location(body, scene.forcing)
    if scene.forcing is not None:
        parameters["forcing.amplitude"] = scene.forcing.scalar_amplitude
    return parameters


def beam_integers(body: BeamBody, scene: Scene) -> dict[str, int]:
    """Return the integer and enumeration parameters of the Beam."""
    parameters = {
        "modes": body.modes,
        "boundary": BOUNDARY_NUMBERS[body.boundary],
        "impact_projection": PROJECTION_NUMBERS[body.impact_projection],
    }
    if scene.forcing is not None:
        parameters["forcing.kind"] = FORCING_NUMBERS[scene.forcing.kind]
        if scene.forcing.mode is not None:
            parameters["forcing.mode"] = scene.forcing.mode
    return parameters
