"""From a recorded channel to what drives a body: SI values without offset and gaps, linear between the samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel, Quality
from vibroimpact.analysis.recording.units import measured_unit, unit_label
from vibroimpact.fmus.errors import DatasetError

Floats = NDArray[np.float64]

#: Parts that a channel is cut into to find its quietest.
QUIET_PARTS = 20
#: Steps of one replay: a minute or more of processor time.
MOST_STEPS = 10**7
#: SI units of what can be driven.
DRIVEN_UNITS = {"base_acceleration": "m s-2", "force": "N"}
VOLTS = "V"
"""Unit of what drives through an exciter."""


@dataclass(frozen=True, slots=True)
class DriveSignal:
    """What drives a body."""

    time: Floats
    """s, on the clock of its channel, shape (sample,)."""
    values: Floats
    """m/s^2 or N, V of an exciter; offset taken off, gaps bridged by straight lines."""
    bridged: NDArray[np.bool_]
    """Where a gap was bridged: what follows from it is a guess."""
    offset: float
    """What was taken off, in the unit of the channel."""
    remarks: tuple[str, ...]
    """What a reader must know."""


def drive_of(
    channel: Channel,
    drive: str,
    offset: float | None = None,
    expected: str = "",
    *,
    designed: bool = False,
) -> DriveSignal:
    """Return what a channel drives a body with, `base_acceleration` or `force`.

    The offset, in the unit of the channel, is taken off every sample (None: `quiet_level`). The expected SI unit is
    that of the drive where it is empty. A designed channel was computed, not measured: without an offset that is given,
    its mean is kept. A channel of something else, or of less than two samples, raises DatasetError.
    """
    expected, unit = expected or DRIVEN_UNITS[drive], measured_unit(channel.unit)
    if unit.si not in (expected, "1"):
        raise DatasetError(
            f"{channel.name}: expected a channel in {expected} to drive {drive}, got {channel.unit}. "
            "Import it with the unit it has, or name another channel."
        )
    known = np.isfinite(channel.values)
    if np.count_nonzero(known) < 2:
        raise DatasetError(f"{channel.name}: expected at least two samples to drive a body, got fewer.")
    remarks = []
    if offset is None:
        quiet = quiet_level(channel.values[known])
        simulated = channel.attrs.get("role") == "simulated"  # it has no offset to be taken off
        offset = 0.0 if designed or simulated else quiet
        if designed and quiet and not simulated:
            remarks.append(f"{channel.name}: {_designed(channel, quiet)}")
    level = offset
    values = np.interp(channel.time, channel.time[known], channel.values[known]) - level
    return DriveSignal(
        channel.time, values * unit.factor, ~known, level, tuple(remarks + _remarks(channel, level, ~known))
    )


def _designed(channel: Channel, level: float) -> str:
    value = _in_its_unit(channel, level)
    return f"its level of {value} is kept: nothing is compared, so it counts as designed (drive_offset takes one off)"


def _in_its_unit(channel: Channel, value: float) -> str:
    return f"{value:.6g}" + ("" if channel.unit == "1" else f" {unit_label(channel.unit)}")


def _remarks(channel: Channel, level: float, bridged: NDArray[np.bool_]) -> list[str]:
    remarks = []
    if level:
        remarks.append(f"{channel.name}: an offset of {_in_its_unit(channel, level)} was taken off")
    if bridged.any():
        remarks.append(f"{channel.name}: {int(bridged.sum())} missing samples were bridged by straight lines")
    clipped = int(np.count_nonzero(channel.quality & Quality.clipped))
    if clipped:
        remarks.append(f"{channel.name}: {clipped} samples are clipped, and drive the body with too little")
    return remarks


def quiet_level(values: Floats) -> float:
    """Return the level of a signal where nothing happens: the median of its quietest part.

    The signal is cut into `QUIET_PARTS` equal parts; the quietest has the least median distance from its median. A
    signal that never rests (of a shaker) has the middle of its whole instead: its quietest part is no quieter than a
    third of all of it.

    >>> pulse = 0.25 + np.exp(-(((np.arange(1000) - 300) / 40.0) ** 2))
    >>> round(quiet_level(pulse), 9)
    0.25
    """
    parts = np.array_split(values, min(QUIET_PARTS, len(values)))
    spreads = [float(np.median(np.abs(part - np.median(part)))) for part in parts]
    whole = float(np.sqrt(np.mean((values - np.mean(values)) ** 2)))
    quietest = int(np.argmin(spreads))
    if spreads[quietest] > whole / 3.0:
        return float(np.mean(values))
    return float(np.median(parts[quietest]))


def step_instants(signal_time: Floats, finest: float, end: float) -> Floats:
    """Return the instants to step through: every sample of the drive, with steps no longer than `finest` (s).

    The slope changes at the drive's samples; `finest` is for motion that is compared with a faster channel. Beyond the
    last sample the steps to the end (s) are `finest` or the drive's last, whichever is shorter. More than `MOST_STEPS`,
    of clocks that are far apart or a hole of hours, raise DatasetError.

    >>> step_instants(np.array([0.0, 1.0, 3.0]), 1.0, 4.0).tolist()
    [0.0, 1.0, 2.0, 3.0, 4.0]
    """
    steps = np.diff(signal_time)
    length = min(finest, float(steps[-1]))
    shares = np.maximum(1.0, np.ceil(steps / finest * (1.0 - 1e-9)))
    beyond = max(0.0, float(np.ceil((end - signal_time[-1]) / length * (1.0 - 1e-9))))
    if float(np.sum(shares)) + beyond > MOST_STEPS:
        raise DatasetError(
            f"replay: expected at most {MOST_STEPS:g} steps, got {float(np.sum(shares)) + beyond:g} of {finest:g} s "
            f"from {signal_time[0]:g} to {max(end, float(signal_time[-1])):g} s. "
            "Look at the instants of the channels, or give replay.stop."
        )
    parts = shares.astype(np.int64)
    within = np.concatenate(
        [
            start + step * np.arange(count) / count
            for start, step, count in zip(signal_time[:-1], steps, parts, strict=True)
        ]
        + [signal_time[-1:]]
    )
    after = signal_time[-1] + length * np.arange(1, int(beyond) + 1)
    instants: Floats = np.concatenate([within, after])
    return instants
