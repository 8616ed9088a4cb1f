"""The tables of a scene file as frozen pydantic models.

Each field says three things in one place: its constraints, its `Rule` in words (for messages), and its
default. Rules between fields or tables are in `scene_rules`. Another kind of body or contact law becomes
one more model here and one more entry in `BODY_MODELS` or `STOP_MODELS`.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from vibroimpact.orchestrator.importer.specification import Exchange
from vibroimpact.orchestrator.scene_errors import Rule
from vibroimpact.orchestrator.sweep import Path

MOST_SAMPLES_PER_RUN = 10**8
MOST_PERIODS = 10**9
MOST_POINTS_PER_AXIS = 10**6
MOST_IMPACTS_PER_POINT = 10**12
DEFAULT_IMPACT_LIMIT = 10_000_000

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[Finite, Field(gt=0)]
NotNegative = Annotated[Finite, Field(ge=0)]
Fraction = Annotated[Finite, Field(ge=0, le=1)]
Switch = Annotated[bool, Rule("true or false")]


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


class OscillatorBody(SceneTable):
    """`[body]`: one mass on a spring and a dashpot, mass x'' + damping x' + stiffness x = force."""

    kind: Annotated[Literal["oscillator"], Rule('"oscillator"', unavailable=("chain", "beam"))] = "oscillator"
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

    @property
    def damping(self) -> float:
        """Damping coefficient, N s/m: as given, or 2 damping_ratio sqrt(stiffness mass)."""
        if self.damping_ratio is None:
            return self.damping_given
        return 2.0 * self.damping_ratio * math.sqrt(self.stiffness * self.mass)


class Forcing(SceneTable):
    """`[forcing]`: amplitude cos(angular_frequency t + phase), a force or an acceleration of the base."""

    kind: Annotated[
        Literal["force", "base_acceleration"],
        Rule('"force" or "base_acceleration"', unavailable=("uniform", "mode")),
    ] = "force"
    amplitude: Annotated[Finite, Rule("a finite number", "N (m/s^2 for base_acceleration)")]
    angular_frequency_given: Annotated[
        NotNegative | None, Rule("a number >= 0", "rad/s", "Use 0 for a constant force.")
    ] = Field(None, alias="angular_frequency")
    frequency: Annotated[NotNegative | None, Rule("a number >= 0", "Hz", "Use 0 for a constant force.")] = (
        None
    )
    phase: Annotated[Finite, Rule("a finite number", "rad")] = 0.0

    @property
    def angular_frequency(self) -> float:
        """Angular frequency, rad/s: as given, or 2 pi frequency; 0 means a constant force."""
        if self.frequency is not None:
            return 2.0 * math.pi * self.frequency
        return self.angular_frequency_given or 0.0


class RestitutionStop(SceneTable):
    """`[[stop]]`: a rigid stop; an impact multiplies the velocity by -restitution."""

    law: Annotated[
        Literal["restitution"], Rule('"restitution"', unavailable=("kelvin_voigt", "hertz", "hunt_crossley"))
    ] = "restitution"
    position: Annotated[Finite, Rule("a finite number", "m")]
    side: Annotated[
        Literal["upper", "lower"],
        Rule('"upper" or "lower"', hint="upper: displacement <= position; lower: displacement >= position."),
    ] = "upper"
    restitution: Annotated[Fraction, Rule("0 <= r <= 1", hint="Use 1 for an elastic stop, 0 for a dead one.")]


class TimeSeries(SceneTable):
    """`record.time_series`: variables sampled at a constant rate."""

    rate: Annotated[Positive, Rule("a number > 0", "samples per s")]
    variables: Annotated[
        tuple[Literal["displacement", "velocity", "acceleration", "contact_force", "forcing"], ...],
        Field(strict=False, min_length=1),
        Rule(
            "an array of variable names",
            item="a variable name",
            hint="Variables: displacement, velocity, acceleration, contact_force, forcing.",
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


BODY_MODELS: dict[str, type[OscillatorBody]] = {"oscillator": OscillatorBody}
STOP_MODELS: dict[str, type[RestitutionStop]] = {"restitution": RestitutionStop}
