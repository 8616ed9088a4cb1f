"""The table `[replay]` of a scene: recorded channels that drive its body, or that are compared with its motion."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

from pydantic import Field

from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.models import Finite, NotNegative, Positive, SceneTable
from vibroimpact.orchestrator.scene.point_fields import POINT_RULE, Point
from vibroimpact.orchestrator.scene.sweep import SweepAxis

MOST_RECORDINGS = 10_000
RECORDING_KEY = "replay.recording"
"""The swept key of a scene with several recordings: the number of the recording, from 1."""
_Name = Annotated[str, Field(min_length=1, max_length=200)]
_CHANNEL = Rule('a channel of the recording, such as "base"', hint="`vibroimpact import` lists them.")


class Compared(SceneTable):
    """One entry of `replay.compare`: a simulated variable, and the channel that measured it."""

    simulated: Annotated[
        _Name,
        Rule('a variable such as "beam.sensor.acceleration" or "displacement"'),
    ]
    measured: Annotated[_Name, _CHANNEL]


class Replay(SceneTable):
    """`[replay]`: the driving channel, the compared channels, and the alignment of their clocks.

    Times are on the clock of the driving channel; without one, on the clock of the first compared channel.
    """

    drive: Annotated[
        Literal["base_acceleration", "force"] | None,
        Rule(
            hint="Leave it out to let the body move freely from its start.",
            doc='`"base_acceleration"`, `"force"`; without it the body moves freely from its start state',
        ),
    ] = None
    channel: Annotated[
        _Name | None,
        replace(
            _CHANNEL,
            doc="channel that drives, linear between its samples",
            default="required beside `drive`",
        ),
    ] = Field(None, alias="from")
    at: Annotated[
        Point | None,
        replace(
            POINT_RULE,
            doc='point where a force acts on several bodies or on given modes, such as `"board.tip"`',
            default='required there beside `drive = "force"`',
        ),
    ] = None
    recordings: Annotated[
        tuple[_Name, ...],
        Field(strict=False, max_length=MOST_RECORDINGS),
        Rule(
            'an array of recording files such as ["a0.nc", "a1.nc"]',
            item="the name of a recording",
            doc="recording files, from the folder of the scene; several make an axis of the sweep",
            default="the command line's",
        ),
    ] = ()
    compare: Annotated[
        tuple[Compared, ...],
        Field(strict=False, max_length=64),
        Rule(
            'an array such as [{ simulated = "beam.sensor.acceleration", measured = "board" }]',
            item="a table with simulated and measured",
            doc="`simulated`: a variable of a time series, with `sensor.` before it for a reading of `[sensor]`; the "
            "kind of the body may stand first (`beam.sensor.acceleration`); `measured`: a channel",
            default="none",
        ),
    ] = ()
    drive_offset: Annotated[
        Finite | None,
        Rule(
            unit="unit of the channel",
            hint="Without it the channel's level before and after its event is taken off.",
            doc="level that is subtracted from the driving channel",
            default="the channel's level where it is quietest; 0 for a force if nothing is compared",
        ),
    ] = None
    start: Annotated[
        Finite | None,
        Rule(
            unit="s",
            doc="start of the simulation on the clock of the driving channel; without a driving channel, on the clock "
            "of the first compared channel",
            default="the first sample",
        ),
    ] = None
    stop: Annotated[
        Finite | None, Rule(unit="s", doc="end of the simulation on that clock", default="the last sample")
    ] = None
    most_lag: Annotated[
        Positive | None,
        Rule(
            unit="s",
            doc="largest lag tried between channels of separate triggers",
            default="half the shorter record",
        ),
    ] = None
    event_window: Annotated[
        Positive | None,
        Rule(
            unit="s",
            doc="time from the start of the event on in which lag and polarity are found",
            default="from half a dominant period before to three after the onset",
        ),
    ] = None
    lag: Annotated[
        Finite | None,
        Rule(
            unit="s",
            hint="Without it the lag is estimated from the start of the event.",
            doc="a lag that is given is not estimated",
            default="found; 0 for channels of one trigger",
        ),
    ] = None
    polarity: Annotated[
        Literal[-1, 1] | None,
        Rule(
            "1 or -1", doc="1 or -1; not estimated if given", default="found; 1 for channels of one trigger"
        ),
    ] = None
    peaks: Annotated[
        tuple[NotNegative, Positive] | None,
        Field(strict=False),
        Rule(
            "a span such as [0.003, 0.006]",
            unit="s from the start of the event",
            doc="`[start, stop]`: span in which successive extremes are compared",
        ),
    ] = None
    windows: Annotated[
        tuple[Annotated[tuple[NotNegative, Positive], Field(strict=False)], ...],
        Field(strict=False, max_length=100),
        Rule(
            "an array of spans such as [[0.0, 0.03]]",
            unit="s from the start of the event",
            item="a span [start, stop]",
            doc="`[start, stop]`, ...: spans that are scored by themselves",
            default="none",
        ),
    ] = ()

    @property
    def axes(self) -> tuple[SweepAxis, ...]:
        """The sweep axis over the recordings; none unless the scene names two or more."""
        if len(self.recordings) < 2:
            return ()
        return (SweepAxis(RECORDING_KEY, tuple(float(n) for n in range(1, len(self.recordings) + 1))),)
