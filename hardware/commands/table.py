"""The table that `vibroimpact import` prints: what was imported, and what was noticed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.table import Table

from vibroimpact.analysis.recording import Channel, EventTrain, Quality, Recording
from vibroimpact.fmus.terminal import Terminal
from vibroimpact.fmus.units import written_unit

_PIPE_WIDTH = 160


def show_recording(recording: Recording, output: Path, figure: Path | None = None) -> None:
    """Print a table of the channels and events of a recording, then its remarks, a line each."""
    console = Terminal()
    if not console.is_terminal:  # a pipe has no width to keep to
        console.width = _PIPE_WIDTH
    if recording.channels:
        console.print(_channel_table(recording))
    if recording.events:
        console.print(_event_table(recording))
    for name, scalar in recording.scalars.items():
        shown = "overrange" if scalar.overrange else f"{scalar.value:.6g} {written_unit(scalar.unit)}"
        console.print(f"{name} = {shown}")
    for line in recording.remarks:
        console.print(f"- {line}", soft_wrap=True)
    console.print(
        f"Recording written to {output}." + (f" Figure: {figure}." if figure else ""), soft_wrap=True
    )


def _channel_table(recording: Recording) -> Table:
    table = Table(title=recording.title)
    table.add_column("channel", overflow="fold")
    for heading in ("samples", "rate (Hz)", "unit", "min", "max", "clipped", "missing", "overrange"):
        table.add_column(heading, justify="right", overflow="fold")
    for channel in recording.channels.values():
        table.add_row(*_channel_row(channel))
    return table


def _channel_row(channel: Channel) -> tuple[str, ...]:
    finite = channel.values[np.isfinite(channel.values)]
    least, most = (f"{finite.min():.6g}", f"{finite.max():.6g}") if len(finite) else ("-", "-")
    rate = f"{channel.axis.rate:.7g}" + ("" if channel.axis.interval is not None else " (mean)")
    if channel.axis.interval_uncertainty:
        rate += f" ±{channel.axis.interval_uncertainty:.1%}"

    def counted(flag: Quality) -> str:
        return str(int(np.sum(channel.quality & np.uint8(flag) != 0)))

    return (
        channel.name,
        str(len(channel.values)),
        rate,
        written_unit(channel.unit),
        least,
        most,
        counted(Quality.clipped),
        counted(Quality.missing),
        counted(Quality.overrange),
    )


def _event_table(recording: Recording) -> Table:
    table = Table(title="" if recording.channels else recording.title)
    table.add_column("event train", overflow="fold")
    for heading in ("events", "first (s)", "last (s)", "window (s)", "grid (s)", "per second"):
        table.add_column(heading, justify="right", overflow="fold")
    for train in recording.events.values():
        table.add_row(*_event_row(train))
    return table


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
