"""The tables of a scene file as frozen pydantic models.

Each field says three things in one place: its constraints, its `Rule` in words (for messages), and its
default. Rules between fields or tables are in `rules`. Another kind of body or contact law becomes
one more model here and one more entry in `BODY_MODELS` or `STOP_MODELS`.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from vibroimpact.orchestrator.importer.specification import Exchange
from vibroimpact.orchestrator.scene.problems import ARRAY_TAG, NUMBER_TAG, Rule
from vibroimpact.orchestrator.scene.sweep import Path

MOST_SAMPLES_PER_RUN = 10**8
MOST_PERIODS = 10**9
MOST_POINTS_PER_AXIS = 10**6
MOST_IMPACTS_PER_POINT = 10**12
DEFAULT_IMPACT_LIMIT = 10_000_000
MOST_MODES = 64
"""Masses of a chain, and modes of a beam: what the FMUs are compiled for."""

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[Finite, Field(gt=0)]
NotNegative = Annotated[Finite, Field(ge=0)]
Fraction = Annotated[Finite, Field(ge=0, le=1)]
Switch = Annotated[bool, Rule("true or false")]
ModeNumber = Annotated[int, Field(ge=1, le=MOST_MODES)]
_Array = Field(strict=False, min_length=1, max_length=MOST_MODES)
FiniteArray = Annotated[tuple[Finite, ...], _Array]
StartArray = Annotated[tuple[Finite, ...], Field(strict=False, max_length=MOST_MODES)]


def _shape(value: object) -> str:
    return ARRAY_TAG if isinstance(value, list | tuple) else NUMBER_TAG


FiniteNumbers = Annotated[
    Annotated[Finite, Tag(NUMBER_TAG)] | Annotated[FiniteArray, Tag(ARRAY_TAG)], Discriminator(_shape)
]
NotNegativeNumbers = Annotated[
    Annotated[NotNegative, Tag(NUMBER_TAG)] | Annotated[tuple[NotNegative, ...], _Array, Tag(ARRAY_TAG)],
    Discriminator(_shape),
]


class SceneTable(BaseModel):
    """Base of all tables: nothing is converted, unknown keys are errors, nothing changes afterwards."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class SceneHeader(SceneTable):
    """`[scene]`: what the scene is called and what its numbers mean."""

    title: Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$"), Rule("one line of text")] = (
        ""
    )
    units: Annotated[
        Literal["SI", "nondimensional"],
        Rule('"SI" or "nondimensional"', hint="A scene has one system of units for all of its numbers."),
    ] = "SI"


_BODY_KINDS = Rule('"oscillator", "chain" or "beam"')


_SLOPE_HINT = "It is of the amplitude of the motion; 0 is a mode that does not depend on it."


class OscillatorBody(SceneTable):
    """`[body]`: one mass on a spring and a dashpot, mass x'' + damping x' + stiffness x = force."""

    MOST_STOPS: ClassVar[int] = 2
    NAME: ClassVar[str] = "an oscillator"

    kind: Annotated[Literal["oscillator"], _BODY_KINDS] = "oscillator"
    mass: Annotated[Positive, Rule("a number > 0", "kg")]
    stiffness: Annotated[NotNegative, Rule("a number >= 0", "N/m", "Use 0 for a body without a spring.")]
    damping_given: Annotated[
        NotNegative, Rule("a number >= 0", "N s/m", "Negative damping feeds energy into the body.")
    ] = Field(0.0, alias="damping")
    damping_ratio: Annotated[
        NotNegative | None, Rule("a number >= 0", hint="Negative damping feeds energy into the body.")
    ] = None
    displacement_start: Annotated[Finite, Rule("a finite number", "m")] = 0.0
    velocity_start: Annotated[Finite, Rule("a finite number", "m/s")] = 0.0
    frequency_slope: Annotated[Finite, Rule("a finite number", "1/m", _SLOPE_HINT)] = 0.0
    damping_slope: Annotated[Finite, Rule("a finite number", "1/m", _SLOPE_HINT)] = 0.0
    damping_reciprocal: Annotated[NotNegative, Rule("a number >= 0", "m", _SLOPE_HINT)] = 0.0

    @property
    def damping(self) -> float:
        """Damping coefficient, N s/m: as given, or 2 damping_ratio sqrt(stiffness mass)."""
        if self.damping_ratio is None:
            return self.damping_given
        return 2.0 * self.damping_ratio * math.sqrt(self.stiffness * self.mass)


_SPRING_HINT = "Element i lies between mass i - 1 (the ground for i = 1) and mass i."


class ChainBody(SceneTable):
    """`[body]`: masses in a row, each joined to the one before by a spring and a dashpot."""

    MOST_STOPS: ClassVar[int] = 8
    NAME: ClassVar[str] = "a chain"

    kind: Annotated[Literal["chain"], _BODY_KINDS]
    masses: Annotated[
        tuple[Positive, ...],
        _Array,
        Rule(f"an array of 1 to {MOST_MODES} numbers > 0", "kg", "One for each mass.", item="a number > 0"),
    ]
    stiffnesses: Annotated[
        NotNegativeNumbers,
        Rule("an array of numbers >= 0, or one number for all", "N/m", _SPRING_HINT, item="a number >= 0"),
    ]
    dampings: Annotated[
        NotNegativeNumbers,
        Rule("an array of numbers >= 0, or one number for all", "N s/m", _SPRING_HINT, item="a number >= 0"),
    ] = 0.0
    far_stiffness: Annotated[NotNegative, Rule("a number >= 0", "N/m", "Use 0 for a free far end.")] = 0.0
    far_damping: Annotated[NotNegative, Rule("a number >= 0", "N s/m", "Use 0 for a free far end.")] = 0.0
    observed_mass: Annotated[
        ModeNumber | None, Rule(f"a whole number from 1 to {MOST_MODES}", hint="Masses count from 1.")
    ] = None
    displacement_start: Annotated[
        StartArray,
        Rule("an array of finite numbers", "m", "One for each mass.", item="a finite number"),
    ] = ()
    velocity_start: Annotated[
        StartArray,
        Rule("an array of finite numbers", "m/s", "One for each mass.", item="a finite number"),
    ] = ()

    @property
    def size(self) -> int:
        """Number of masses."""
        return len(self.masses)


class Rayleigh(SceneTable):
    """`body.rayleigh`: damping ratios mass / (2 w) + stiffness w / 2 in addition to those given."""

    mass: Annotated[NotNegative, Rule("a number >= 0", "1/s")] = 0.0
    stiffness: Annotated[NotNegative, Rule("a number >= 0", "s")] = 0.0


class BeamBody(SceneTable):
    """`[body]`: an Euler-Bernoulli beam of so many modes."""

    MOST_STOPS: ClassVar[int] = 8
    NAME: ClassVar[str] = "a beam"

    kind: Annotated[Literal["beam"], _BODY_KINDS]
    length: Annotated[Positive, Rule("a number > 0", "m")]
    width: Annotated[Positive | None, Rule("a number > 0", "m")] = None
    thickness: Annotated[Positive | None, Rule("a number > 0", "m", "It is measured along the motion.")] = (
        None
    )
    youngs_modulus: Annotated[Positive | None, Rule("a number > 0", "Pa")] = None
    density: Annotated[Positive | None, Rule("a number > 0", "kg/m^3")] = None
    flexural_rigidity: Annotated[Positive | None, Rule("a number > 0", "N m^2")] = None
    mass_per_length: Annotated[Positive | None, Rule("a number > 0", "kg/m")] = None
    frequency: Annotated[
        Positive | None,
        Rule("a number > 0", "Hz", "It is the first natural frequency, beside mass_per_length."),
    ] = None
    boundary: Annotated[
        Literal["clamped-free", "clamped-clamped", "clamped-pinned", "pinned-pinned"],
        Rule('"clamped-free", "clamped-clamped", "clamped-pinned" or "pinned-pinned"'),
    ] = "clamped-free"
    modes: Annotated[ModeNumber, Rule(f"a whole number from 1 to {MOST_MODES}")] = 4
    damping_ratio: Annotated[
        NotNegativeNumbers,
        Rule(
            "a number >= 0, or an array of them",
            hint="One number for all modes, or one for each.",
            item="a number >= 0",
        ),
    ] = 0.0
    frequency_slope: Annotated[
        FiniteNumbers,
        Rule("a finite number, or an array of them", "1/m", _SLOPE_HINT, item="a finite number"),
    ] = 0.0
    damping_slope: Annotated[
        FiniteNumbers,
        Rule("a finite number, or an array of them", "1/m", _SLOPE_HINT, item="a finite number"),
    ] = 0.0
    damping_reciprocal: Annotated[
        NotNegativeNumbers, Rule("a number >= 0, or an array of them", "m", _SLOPE_HINT, item="a number >= 0")
    ] = 0.0
    rayleigh: Annotated[
        Rayleigh | None, Rule("a table such as { mass = 0.1, stiffness = 1e-5 }", hint="Both are optional.")
    ] = None
    poisson_ratio: Annotated[
        Finite,
        Field(gt=-1, le=0.5),
        Rule("-1 < nu <= 0.5", hint="It serves the warning of modes that are too short for this theory."),
    ] = 0.3
    impact_projection: Annotated[
        Literal["variational", "collocation"],
        Rule('"variational" or "collocation"', hint="Only variational impacts never create energy."),
    ] = "variational"
    displacement_start: Annotated[
        StartArray,
        Rule("an array of finite numbers", "m", "One for each mode.", item="a finite number"),
    ] = ()
    velocity_start: Annotated[
        StartArray,
        Rule("an array of finite numbers", "m/s", "One for each mode.", item="a finite number"),
    ] = ()

    @property
    def size(self) -> int:
        """Number of modes."""
        return self.modes


_LOCATION = Rule(
    "a number from 0 to 1", hint="It is a fraction of the length: 0 is the clamped end, 1 the far end."
)


class Sensor(SceneTable):
    """`[sensor]`: the observed point of a beam, and what a reading there is: gain * value + offset."""

    location: Annotated[Fraction | None, _LOCATION] = None
    gain: Annotated[
        Finite,
        Rule("a finite number", hint="A reading is gain * value + offset, in the unit of its channel."),
    ] = 1.0
    offset: Annotated[Finite, Rule("a finite number", hint="It has the unit of the reading.")] = 0.0


class Forcing(SceneTable):
    """`[forcing]`: amplitude cos(angular_frequency t + phase), a force or an acceleration of the base."""

    kind: Annotated[
        Literal["force", "base_acceleration", "uniform", "mode"],
        Rule('"force", "base_acceleration", "uniform" or "mode"'),
    ] = "force"
    amplitude: Annotated[
        FiniteNumbers,
        Rule(
            "a finite number, or an array of them for a chain",
            "N (m/s^2 for base_acceleration, N/m for uniform)",
            item="a finite number",
        ),
    ]
    location: Annotated[Fraction | None, _LOCATION] = None
    mode: Annotated[ModeNumber | None, Rule(f"a whole number from 1 to {MOST_MODES}")] = None
    angular_frequency_given: Annotated[
        NotNegative | None, Rule("a number >= 0", "rad/s", "Use 0 for a constant force.")
    ] = Field(None, alias="angular_frequency")
    frequency: Annotated[NotNegative | None, Rule("a number >= 0", "Hz", "Use 0 for a constant force.")] = (
        None
    )
    phase: Annotated[Finite, Rule("a finite number", "rad")] = 0.0

    @property
    def scalar_amplitude(self) -> float:
        """Amplitude of a load that has one; forces on the masses of a chain have an array of them."""
        assert not isinstance(self.amplitude, tuple)
        return self.amplitude

    @property
    def angular_frequency(self) -> float:
        """Angular frequency, rad/s: as given, or 2 pi frequency; 0 means a constant force."""
        if self.frequency is not None:
            return 2.0 * math.pi * self.frequency
        return self.angular_frequency_given or 0.0


_LAWS = Rule('"restitution", "kelvin_voigt", "hertz" or "hunt_crossley"')


class StopTable(SceneTable):
    """Base of `[[stop]]`: where a stop is."""

    position: Annotated[Finite, Rule("a finite number", "m")]
    side: Annotated[
        Literal["upper", "lower"],
        Rule('"upper" or "lower"', hint="upper: displacement <= position; lower: displacement >= position."),
    ] = "upper"
    mass: Annotated[
        ModeNumber | None, Rule(f"a whole number from 1 to {MOST_MODES}", hint="Masses count from 1.")
    ] = None
    location: Annotated[Fraction | None, _LOCATION] = None


class RestitutionStop(StopTable):
    """`[[stop]]`: a rigid stop; an impact multiplies the velocity by -restitution."""

    law: Annotated[Literal["restitution"], _LAWS] = "restitution"
    restitution: Annotated[Fraction, Rule("0 <= r <= 1", hint="Use 1 for an elastic stop, 0 for a dead one.")]
    yield_velocity: Annotated[
        NotNegative, Rule("a number >= 0", "m/s", "Use 0 for a restitution that does not depend on speed.")
    ] = 0.0


class KelvinVoigtStop(StopTable):
    """`[[stop]]`: a spring beside a dashpot; it never pulls."""

    law: Annotated[Literal["kelvin_voigt"], _LAWS]
    stiffness: Annotated[Positive, Rule("a number > 0", "N/m")]
    damping: Annotated[
        NotNegative, Rule("a number >= 0", "N s/m", "Negative damping feeds energy into the body.")
    ] = 0.0
    relaxation_time: Annotated[
        NotNegative, Rule("a number >= 0", "s", "Use 0 for a surface that relaxes at once.")
    ] = 0.0


class HertzStop(StopTable):
    """`[[stop]]`: an elastic ball, force = stiffness penetration^1.5."""

    law: Annotated[Literal["hertz"], _LAWS]
    stiffness: Annotated[Positive, Rule("a number > 0", "N/m^1.5")]


class HuntCrossleyStop(StopTable):
    """`[[stop]]`: force = stiffness penetration^exponent (1 + damping rate); it never pulls."""

    law: Annotated[Literal["hunt_crossley"], _LAWS]
    stiffness: Annotated[Positive, Rule("a number > 0", "N/m^exponent")]
    damping: Annotated[
        NotNegative, Rule("a number >= 0", "s/m", "Negative damping feeds energy into the body.")
    ] = 0.0
    exponent: Annotated[Finite, Field(ge=1, le=10), Rule("a number from 1 to 10")] = 1.5


class TimeSeries(SceneTable):
    """`record.time_series`: variables sampled at a constant rate; `sampled_names` knows which there are."""

    rate: Annotated[Positive, Rule("a number > 0", "samples per s")]
    variables: Annotated[
        tuple[Annotated[str, Field(min_length=1, max_length=60)], ...],
        Field(strict=False, min_length=1),
        Rule(
            "an array of variable names",
            item="a variable name",
            hint='For example ["displacement", "velocity", "contact_force"].',
        ),
    ] = ("displacement", "velocity")


class Record(SceneTable):
    """`[record]`: how long to wait, how long to record, and what.

    A forced scene counts periods and its times are 0; any other scene has times and its periods are 0.
    """

    transient_periods: Annotated[
        int, Field(ge=0, le=MOST_PERIODS), Rule(f"a whole number from 0 to {MOST_PERIODS}")
    ] = 0
    recorded_periods: Annotated[
        int, Field(ge=1, le=MOST_SAMPLES_PER_RUN), Rule(f"a whole number from 1 to {MOST_SAMPLES_PER_RUN}")
    ] = 0
    transient_time: Annotated[NotNegative, Rule("a number >= 0", "s")] = 0.0
    recorded_time: Annotated[Positive, Rule("a number > 0", "s")] = 0.0
    impacts: Switch = True
    extrema: Switch = True
    strobe: Switch = True
    time_series: Annotated[
        TimeSeries | None, Rule('a table such as { rate = 200, variables = ["displacement"] }')
    ] = None


class Execution(SceneTable):
    """`[execution]`: how points run and when to give one up.

    `macro_step`, `exchange` and `guard` are for coupled runs.
    """

    how: Annotated[
        Literal["auto", "coupled", "fused"], Rule('"auto", "coupled" or "fused"', unavailable=("batch",))
    ] = "auto"
    impact_limit: Annotated[
        int,
        Field(ge=1, le=MOST_IMPACTS_PER_POINT),
        Rule(f"a whole number from 1 to {MOST_IMPACTS_PER_POINT}"),
    ] = DEFAULT_IMPACT_LIMIT
    deadline: Annotated[Positive | None, Rule("a number > 0", "s")] = None
    macro_step: Annotated[Positive | None, Rule("a number > 0", "s")] = None
    exchange: Annotated[Exchange, Rule('"jacobi", "gauss_seidel" or "iterated"')] = "gauss_seidel"
    guard: Switch = False
    contact_tolerance: Annotated[
        Annotated[Finite, Field(gt=0, le=1e-2)] | None,
        Rule("0 < tolerance <= 0.01", hint="It is the relative error of hertz and hunt_crossley stops."),
    ] = None


class AxisTable(SceneTable):
    """One entry of `[sweep]` as written: a range or a list, and a path."""

    start: Annotated[Finite | None, Rule("a finite number")] = None
    stop: Annotated[Finite | None, Rule("a finite number")] = None
    points: Annotated[
        int | None,
        Field(ge=1, le=MOST_POINTS_PER_AXIS),
        Rule(f"a whole number from 1 to {MOST_POINTS_PER_AXIS}"),
    ] = None
    values: Annotated[
        tuple[Finite, ...] | None,
        Field(strict=False, min_length=1),
        Rule("an array of finite numbers", item="a finite number"),
    ] = None
    path: Annotated[Path, Rule('"independent", "up", "down" or "up-down"')] = "independent"


Body = OscillatorBody | ChainBody | BeamBody
Stop = RestitutionStop | KelvinVoigtStop | HertzStop | HuntCrossleyStop

BODY_MODELS: dict[str, type[Body]] = {"oscillator": OscillatorBody, "chain": ChainBody, "beam": BeamBody}
STOP_MODELS: dict[str, type[Stop]] = {
    "restitution": RestitutionStop,
    "kelvin_voigt": KelvinVoigtStop,
    "hertz": HertzStop,
    "hunt_crossley": HuntCrossleyStop,
}
