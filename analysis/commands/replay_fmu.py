"""The command `vibroimpact fmu replay`: an FMU that plays the channels of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vibroimpact.fmus.commands import commands
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.terminal import say

if TYPE_CHECKING:
    from vibroimpact.analysis.recording import Channel, Recording
    from vibroimpact.fmus.packaging.replay_fmu import ReplaySignal

#: A time axis that calls itself even is played as such where no instant is off by more than this part of the interval.
EVEN = 0.01


def register(app: typer.Typer) -> None:
    """Add `replay` to the command `fmu`, which lives below this package: only here recordings can be read."""
    commands.command("replay")(replay)


def replay(
    recording: Annotated[Path, typer.Argument(help="Recording (.nc), or a dataset with time series.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="FMU to write.")],
    channel: Annotated[
        list[str] | None, typer.Option(help="Channel to play; again for more; default: all.")
    ] = None,
    si: Annotated[
        bool, typer.Option("--si", help="Play values in SI units: g becomes m/s2, mV becomes V.")
    ] = False,
    run: Annotated[int | None, typer.Option(help="run_index, of a dataset of several runs.", min=0)] = None,
) -> None:
    """Make an FMU that plays recorded channels in this or another tool: value, slope, validity.

    Example: vibroimpact fmu replay a0.nc --channel base --si -o a0.fmu
    """
    from vibroimpact.analysis.dataset.outputs import refuse_outputs
    from vibroimpact.analysis.recording import open_signals
    from vibroimpact.fmus.packaging.replay_fmu import build_replay

    refuse_outputs([recording], output, ending=".fmu")
    source = open_signals(recording, run)
    chosen = _chosen(source, channel or ())
    build_replay({item.name: replay_signal(item, si=si) for item in chosen}, output)
    for item in chosen:
        say(_described(item, si))
    say(str(output))


def _chosen(source: Recording, names: Sequence[str]) -> list[Channel]:
    if not source.channels:
        raise DatasetError(
            f"{source.title}: expected a channel to play, got none. Event trains cannot be played."
        )
    return [source.channel(name) for name in dict.fromkeys(names or source.channels)]


def replay_signal(channel: Channel, *, si: bool = False) -> ReplaySignal:
    """Return a channel as what `build_replay` takes.

    Parameters
    ----------
    channel : Channel
        Its samples without a value (NaN) stay gaps; clipped ones are played as they are.
    si : bool
        In the SI unit of its kind instead of its own.
    """
    import numpy as np

    from vibroimpact.analysis.recording.units import measured_unit
    from vibroimpact.fmus.packaging.replay_fmu import ReplaySignal

    unit = measured_unit(channel.unit)
    values, name = (channel.si(), unit.si) if si else (channel.values, unit.cf)
    time, interval = channel.time, channel.axis.interval
    if interval is not None and len(time) > 1:
        even = time[0] + interval * np.arange(len(time))
        if float(np.abs(time - even).max()) <= EVEN * interval:
            return ReplaySignal.evenly(values, name, interval, float(time[0]))
    return ReplaySignal(time, values, name)


def _described(channel: Channel, si: bool) -> str:
    import numpy as np

    from vibroimpact.analysis.recording import Quality
    from vibroimpact.analysis.recording.units import measured_unit

    unit = measured_unit(channel.unit).si if si else channel.unit
    gaps = int(np.isnan(channel.values).sum())
    clipped = int(((channel.quality & int(Quality.clipped)) != 0).sum())
    remarks = f", {gaps} missing (not valid, bridged)" if gaps else ""
    remarks += f", {clipped} clipped (played as they are)" if clipped else ""
    spacing = "" if channel.axis.interval is None else f", every {channel.axis.interval!r} s"
    span = f"{channel.time[0]:.9g} to {channel.time[-1]:.9g} s"
    return f"{channel.name}: {len(channel.values)} samples in {unit}, {span}{spacing}{remarks}"
