"""From a scene to the parameters of the Beam FMU that are not those of its contacts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

from vibroimpact.orchestrator.run.parameters.chain import each, numbered
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.models import BeamBody
from vibroimpact.orchestrator.scene.places import forcing_location, observed_location

if TYPE_CHECKING:
    from vibroimpact.fmus.modes import Boundary

BOUNDARY_NUMBERS = {"clamped-free": 1, "clamped-clamped": 2, "clamped-pinned": 3, "pinned-pinned": 4}
FORCING_NUMBERS = {"force": 1, "uniform": 2, "mode": 3, "base_acceleration": 4}
PROJECTION_NUMBERS = {"variational": 1, "collocation": 2}
AMPLITUDE_KEYS = ("frequency_slope", "damping_slope", "damping_reciprocal")
_GIVEN = (
    *("width", "thickness", "youngs_modulus", "density"),
    *("flexural_rigidity", "mass_per_length"),
)


def beam_floats(body: BeamBody, scene: Scene) -> dict[str, float]:
    """Return the real parameters of the Beam, by variable name, SI."""
    parameters = {"length": body.length, "poisson_ratio": body.poisson_ratio}
    parameters |= {name: getattr(body, name) for name in _GIVEN if getattr(body, name) is not None}
    if body.frequency is not None:
        parameters["flexural_rigidity"] = rigidity_of_frequency(body)
    parameters |= numbered("damping_ratio", each(body.damping_ratio, body.size))
    for key in AMPLITUDE_KEYS:
        if key in body.model_fields_set:  # an effect that the scene does not name is not even told to the FMU
            parameters |= numbered(f"amplitude.{key}", each(getattr(body, key), body.size))
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


def rigidity_of_frequency(body: BeamBody) -> float:
    """Return the flexural rigidity, N m^2, that gives a beam its first natural frequency (thesis eq. 7.16).

    w_1 = (xi_1 / length)^2 sqrt(rigidity / mass_per_length), xi_1 the first eigenvalue of its boundary.
    """
    from vibroimpact.fmus.modes import beam_modes  # loads numpy and the core; few scenes need it

    assert body.frequency is not None
    assert body.mass_per_length is not None
    eigenvalue = float(beam_modes(cast("Boundary", body.boundary.replace("-", "_")), 1).eigenvalues[0])
    angular = 2.0 * math.pi * body.frequency
    return body.mass_per_length * (angular * (body.length / eigenvalue) ** 2) ** 2


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
