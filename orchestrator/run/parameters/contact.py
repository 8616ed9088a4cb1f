"""From the stops of a scene to the parameters of the contact ports of a body's FMU."""

from __future__ import annotations

from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.models import BeamBody, ChainBody, Stop
from vibroimpact.orchestrator.scene.places import stop_location, stop_mass

LAW_NUMBERS = {"none": 0, "restitution": 1, "kelvin_voigt": 2, "hertz": 3, "hunt_crossley": 4}
SIDE_NUMBERS = {"upper": 1, "lower": 2}
#: Parameters of contact laws; each has some of them.
_OF_A_LAW = (
    "restitution",
    "yield_velocity",
    "stiffness",
    "damping",
    "exponent",
    "relaxation_time",
)


def contact_floats(scene: Scene) -> dict[str, float]:
    """Return the real parameters of all contact ports, by variable name, SI."""
    parameters: dict[str, float] = {}
    for k, stop in enumerate(scene.stops, start=1):
        port = f"contact[{k}]"
        parameters[f"{port}.position"] = stop.position
        parameters |= {f"{port}.{name}": value for name, value in _law_floats(stop).items()}
        if isinstance(scene.body, BeamBody):
            parameters[f"{port}.location"] = stop_location(stop)
    return parameters


def _law_floats(stop: Stop) -> dict[str, float]:
    """Return the numbers of the law of a stop."""
    return {name: getattr(stop, name) for name in _OF_A_LAW if hasattr(stop, name)}


def contact_integers(scene: Scene) -> dict[str, int]:
    """Return the integer and enumeration parameters of all contact ports."""
    parameters: dict[str, int] = {}
    for k, stop in enumerate(scene.stops, start=1):
        port = f"contact[{k}]"
        parameters[f"{port}.law"] = LAW_NUMBERS[stop.law]
        parameters[f"{port}.side"] = SIDE_NUMBERS[stop.side]
        if isinstance(scene.body, ChainBody):
            parameters[f"{port}.mass_number"] = stop_mass(scene.body, stop)
    return parameters
