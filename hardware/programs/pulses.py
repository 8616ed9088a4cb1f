"""Pulses in a stream of samples: the selection of samples, and a first estimate of each pulse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel, EventTrain, Recording
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.analysis.spikes.pulses import FOOT
from vibroimpact.analysis.spikes.report import impulse_unit
from vibroimpact.fmus.messages import joined
from vibroimpact.hardware.rig.acquisition import Block, Gap
from vibroimpact.hardware.rig.measurement import Measurement, PulseRule, rows_of

Floats = NDArray[np.float64]
Numbers = NDArray[np.int64]
Mask = NDArray[np.bool_]

TRAIN = "pulses"
"""Name of the event train."""
_LONG_AGO, _NEVER = -(2**60), 2**60


class PulseFinder:
    """Finds pulses in arriving samples, independent of their division into blocks.

    A pulse begins where the channel passes the threshold. It ends where the channel is back below a part of the
    threshold (`hysteresis`), so that noise does not split it. A new crossing within the dead time from its start, such
    as the ringing of a load cell, belongs to it. Kept samples are those of pulses, up to `before` and `after` them,
    and in the dead time, each once.

    After `most` pulses it is `done`, once all of the last one is kept. `starts` has the number of the first sample of
    each pulse beyond the threshold.
    """

    def __init__(self, measurement: Measurement, most: int | None = None) -> None:
        assert measurement.pulses is not None
        self._rule: PulseRule = measurement.pulses
        self._place, self._rate = measurement.place_of(self._rule.channel), measurement.rate
        self._skew, self._calibration = measurement.skew, measurement.inputs[self._place].calibration
        self._most, self.done = most, False
        self.starts: list[int] = []
        self._is_up, self._last_up, self._last_start = False, _LONG_AGO, _LONG_AGO
        self._end, self._highest = 0, -np.inf
        self._numbers: Numbers = np.empty(0, dtype=np.int64)
        self._volts: Floats = np.empty((len(measurement.inputs), 0))
        self._kept: Mask = np.empty(0, dtype=np.bool_)

    @property
    def up_for(self) -> int:
        """Samples of an unfinished pulse so far; 0 without one."""
        return self._end - self._last_start if self._is_up else 0

    @property
    def none_found(self) -> str:
        """The message if there are no pulses."""
        highest = np.sign(self._rule.threshold) * self._highest if self._end else 0.0
        return (
            f"{self._rule.channel}: expected a pulse beyond {self._rule.threshold:g} within "
            f"{self._end / self._rate:.6g} s, got none, {highest:.3g} at most. Nothing is written."
        )

    def feed(self, block: Block) -> list[Block]:
        """Take samples; return the samples that are now known to be kept."""
        if self.done:
            return []
        numbers = np.arange(block.first, block.end, dtype=np.int64)
        up = self._up(numbers, block.volts[self._place], self._is_up and block.first == self._end)
        rises = numbers[up[1:] & ~up[:-1]]
        starts = self._new_starts(rises)
        kept = self._within(numbers, up[1:], starts)
        count = self._needed(numbers, kept, starts)
        self._end = block.first + count
        self._is_up = bool(up[count])
        self.starts += starts[starts < self._end].tolist()
        self._last_start = self.starts[-1] if self.starts else _LONG_AGO
        self._append(numbers[:count], block.volts[:, :count], kept[:count], rises[rises < self._end])
        undecided = 0 if self.done else self._rule.before
        return self._taken(int(np.searchsorted(self._numbers, self._end - undecided)))

    def finish(self) -> list[Block]:
        """Return the unfinished pulse at the end of the record."""
        return self._taken(len(self._numbers))

    def _up(self, numbers: Numbers, volts: Floats, was_up: bool) -> Mask:
        """Return whether the channel was within a pulse, and a mask of samples within one, shape (1 + sample,)."""
        values = volts
        if self._calibration is not None:
            values = self._calibration.to_units(volts, numbers / self._rate + self._place * self._skew)
        height, level = np.sign(self._rule.threshold) * values, abs(self._rule.threshold)
        self._highest = max(self._highest, float(height.max()))
        is_over = height < self._rule.hysteresis * level
        # between the two levels the state does not change
        crossings = np.concatenate([[was_up], np.where(height >= level, 1, np.where(is_over, 0, -1))])
        last_crossing = np.maximum.accumulate(np.where(crossings >= 0, np.arange(len(crossings)), 0))
        up: Mask = crossings[last_crossing] == 1
        return up

    def _new_starts(self, rises: Numbers) -> Numbers:
        """Return the rises that begin new pulses: those after the dead time of the previous one."""
        found, last = [], self._last_start
        for rise in rises.tolist():
            if rise - last >= self._rule.dead:
                found.append(rise)
                last = rise
        return np.array(found, dtype=np.int64)

    def _within(self, numbers: Numbers, up: Mask, starts: Numbers) -> Mask:
        """Return a mask of samples within pulses, shortly after them, or in their dead time."""
        last_up = np.maximum.accumulate(np.where(up, numbers, self._last_up))
        self._last_up = int(last_up[-1])
        start = np.append(self._last_start, starts)[np.searchsorted(starts, numbers, side="right")]
        kept: Mask = (numbers - last_up <= self._rule.after) | (numbers - start < self._rule.dead)
        return kept

    def _needed(self, numbers: Numbers, kept: Mask, starts: Numbers) -> int:
        """Return the number of samples to use: all up to the end of the last pulse in `most`."""
        missing = (self._most or len(self.starts) + len(starts) + 1) - len(self.starts)
        if missing > len(starts):
            return len(numbers)
        begin = int(np.searchsorted(numbers, starts[missing - 1])) if missing > 0 else 0
        over = np.flatnonzero(~kept[begin:])
        self.done = len(over) > 0
        return begin + int(over[0]) if self.done else len(numbers)

    def _append(self, numbers: Numbers, volts: Floats, kept: Mask, rises: Numbers) -> None:
        """Add samples to the undecided ones, and keep those shortly before a rise."""
        self._numbers = np.concatenate([self._numbers, numbers])
        self._volts = np.concatenate([self._volts, volts], axis=1)
        self._kept = np.concatenate([self._kept, kept])
        coming = np.append(rises, _NEVER)[np.searchsorted(rises, self._numbers)]
        self._kept |= coming - self._numbers <= self._rule.before

    def _taken(self, count: int) -> list[Block]:
        """Return the kept ones among the first samples, and drop these."""
        kept = np.flatnonzero(self._kept[:count])
        numbers, volts = self._numbers[kept], self._volts[:, kept]
        self._numbers, self._kept = self._numbers[count:], self._kept[count:]
        self._volts = self._volts[:, count:]
        if not len(numbers):
            return []
        cuts = np.flatnonzero(np.diff(numbers) != 1) + 1
        firsts = numbers[np.concatenate([[0], cuts])].tolist()
        return [Block(first, part) for first, part in zip(firsts, np.split(volts, cuts, axis=1), strict=True)]


def with_pulses(
    recording: Recording, measurement: Measurement, blocks: Sequence[Block], gaps: Sequence[Gap], watched: int
) -> Recording:
    """Return the recording with an event train of its pulses: their instants, peaks and impulses.

    A peak is the largest sample above the level before the pulse. An impulse is the integral down to 5 % of the peak.
    Both are first estimates; `vibroimpact spikes` measures them with errors. `watched` samples were examined.
    """
    rule = measurement.pulses
    assert rule is not None
    channel, rate = recording.channel(rule.channel), measurement.rate
    rows = np.searchsorted(rows_of(blocks, gaps), _starts(measurement, blocks))
    ends = np.append(rows[1:], len(channel.time))
    looks = [_look(channel, rule, int(row), int(end)) for row, end in zip(rows, ends, strict=False)]
    peaks, impulses = np.array(looks).reshape(-1, 2).T
    masked = [end for gap in gaps for end in (gap.first / rate, gap.end / rate)]
    unit = measured_unit(channel.unit).si
    train = EventTrain(
        TRAIN,
        channel.time[rows],
        window=(0.0, watched / rate),
        resolution=1.0 / rate,
        label=f"pulses of {channel.name} beyond {rule.threshold:g} {measured_unit(channel.unit).label}",
        attrs={
            "peak": peaks,
            "peak_unit": unit,
            "impulse": impulses,
            "impulse_unit": impulse_unit(unit),
            **({"masked": np.array(masked)} if masked else {}),
        },
    )
    many = "1 pulse is" if len(rows) == 1 else f"{len(rows)} pulses are"
    remark = (
        f"{many} kept of {watched / rate:.6g} s, with {rule.before} samples before and {rule.after} after; "
        "what did not pass the threshold is not there"
    )
    attrs = {**recording.attrs, "remarks": joined("\n", [*recording.remarks, remark])}
    return replace(recording, events={TRAIN: train}, attrs=attrs)


def _starts(measurement: Measurement, blocks: Sequence[Block]) -> list[int]:
    """Return the starts of pulses among the kept samples, equal to those found during the measurement."""
    finder = PulseFinder(measurement)
    for block in blocks:
        finder.feed(block)
    return finder.starts


def _look(channel: Channel, rule: PulseRule, first: int, end: int) -> tuple[float, float]:
    """Return peak and impulse of the pulse from one row to before another, in SI units."""
    begin = max(first - rule.before, 0)
    sign, values, time = np.sign(rule.threshold), channel.si()[begin:end], channel.time[begin:end]
    before = values[: first - begin]
    level = float(np.median(before[np.isfinite(before)])) if np.isfinite(before).any() else 0.0
    height = np.nan_to_num(sign * (values - level))
    top = int(np.argmax(height))
    low = np.flatnonzero(height <= FOOT * height[top])
    left, right = low[low < top], low[low > top]
    foot = slice(int(left[-1]) if len(left) else 0, int(right[0]) + 1 if len(right) else len(height))
    impulse = float(np.trapezoid(height[foot], time[foot]))
    return float(sign * height[top]), float(sign * impulse)
