"""The tables of a scene file as frozen pydantic models.

A field says everything about itself in one place: its constraints, its default, and its `Rule`, from which messages,
keys of sweeps, units of datasets, parameters of FMUs and the tables of docs/scene.md come (`fields`). Rules between
fields or tables are in `rules`. Another kind of body or contact law becomes one more model here and one more entry in
`BODY_MODELS` or `STOP_MODELS`.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from vibroimpact.orchestrator.importer.specification import Exchange
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.problems import ARRAY_TAG, NUMBER_TAG
from vibroimpact.orchestrator.scene.sweep import SweepPath

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

    title: Annotated[
        str,
        Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$"),
        Rule("one line of text", doc="one line, at most 200 characters"),
    ] = ""
    units: Annotated[
        Literal["SI", "nondimensional"],
        Rule(hint="A scene has one system of units for all of its numbers."),
    ] = "SI"


DAMPING = "damping"
FALLING_RESTITUTION = "restitution that falls with speed"
AMPLITUDE = "motion that depends on its amplitude"
"""Effects that a number > 0 calls for."""

_BODY_KINDS = Rule('"oscillator", "chain" or "beam"')
_FEEDS = "Negative damping feeds energy into the body."


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
    damping_given: Annotated[NotNegative, Rule(unit="N s/m", hint=_FEEDS, fmu="damping", effect=DAMPING)] = (
        Field(0.0, alias="damping")
    )
    damping_ratio: Annotated[
        NotNegative | None,
        Rule(
            hint=_FEEDS,
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
        return 2.0 * self.damping_ratio * math.sqrt(self.stiffness * self.mass)


_ARRAY_OR_ONE = "an array of numbers >= 0, or one number for all"
_SPRING_HINT = "Element i lies between mass i - 1 (the ground for i = 1) and mass i."
_FREE_END = "Use 0 for a free far end."


class ChainBody(SceneTable):
    """`[body]`: masses in a row, each joined to the one before by a spring and a dashpot."""

    MOST_STOPS: ClassVar[int] = 8
    NAME: ClassVar[str] = "a chain"

    kind: Annotated[Literal["chain"], _BODY_KINDS]
    masses: Annotated[
        tuple[Positive, ...],
        _Array,
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
        ModeNumber, Rule(doc="a coefficient of restitution has a meaning only together with it")
    ] = 4
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
        """Number of modes."""
        return self.modes


def _location(doc: str, default: str) -> Rule:
    hint = "It is a fraction of the length: 0 is the clamped end, 1 the far end."
    return Rule(hint=hint, doc=doc, default=default)


class Sensor(SceneTable):
    """`[sensor]`: the observed point of a beam, and what a reading there is: gain * value + offset."""

    location: Annotated[
        Fraction | None,
        _location(
            "beams only; a point that moves",
            "left out: the tip of a clamped-free beam, else the point of `stop[1]`, or the middle",
        ),
    ] = None
    gain: Annotated[
        Finite,
        Rule(
            hint="A reading is gain * value + offset, in the unit of its channel.",
            doc="replays only: reading per value, both in the unit of the channel; where these are of different "
            "kinds, in its unit per SI unit",
        ),
    ] = 1.0
    offset: Annotated[
        Finite,
        Rule(
            hint="It has the unit of the reading.",
            doc="replays only, in the unit of the reading: left out, the level of the channel before its event is "
            "taken off instead",
        ),
    ] = 0.0


_CONSTANT = "Use 0 for a constant force."


class Forcing(SceneTable):
    """`[forcing]`: amplitude cos(angular_frequency t + phase), a force or an acceleration of the base."""

    kind: Annotated[
        Literal["force", "base_acceleration", "uniform", "mode"],
        Rule(
            doc='`"force"`; `"base_acceleration"`: the amplitude is the acceleration of the base, displacements are '
            'relative to it; for beams also `"uniform"`: a force per length, and `"mode"`: a load in the shape of a '
            "mode"
        ),
    ] = "force"
    amplitude: Annotated[
        FiniteNumbers,
        Rule(
            "a finite number, or an array of them for a chain",
            unit="N (m/s^2 for base_acceleration, N/m for uniform)",
            doc='of a chain under `"force"` one for each mass; a number is enough for a single mass',
        ),
    ]
    angular_frequency_given: Annotated[
        NotNegative | None,
        Rule(
            unit="rad/s",
            hint=_CONSTANT,
            fmu="forcing.angular_frequency",
            doc="0 is a constant force, amplitude cos(phase), for example a weight",
            default="this or `frequency`",
        ),
    ] = Field(None, alias="angular_frequency")
    frequency: Annotated[
        NotNegative | None,
        Rule(unit="Hz", hint=_CONSTANT, doc="SI scenes only", default="this or `angular_frequency`"),
    ] = None
    phase: Annotated[
        Finite,
        Rule(
            unit="rad",
            fmu="forcing.phase",
            doc="of the force at time 0. The recording begins and ends where the forcing phase is 0, so with a phase "
            "other than 0 it begins up to one period after time 0, also with `transient_periods = 0`: what happens "
            "before is not in the data",
        ),
    ] = 0.0
    location: Annotated[
        Fraction | None,
        _location('point of a beam that a `"force"` acts on; one that moves', "the free tip, or the middle"),
    ] = None
    mode: Annotated[
        ModeNumber | None,
        Rule(
            doc="the mode whose shape the load has; no other mode is driven by it",
            default='required for `"mode"`',
        ),
    ] = None

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

    position: Annotated[Finite, Rule(unit="m", fmu="contact[k].position")]
    side: Annotated[
        Literal["upper", "lower"],
        Rule(
            hint="upper: displacement <= position; lower: displacement >= position.",
            doc='`"upper"`: displacement <= position; `"lower"`: displacement >= position',
        ),
    ] = "upper"
    mass: Annotated[
        ModeNumber | None,
        Rule(hint="Masses count from 1.", doc="chains: the mass that the stop limits", default="the last"),
    ] = None
    location: Annotated[
        Fraction | None,
        _location(
            "beams: the point that the stop limits; one that moves",
            "the tip; required where the far end is supported",
        ),
    ] = None


class RestitutionStop(StopTable):
    """`[[stop]]`: a rigid stop; an impact multiplies the velocity by -restitution."""

    law: Annotated[Literal["restitution"], _LAWS] = "restitution"
    restitution: Annotated[
        Fraction,
        Rule(
            "0 <= r <= 1", hint="Use 1 for an elastic stop, 0 for a dead one.", fmu="contact[k].restitution"
        ),
    ]
    yield_velocity: Annotated[
        NotNegative,
        Rule(
            unit="m/s",
            hint="Use 0 for a restitution that does not depend on speed.",
            fmu="contact[k].yield_velocity",
            effect=FALLING_RESTITUTION,
            doc="above it restitution falls as (velocity / yield_velocity)^(-1/4); 0: it is constant",
        ),
    ] = 0.0


class KelvinVoigtStop(StopTable):
    """`[[stop]]`: a spring beside a dashpot; it never pulls."""

    law: Annotated[Literal["kelvin_voigt"], _LAWS]
    stiffness: Annotated[Positive, Rule(unit="N/m", fmu="contact[k].stiffness")]
    damping: Annotated[NotNegative, Rule(unit="N s/m", hint=_FEEDS, fmu="contact[k].damping")] = 0.0
    relaxation_time: Annotated[
        NotNegative,
        Rule(
            unit="s",
            hint="Use 0 for a surface that relaxes at once.",
            fmu="contact[k].relaxation_time",
            doc="time constant with which the surface comes back after separation; 0: at once; fused runs only",
        ),
    ] = 0.0


class HertzStop(StopTable):
    """`[[stop]]`: an elastic ball, force = stiffness penetration^1.5."""

    law: Annotated[Literal["hertz"], _LAWS]
    stiffness: Annotated[Positive, Rule(unit="N/m^1.5", fmu="contact[k].stiffness")]


class HuntCrossleyStop(StopTable):
    """`[[stop]]`: force = stiffness penetration^exponent (1 + damping rate); it never pulls."""

    law: Annotated[Literal["hunt_crossley"], _LAWS]
    stiffness: Annotated[Positive, Rule(unit="N/m^exponent", fmu="contact[k].stiffness")]
    damping: Annotated[NotNegative, Rule(unit="s/m", hint=_FEEDS, fmu="contact[k].damping")] = 0.0
    exponent: Annotated[Finite, Field(ge=1, le=10), Rule(fmu="contact[k].exponent")] = 1.5


class TimeSeries(SceneTable):
    """`record.time_series`: variables sampled at a constant rate; `sampled_names` knows which there are."""

    rate: Annotated[Positive, Rule(unit="samples per s", doc="at most 10^8 samples per run")]
    variables: Annotated[
        tuple[Annotated[str, Field(min_length=1, max_length=60)], ...],
        Field(strict=False, min_length=1),
        Rule(
            "an array of variable names",
            item="a variable name",
            hint='For example ["displacement", "velocity", "contact_force"].',
            doc="of the names below, each once",
        ),
    ] = ("displacement", "velocity")


_NOT_RECORDED = "not recorded"


class Record(SceneTable):
    """`[record]`: how long to wait, how long to record, and what.

    A forced scene counts periods and its times are 0; any other scene has times and its periods are 0.
    """

    transient_periods: Annotated[int, Field(ge=0, le=MOST_PERIODS), Rule(doc=_NOT_RECORDED)] = 0
    recorded_periods: Annotated[
        int, Field(ge=1, le=MOST_SAMPLES_PER_RUN), Rule(default="required when forced")
    ] = 0
    transient_time: Annotated[NotNegative, Rule(unit="s", doc=_NOT_RECORDED)] = 0.0
    recorded_time: Annotated[Positive, Rule(unit="s", default="required when unforced")] = 0.0
    impacts: Annotated[bool, Rule(doc="times, phases, velocities and impulses of impacts; sticking")] = True
    extrema: Annotated[
        bool,
        Rule(
            doc="largest and smallest displacement of each period; an unforced scene has no periods and none of these"
        ),
    ] = True
    strobe: Annotated[
        bool,
        Rule(
            doc="displacement and velocity once per period, where the forcing phase is 0; none in an unforced scene"
        ),
    ] = True
    time_series: Annotated[
        TimeSeries | None,
        Rule(
            'a table such as { rate = 200, variables = ["displacement"] }',
            doc='`{ rate = 200, variables = ["displacement", "velocity"] }`',
        ),
    ] = None


class Execution(SceneTable):
    """`[execution]`: how points run and when to give one up.

    `macro_step`, `exchange` and `guard` are for coupled runs.
    """

    how: Annotated[
        Literal["auto", "coupled", "fused"],
        Rule(
            unavailable=("batch",),
            doc='`"auto"`; `"fused"`: the contact law runs inside the body; `"coupled"`: each component is an FMU of '
            "its own and the importer finds the events between them",
        ),
    ] = "auto"
    impact_limit: Annotated[
        int,
        Field(ge=1, le=MOST_IMPACTS_PER_POINT),
        Rule(
            doc="impacts, touch-downs and rests per point, recorded or not, then its outcome is impact_limit"
        ),
    ] = DEFAULT_IMPACT_LIMIT
    deadline: Annotated[
        Positive | None,
        Rule(
            unit="s",
            doc="wall time per point, then its outcome is timeout; looked at every few hundredths of a second, within "
            "a long step too",
        ),
    ] = None
    macro_step: Annotated[
        Positive | None,
        Rule(unit="s", doc="time between two exchanges of values; coupled only", default="the whole run"),
    ] = None
    exchange: Annotated[
        Exchange,
        Rule(
            doc='`"jacobi"`, `"gauss_seidel"`, `"iterated"`: whose values of the step each component sees; coupled only'
        ),
    ] = "gauss_seidel"
    guard: Annotated[
        bool,
        Rule(
            doc="points run in a child process, which may crash or hang; coupled only",
            default="false; true as soon as a component is a file",
        ),
    ] = False
    contact_tolerance: Annotated[
        Annotated[Finite, Field(gt=0, le=1e-2)] | None,
        Rule(
            "0 < tolerance <= 0.01",
            hint="It is the relative error of hertz and hunt_crossley stops.",
            fmu="contact_tolerance",
            doc="relative error of hertz and hunt_crossley stops, whose contacts are integrated; the other laws are "
            "exact; not in general scenes",
            default="1e-10",
        ),
    ] = None


class AxisTable(SceneTable):
    """One entry of `[sweep]` as written: a range or a list, and a path."""

    start: Annotated[Finite | None, Rule(doc="first value of a range")] = None
    stop: Annotated[Finite | None, Rule(doc="last value of a range, included")] = None
    points: Annotated[
        int | None,
        Field(ge=1, le=MOST_POINTS_PER_AXIS),
        Rule(doc="number of values of a range, evenly spaced; at least 2 unless start = stop"),
    ] = None
    values: Annotated[
        tuple[Finite, ...] | None,
        Field(strict=False, min_length=1),
        Rule(doc="instead of a range; all different"),
    ] = None
    path: Annotated[SweepPath, Rule()] = "independent"


Body = OscillatorBody | ChainBody | BeamBody
Stop = RestitutionStop | KelvinVoigtStop | HertzStop | HuntCrossleyStop

BODY_MODELS: dict[str, type[Body]] = {"oscillator": OscillatorBody, "chain": ChainBody, "beam": BeamBody}
STOP_MODELS: dict[str, type[Stop]] = {
    "restitution": RestitutionStop,
    "kelvin_voigt": KelvinVoigtStop,
    "hertz": HertzStop,
    "hunt_crossley": HuntCrossleyStop,
}
