"""The output of a sweep, planned sample by sample: one continuous phase through all changes of frequency.

The phase is a whole number of 2^-64 cycles, and so is its increment per sample. It does not depend on the start of an
output block, and the first samples of periods are exact. A frequency is met within rate / 2^65.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vibroimpact.hardware.programs.sweep.settings import SweepSettings

Floats = NDArray[np.float64]
CYCLE = 2**64
"""Units of phase in a cycle."""
_MANTISSA = 53
"""Bits of a phase that a sine can resolve."""
Kind = Literal["rise", "pass", "repeat", "step", "fall"]


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of the output at one frequency."""

    kind: Kind
    """Rise and fall of the amplitude, a step, a pass through a finished step, or a repeat of the last finished one."""
    place: int
    """Number of the step along the path, from 0; -1 for rise and fall."""
    first: int
    """Number of its first sample."""
    count: int
    increment: int
    phase: int
    """`increment` per sample, and `phase` at the first sample, in units of 1 / `CYCLE`."""

    @property
    def stop(self) -> int:
        """The first sample after it."""
        return self.first + self.count

    def begin_of(self, period: int) -> int:
        """Return the first sample of a forcing period: the first one at or after the whole phase."""
        return self.first + _samples_to(period, self.phase, self.increment)


def _samples_to(cycles: int, phase: int, increment: int) -> int:
    """Return the number of samples after which a phase has advanced by `cycles` from the start of its own cycle."""
    return max(0, -((phase - cycles * CYCLE) // increment))


@dataclass(frozen=True, slots=True)
class Plan:
    """The whole output of a sweep; a waveform for `Output`."""

    rate: float
    """Samples per second."""
    amplitude: float
    """V."""
    segments: tuple[Segment, ...]
    """Each begins at the end of the previous one."""
    _firsts: tuple[int, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Note the starts of the segments."""
        object.__setattr__(self, "_firsts", tuple(segment.first for segment in self.segments))

    @property
    def samples(self) -> int:
        """Samples of the whole output; the last one is 0 V."""
        return self.segments[-1].stop

    @property
    def duration(self) -> float:
        """Duration of the whole output, s."""
        return self.samples / self.rate

    def volts(self, first: int, count: int) -> Floats:
        """Return samples of the output, V, shape (count,); 0 before its start and after its end."""
        found = np.zeros(count)
        place = max(0, bisect_right(self._firsts, first) - 1)
        for segment in self.segments[place:]:
            if segment.first >= first + count:
                break
            low, high = max(first, segment.first), min(first + count, segment.stop)
            if low < high:
                found[low - first : high - first] = self._of(segment, low - segment.first, high - low)
        return found

    def _of(self, segment: Segment, offset: int, count: int) -> Floats:
        numbers = np.arange(offset, offset + count, dtype=np.uint64)
        # wraps at a whole cycle
        phase = np.uint64(segment.phase) + numbers * np.uint64(segment.increment)
        angle = (phase >> np.uint64(64 - _MANTISSA)) * (2.0 * np.pi / 2**_MANTISSA)
        wave: Floats = self.amplitude * np.sin(angle)
        if segment.kind == "rise":
            wave *= 0.5 * (1.0 - np.cos(np.pi * numbers / segment.count))
        elif segment.kind == "fall":
            wave *= 0.5 * (1.0 + np.cos(np.pi * (numbers + 1.0) / segment.count))
        return wave


def planned(settings: SweepSettings, finished: int = 0) -> Plan:
    """Return the output of a sweep with this many finished steps.

    The amplitude rises at the first frequency of the path. Finished steps are passed through in the order of the path,
    so that the motion is on its former branch. The last of them is repeated in full, to check this.
    """
    steps, sweep = settings.steps, settings.sweep
    pieces: list[tuple[Kind, int, float, int]] = [("rise", -1, steps[0][1], settings.output.ramp_periods)]
    for place, (_, frequency) in enumerate(steps):
        kind: Kind = "step" if place >= finished else "repeat" if place == finished - 1 else "pass"
        periods = sweep.resume_periods if kind == "pass" else settings.step_periods
        pieces.append((kind, place, frequency, periods))
    pieces.append(("fall", -1, steps[-1][1], settings.output.ramp_periods))
    segments: list[Segment] = []
    first = phase = 0
    for kind, place, frequency, periods in pieces:
        increment = round(Fraction(frequency) / Fraction(settings.output.rate) * CYCLE)
        count = _samples_to(periods, phase, increment)
        segments.append(Segment(kind, place, first, count, increment, phase))
        first, phase = first + count, (phase + count * increment) % CYCLE
    return Plan(settings.output.rate, settings.output.amplitude, tuple(segments))


def recorded_periods(settings: SweepSettings, segment: Segment) -> NDArray[np.int64]:
    """Return the sample numbers of the starts of recorded periods, and of the last end, shape (periods + 1,).

    Periods may differ by one in their number of samples.
    """
    whole = range(settings.sweep.transient_periods, settings.step_periods + 1)
    return np.array([segment.begin_of(period) for period in whole], dtype=np.int64)
