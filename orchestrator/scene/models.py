"""The tables of a scene file as frozen pydantic models.

A field is defined in one place: its constraints, its default, and its `Rule`. Messages, keys of sweeps, units of
datasets, parameters of FMUs and the tables of docs/scene come from there (`fields`). Rules between fields or tables
are in `rules`. A new contact law is one more model here, in `Stop`; a new kind of body is one more in `body_models`.
The tables of a measuring chain, a replay and a sweep are in `measuring_models`, `replay_models` and `sweep_models`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar, Literal, get_args

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from vibroimpact.orchestrator.scene.fields import Rule, listed
from vibroimpact.orchestrator.scene.point_fields import MOST_OBSERVED, POINT_RULE, Observed, Point
from vibroimpact.orchestrator.scene.problems import ARRAY_TAG, NUMBER_TAG, WORD_TAG

MOST_SAMPLES_PER_RUN = 10**8
MOST_PERIODS = 10**9
MOST_MODES = 64
"""Largest number of masses of a chain and of modes of a beam, for which the FMUs are compiled."""

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[Finite, Field(gt=0)]
NotNegative = Annotated[Finite, Field(ge=0)]
Fraction = Annotated[Finite, Field(ge=0, le=1)]
ModeNumber = Annotated[int, Field(ge=1, le=MOST_MODES)]
_Array = Field(strict=False, min_length=1, max_length=MOST_MODES)
FiniteArray = Annotated[tuple[Finite, ...], _Array]
PositiveArray = Annotated[tuple[Positive, ...], _Array]
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


def _word_or_number(value: object) -> str:
    return WORD_TAG if isinstance(value, str) else NUMBER_TAG


ModeCount = Annotated[
    Annotated[ModeNumber, Tag(NUMBER_TAG)] | Annotated[Literal["auto"], Tag(WORD_TAG)],
    Discriminator(_word_or_number),
]


StepSize = Annotated[
    Annotated[Positive, Tag(NUMBER_TAG)] | Annotated[Literal["auto"], Tag(WORD_TAG)],
    Discriminator(_word_or_number),
]


class SceneTable(BaseModel):
    """Base of all tables: values are not converted, unknown keys are errors, and instances are frozen."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class SceneHeader(SceneTable):
    """`[scene]`: the title of the scene and the units of its numbers."""

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
"""Effects that a number > 0 asks for."""

FEEDS_ENERGY = "Negative damping feeds energy into the body."


def location_rule(doc: str, default: str) -> Rule:
    """Return the rule of a point of a beam."""
    hint = "It is a fraction of the length: 0 is the clamped end, 1 the far end."
    return Rule(hint=hint, doc=doc, default=default)


MOST_KNOTS = 8192
"""Most numbers of the tables of a scene, for which the FMU Structure is compiled."""
MOTION_KEYS = (
    *("velocity", "motion_amplitude", "motion_angular_frequency", "motion_phase"),
    *("motion_times", "motion_values"),
)
"""Keys of a stop that moves."""
_Knots = Annotated[tuple[Finite, ...], Field(strict=False, min_length=2, max_length=MOST_KNOTS)]


class StopTable(SceneTable):
    """Base of `[[stop]]`: the place of a stop, and its motion."""

    between: ClassVar[tuple[str, ...]] = ()

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
        location_rule(
            "beams: the point that the stop limits; not a supported end",
            "the tip; required where the far end is supported",
        ),
    ] = None
    at: Annotated[
        Point | None,
        replace(
            POINT_RULE,
            doc='several bodies: the point that the stop limits, such as `"ball"` or `"chain.2"`',
            default="required there",
        ),
    ] = None
    velocity: Annotated[
        Finite,
        Rule(
            unit="m/s",
            fmu="stop[k].velocity",
            told_if_given=True,
            doc="the stop moves by velocity times time; its other motions are added",
        ),
    ] = 0.0
    motion_amplitude: Annotated[
        Finite,
        Rule(
            unit="m",
            fmu="stop[k].amplitude",
            told_if_given=True,
            doc="the stop moves by motion_amplitude cos(motion_angular_frequency time + motion_phase)",
        ),
    ] = 0.0
    motion_angular_frequency: Annotated[
        NotNegative,
        Rule(
            unit="rad/s",
            fmu="stop[k].angular_frequency",
            told_if_given=True,
            doc="> 0 with a motion_amplitude",
            default="required there",
        ),
    ] = 0.0
    motion_phase: Annotated[
        Finite, Rule(unit="rad", fmu="stop[k].phase", told_if_given=True, doc="at time 0")
    ] = 0.0
    motion_times: Annotated[
        _Knots | None,
        Rule(
            "an array of 2 ascending numbers or more",
            unit="s",
            sweepable=False,
            doc="instants of motion_values; before the first and after the last the stop keeps its velocity",
            default="no table",
        ),
    ] = None
    motion_values: Annotated[
        _Knots | None,
        Rule(
            "an array of as many numbers as motion_times",
            unit="m",
            sweepable=False,
            doc="the stop moves by the natural cubic spline through them",
            default="no table",
        ),
    ] = None

    @property
    def moves(self) -> bool:
        """Whether a motion of the stop is given, which may be 0."""
        return not self.model_fields_set.isdisjoint(MOTION_KEYS)

    @property
    def drifts(self) -> bool:
        """Whether the stop has a motion that is no sine."""
        return self.velocity != 0.0 or self.motion_times is not None


class ContactTable(SceneTable):
    """Base of `[[contact]]` of a scene with `[[body]]`: two points that hit each other.

    The displacement of a contact is the first point's minus the second's, with a stop above it at the clearance.
    """

    side: ClassVar[Literal["upper"]] = "upper"
    mass: ClassVar[None] = None
    location: ClassVar[None] = None
    at: ClassVar[None] = None
    moves: ClassVar[bool] = False

    between: Annotated[
        tuple[Point, ...],
        Field(strict=False, min_length=2, max_length=2),
        replace(
            POINT_RULE,
            expected='two points of bodies such as ["ball", "beam.tip"]',
            doc="two points, of two bodies or of one; the gap is the clearance, plus the displacement of the second "
            "point, minus the displacement of the first",
        ),
    ]
    clearance: Annotated[
        Finite, Rule(unit="m", fmu="contact[k].position", doc="gap while both displacements are 0")
    ] = 0.0

    @property
    def position(self) -> float:
        """Position of the stop that limits the relative displacement, m: the clearance."""
        return self.clearance


class RestitutionLaw(SceneTable):
    """A rigid contact; an impact multiplies the velocity by -restitution."""

    law: Annotated[Literal["restitution"], Rule()] = "restitution"
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


class KelvinVoigtLaw(SceneTable):
    """A spring and a dashpot in parallel, which never pull."""

    law: Annotated[Literal["kelvin_voigt"], Rule()]
    stiffness: Annotated[Positive, Rule(unit="N/m", fmu="contact[k].stiffness")]
    damping: Annotated[NotNegative, Rule(unit="N s/m", hint=FEEDS_ENERGY, fmu="contact[k].damping")] = 0.0
    relaxation_time: Annotated[
        NotNegative,
        Rule(
            unit="s",
            hint="Use 0 for a surface that relaxes at once.",
            fmu="contact[k].relaxation_time",
            doc="time constant with which the surface comes back after separation; 0: at once; fused runs only",
        ),
    ] = 0.0


class HertzLaw(SceneTable):
    """An elastic ball, force = stiffness penetration^1.5."""

    law: Annotated[Literal["hertz"], Rule()]
    stiffness: Annotated[Positive, Rule(unit="N/m^1.5", fmu="contact[k].stiffness")]


class HuntCrossleyLaw(SceneTable):
    """Force = stiffness penetration^exponent (1 + damping rate); it never pulls."""

    law: Annotated[Literal["hunt_crossley"], Rule()]
    stiffness: Annotated[Positive, Rule(unit="N/m^exponent", fmu="contact[k].stiffness")]
    damping: Annotated[NotNegative, Rule(unit="s/m", hint=FEEDS_ENERGY, fmu="contact[k].damping")] = 0.0
    exponent: Annotated[Finite, Field(ge=1, le=10), Rule(fmu="contact[k].exponent")] = 1.5


class RestitutionStop(RestitutionLaw, StopTable):
    """`[[stop]]`: a rigid stop."""


class KelvinVoigtStop(KelvinVoigtLaw, StopTable):
    """`[[stop]]`: a spring beside a dashpot."""


class HertzStop(HertzLaw, StopTable):
    """`[[stop]]`: an elastic ball."""


class HuntCrossleyStop(HuntCrossleyLaw, StopTable):
    """`[[stop]]`: a ball that loses energy."""


class RestitutionContact(RestitutionLaw, ContactTable):
    """`[[contact]]`: two rigid points."""


class KelvinVoigtContact(KelvinVoigtLaw, ContactTable):
    """`[[contact]]`: a spring beside a dashpot between two points."""


class HertzContact(HertzLaw, ContactTable):
    """`[[contact]]`: two elastic spheres."""


class HuntCrossleyContact(HuntCrossleyLaw, ContactTable):
    """`[[contact]]`: two spheres that lose energy."""


class TimeSeries(SceneTable):
    """`record.time_series`: variables sampled at a constant rate; `sampled_names` lists the possible names."""

    rate: Annotated[
        Positive | None,
        Rule(
            unit="samples per s",
            doc="at most 10^8 samples per run",
            default="required; with `[daq]` the rate of `[daq]`",
        ),
    ] = None
    variables: Annotated[
        tuple[Annotated[str, Field(min_length=1, max_length=200)], ...],
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
    """`[record]`: the transient, the recording, and the recorded quantities.

    A forced scene counts periods, and its times are 0; any other scene has times, and its periods are 0.
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
            doc="largest and smallest displacement of each period; an unforced scene has no periods and no extremes"
        ),
    ] = True
    strobe: Annotated[
        bool,
        Rule(
            doc="displacement and velocity once per period, where the forcing phase is 0; none in an unforced scene"
        ),
    ] = True
    each_period: Annotated[
        bool,
        Rule(
            doc="`false`: one value for all recorded periods together, enough for a map of many points: the largest "
            "and smallest displacement, the mean number of impacts, the strobe of the last period"
        ),
    ] = True
    observed: Annotated[
        tuple[Observed, ...],
        Field(strict=False, max_length=MOST_OBSERVED),
        Rule(
            f"an array of at most {MOST_OBSERVED} points and pairs of points",
            item="a point of a body, or an array of two points",
            hint='For example ["ball", ["ball", "frame"]].',
            doc='several bodies: points such as `"ball"`, and pairs such as `["ball", "frame"]` for the first '
            "displacement minus the second; each has extremes and a strobe, the first as the observed point",
            default="the first stop's point, else the first contact's first point, else the last body",
        ),
    ] = ()
    time_series: Annotated[
        TimeSeries | None,
        Rule(
            'a table such as { rate = 200, variables = ["displacement"] }',
            doc='`{ rate = 200, variables = ["displacement", "velocity"] }`',
        ),
    ] = None


OwnStop = RestitutionStop | KelvinVoigtStop | HertzStop | HuntCrossleyStop
Contact = RestitutionContact | KelvinVoigtContact | HertzContact | HuntCrossleyContact
Stop = OwnStop | Contact
"""Everything that limits a motion: a stop, or another point of the bodies."""

STOP_MODELS: dict[str, type[OwnStop]] = {
    get_args(model.model_fields["law"].annotation)[0]: model for model in get_args(OwnStop)
}
"""Models of `[[stop]]` by contact law; the core has each law under the same name."""

CONTACT_MODELS: dict[str, type[Contact]] = {
    get_args(model.model_fields["law"].annotation)[0]: model for model in get_args(Contact)
}
"""Models of `[[contact]]` of a scene with `[[body]]`, by contact law."""

LAWS_THAT_YIELD = listed(
    [f'"{law}"' for law, model in STOP_MODELS.items() if model is not RestitutionStop], "or"
)
"""Compliant contact laws in words, for messages."""
