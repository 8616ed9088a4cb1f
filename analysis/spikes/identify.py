"""Identify the spikes of a channel: method, baseline, threshold, groups.

`identify` is the spike identification of thesis section 5.2; its result contains all its decisions.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel, Quality
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.analysis.robust import robust_sigma
from vibroimpact.analysis.spikes.baseline import drift_window, running_median
from vibroimpact.analysis.spikes.converter import (
    LEAST_STEPS,
    between_steps,
    converter_step,
)
from vibroimpact.analysis.spikes.cycle import PeriodicPart, cycle_scores, find_cycle
from vibroimpact.analysis.spikes.detection import Excursions, Group, find_excursions, group_excursions
from vibroimpact.analysis.spikes.noise import (
    HALF_WAVE_OF_MOTION,
    STANDS_OUT,
    Tail,
    outside_excursions,
    samples_in_half_wave,
    tail_threshold,
)
from vibroimpact.fmus.errors import EstimationError, UsageError
from vibroimpact.fmus.messages import Argument, message

Floats = NDArray[np.float64]

METHODS = ("auto", "threshold", "cycle_median", "cycle_threshold")
_THRESHOLD = Argument("method", "threshold")
POLARITIES = {"both": 0, "positive": 1, "negative": -1}
#: Number of windows of the RMS of a smooth shock in one cycle.
_RMS_WINDOWS_IN_CYCLE = 10
#: Number of cycles in which a forced motion settles, at its start and after a shock.
_CYCLES_TO_SETTLE = 2.0
#: Lowest threshold, relative to the largest value, for simulated signals, which have no noise.
_SMALLEST_PART = 1e-3
#: One over the assumed share of the record of the longest spike, in the first estimate of the drift.
_FIRST_WINDOWS = 2000
_FEWEST_SAMPLES = 16
#: Height, relative to the noise, at which a person sees a spike. Number of samples without a spike that may be this
#: high: a few, or this many times the number from normal noise.
_SEEN_BY_EYE, _FEW, _MANY_TIMES = 4.5, 3, 10.0


@dataclass(frozen=True, slots=True)
class SpikeSettings:
    """Settings for finding spikes; None means chosen from the data.

    Attributes
    ----------
    method : {"auto", "threshold", "cycle_median", "cycle_threshold"}
        `threshold`: the signal without its baseline is compared with a threshold. `cycle_median`: the periodic part is
        removed, and the short-window RMS of the residual is compared with the same phase of the other cycles.
        `cycle_threshold`: the periodic part is removed, then as for `threshold`.
    threshold : float or None
        SI unit of the channel; a robust score with `cycle_median`.
    threshold_part : float or None
        The threshold as a share of the largest value instead.
    hysteresis : float
        Lower threshold as a share of the threshold, 0 to 1.
    minimum_samples : int
        Number of samples above the threshold below which a group is no spike (thesis section 5.3: four).
    merge : float or None
        Distance of excursions, s, below which they form one spike. None: ten lengths of its main excursion; with
        `cycle_median` two cycles, in which the motion settles again.
    polarity : {"both", "positive", "negative"}
    noise : float or None
        Standard deviation of the noise, SI unit; the noise is assumed normal.
    false_alarms : float
        Expected number of noise peaks above the threshold in the record.
    baseline_window : float or None
        s.
    rms_window : float or None
        s; None: a tenth of a cycle.
    period : float or None
        Period of the excitation, s.
    """

    method: str = "auto"
    threshold: float | None = None
    threshold_part: float | None = None
    hysteresis: float = 0.5
    minimum_samples: int = 4
    merge: float | None = None
    polarity: str = "both"
    noise: float | None = None
    false_alarms: float = 0.01
    baseline_window: float | None = None
    rms_window: float | None = None
    period: float | None = None

    def __post_init__(self) -> None:
        """Raise UsageError with all impossible settings at once."""
        problems = [
            f"{name}: expected {rule}, got {got!r}." for name, rule, ok, got in self._rules() if not ok
        ]
        if problems:
            raise UsageError("\n".join(problems))

    def _rules(self) -> list[tuple[str, str, bool, object]]:
        positive = ("threshold", "noise", "baseline_window", "rms_window", "period")
        values = {name: getattr(self, name) for name in positive}
        return [
            *((name, "more than 0", value is None or value > 0.0, value) for name, value in values.items()),
            ("method", f"one of {', '.join(METHODS)}", self.method in METHODS, self.method),
            ("polarity", f"one of {', '.join(POLARITIES)}", self.polarity in POLARITIES, self.polarity),
            ("hysteresis", "0 < hysteresis <= 1", 0.0 < self.hysteresis <= 1.0, self.hysteresis),
            ("minimum_samples", "1 or more", self.minimum_samples >= 1, self.minimum_samples),
            ("merge", "0 or more", self.merge is None or self.merge >= 0.0, self.merge),
            ("false_alarms", "0 < false_alarms < 1", 0.0 < self.false_alarms < 1.0, self.false_alarms),
            (
                "threshold",
                "a part between 0 and 100 %",
                self.threshold_part is None or 0.0 < self.threshold_part < 1.0,
                self.threshold_part,
            ),
        ]


@dataclass(frozen=True, slots=True)
class Identification:
    """The spikes of a channel, and the way they were found.

    Attributes
    ----------
    time, signal : ndarray of float, shape (sample,)
        s; SI unit of the channel, with straight lines across bad samples.
    bad : ndarray of bool, shape (sample,)
        Mask of the samples without a value of their own.
    clipped : ndarray of bool, shape (sample,)
    baseline, residual : ndarray of float, shape (sample,)
        Drift and periodic part; the signal without them.
    statistic : ndarray of float, shape (sample,)
        Values compared with the threshold: the residual, or the robust score.
    unit : str
        SI unit of the signal.
    method, reason : str
    threshold, lower_threshold : float
        In units of the statistic.
    noise : float
        Standard deviation of the residual at rest, SI unit.
    tail : Tail
        Tail of the statistic.
    cycle : PeriodicPart
    excursions : Excursions
    groups : list of Group
    short : int
        Number of excursions with too few samples.
    settled : float
        s; earlier excursions belong to the start of a periodic motion, and are no spikes.
    baseline_window : int
        Window of the baseline, samples.
    settings : SpikeSettings
    interval : float
        Sampling interval, s; the mean interval without pauses.
    remarks : list of str
    doubts : list of str
        Reasons to doubt that these are the spikes, and all of them.
    """

    time: Floats
    signal: Floats
    bad: NDArray[np.bool_]
    clipped: NDArray[np.bool_]
    baseline: Floats
    residual: Floats
    statistic: Floats
    unit: str
    method: str
    reason: str
    threshold: float
    lower_threshold: float
    noise: float
    tail: Tail
    cycle: PeriodicPart
    excursions: Excursions
    groups: list[Group]
    short: int
    settled: float
    baseline_window: int
    settings: SpikeSettings
    interval: float
    remarks: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)

    @property
    def verdict(self) -> str:
        """One line that says whether the spikes are reliable, and why not."""
        return f"not sure, because {'; '.join(self.doubts)}." if self.doubts else "sure."


def identify(channel: Channel, settings: SpikeSettings | None = None) -> Identification:
    """Find the spikes of a channel.

    Parameters
    ----------
    channel : Channel
    settings : SpikeSettings, optional

    Raises
    ------
    EstimationError
        Too few good samples, or a periodic part is requested for uneven samples.
    """
    chosen = settings or SpikeSettings()
    signal, bad = _bridged(channel)
    time = channel.time
    cycle, method, reason = _method(channel, signal, chosen)
    periodic = cycle.periodic if method != "threshold" else np.zeros(len(signal))
    interval = channel.axis.pace
    step = converter_step(signal[~bad])
    between = between_steps(len(signal), step) if step else np.zeros(len(signal))
    baseline, window = _baseline(signal - periodic + between, bad, chosen, interval)
    residual = signal - periodic - baseline
    polarity = POLARITIES[chosen.polarity]
    statistic = residual
    if method == "cycle_median":
        width = round(chosen.rms_window / interval) if chosen.rms_window else 0
        width = max(2, width or round(cycle.period / _RMS_WINDOWS_IN_CYCLE))
        statistic, polarity = cycle_scores(residual, cycle.period, width), 1
    start = np.arange(len(time)) < (_CYCLES_TO_SETTLE * cycle.period if method != "threshold" else 0.0)
    looked_into = statistic + between if method != "cycle_median" else statistic
    tail, noise = _noise(looked_into, residual + between, bad | start, chosen, polarity, method)
    least = LEAST_STEPS * step if method != "cycle_median" else 0.0
    threshold = _threshold(statistic, tail, chosen, polarity, least)
    looked_at = statistic if polarity == 0 else np.where(polarity * statistic > 0.0, statistic, 0.0)
    excursions = find_excursions(time, looked_at, threshold, chosen.hysteresis)
    settling = _CYCLES_TO_SETTLE * cycle.period * interval
    merge = settling if method == "cycle_median" and chosen.merge is None else chosen.merge
    groups, short = group_excursions(excursions, time, merge, chosen.minimum_samples)
    settled = float(time[0])
    if method != "threshold":
        groups, settled = _after_start(groups, excursions, time, settling)
    return Identification(
        time,
        signal,
        bad,
        np.asarray((channel.quality & np.uint8(Quality.clipped)) != 0),
        baseline + periodic,
        residual,
        statistic,
        measured_unit(channel.unit).si,
        method,
        reason,
        threshold,
        chosen.hysteresis * threshold,
        noise,
        tail,
        cycle,
        excursions,
        groups,
        short,
        settled,
        window,
        chosen,
        interval,
        _remarks(channel, bad, step if noise < step else 0.0)
        + (_motion_remark(residual[~bad], interval) if method == "threshold" and noise else []),
        _constant(signal[~bad])
        + (_missed(time, looked_at, noise, threshold, chosen) if method != "cycle_median" else []),
    )


def _bridged(channel: Channel) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the values in SI units with straight lines across missing samples, and the mask of missing samples."""
    values = channel.si()
    bad = ~np.isfinite(values)
    if np.count_nonzero(~bad) < _FEWEST_SAMPLES:
        raise EstimationError(
            f"{channel.name}: expected at least {_FEWEST_SAMPLES} samples with a value, "
            f"got {np.count_nonzero(~bad)}."
        )
    if np.any(bad):
        values = values.copy()
        values[bad] = np.interp(channel.time[bad], channel.time[~bad], values[~bad])
    return values, bad


def _method(channel: Channel, signal: Floats, settings: SpikeSettings) -> tuple[PeriodicPart, str, str]:
    """Return the periodic part, the method and the reason for its choice."""
    interval = channel.axis.interval
    if settings.method == "threshold":
        return PeriodicPart(0.0, np.zeros(len(signal)), 0, 1.0, "not looked for"), "threshold", "asked for"
    if interval is None:
        if settings.method.startswith("cycle"):
            raise EstimationError(
                message(
                    f"{channel.name}: {settings.method}: expected evenly spaced samples, got uneven ones. "
                    "Resample it at import, or use ",
                    *(_THRESHOLD, "."),
                )
            )
        cycle = PeriodicPart(0.0, np.zeros(len(signal)), 0, 1.0, "the samples are not evenly spaced")
    else:
        cycle = find_cycle(signal, settings.period / interval if settings.period else None)
    if settings.method == "auto":
        if cycle.found:
            return cycle, "cycle_median", f"periodic excitation: {cycle.reason}"
        return cycle, "threshold", f"no periodic excitation: {cycle.reason}"
    if settings.method.startswith("cycle") and not cycle.found:
        raise EstimationError(
            message(
                f"{channel.name}: {settings.method}: expected a periodic excitation, got none: {cycle.reason}. "
                "Give its period with ",
                *(Argument("period"), ", or use ", _THRESHOLD, "."),
            )
        )
    return cycle, settings.method, "asked for"


def _baseline(
    values: Floats, bad: NDArray[np.bool_], settings: SpikeSettings, interval: float
) -> tuple[Floats, int]:
    """Return the drift without spikes, and its window (samples)."""
    length = len(values)
    if settings.baseline_window is not None:
        window = min(length, max(2, round(settings.baseline_window / interval)))
        return running_median(values, window, ~bad), window
    # the first estimate shows where the spikes are
    first = running_median(values, drift_window(values, length // _FIRST_WINDOWS, ~bad), ~bad)
    rest, used = values - first, ~bad
    used[used] = outside_excursions(rest[used])
    found = find_excursions(
        np.arange(length, dtype=np.float64), rest, STANDS_OUT * robust_sigma(rest[used]), settings.hysteresis
    )
    long = found.samples >= settings.minimum_samples
    longest = int(np.max((found.last - found.first + 1)[long], initial=1))
    if np.count_nonzero(used) < length // 4:
        used = ~bad
    window = drift_window(values, longest, used)
    return running_median(values, window, used), window


def _noise(
    statistic: Floats,
    residual: Floats,
    bad: NDArray[np.bool_],
    settings: SpikeSettings,
    polarity: int,
    method: str,
) -> tuple[Tail, float]:
    """Return the tail of the statistic and the noise of the residual."""
    from scipy.special import ndtri

    tail = tail_threshold(statistic[~bad], settings.false_alarms, polarity)
    noise = settings.noise
    if noise is not None and method != "cycle_median":
        normal = -float(ndtri(settings.false_alarms / (2.0 * len(statistic))))
        return Tail(noise, 0.0, noise * normal), noise
    if noise is not None:
        return tail, noise
    return tail, tail.sigma if method != "cycle_median" else tail_threshold(residual[~bad], 0.01).sigma


def _threshold(statistic: Floats, tail: Tail, settings: SpikeSettings, polarity: int, least: float) -> float:
    """Return the requested threshold, or that of the noise and `least`."""
    largest = float(np.max(np.abs(statistic) if polarity == 0 else polarity * statistic, initial=0.0))
    if settings.threshold is not None:
        return settings.threshold
    if settings.threshold_part is not None:
        return settings.threshold_part * largest
    return max(tail.threshold, least, _SMALLEST_PART * largest, float(np.finfo(float).tiny))


def _after_start(
    groups: list[Group], found: Excursions, time: Floats, reach: float
) -> tuple[list[Group], float]:
    """Return the spikes after the motion has settled, and the time of settling.

    A forced motion that starts outside its own cycle approaches the cycle. The first excursion within the first two
    cycles is this approach, together with all that follow it without a quiet cycle.
    """
    begin = float(time[0])
    if groups and float(found.up[groups[0].first]) - begin < reach:
        return groups[1:], float(time[found.last[groups[0].last]])
    return groups, begin


def _motion_remark(residual: Floats, interval: float) -> list[str]:
    """Return a remark if the signal between the spikes is a motion, which the threshold then describes."""
    samples = samples_in_half_wave(residual)
    if samples < HALF_WAVE_OF_MOTION:
        return []
    return [
        message(
            f"Between its spikes the signal is no noise but a motion at about {0.5 / (samples * interval):.3g} Hz: "
            "the threshold is what this motion hardly passes. Consider ",
            *(Argument("method"), ", ", Argument("threshold"), " and ", Argument("baseline_window"), "."),
        )
    ]


def _constant(values: Floats) -> list[str]:
    """Return a doubt if a channel is constant."""
    if np.ptp(values) > 0.0:
        return []
    return [f"all {values.size} samples are {values[0]:.6g}: the channel is dead"]


def _missed(
    time: Floats, statistic: Floats, noise: float, threshold: float, settings: SpikeSettings
) -> list[str]:
    """Return a doubt if more samples stand out of the noise, below the threshold, than normal noise explains."""
    from scipy.special import ndtr

    level = _SEEN_BY_EYE * noise
    is_given = settings.threshold is not None or settings.threshold_part is not None
    if is_given or not 0.0 < level < threshold:
        return []
    high = find_excursions(time, statistic, level, settings.hysteresis)
    groups, _ = group_excursions(high, time, settings.merge, 1)
    low = [one for one in groups if high.peak[one.main] <= threshold]
    samples = sum(int(high.samples[one.first : one.last + 1].sum()) for one in low)
    if samples <= max(_FEW, _MANY_TIMES * 2.0 * float(ndtr(-_SEEN_BY_EYE)) * len(statistic)):
        return []
    return [
        f"{samples} samples lie beyond {_SEEN_BY_EYE:g} times the noise and below the threshold, "
        f"{threshold / noise:.3g} times the noise: spikes as weak, or noise with a heavy tail"
    ]


def _remarks(channel: Channel, bad: NDArray[np.bool_], step: float) -> list[str]:
    remarks = []
    if step:
        remarks.append(
            f"The values lie on a grid of {step:.4g}, the step of a converter: the noise is taken to be at least "
            f"that of the steps, and the threshold {LEAST_STEPS:g} steps."
        )
    count = int(np.count_nonzero(bad))
    if count:
        remarks.append(f"{count} samples have no value; straight lines bridge them.")
    clipped = int(np.count_nonzero(channel.quality & np.uint8(Quality.clipped)))
    if clipped:
        remarks.append(f"{clipped} samples are clipped: peak and impulse of their spikes are lower bounds.")
    uncertainty = channel.axis.interval_uncertainty
    if uncertainty:
        remarks.append(
            f"The time axes of the source contradict each other: every frequency, period and duration "
            f"is uncertain by {uncertainty:.1%}."
        )
    return remarks
