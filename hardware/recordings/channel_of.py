"""Make a channel of a column: its samples in time order, its flags, and remarks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.hardware.formats.table import Column, Flags, Floats
from vibroimpact.hardware.recordings.sample_quality import clipped_samples, flags
from vibroimpact.hardware.recordings.time_axis import Placement

_OFFSET_SHOWS = 3.0
"""Distance of the median from zero, in median absolute deviations, above which it is an offset."""


def channel_of(
    name: str, column: Column, placement: Placement, masked: Sequence[tuple[float, float]]
) -> tuple[Channel, list[str]]:
    """Return the channel of a column with a known unit, and remarks.

    Samples in the spans of time `masked` (s) are no measurement: they become missing.
    """
    # a row -1 reads the last one here, and is overwritten as missing
    values = column.values[placement.row]
    values[placement.row < 0] = np.nan
    overrange = np.zeros(len(values), dtype=bool)
    if column.overrange is not None:
        overrange = (placement.row >= 0) & column.overrange[placement.row]
    hidden = np.zeros(len(values), dtype=bool)
    for begin, end in masked:
        hidden |= (placement.axis.time >= begin) & (placement.axis.time <= end)
    overrange |= np.isinf(values)
    values[hidden | overrange] = np.nan
    overrange &= ~hidden
    clipped = clipped_samples(values, column.rails)
    quality = flags(values, overrange, clipped, placement.suspect)
    remarks = _remarks(name, column, values, clipped, overrange, hidden, placement)
    unit, attrs = measured_unit(column.unit).cf, {"role": "measured", **column.attrs}
    return Channel(name, values, unit, placement.axis, quality, column.label, attrs), remarks


def _remarks(
    name: str,
    column: Column,
    values: Floats,
    clipped: Flags,
    overrange: Flags,
    hidden: Flags,
    placement: Placement,
) -> list[str]:
    """Return remarks on the samples."""
    remarks = []
    if np.any(clipped):
        levels = sorted({float(level) for level in values[clipped]})
        clipped_at = " and ".join(f"{level:.6g}" for level in dict.fromkeys((levels[0], levels[-1])))
        remarks.append(
            f"{name}: {int(clipped.sum())} samples are clipped, at {clipped_at} {column.unit}".rstrip()
        )
    if np.any(overrange):
        remarks.append(f"{name}: {int(overrange.sum())} samples are marked as overrange: NaN")
    if np.any(hidden):
        remarks.append(f"{name}: {int(hidden.sum())} samples are masked: NaN")
    empty = int(np.sum(np.isnan(values) & ~overrange & ~hidden)) - placement.missing
    if empty > 0:
        remarks.append(f"{name}: {empty} samples have no number in the file: NaN")
    finite = values[np.isfinite(values) & ~clipped]
    if len(finite) < 2:
        return remarks
    in_unit = f" {column.unit}" if column.unit else ""
    rest = float(np.median(finite))
    usual = float(np.median(np.abs(finite - rest)))
    if abs(rest) > _OFFSET_SHOWS * usual and np.ptp(finite) > 0.0:
        remarks.append(f"{name}: rests at {rest:.4g}{in_unit}, not at zero: an offset, kept as it is")
    elif np.ptp(finite) == 0.0:
        remarks.append(f"{name}: has the one value {rest:.6g} all the way")
    return remarks
