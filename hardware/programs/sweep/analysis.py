"""Results of a step's samples: extrema of each period, their averages, impacts, and flags of problems."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import MeasurementFlag
from vibroimpact.analysis.spikes.detection import find_excursions
from vibroimpact.hardware.programs.sweep.drive import Drive, seen_drive
from vibroimpact.hardware.programs.sweep.extrema import Floats, Indices, extrema_of
from vibroimpact.hardware.programs.sweep.plan import CYCLE, Plan, Segment, recorded_periods
from vibroimpact.hardware.programs.sweep.settings import InputTable, SweepSettings

_ERRORS_OF_A_TREND = 4.0
"""Standard errors, above which a trend is significant."""
_FEWEST_OF_A_TREND = 4
_OTHER_DRIVE = 0.05
"""Relative difference of the drive from the planned amplitude, above which it is reported."""
_SLOPE = 0.01
"""Share of a period on both sides of an instant, for the velocity as a difference."""
_ENDED = 0.5
"""Part of the threshold, below which an excursion of the load cell is over."""


class Scale(Protocol):
    """Converts the volts of an input to its measured quantity."""

    def __call__(self, volts: Floats, time: Floats, /) -> Floats:
        """Return values at times (s) since the start of the acquisition."""


@dataclass(frozen=True, slots=True)
class Converter:
    """Lowest and highest voltage of an input, and the step of its converter, V."""

    low: float
    high: float
    step: float

    def at_its_end(self, volts: Floats) -> NDArray[np.bool_]:
        """Return a mask of the samples at the first or the last step."""
        return np.asarray((volts <= self.low + 0.5 * self.step) | (volts >= self.high - 1.5 * self.step))


@dataclass(frozen=True, slots=True)
class StepSamples:
    """The samples of a step, NaN if missing: shape (input, sample), from the first one of its segment."""

    segment: Segment
    volts: Floats


@dataclass(frozen=True, slots=True)
class MeasuredStep:
    """The results of a step."""

    place: int
    """Number along the path."""
    highest: Floats
    lowest: Floats
    """`highest` and `lowest`: m, shape (value,), each the mean of `average_periods` periods."""
    strobe: Floats
    """Displacement (m) and velocity (m/s) at forcing phase 0 of the first period of each, shape (value, 2)."""
    impacts: Floats | None
    """Mean number of impacts in a period, shape (value,); None without a load cell."""
    flags: MeasurementFlag
    message: str
    """Problems in words, or empty."""
    drive: Drive
    final_displacement: float
    """m."""

    @property
    def range(self) -> float:
        """Mean range of displacement over the periods, m; NaN without a whole period."""
        ranges = self.highest - self.lowest
        return float(np.nanmean(ranges)) if np.isfinite(ranges).any() else np.nan


class StepCollector:
    """Cuts the stream of an acquisition with this many inputs into steps, by the numbers of its samples."""

    def __init__(self, plan: Plan, inputs: int) -> None:
        self._left = [segment for segment in plan.segments if segment.kind in ("step", "repeat")]
        self._inputs = inputs
        self._kept: list[tuple[int, Floats]] = []

    def take(self, first: int, volts: Floats) -> Iterator[StepSamples]:
        """Take samples, shape (input, sample), and yield the steps that they complete.

        Samples come in order; after lost samples, `first` is larger than the previous end.
        """
        self._kept.append((first, volts))
        while self._left and first + volts.shape[1] >= self._left[0].stop:
            segment = self._left.pop(0)
            found = np.full((self._inputs, segment.count), np.nan)
            for begin, block in self._kept:
                low, high = max(begin, segment.first), min(begin + block.shape[1], segment.stop)
                if low < high:
                    found[:, low - segment.first : high - segment.first] = block[
                        :, low - begin : high - begin
                    ]
            self._forget()
            yield StepSamples(segment, found)
        self._forget()

    def _forget(self) -> None:
        """Drop samples that no step needs any more."""
        needed = self._left[0].first if self._left else np.inf
        self._kept = [(begin, block) for begin, block in self._kept if begin + block.shape[1] > needed]


def analysed(
    step: StepSamples,
    settings: SweepSettings,
    scale: Scale,
    converters: Sequence[Converter],
) -> MeasuredStep:
    """Return the results of a step, with the scale of the displacement and the converter of each input."""
    segment, rate = step.segment, settings.output.rate
    edges = recorded_periods(settings, segment) - segment.first
    place = settings.place_of("displacement")
    assert place is not None  # the file was checked
    volts = step.volts[place]
    time = np.arange(segment.first, segment.stop) / rate
    displacement = scale(volts, time)
    highest, lowest = extrema_of(displacement, edges)
    highest, lowest = (_grouped(each, settings) for each in (highest, lowest))
    drive = _drive(step, settings)
    recorded = step.volts[:, edges[0] : edges[-1]]
    flags, reasons = MeasurementFlag(0), []
    # comparisons with NaN are false
    clipped = [
        each.name
        for each, values, converter in zip(settings.inputs, recorded, converters, strict=True)
        if each.role in ("displacement", "load_cell") and converter.at_its_end(values).any()
    ]
    if clipped:
        flags |= MeasurementFlag.clipped
        reasons.append(f"{' and '.join(clipped)} at the end of the range")
    if lost := int(np.isnan(recorded[place]).sum()):
        flags |= MeasurementFlag.gap
        reasons.append(f"{lost} of {recorded.shape[1]} samples lost")
    if drift := _drift(highest, lowest, settings.sweep.drift):
        flags |= MeasurementFlag.drift
        reasons.append(f"{drift} while it was recorded")
    if wrong := _wrong_drive(drive, settings):
        flags |= MeasurementFlag.starved
        reasons.append(wrong)
    late = drive.late((0.5 * (edges[0] + edges[-1]) - 0.5 * segment.count) / rate)
    return MeasuredStep(
        segment.place,
        highest,
        lowest,
        _strobe(displacement, segment, settings, late * rate),
        _impacts(step, settings, edges),
        flags,
        "; ".join(reasons),
        drive,
        float(displacement[-1]),
    )


def _grouped(values: Floats, settings: SweepSettings) -> Floats:
    """Return the means of groups of periods."""
    means: Floats = values.reshape(-1, settings.sweep.average_periods).mean(axis=1)
    return means


def _strobe(displacement: Floats, segment: Segment, settings: SweepSettings, late: float) -> Floats:
    """Return displacement and velocity at phase 0 of the first period of each group, shifted by the lag in samples."""
    periods = range(settings.sweep.transient_periods, settings.step_periods, settings.sweep.average_periods)
    at = np.array([(period * CYCLE - segment.phase) / segment.increment for period in periods]) + late
    half = max(1.0, _SLOPE * CYCLE / segment.increment)
    numbers = np.arange(segment.count)
    there = np.interp(at, numbers, displacement)
    slope = np.interp(at + half, numbers, displacement) - np.interp(at - half, numbers, displacement)
    return np.stack([there, slope * settings.output.rate / (2.0 * half)], axis=1)


def _drift(highest: Floats, lowest: Floats, share: float) -> str:
    """Return a sentence about each trend in a step that exceeds a share of the range; empty without a trend."""
    ranges = highest - lowest
    size = float(np.nanmean(ranges)) if np.isfinite(ranges).any() else np.nan
    for name, values in (("range", ranges), ("mean", 0.5 * (highest + lowest))):
        good = np.isfinite(values)
        count = int(good.sum())
        if count < _FEWEST_OF_A_TREND:
            continue
        place = np.arange(len(values))[good] - np.arange(len(values))[good].mean()
        slope = float(place @ values[good] / (place @ place))
        left = values[good] - values[good].mean() - slope * place
        error = np.sqrt(left @ left / (count - 2) / (place @ place))
        change = abs(slope) * (len(values) - 1)
        if change > share * size and abs(slope) > _ERRORS_OF_A_TREND * error:
            return f"{name} changed by {100.0 * change / size:.2g} % of the range"
    return ""


def _drive(step: StepSamples, settings: SweepSettings) -> Drive:
    place = settings.place_of("drive")
    return Drive() if place is None else seen_drive(step.volts[place], step.segment, settings.output.rate)


def _wrong_drive(drive: Drive, settings: SweepSettings) -> str:
    """Return, in words, the deviation of the drive from the plan; empty if it is small or was not measured."""
    planned = settings.output.amplitude
    if not np.isfinite(drive.amplitude):
        return ""
    if abs(drive.amplitude - planned) > _OTHER_DRIVE * planned:
        return f"the drive was {drive.amplitude:.3g} V, not {planned:g} V"
    if drive.residual > _OTHER_DRIVE:
        return f"{100.0 * drive.residual:.2g} % of the drive was no sine"
    return ""


def _impacts(step: StepSamples, settings: SweepSettings, edges: Indices) -> Floats | None:
    """Return the mean number of impacts per period of each group."""
    place = settings.place_of("load_cell")
    if place is None:
        return None
    begins = _pulses(step.volts[place], settings.inputs[place], settings.output.rate)
    counts = np.histogram(begins, edges)[0].astype(np.float64)
    missing = np.isnan(np.add.reduceat(step.volts[place], edges[:-1])[: len(counts)])
    counts[missing] = np.nan
    return _grouped(counts, settings)


def _pulses(volts: Floats, cell: InputTable, rate: float) -> Floats:
    """Return the samples at which pulses of a load cell begin; the dead time excludes ringing."""
    assert cell.threshold is not None  # the file was checked
    centred = np.nan_to_num(volts - np.nanmedian(volts)) if np.isfinite(volts).any() else np.zeros(len(volts))
    found = find_excursions(np.arange(len(volts), dtype=np.float64), centred, cell.threshold, _ENDED)
    begins: list[float] = []
    for up in found.up:
        if not begins or up - begins[-1] > cell.dead_time * rate:
            begins.append(float(up))
    return np.array(begins)
