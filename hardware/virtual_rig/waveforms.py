"""Samples with their time and the name of their channel, as newer clients of NI read them."""

from __future__ import annotations

from typing import Any

from vibroimpact.hardware.virtual_rig.plant import TICK, Floats
from vibroimpact.hardware.virtual_rig.tasks import Task

_TIMING, _PROPERTIES = 1, 2
"""Bits of the parts that a client requests beside the samples."""
_SECONDS_TO_1970 = 2_082_844_800
"""Time from 1904, the origin of NI's time, to 1970, s."""


def put_waveforms(response: Any, task: Task, volts: Floats, mode: int, served_at: float) -> None:
    """Put samples just read from a task, shape (channel, sample), into a response.

    `mode` gives the parts requested beside the samples; the rig was at 0 at `served_at`, s since 1970.
    """
    count = volts.shape[1]
    for place, channel in enumerate(task.channels):
        waveform = response.waveforms.add()
        waveform.y_data.extend(volts[place].tolist())
        if mode & _TIMING and task.clock is not None:
            first = int(task.edge(task.position - count)) + place * task.skew if count else 0
            waveform.dt = 1.0 / task.clock_rate
            whole, part = divmod(round(served_at / TICK) + first, round(1.0 / TICK))
            waveform.t0.seconds = whole + _SECONDS_TO_1970
            waveform.t0.fractional_seconds = int(part * TICK * 2.0**64)
        if mode & _PROPERTIES:
            waveform.attributes["NI_ChannelName"].string_value = channel.name
            waveform.attributes["NI_UnitDescription"].string_value = "Volts"
