"""The measured drive, from an input that the output is wired to: its amplitude, its lag, the error of the clock."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.hardware.programs.sweep.plan import CYCLE, Segment

Floats = NDArray[np.float64]

_PARTS = 12
"""Parts of a step whose phases are compared."""
_FEWEST_PERIODS = 2


class Drive(NamedTuple):
    """The drive of a step as measured by an input."""

    amplitude: float = np.nan
    """V."""
    lag: float = np.nan
    """Measured minus planned drive in the middle of the step, s, within half a period."""
    clock_error: float = np.nan
    """Relative error of the inputs' clock, 1e-6, from this step alone; positive if it is fast."""
    residual: float = np.nan
    """RMS of the rest beside a sine of the planned frequency, over the amplitude."""

    def late(self, after: float) -> float:
        """Return the lag (s) at a time (s) after the middle of the step; 0 if it was not measured."""
        lag = self.lag + 1e-6 * self.clock_error * after
        return lag if np.isfinite(lag) else 0.0


def seen_drive(volts: Floats, segment: Segment, rate: float) -> Drive:
    """Return the drive of a step as measured by an input.

    The step is cut into parts; each is fitted by the planned sine with its own amplitude, phase and offset. If the
    clock of the inputs is fast by e, the phase falls behind by 2 pi f e in a second. `volts` are all samples of the
    step, shape (sample,), NaN if missing.
    """
    periods = segment.count * segment.increment / CYCLE
    parts = int(min(_PARTS, periods // _FEWEST_PERIODS))
    cycles = np.arange(segment.count) * (segment.increment / CYCLE) + segment.phase / CYCLE
    angles = np.asarray(2.0 * np.pi * (cycles % 1.0), dtype=np.float64)
    ends = np.linspace(0, segment.count, parts + 1).astype(np.int64)
    fits = [_fitted(volts[low:high], angles[low:high]) for low, high in pairwise(ends)]
    good = [(k, fit) for k, fit in enumerate(fits) if fit is not None]
    if not good:
        return Drive()
    middles = np.array([0.5 * (ends[k] + ends[k + 1]) for k, _ in good]) / rate
    waves = np.array([fit[0] for _, fit in good])
    angular = 2.0 * np.pi * rate * segment.increment / CYCLE
    phases = np.unwrap(np.angle(waves))
    amplitude = float(np.abs(waves).mean())
    centre = 0.5 * segment.count / rate
    slope, phase = np.polyfit(middles - centre, phases, 1) if len(good) > 1 else (np.nan, phases[0])
    residual = float(np.sqrt(np.mean([fit[1] for _, fit in good])))
    lag = -float((phase + np.pi) % (2.0 * np.pi) - np.pi) / angular
    return Drive(
        amplitude, lag, float(-1e6 * slope / angular), residual / amplitude if amplitude > 0.0 else np.inf
    )


def _fitted(volts: Floats, angle: Floats) -> tuple[complex, float] | None:
    """Return the complex amplitude of a part, and the mean square of the residual; None for too few samples."""
    there = np.isfinite(volts)
    if there.sum() < 8:
        return None
    basis = np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], axis=1)[there]
    (sine, cosine, offset), *_ = np.linalg.lstsq(basis, volts[there], rcond=None)
    left = volts[there] - basis @ np.array([sine, cosine, offset])
    return complex(sine, cosine), float(np.mean(left**2))


class SeenLags(NamedTuple):
    """The lags of steps measured by one acquisition, in order; each field has shape (step,)."""

    time: Floats
    """Middle of each step, s."""
    lag: Floats
    """s, as in `Drive`."""
    clock_error: Floats
    """1e-6, as in `Drive`."""
    period: Floats
    """Forcing period, s."""


def clock_error_of(seen: Sequence[SeenLags]) -> tuple[float, float]:
    """Return the error of the inputs' clock and its standard error, 1e-6: the slope of the lag over all steps.

    An input samples in steps of its clock, so that the lag grows by whole samples. The slope from one step is
    therefore coarse; it only resolves the whole periods by which the lag grows from step to step. Each acquisition
    starts its clocks anew.
    """
    time, lag = [], []
    for each in seen:
        good = np.isfinite(each.lag) & np.isfinite(each.clock_error)
        if good.sum() > 1:
            one = SeenLags(*(column[good] for column in each))
            time.append(one.time - one.time.mean())
            unwrapped = _unwrapped(one)
            lag.append(unwrapped - unwrapped.mean())
    free = sum(map(len, time)) - len(time) - 1
    if free < 1:
        return np.nan, np.nan
    t, y = np.concatenate(time), np.concatenate(lag)
    slope = float(t @ y / (t @ t))
    left = y - slope * t
    return 1e6 * slope, 1e6 * float(np.sqrt(left @ left / free / (t @ t)))


def _unwrapped(seen: SeenLags) -> Floats:
    """Return the lags with their whole periods."""
    found = [float(seen.lag[0])]
    usual = 1e-6 * float(np.median(seen.clock_error))
    for k in range(1, len(seen.lag)):
        expected = found[-1] + usual * float(seen.time[k] - seen.time[k - 1])
        turns = np.rint((expected - seen.lag[k]) / seen.period[k])
        found.append(float(seen.lag[k] + turns * seen.period[k]))
    return np.array(found)
