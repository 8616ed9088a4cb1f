"""The drive signal of a body from a recorded channel: SI values without offset and gaps, linear between samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel, Quality
from vibroimpact.analysis.recording.units import measured_unit, unit_label
from vibroimpact.fmus.errors import DatasetError

Floats = NDArray[np.float64]

#: Number of equal parts of a signal, from which its quietest is chosen.
QUIET_PARTS = 20
#: Most steps of one replay: they take a minute or more of processor time.
MOST_STEPS = 10**7
#: SI unit of each kind of drive.
DRIVEN_UNITS = {"base_acceleration": "m s-2", "force": "N"}
VOLTS = "V"
"""Unit of a drive through an exciter."""


@dataclass(frozen=True, slots=True)
class DriveSignal:
    """The drive of a body."""

    time: Floats
    """s, on the clock of its channel, shape (sample,)."""
    values: Floats
    """m/s^2 or N, V with an exciter; without offset, with gaps bridged by straight lines."""
    bridged: NDArray[np.bool_]
    """Mask of bridged gaps: the motion after them is a guess."""
    offset: float
    """The offset removed, in the unit of the channel."""
    remarks: tuple[str, ...]
    """Remarks for the results."""


def drive_of(
    channel: Channel,
    drive: str,
    offset: float | None = None,
    expected: str = "",
    *,
    designed: bool = False,
) -> DriveSignal:
    """Return the drive signal of a channel for the drive `base_acceleration` or `force`.

    The offset, in the unit of the channel, is subtracted from every sample (None: `quiet_level`). `expected` is the SI
    unit, by default the drive's. A designed channel was computed, not measured: without a given offset its mean is
    kept. DatasetError: the channel measures another quantity, or has less than two samples.
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
        simulated = channel.attrs.get("role") == "simulated"  # a simulated channel has no offset
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
    """Return the rest level of a signal: the median of its quietest part.

    The signal is cut into `QUIET_PARTS` equal parts; the quietest part has the least median distance from its median.
    A signal that never rests (of a shaker) has its overall mean instead. In such a signal the spread of the quietest
    part exceeds a third of the overall spread.

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
    """Return the instants of the steps: every sample of the drive, with steps no longer than `finest` (s).

    The slope changes at the drive's samples; `finest` is for motion that is compared with a faster channel. After the
    last sample the steps up to `end` (s) are `finest` or the drive's last, whichever is shorter. DatasetError: more
    than `MOST_STEPS`, because of clocks far apart or a hole of hours.

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
