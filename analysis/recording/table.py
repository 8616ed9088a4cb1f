"""A recording as a printed table: its channels, its events and its remarks."""

from __future__ import annotations

import numpy as np

from vibroimpact.analysis.recording.channels import Channel, EventTrain, Quality, Recording
from vibroimpact.fmus.messages import message
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal
from vibroimpact.fmus.units import written_unit


def print_recording(console: Terminal, recording: Recording) -> None:
    """Print tables of the channels and events of a recording, then its single values and remarks, a line each."""
    channels, trains = recording.channels.values(), recording.events.values()
    if channels:
        heads = [">samples", ">rate (Hz)", ">unit", ">min", ">max", ">clipped", ">missing", ">overrange"]
        console.print(table(recording.title, "<channel", *heads, rows=map(_channel_row, channels)))
    if trains:
        heads = [">events", ">first (s)", ">last (s)", ">window (s)", ">grid (s)", ">per second"]
        title = "" if channels else recording.title
        console.print(table(title, "<event train", *heads, rows=map(_event_row, trains)))
    for name, scalar in recording.scalars.items():
        shown = "overrange" if scalar.overrange else f"{scalar.value:.6g} {written_unit(scalar.unit)}"
        console.print(f"{name} = {shown}")
    for line in recording.remarks:
        console.print(message("- ", line), soft_wrap=True)


def _channel_row(channel: Channel) -> tuple[str, ...]:
    finite = channel.values[np.isfinite(channel.values)]
    least, most = (f"{finite.min():.6g}", f"{finite.max():.6g}") if len(finite) else ("-", "-")
    rate = f"{channel.axis.rate:.7g}" + ("" if channel.axis.interval is not None else " (mean)")
    if channel.axis.interval_uncertainty:
        rate += f" ±{channel.axis.interval_uncertainty:.1%}"

    flags = (Quality.clipped, Quality.missing, Quality.overrange)
    counts = (str(int(np.sum(channel.quality & np.uint8(flag) != 0))) for flag in flags)
    return channel.name, str(len(channel.values)), rate, written_unit(channel.unit), least, most, *counts


def _event_row(train: EventTrain) -> tuple[str, ...]:
    begin, end = train.window or (float(train.times[0]), float(train.times[-1]))
    rate = f"{len(train.times) / (end - begin):.5g}" if end > begin else "-"
    return (
        train.name,
        str(len(train.times)),
        f"{train.times[0]:.6g}",
        f"{train.times[-1]:.6g}",
        "not known" if train.window is None else f"{begin:g} to {end:g}",
        f"{train.resolution:.4g}" if train.resolution else "-",
        rate,
    )
