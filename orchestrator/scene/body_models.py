"""The tables `[body]` of a scene file as frozen pydantic models."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.models import (
    AMPLITUDE,
    DAMPING,
    FEEDS_ENERGY,
    MOST_MODES,
    Finite,
    FiniteNumbers,
    ModeCount,
    ModeNumber,
    NotNegative,
    NotNegativeNumbers,
    Positive,
    PositiveArray,
    SceneTable,
    StartArray,
)

_BODY_KINDS = Rule('"oscillator", "chain" or "beam"')


def _of_amplitude(name: str, unit: str, doc: str, each: str = "") -> Rule:
    """Return the rule of a number by which motion follows its amplitude; an FMU that is not told of it saves it."""
    hint = "It is of the amplitude of the motion; 0 is a mode that does not depend on it."
    variable = f"amplitude.{name}{each}"
    return Rule(unit=unit, hint=hint, fmu=variable, told_if_given=True, effect=AMPLITUDE, doc=doc)


_FREQUENCY_SLOPE = (
    "frequency_slope",
    "1/m",
    "relative change of the natural frequency per metre of amplitude, see "
    "[below](#motion-that-depends-on-its-amplitude)",
)
_DAMPING_SLOPE = ("damping_slope", "1/m", "change of the damping ratio per metre of amplitude")
_DAMPING_RECIPROCAL = ("damping_reciprocal", "m", "damping ratio times amplitude that is added")


class OscillatorBody(SceneTable):
    """`[body]`: one mass on a spring and a dashpot, mass x'' + damping x' + stiffness x = force."""

    MOST_STOPS: ClassVar[int] = 2
    NAME: ClassVar[str] = "an oscillator"

    kind: Annotated[Literal["oscillator"], _BODY_KINDS] = "oscillator"
    mass: Annotated[Positive, Rule(unit="kg", fmu="mass")]
    stiffness: Annotated[
        NotNegative, Rule(unit="N/m", hint="Use 0 for a body without a spring.", fmu="stiffness")
    ]
    damping_given: Annotated[
        NotNegative, Rule(unit="N s/m", hint=FEEDS_ENERGY, fmu="damping", effect=DAMPING)
    ] = Field(0.0, alias="damping")
    damping_ratio: Annotated[
        NotNegative | None,
        Rule(
            hint=FEEDS_ENERGY,
            effect=DAMPING,
            doc="needs stiffness > 0; instead of `damping`: damping = 2 damping_ratio sqrt(stiffness mass) at every "
            "point of a sweep",
        ),
    ] = None
    displacement_start: Annotated[
        Finite,
        Rule(unit="m", fmu="displacement_start", doc="not beyond a rigid stop; exactly on a stop is allowed"),
    ] = 0.0
    velocity_start: Annotated[Finite, Rule(unit="m/s", fmu="velocity_start")] = 0.0
    frequency_slope: Annotated[Finite, _of_amplitude(*_FREQUENCY_SLOPE)] = 0.0
    damping_slope: Annotated[Finite, _of_amplitude(*_DAMPING_SLOPE)] = 0.0
    damping_reciprocal: Annotated[NotNegative, _of_amplitude(*_DAMPING_RECIPROCAL)] = 0.0

    @property
    def damping(self) -> float:
        """Damping coefficient, N s/m: as given, or 2 damping_ratio sqrt(stiffness mass)."""
        if self.damping_ratio is None:
            return self.damping_given
        square = self.stiffness * self.mass
        # the points of a sweep come as arrays, too
        root = np.sqrt(square) if isinstance(square, np.ndarray) else math.sqrt(square)
        return 2.0 * self.damping_ratio * root

    def mass_at(self, number: int | None) -> float:
        """Return the mass that a stop limits, kg."""
        return self.mass


_ARRAY_OR_ONE = "an array of numbers >= 0, or one number for all"
_SPRING_HINT = "Element i lies between mass i - 1 (the ground for i = 1) and mass i."
_FREE_END = "Use 0 for a free far end."


class ChainBody(SceneTable):
    """`[body]`: masses in a row, each joined to the one before by a spring and a dashpot."""

    MOST_STOPS: ClassVar[int] = 8
    NAME: ClassVar[str] = "a chain"

    kind: Annotated[Literal["chain"], _BODY_KINDS]
    masses: Annotated[
        PositiveArray,
        Rule(
            f"an array of 1 to {MOST_MODES} numbers > 0",
            unit="kg",
            hint="One for each mass.",
            fmu="mass[i]",
            doc=f"1 to {MOST_MODES} of them",
        ),
    ]
    stiffnesses: Annotated[
        NotNegativeNumbers,
        Rule(
            _ARRAY_OR_ONE,
            unit="N/m",
            hint=_SPRING_HINT,
            fmu="stiffness[i]",
            doc="one for each mass, or one for all",
        ),
    ]
    dampings: Annotated[
        NotNegativeNumbers,
        Rule(
            _ARRAY_OR_ONE,
            unit="N s/m",
            hint=_SPRING_HINT,
            fmu="damping[i]",
            effect=DAMPING,
            doc="one for each mass, or one for all",
        ),
    ] = 0.0
    far_stiffness: Annotated[
        NotNegative,
        Rule(
            unit="N/m",
            hint=_FREE_END,
            fmu="far_stiffness",
            doc="a spring between the last mass and the ground behind it",
        ),
    ] = 0.0
    far_damping: Annotated[
        NotNegative,
        Rule(unit="N s/m", hint=_FREE_END, fmu="far_damping", effect=DAMPING, doc="likewise a dashpot"),
    ] = 0.0
    modes: Annotated[
        ModeCount | None,
        Rule(
            f'a whole number from 1 to {MOST_MODES}, or "auto"',
            sweepable=True,
            hint="The slowest ones are simulated.",
            doc='1 to the number of masses, the slowest; `"auto"`: the fewest that meet `execution.tolerance`, '
            "see [below](#how-many-modes)",
            default="all",
        ),
    ] = None
    observed_mass: Annotated[
        ModeNumber | None,
        Rule(
            hint="Masses count from 1.",
            doc="the mass whose displacement and velocity are recorded",
            default="the mass of `stop[1]`; without a stop the last",
        ),
    ] = None
    displacement_start: Annotated[
        StartArray,
        Rule(
            unit="m",
            hint="One for each mass.",
            fmu="displacement_start[i]",
            doc="one for each mass; not beyond a rigid stop",
            default="0",
        ),
    ] = ()
    velocity_start: Annotated[
        StartArray, Rule(unit="m/s", hint="One for each mass.", fmu="velocity_start[i]", default="0")
    ] = ()

    @property
    def size(self) -> int:
        """Number of masses."""
        return len(self.masses)

    def mass_at(self, number: int | None) -> float:
        """Return the mass that a stop limits, kg: that of its number, or the last."""
        return self.masses[(number or self.size) - 1]


class Rayleigh(SceneTable):
    """`body.rayleigh`: damping ratios mass / (2 w) + stiffness w / 2 in addition to those given."""

    mass: Annotated[NotNegative, Rule(unit="1/s", fmu="rayleigh.mass")] = 0.0
    stiffness: Annotated[NotNegative, Rule(unit="s", fmu="rayleigh.stiffness")] = 0.0


class BeamBody(SceneTable):
    """`[body]`: an Euler-Bernoulli beam of so many modes."""

    MOST_STOPS: ClassVar[int] = 8
    NAME: ClassVar[str] = "a beam"

    kind: Annotated[Literal["beam"], _BODY_KINDS]
    length: Annotated[Positive, Rule(unit="m", fmu="length")]
    width: Annotated[Positive | None, Rule(unit="m", fmu="width", doc="with the three keys below")] = None
    thickness: Annotated[
        Positive | None,
        Rule(unit="m", hint="It is measured along the motion.", fmu="thickness", doc="along the motion"),
    ] = None
    youngs_modulus: Annotated[Positive | None, Rule(unit="Pa", fmu="youngs_modulus")] = None
    density: Annotated[Positive | None, Rule(unit="kg/m^3", fmu="density")] = None
    flexural_rigidity: Annotated[
        Positive | None,
        Rule(
            unit="N m^2",
            fmu="flexural_rigidity",
            doc="beside `mass_per_length`, in place of the four keys above",
        ),
    ] = None
    mass_per_length: Annotated[Positive | None, Rule(unit="kg/m", fmu="mass_per_length")] = None
    frequency: Annotated[
        Positive | None,
        Rule(
            unit="Hz",
            hint="It is the first natural frequency, beside mass_per_length.",
            doc="first natural frequency, beside `mass_per_length` and in place of `flexural_rigidity`",
        ),
    ] = None
    boundary: Annotated[
        Literal["clamped-free", "clamped-clamped", "clamped-pinned", "pinned-pinned"], Rule()
    ] = "clamped-free"
    modes: Annotated[
        ModeCount,
        Rule(
            f'a whole number from 1 to {MOST_MODES}, or "auto"',
            sweepable=True,
            doc="1 to 64; a coefficient of restitution has a meaning only together with it; "
            '`"auto"`: the fewest that meet `execution.tolerance`, see [below](#how-many-modes)',
        ),
    ] = 4
    residual: Annotated[
        bool | None,
        Rule(
            hint="It needs stops that yield.",
            default="false",
            doc="the last of the modes, one for each place of a stop, are not natural ones but what all modes beyond "
            "give way under a force there, so that the beam is not too stiff for its stops; they have to yield",
        ),
    ] = None
    damping_ratio: Annotated[
        NotNegativeNumbers,
        Rule(hint="One number for all modes, or one for each.", fmu="damping_ratio[i]", effect=DAMPING),
    ] = 0.0
    frequency_slope: Annotated[FiniteNumbers, _of_amplitude(*_FREQUENCY_SLOPE, each="[i]")] = 0.0
    damping_slope: Annotated[FiniteNumbers, _of_amplitude(*_DAMPING_SLOPE, each="[i]")] = 0.0
    damping_reciprocal: Annotated[NotNegativeNumbers, _of_amplitude(*_DAMPING_RECIPROCAL, each="[i]")] = 0.0
    rayleigh: Annotated[
        Rayleigh | None,
        Rule(
            "a table such as { mass = 0.1, stiffness = 1e-5 }",
            hint="Both are optional.",
            doc="`{ mass = .., stiffness = .. }`: adds mass / (2 w) + stiffness w / 2 to each damping ratio",
        ),
    ] = None
    poisson_ratio: Annotated[
        Finite,
        Field(gt=-1, le=0.5),
        Rule(
            "-1 < nu <= 0.5",
            hint="It serves the warning of modes that are too short for this theory.",
            sweepable=False,
            fmu="poisson_ratio",
            doc="only for the warning of modes that leave the theory's validity",
        ),
    ] = 0.3
    impact_projection: Annotated[
        Literal["variational", "collocation"],
        Rule(
            hint="Only variational impacts never create energy.",
            doc='`"variational"`: impacts never create energy; `"collocation"`: the thesis\'s rule (7.60), which can',
        ),
    ] = "variational"
    displacement_start: Annotated[
        StartArray,
        Rule(
            unit="m",
            hint="One for each mode.",
            fmu="modal_displacement_start[i]",
            doc="of the modes: the displacement at s is the sum of shape(s) times these; at most one for each mode. "
            "The beam's FMU refuses a start beyond a rigid stop",
            default="0",
        ),
    ] = ()
    velocity_start: Annotated[
        StartArray,
        Rule(
            unit="m/s",
            hint="One for each mode.",
            fmu="modal_velocity_start[i]",
            doc="likewise",
            default="0",
        ),
    ] = ()

    @property
    def size(self) -> int:
        """Number of modes; where it is to be found, the most that it may be."""
        return MOST_MODES if self.modes == "auto" else self.modes


Body = OscillatorBody | ChainBody | BeamBody

BODY_MODELS: dict[str, type[Body]] = {"oscillator": OscillatorBody, "chain": ChainBody, "beam": BeamBody}
