"""The table `[replay]` of a scene: recorded channels that drive its body, or that its motion is compared with."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vibroimpact.orchestrator.scene.models import Finite, NotNegative, Positive, SceneTable
from vibroimpact.orchestrator.scene.problems import Rule

MOST_RECORDINGS = 10_000
RECORDING_KEY = "replay.recording"
"""The swept key of a scene with several recordings: which of them, from 1."""
_Name = Annotated[str, Field(min_length=1, max_length=200)]
_CHANNEL = Rule('a channel of the recording, such as "base"', hint="`vibroimpact import` lists them.")


class Compared(SceneTable):
    """One entry of `replay.compare`: what the scene simulates, and the channel that measured it."""

    simulated: Annotated[
        _Name,
        Rule('a variable such as "beam.sensor.acceleration" or "displacement"'),
    ]
    measured: Annotated[_Name, _CHANNEL]


class Replay(SceneTable):
    """`[replay]`: which channels drive, which are compared, and how their clocks meet.

    Times are on the clock of the channel that drives; without one, on that of the first channel compared.
    """

    drive: Annotated[
        Literal["base_acceleration", "force"] | None,
        Rule(
            '"base_acceleration" or "force"', hint="Leave it out to let the body move freely from its start."
        ),
    ] = None
    channel: Annotated[_Name | None, _CHANNEL] = Field(None, alias="from")
    recordings: Annotated[
        tuple[_Name, ...],
        Field(strict=False, max_length=MOST_RECORDINGS),
        Rule('an array of recording files such as ["a0.nc", "a1.nc"]', item="the name of a recording"),
    ] = ()
    compare: Annotated[
        tuple[Compared, ...],
        Field(strict=False, max_length=64),
        Rule(
            'an array such as [{ simulated = "beam.sensor.acceleration", measured = "board" }]',
            item="a table with simulated and measured",
        ),
    ] = ()
    drive_offset: Annotated[
        Finite | None,
        Rule(
            "a finite number",
            "unit of the channel",
            "Without it the channel's level before and after its event is taken off.",
        ),
    ] = None
    start: Annotated[Finite | None, Rule("a finite number", "s")] = None
    stop: Annotated[Finite | None, Rule("a finite number", "s")] = None
    most_lag: Annotated[Positive | None, Rule("a number > 0", "s")] = None
    event_window: Annotated[Positive | None, Rule("a number > 0", "s")] = None
    lag: Annotated[
        Finite | None,
        Rule("a finite number", "s", "Without it the lag is estimated from the start of the event."),
    ] = None
    polarity: Annotated[Literal[-1, 1] | None, Rule("1 or -1")] = None
    peaks: Annotated[
        tuple[NotNegative, Positive] | None,
        Field(strict=False),
        Rule("a span such as [0.003, 0.006]", "s from the start of the event"),
    ] = None
    windows: Annotated[
        tuple[Annotated[tuple[NotNegative, Positive], Field(strict=False)], ...],
        Field(strict=False, max_length=100),
        Rule(
            "an array of spans such as [[0.0, 0.03]]",
            "s from the start of the event",
            item="a span [start, stop]",
        ),
    ] = ()
