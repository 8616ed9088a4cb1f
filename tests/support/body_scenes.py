"""A scene of steady impacts for the FMU of each body, and the parameters that this FMU rejects."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from support.component_fmu import EXTERNAL, HUNT_CROSSLEY, KELVIN_VOIGT, ComponentFmu, each, forced, stop


@dataclass(frozen=True)
class BodyScene:
    """A body in a scene of steady impacts on its first stop, at `position`, with restitution `r`.

    Attributes
    ----------
    end : float
        Time in s by which the body has hit the stop more than three times.
    intervals : tuple of float
        Communication intervals in s; the last interval is the whole run.
    fixed : str
        A parameter that cannot change once the body moves.
    load : str
        Its first input.
    laws : list of dict
        Stops that replace the first stop, for saved states, and an angular frequency.
    bad : list
        Parameters, a wrong value of each, and the words of its rule.
    together : dict
        Wrong values that are independent of each other.
    """

    component: str
    parameters: dict[str, float]
    position: float
    r: float
    end: float
    intervals: tuple[float, ...]
    fixed: str
    load: str
    laws: list[dict[str, float]] = field(repr=False)
    bad: list[tuple[str, float, str]] = field(repr=False)
    together: dict[str, float] = field(repr=False)

    @property
    def scene(self) -> dict[str, float]:
        return {**self.parameters, **stop(self.position, self.r)}

    @property
    def coupled(self) -> dict[str, float]:
        """The body's scene, for an importer that answers the impacts."""
        return {**self.parameters, **stop(self.position, law=EXTERNAL)}

    def fmu(self, parameters: dict[str, float] | None = None, **options: Any) -> ComponentFmu:
        return ComponentFmu(self.component, self.scene if parameters is None else parameters, **options)

    def __str__(self) -> str:
        return self.component


BAD_CONTACT = [
    ("contact[1].restitution", 1.2, "0 <= r <= 1"),
    ("contact[1].restitution", -0.1, "0 <= r <= 1"),
    ("contact[1].restitution", math.nan, "0 <= r <= 1"),
    ("contact[1].position", math.nan, "finite"),
    ("contact[1].side", 3, "1 (upper)"),
    ("impact_limit", -1, ">= 0"),
]
BAD_STRUCTURE = [
    *BAD_CONTACT,
    ("contact[1].law", 8, "7 (pair)"),
    ("contact[1].yield_velocity", -1.0, ">= 0"),
    ("contact[1].relaxation_time", math.nan, ">= 0"),
    ("contact[1].applied_force", math.nan, "finite"),
    ("contact_tolerance", 0.0, "0 < tolerance"),
    ("base_acceleration_rate", math.inf, "finite"),
    ("forcing.amplitude", math.nan, "finite"),
    ("forcing.angular_frequency", -1.0, ">= 0"),
    ("forcing.phase", math.inf, "finite"),
]

OSCILLATOR = BodyScene(
    "Oscillator",
    forced(),
    position=1.0,
    r=0.7,
    end=62.0,
    intervals=(0.01, 0.1, 1.0, 62.0),
    fixed="mass",
    load="force",
    laws=[{}, {**stop(0.0), "forcing.angular_frequency": 0.2}],
    bad=[
        *BAD_CONTACT,
        ("contact[1].law", 8, "1 (restitution)"),
        ("mass", 0.0, "> 0"),
        ("mass", -1.0, "> 0"),
        ("mass", math.nan, "> 0"),
        ("mass", math.inf, "> 0"),
        ("damping", -0.1, ">= 0"),
        ("damping", math.nan, ">= 0"),
        ("stiffness", -1.0, ">= 0"),
        ("stiffness", math.inf, ">= 0"),
        ("forcing.amplitude", math.nan, "finite"),
        ("forcing.angular_frequency", -1.0, ">= 0"),
        ("forcing.phase", math.inf, "finite"),
        ("displacement_start", math.nan, "finite"),
        ("velocity_start", -math.inf, "finite"),
        ("displacement_start", 1.5, "free side of contact[1]"),
        ("force", math.nan, "finite"),
    ],
    together={"mass": -1.0, "damping": -2.0, "contact[1].restitution": 3.0},
)
CHAIN = BodyScene(
    "Chain",
    {
        **{"masses": 2, "damping[1]": 0.1, "damping[2]": 0.1},
        **{"forcing.amplitude[1]": 0.5, "forcing.angular_frequency": 0.9},
    },
    position=0.1,
    r=0.7,
    end=60.0,
    intervals=(0.1, 60.0),
    fixed="mass[1]",
    load="force[2]",
    laws=[
        {"forcing.angular_frequency": 0.2, "record.energies": True, **law}
        for law in ({}, stop(0.1, law=KELVIN_VOIGT, stiffness=50.0))
    ],
    bad=[
        *((name.replace("amplitude", "amplitude[2]"), value, rule) for name, value, rule in BAD_STRUCTURE),
        ("masses", 0, "1 to 64"),
        ("masses", 65, "1 to 64"),
        ("mass[2]", 0.0, "> 0"),
        ("mass[1]", math.nan, "> 0"),
        ("stiffness[2]", -1.0, ">= 0"),
        ("damping[1]", math.inf, ">= 0"),
        ("far_stiffness", -1.0, ">= 0"),
        ("far_damping", math.nan, ">= 0"),
        ("displacement_start[1]", math.nan, "finite"),
        ("velocity_start[2]", -math.inf, "finite"),
        ("observed_mass", 3, "1 to 2"),
        ("contact[1].mass_number", 3, "1 to 2"),
        ("contact[1].mass_number", -1, "0 for the last"),
        ("force[2]", math.nan, "finite"),
    ],
    together={
        "mass[1]": -1.0,
        "stiffness[2]": -2.0,
        "contact[1].restitution": 3.0,
        "contact[8].stiffness": -1.0,
    },
)
BEAM = BodyScene(
    "Beam",
    {
        **{"modes": 3, **each("damping_ratio", [0.02] * 3)},
        **{"forcing.amplitude": 0.5, "forcing.angular_frequency": 150.0},
    },
    position=1e-3,
    r=0.5,
    end=0.5,
    intervals=(1e-3, 0.5),
    fixed="length",
    load="force",
    laws=[
        {"forcing.angular_frequency": 30.0, **stop(1e-4, 0.3, law=law, stiffness=2e4)}
        for law in (1, KELVIN_VOIGT, HUNT_CROSSLEY)
    ],
    bad=[
        *BAD_STRUCTURE,
        ("modes", 0, "1 to 64"),
        ("modes", 65, "1 to 64"),
        ("boundary", 5, "1 to 4"),
        ("length", 0.0, "> 0"),
        ("width", -1.0, "> 0"),
        ("thickness", math.nan, "> 0"),
        ("youngs_modulus", math.inf, "> 0"),
        ("density", 0.0, "> 0"),
        ("flexural_rigidity", -1.0, ">= 0"),
        ("mass_per_length", math.nan, ">= 0"),
        ("poisson_ratio", 0.75, "<= 0.5"),
        ("rayleigh.mass", -1.0, ">= 0"),
        ("rayleigh.stiffness", math.inf, ">= 0"),
        ("damping_ratio[3]", -0.1, ">= 0"),
        ("modal_displacement_start[1]", math.nan, "finite"),
        ("modal_velocity_start[2]", math.inf, "finite"),
        ("forcing.kind", 0, "1 to 4"),
        ("forcing_location", 1.5, "0 <= location <= 1"),
        ("sensor_location", -0.5, "0 <= location <= 1"),
        ("sensor[4].location", math.nan, "0 <= location <= 1"),
        ("contact[1].location", 1.25, "0 <= location <= 1"),
        ("contact[1].location", 0.0, "a point that can move"),
        ("impact_projection", 3, "1 to 2"),
        ("force_rate", math.nan, "finite"),
    ],
    together={"length": -1.0, "damping_ratio[2]": -2.0, "contact[1].restitution": 3.0, "boundary": 9},
)
STRUCTURE = BodyScene(
    "Structure",
    {"forcing.amplitude": 0.5, "forcing.angular_frequency": 0.6},
    position=0.1,
    r=0.5,
    end=60.0,
    intervals=(0.1, 60.0),
    fixed="forcing.phase",
    load="force",
    laws=[
        {"forcing.angular_frequency": 0.2, "record.energies": True, **law}
        for law in ({}, stop(0.1, law=KELVIN_VOIGT, stiffness=5.0))
    ],
    bad=[
        *BAD_STRUCTURE,
        ("modes", 0, "1 to 64"),
        ("modes", 65, "1 to 64"),
        ("forcing.base_acceleration", math.inf, "finite"),
        ("force_rate", math.nan, "finite"),
    ],
    together={"forcing.phase": math.inf, "contact[1].restitution": 3.0, "contact[32].stiffness": -1.0},
)
BODIES = (OSCILLATOR, CHAIN, BEAM, STRUCTURE)
