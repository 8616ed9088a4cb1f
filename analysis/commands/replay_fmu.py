"""The command `vibroimpact fmu replay`: write an FMU that plays the channels of a recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vibroimpact.analysis.dataset.outputs import refuse_outputs
from vibroimpact.analysis.operations.fmu_replay import ExportReplay
from vibroimpact.analysis.recording import Channel, Quality, Recording, open_signals
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.packaging.replay_fmu import ReplaySignal, build_replay
from vibroimpact.fmus.terminal import say

#: Largest deviation of a time axis with a stated interval, over this interval, at which it is played as even.
EVEN = 0.01


def build_player(options: ExportReplay) -> None:
    """Write the FMU that plays channels of a recording (all, unless some are named), and list them."""
    output, si = options.output, options.si
    refuse_outputs([options.recording], output, ending=".fmu")
    source = open_signals(options.recording, options.run)
    chosen = _chosen(source, options.channel or ())
    signals = {item.name: replay_signal(item, si=si) for item in chosen}
    build_replay(
        signals, output, fmi=options.fmi, platform=options.platform, note=lambda text: say(text, err=True)
    )
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
    """Return a channel in the form that `build_replay` takes, in its own unit or in the SI unit of its kind.

    Samples without a value (NaN) stay gaps; clipped ones are played as they are.
    """
    unit = measured_unit(channel.unit)
    values, name = (channel.si(), unit.si) if si else (channel.values, unit.cf)
    time, interval = channel.time, channel.axis.interval
    if interval is not None and len(time) > 1:
        even = time[0] + interval * np.arange(len(time))
        if float(np.abs(time - even).max()) <= EVEN * interval:
            return ReplaySignal.evenly(values, name, interval, float(time[0]))
    return ReplaySignal(time, values, name)


def _described(channel: Channel, si: bool) -> str:
    unit = measured_unit(channel.unit).si if si else channel.unit
    gaps = int(np.isnan(channel.values).sum())
    clipped = int(((channel.quality & int(Quality.clipped)) != 0).sum())
    remarks = f", {gaps} missing (not valid, bridged)" if gaps else ""
    remarks += f", {clipped} clipped (played as they are)" if clipped else ""
    spacing = "" if channel.axis.interval is None else f", every {channel.axis.interval!r} s"
    span = f"{channel.time[0]:.9g} to {channel.time[-1]:.9g} s"
    return f"{channel.name}: {len(channel.values)} samples in {unit}, {span}{spacing}{remarks}"
