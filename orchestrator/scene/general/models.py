"""The tables of a general scene as frozen pydantic models: components, connections and watched events."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vibroimpact.orchestrator.importer.specification import Direction
from vibroimpact.orchestrator.scene.models import Finite, NotNegative, Positive, SceneTable, Switch
from vibroimpact.orchestrator.scene.problems import Rule

_Text = Annotated[str, Field(min_length=1, max_length=1000, pattern=r"^[^\x00-\x1f\x7f]*$")]
_VARIABLE_RULE = Rule(
    "a variable COMPONENT.VARIABLE in quotes",
    item="a variable COMPONENT.VARIABLE in quotes",
    hint='For example "ball.h"; the component ends at the first dot.',
)
Reference = Annotated[_Text, _VARIABLE_RULE]


class ComponentTable(SceneTable):
    """`[component.NAME]`: an FMU and the start values of its variables."""

    fmu: Annotated[
        _Text,
        Rule("a path of an FMU file, or the name of a shipped component", hint='For example "ball.fmu".'),
    ]
    fmi: Annotated[Literal["3.0", "2.0"] | None, Rule('"3.0" or "2.0", in quotes')] = None
    parameters: Annotated[
        dict[str, object], Rule('a table such as { "mass" = 1.0, "contact[1].law" = "external" }')
    ] = Field(default_factory=dict)


class ConnectionTable(SceneTable):
    """`[[connection]]`: an input that is gain times an output, at every exchange."""

    source: Annotated[_Text, _VARIABLE_RULE] = Field(alias="from")
    target: Annotated[_Text, _VARIABLE_RULE] = Field(alias="to")
    gain: Annotated[Finite, Rule("a finite number")] = 1.0
    gain_unit: Annotated[
        _Text | None, Rule('a unit such as "N/m", "N.s/m" or "1"', hint='Use "1" for a plain number.')
    ] = None


class EventTable(SceneTable):
    """`[[event]]`: a crossing to be found in a component that does not report events itself."""

    watch: Annotated[_Text, _VARIABLE_RULE]
    direction: Annotated[
        Direction,
        Rule('"falling", "rising" or "either"', hint="It says how the variable crosses the level."),
    ]
    level: Annotated[Finite, Rule("a finite number")] = 0.0


class GeneralRecord(SceneTable):
    """`[record]` of a general scene: how long to wait, how long to record, and what."""

    transient_time: Annotated[NotNegative, Rule("a number >= 0", "s")] = 0.0
    recorded_time: Annotated[Positive, Rule("a number > 0", "s")]
    variables: Annotated[
        tuple[Reference, ...],
        Field(strict=False),
        Rule(
            'an array such as ["ball.h", "ball.v"]',
            item="a variable COMPONENT.VARIABLE in quotes",
            hint='For example "ball.h"; the component ends at the first dot.',
        ),
    ] = ()
    rate: Annotated[Positive | None, Rule("a number > 0", "samples per s")] = None
    events: Switch = True
