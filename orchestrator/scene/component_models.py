"""The tables of a general scene as frozen pydantic models: components, connections and watched events."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

from pydantic import Field

from vibroimpact.orchestrator.importer.specification import Crossing, Side
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.models import (
    FEEDS_ENERGY,
    Finite,
    Fraction,
    NotNegative,
    Positive,
    SceneTable,
)

_Text = Annotated[str, Field(min_length=1, max_length=10_000, pattern=r"^[^\x00-\x1f\x7f]*$")]
_VARIABLE_RULE = Rule(
    "a variable COMPONENT.VARIABLE in quotes",
    item="a variable COMPONENT.VARIABLE in quotes",
    hint='For example "ball.h"; the component ends at the first dot.',
)
Reference = Annotated[_Text, _VARIABLE_RULE]


_Pair = Annotated[tuple[bool | int | str, bool | int | str], Field(strict=False)]


class ComponentTable(SceneTable):
    """`[component.NAME]`: an FMU and the start values of its variables."""

    fmu: Annotated[
        _Text,
        Rule(
            "a path of an FMU file, or the name of a shipped component",
            hint='For example "ball.fmu".',
            doc="a path that ends in `.fmu`, relative to the folder of the scene file; `grpc://HOST:PORT`, a server of "
            "one FMU ([elsewhere](../fmus_elsewhere.md)); or a shipped component: "
            '`"Oscillator"`, `"Chain"`, `"Beam"`, `"Structure"`, `"ImpactStop"`, `"Gain"`, `"Sensor"`, '
            '`"LoadCell"`, `"Exciter"`, `"Noise"`, `"AnalogInput"`, in any spelling',
        ),
    ]
    fmi: Annotated[
        Literal["3.0", "2.0"] | None,
        Rule(
            '"3.0" or "2.0", in quotes',
            doc='`"3.0"`, `"2.0"`; only for a shipped component',
            default='`"3.0"`',
        ),
    ] = None
    parameters: Annotated[
        dict[str, object],
        Rule(
            'a table such as { "mass" = 1.0, "contact[1].law" = "external" }',
            doc="start values by variable name; names with dots or brackets stand in quotes",
            default="empty",
        ),
    ] = Field(default_factory=dict)
    tolerance: Annotated[
        Annotated[Finite, Field(gt=0, le=1)] | None,
        Rule(
            "0 < tolerance <= 1",
            hint="It is the relative tolerance of the solver.",
            doc="relative tolerance of the solver inside the FMU, or of the integration in model exchange; only for an "
            "FMU from a file, or in model exchange",
            default="the FMU's own; in model exchange that of its default experiment, else 1e-8",
        ),
    ] = None
    certificate: Annotated[
        _Text | None,
        Rule(
            "a path of a certificate (PEM)",
            doc="a path relative to the folder of the scene file: the certificate (PEM) that the server must show, or "
            "that of the authority which has signed it; beside `grpc://` only",
            default="none: no TLS, on this machine alone",
        ),
    ] = None
    run_as: Annotated[
        Literal["auto", "model_exchange", "co_simulation"],
        Rule(
            '"auto", "model_exchange" or "co_simulation"',
            doc='`"co_simulation"`: the FMU makes its own steps; `"model_exchange"`: the importer integrates it; '
            '`"auto"`: co-simulation where the FMU has it',
            default='`"auto"`',
        ),
    ] = "auto"


class ConnectionTable(SceneTable):
    """`[[connection]]`: an input that is gain times an output, plus an offset, at every exchange."""

    source: Annotated[_Text, replace(_VARIABLE_RULE, doc="an output, a local variable or a parameter")] = (
        Field(alias="from")
    )
    target: Annotated[
        _Text,
        replace(
            _VARIABLE_RULE,
            doc="an input, or a tunable parameter, which changes at events; at most one connection may feed it",
        ),
    ] = Field(alias="to")
    gain: Annotated[Finite, Rule(doc="the input is gain times the output; only between real numbers")] = 1.0
    gain_unit: Annotated[
        _Text | None,
        Rule(
            'a unit such as "N/m", "N.s/m" or "1"',
            hint='Use "1" for a plain number.',
            doc='the unit of the gain, a product of SI units: `"N/m"`, `"N.s/m"`, `"kg.m2/s2"`, `"1"`',
        ),
    ] = None
    offset: Annotated[
        Finite, Rule(doc="added after the gain, in the unit of the input; only between real numbers")
    ] = 0.0
    mapping: Annotated[
        tuple[_Pair, ...],
        Field(strict=False),
        Rule(
            "an array of pairs such as [[1, 10], [2, 20]]",
            item="a pair of values",
            hint="Each pair has a value of the output, and the value that the input takes.",
            doc="pairs of a value of the output and the value that the input takes; only between whole numbers, "
            "enumerations and truth values; any other value of the output is an error",
            default="empty",
        ),
    ] = ()


class EventTable(SceneTable):
    """`[[event]]`: a crossing to locate in a component that does not report events itself."""

    watch: Annotated[
        _Text,
        replace(
            _VARIABLE_RULE,
            doc="a continuous real variable of an FMU that can restore its state (`canGetAndSetFMUState`), or runs as "
            "model exchange",
        ),
    ]
    direction: Annotated[
        Crossing,
        Rule(
            hint="It says how the variable crosses the level.",
            doc='`"falling"`, `"rising"`, `"either"`',
        ),
    ]
    level: Annotated[Finite, Rule(doc="in the unit of the variable")] = 0.0


def _name_of(what: str, example: str) -> Rule:
    return Rule(f"the name of {what}", hint=f'For example "{example}".', doc=f"the name of {what}")


class StopContactTable(SceneTable):
    """`[[contact]]` with `stop`: a body of any tool that meets a compliant stop."""

    body: Annotated[_Text, _name_of("a component", "mass")]
    displacement: Annotated[
        _Text, _name_of("an output of the body: the displacement of its contact point", "x")
    ]
    velocity: Annotated[_Text, _name_of("an output of the body: the velocity of that point", "v")]
    force: Annotated[
        _Text | None,
        replace(
            _name_of("an input of the body: the force on that point", "f"),
            default="none: the velocity of a body in model exchange is a continuous state; its stop is rigid. "
            "Required of other bodies",
        ),
    ] = None
    mass: Annotated[
        Positive | None,
        Rule(
            unit="kg",
            doc="effective mass of the contact point, within 5 % of the mass that a trial step finds; it sets the "
            "length of the steps in a contact",
            default="found by a trial step, in model exchange by the states; required for another body that cannot "
            "restore its state",
        ),
    ] = None
    stop: Annotated[
        _Text, _name_of("a component that answers with a force, and can restore its state", "stop")
    ]
    side: Annotated[
        Side | None,
        Rule(
            doc='`"upper"`: the stop is above the body, `"lower"`: below it; for a stop without `side`',
            default="the stop's own",
        ),
    ] = None
    stop_displacement: Annotated[_Text, _name_of("the stop's input for the displacement", "displacement")] = (
        "displacement"
    )
    stop_velocity: Annotated[
        _Text | None,
        replace(
            _name_of("the stop's input for the velocity", "velocity"),
            default="`velocity`, where the stop has it",
        ),
    ] = None
    stop_force: Annotated[
        _Text,
        replace(
            _name_of("the stop's force", "applied_force"),
            doc="the name of the output of the stop with its force, >= 0, which presses the body away",
        ),
    ] = "applied_force"


_PAIR_LAWS = Rule(
    "the name of a contact law",
    doc='`"restitution"`, `"kelvin_voigt"`, `"hertz"`, `"hunt_crossley"`; each law has its own further keys',
)


class BodyPointTable(SceneTable):
    """`bodies.NAME` of a `[[contact]]` with `between`: the point of a body of any tool."""

    displacement: Annotated[
        _Text, _name_of("an output of the body: the displacement of its contact point", "x")
    ]
    velocity: Annotated[_Text, _name_of("an output of the body: the velocity of that point", "v")]
    force: Annotated[_Text, _name_of("an input of the body: the force on that point", "f")]
    mass: Annotated[
        Positive | None,
        Rule(
            unit="kg",
            doc="effective mass of the point, within 5 % of a trial step's mass",
            default="found by the states of a body in model exchange, for the law restitution; else required",
        ),
    ] = None


class PairTable(SceneTable):
    """`[[contact]]` with `between`: two bodies that hit each other."""

    between: Annotated[
        tuple[Reference, ...],
        Field(strict=False, min_length=2, max_length=2),
        Rule(
            'two points of bodies such as ["a.mass[2]", "b.tip"]',
            item='a point of a body such as "a.mass[2]"',
            doc='two points: `"a"` (of an Oscillator), `"a.mass[2]"` (of a Chain), `"a.tip"` (of a Beam), or any '
            '`"a.contact[1]"` with its place among the parameters; the gap is the clearance, plus the displacement of '
            "the second point, minus the displacement of the first",
        ),
    ]
    clearance: Annotated[Finite, Rule(unit="m", doc="gap while both displacements are 0")] = 0.0
    bodies: Annotated[
        dict[str, BodyPointTable],
        Rule(
            "a table of bodies",
            hint='For example bodies = { ball = { displacement = "x", velocity = "v", force = "f", mass = 2.0 } }.',
            doc="points of bodies of other tools, by their names in `between`; each body can restore its state",
            default="none",
        ),
    ] = Field(default_factory=dict)


class RestitutionPair(PairTable):
    """`[[contact]]` with `between`: an impact multiplies the closing velocity by -restitution."""

    law: Annotated[Literal["restitution"], _PAIR_LAWS] = "restitution"
    restitution: Annotated[Fraction, Rule("0 <= r <= 1", hint="Use 1 for elastic bodies, 0 for dead ones.")]


class KelvinVoigtPair(PairTable):
    """`[[contact]]` with `between`: a spring and a dashpot in parallel, which never pull."""

    law: Annotated[Literal["kelvin_voigt"], _PAIR_LAWS]
    stiffness: Annotated[Positive, Rule(unit="N/m")]
    damping: Annotated[NotNegative, Rule(unit="N s/m", hint=FEEDS_ENERGY)] = 0.0


class HertzPair(PairTable):
    """`[[contact]]` with `between`: elastic spheres, force = stiffness penetration^1.5."""

    law: Annotated[Literal["hertz"], _PAIR_LAWS]
    stiffness: Annotated[Positive, Rule(unit="N/m^1.5")]


class HuntCrossleyPair(PairTable):
    """`[[contact]]` with `between`: force = stiffness penetration^exponent (1 + damping rate); it never pulls."""

    law: Annotated[Literal["hunt_crossley"], _PAIR_LAWS]
    stiffness: Annotated[Positive, Rule(unit="N/m^exponent")]
    damping: Annotated[NotNegative, Rule(unit="s/m", hint=FEEDS_ENERGY)] = 0.0
    exponent: Annotated[Finite, Field(ge=1, le=10), Rule()] = 1.5


BodyPair = RestitutionPair | KelvinVoigtPair | HertzPair | HuntCrossleyPair

PAIR_MODELS: dict[str, type[BodyPair]] = {
    "restitution": RestitutionPair,
    "kelvin_voigt": KelvinVoigtPair,
    "hertz": HertzPair,
    "hunt_crossley": HuntCrossleyPair,
}


class GeneralRecord(SceneTable):
    """`[record]` of a general scene: transient time, recorded time, and recorded variables."""

    start_time: Annotated[
        Finite, Rule(unit="s", doc="time at which the run begins; samples and events have times from it on")
    ] = 0.0
    transient_time: Annotated[NotNegative, Rule(unit="s", doc="time before the recording")] = 0.0
    recorded_time: Annotated[Positive, Rule(unit="s")]
    variables: Annotated[
        tuple[Reference, ...],
        Field(strict=False),
        replace(
            _VARIABLE_RULE,
            expected='an array such as ["ball.h", "ball.v"]',
            doc="variables of any component: numbers, true/false, texts, and arrays of them; each once",
            default="empty",
        ),
    ] = ()
    rate: Annotated[
        Positive | None,
        Rule(
            unit="samples per s",
            doc="at most 10^8 samples per run",
            default="required with `variables`",
        ),
    ] = None
    events: Annotated[bool, Rule(doc="whether the located events are recorded")] = True
