"""Cut a displacement at its impacts, found as kinks of the signal alone, with the instants between samples.

Symbols: V speed of approach, r restitution. At an impact the velocity jumps by -(1 + r) V; on both sides the motion is
smooth. Each side has its own one-sided cubic over a window fixed in time. The instant is where the two cubics meet. If
the stop is known, it is where each meets the stop (weights by their speeds). The window balances noise against the
motion's curvature. Where flights are shorter than the window, a shorter window that shows more impacts is used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from vibroimpact.analysis.estimation.noise import Mask, noise_level, one_sided_window
from vibroimpact.analysis.estimation.physics import Floats, Known
from vibroimpact.analysis.estimation.signals import Signal, refuse_other_quantities
from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.robust import robust_sigma
from vibroimpact.fmus.errors import EstimationError

# Size of a jump of the velocity, in standard errors, above which it is a kink ...
_JUMPS_BEYOND = 5.0
# ... if it also exceeds this multiple of the apparent jump in smooth motion of the largest size and fastest rate.
_BIAS_BEYOND = 1.5
FEWEST_IN_FLIGHT = 10
# Relative deviation of a sampling step from the median beyond which it is a gap or a repeated sample, without a kink.
_UNEVEN = 0.5
_REFINEMENTS = 4
# A kink is away from the stop if its level differs from the median level by more than this many standard errors ...
_LEVEL_BEYOND = 8.0
# ... and by more than this share of the motion's size.
_LEVEL_OF_SIZE = 0.02
# Ratio of each trial window to the one before, down to the smallest number of samples ...
_SHORTER = 0.6
_FEWEST_IN_WINDOW = 6
# ... the shorter window is used if it shows more impacts by more than this factor.
_MORE_IMPACTS = 1.1
# No shorter window is tried if all impacts are further apart than this many windows.
_SEPARATE = 2.5
# A kink the other way counts if it is further than this many windows from all kinks at the stop ...
_CLEAR_OF = 1.1
# ... and larger than this share of the largest kink there: smooth motion makes small kinks.
_PART_OF_LARGEST = 0.1
# Distance of a known stop from the impacts, over the motion's size, above which it is refused; impacts for this check.
_STOP_OF_SIZE, _FEWEST_TO_CHECK = 0.1, 5
# Motion passes a level if more than this share of its samples is further beyond it than this share of its size.
_PART_BEYOND, _BEYOND_OF_SIZE = 0.05, 0.1
# Smallest number of jumps without a kink whose scatter serves as their error.
_FEWEST_FREE = 50
# Samples within this many standard errors of the instant of an impact belong to no flight.
DOUBTFUL = 2.5


@dataclass(frozen=True, slots=True)
class Impact:
    """One kink."""

    time: float
    time_error: float
    """Standard error of the instant, s."""
    level: float
    """Displacement where both sides meet."""
    before: float
    after: float
    """`before` and `after`: velocities of the two sides at the impact."""


@dataclass(frozen=True, slots=True)
class Flight:
    """Smooth motion between two consecutive impacts, from start to end, s."""

    start: float
    end: float
    index: NDArray[np.intp]
    """Good samples of the flight, without samples too near an impact for their side to be known; shape (sample,)."""
    first: int
    """Index of the impact at its start; the next impact is at its end."""
    usable: bool
    """Whether it has enough samples."""

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.end - self.start


@dataclass(frozen=True, slots=True)
class Segmentation:
    """A signal cut at its impacts."""

    signal: Signal
    impacts: tuple[Impact, ...]
    flights: tuple[Flight, ...]
    """Flights between impacts, first to last."""
    window: float
    """Window of the one-sided cubics, s."""
    stray: int = 0
    """Number of kinks away from the stop: their level differs from the others."""
    opposite: int = 0
    """Number of kinks the other way, far from all others: impacts on a stop on the other side."""

    @property
    def stop_position(self) -> float:
        """Level of the kinks: their mean, weighted by the squares of their jumps."""
        weight = np.array([(impact.before - impact.after) ** 2 for impact in self.impacts])
        return float(np.average([impact.level for impact in self.impacts], weights=weight))

    @property
    def passed(self) -> bool:
        """Whether the motion passes the level of the kinks, so that no stop is there."""
        return bool(self.impacts) and _exceeds_level(self.signal, self.stop_position)


def segment_channel(channel: Channel, fastest: float, known: Known, window: float | None) -> Segmentation:
    """Cut a channel at its impacts; errors are those of `segment`.

    EstimationError: the channel has another quantity than displacement. Velocities jump at impacts; accelerations and
    forces have spikes.
    """
    refuse_other_quantities(channel)
    return segment(
        channel.time,
        np.where(channel.good, channel.values, 0.0),
        channel.good,
        fastest=fastest,
        side=known.side,
        stop_position=known.stop_position,
        window=window,
    )


def segment(
    time: Floats,
    values: Floats,
    good: Mask,
    *,
    fastest: float,
    side: str | None = None,
    stop_position: float | None = None,
    window: float | None = None,
) -> Segmentation:
    """Find the impacts of a displacement and cut it there; arrays have shape (sample,), time in s.

    `fastest` is the angular frequency of the fastest smooth part of the motion, for example of the force, rad/s.
    `side` is `upper` or `lower` (None: the kinks decide). The window of the one-sided cubics is in s (None: chosen from
    the noise). Too few samples, or fewer than two impacts, raise EstimationError.
    """
    noise = noise_level(values, good)
    interval = float(np.median(np.diff(time)))
    signal = Signal(time, values, good, interval, 1.0, noise)
    if window is None:
        longest = 0.25 * 2.0 * math.pi / fastest
        window = one_sided_window(noise, interval, 0.5 * signal.range, fastest, longest)
        counts = _counts(window / interval)
    else:
        counts = [max(_FEWEST_IN_WINDOW, round(window / interval))]
    found: Segmentation | None = None
    misplaced: EstimationError | None = None
    for count in counts:
        try:
            trial = _possible_cut(signal, fastest, count, side, stop_position)
        except EstimationError as problem:
            # a window that is too long shows kinks away from the impacts
            misplaced = misplaced or problem
            continue
        if found is None or _is_better(trial, found):
            found = trial
        if _are_separate(trial, count) and not trial.passed:
            break
    if misplaced is not None and (found is None or len(found.impacts) < _FEWEST_TO_CHECK):
        raise misplaced
    if found is None or len(found.impacts) < 2:
        raise EstimationError(
            f"segmentation: expected at least two impacts with a jump of the velocity above the noise "
            f"({noise:.3g}), got {0 if found is None else len(found.impacts)}. Give a longer recording of impacting "
            "motion, or one with less noise or more samples between impacts."
        )
    shorter = [count for count in counts if count * interval <= found.window]
    return replace(found, opposite=max(_opposite(found.signal, fastest, count) for count in shorter))


def _counts(most: float) -> list[int]:
    """Return the numbers of samples in a one-sided window, longest first."""
    counts = [max(_FEWEST_IN_WINDOW, round(most))]
    while counts[-1] > _FEWEST_IN_WINDOW:
        counts.append(max(_FEWEST_IN_WINDOW, round(_SHORTER * counts[-1])))
    return counts


def _is_better(trial: Segmentation, found: Segmentation) -> bool:
    """Tell whether a shorter window shows more impacts, or shows a stop where the longer one does not."""
    if trial.passed != found.passed:
        return _is_stopped(trial)
    return len(trial.impacts) > _MORE_IMPACTS * len(found.impacts)


def _exceeds_level(signal: Signal, level: float) -> bool:
    """Tell whether more samples are above a level than a stop there allows, given noise and yielding of the stop."""
    limit = level + max(_BEYOND_OF_SIZE * 0.5 * signal.range, _JUMPS_BEYOND * signal.noise)
    return bool(np.mean(signal.values[signal.good] > limit) > _PART_BEYOND)


def _are_separate(cut: Segmentation, count: int) -> bool:
    """Tell whether all impacts are so far apart that a shorter window would show no more."""
    spacing = np.diff([impact.time for impact in cut.impacts])
    return bool(len(spacing) and not cut.stray and np.min(spacing) > _SEPARATE * count * cut.signal.interval)


def _possible_cut(
    raw: Signal, fastest: float, count: int, side: str | None, stop_position: float | None
) -> Segmentation:
    """Return a signal cut at the impacts of windows of `count` samples, on the side that the motion does not pass.

    In a window that is too long for the motion, smooth motion turns like an impact on the other side.
    """
    sign = _side_sign(_jumps_and_least(raw, fastest, count)[0], side)
    cuts: list[Segmentation | EstimationError] = []
    for one in (sign, -sign) if side is None else (sign,):
        try:
            found = _cut(raw, fastest, count, one, stop_position)
        except EstimationError as problem:
            cuts.append(problem)
            continue
        if _is_stopped(found):
            return found
        cuts.append(found)
    if isinstance(cuts[0], EstimationError):
        raise cuts[0]
    return cuts[0]


def _is_stopped(cut: Segmentation) -> bool:
    """Tell whether a cut has impacts, and no motion beyond them."""
    return len(cut.impacts) >= 2 and not cut.passed


def _mirrored(raw: Signal, sign: float) -> Signal:
    """Return a signal with an upper stop: a lower stop (sign -1) is mirrored."""
    return replace(raw, values=sign * raw.values, sign=sign)


def _cut(raw: Signal, fastest: float, count: int, sign: float, stop_position: float | None) -> Segmentation:
    """Return a signal cut at the impacts on one side, found with windows of `count` samples on each side."""
    jump, least = _jumps_and_least(raw, fastest, count)
    signal = _mirrored(raw, sign)
    places = _kinks(-sign * jump, least, count)
    stop = None if stop_position is None else sign * stop_position
    located = _located(signal, places, count, stop)
    if stop is not None and len(located) < 0.5 * len(places):
        _check_stop(_consistent(_located(signal, places, count, None), signal, count), signal, stop)
    impacts = _consistent(located, signal, count)
    stray = len(located) - len(impacts)
    return Segmentation(signal, tuple(impacts), _flights(signal, impacts), count * signal.interval, stray)


def _opposite(signal: Signal, fastest: float, count: int) -> int:
    """Return the number of kinks the other way in windows of `count` samples, away from kinks at the stop.

    Noise that is not white moves slopes by more than its differences from sample to sample suggest. The scatter of the
    jumps away from kinks measures this.
    """
    jump, least = _jumps_and_least(signal, fastest, count)
    ours = _kinks(-jump, least, count)
    away = np.isfinite(jump)
    for place in ours:
        away[max(0, place - count) : place + count + 1] = False
    if np.count_nonzero(away) >= _FEWEST_FREE:
        least = max(least, _JUMPS_BEYOND * robust_sigma(jump[away] - np.median(jump[away])))
    largest = float(np.max(-jump[ours])) if ours else 0.0
    others = _kinks(jump, max(least, _PART_OF_LARGEST * largest), count)
    return sum(all(abs(place - one) > _CLEAR_OF * count for one in ours) for place in others)


def _jumps_and_least(signal: Signal, fastest: float, count: int) -> tuple[Floats, float]:
    """Return the jumps of the velocity, and the smallest jump beyond noise and smooth motion."""
    even = np.abs(np.diff(signal.time) - signal.interval) < _UNEVEN * signal.interval
    weights = _hinge(count)
    jump = _jumps(signal.values, signal.good, even, weights) / signal.interval
    error = signal.noise * float(np.linalg.norm(weights)) / signal.interval
    fourth = (np.arange(2 * count) - (count - 0.5)) ** 4 / 24.0
    bend = 0.5 * signal.range * fastest**4 * signal.interval**3
    return jump, max(_JUMPS_BEYOND * error, _BIAS_BEYOND * (bend * abs(float(weights @ fourth))))


def _hinge(count: int) -> Floats:
    """Return the weights of 2 `count` samples for the kink in their middle, in addition to a cubic, per interval.

    Least squares of a cubic + kink * max(0, t): the part that the cubic can follow has no weight.
    """
    abscissa = np.arange(2 * count) - (count - 0.5)
    cubic = np.vander(abscissa / count, 4)
    hinge = np.maximum(0.0, abscissa)
    residual = hinge - cubic @ np.linalg.lstsq(cubic, hinge, rcond=None)[0]
    weights: Floats = residual / (residual @ residual)
    return weights


def _jumps(values: Floats, good: Mask, even: Mask, weights: Floats) -> Floats:
    """Return the jump of the velocity in each sampling interval, times its length; NaN where it is unknown."""
    from scipy.signal import oaconvolve

    count = len(weights) // 2
    jump = np.full(len(values) - 1, np.nan)
    if len(values) >= 2 * count:
        kinks = oaconvolve(np.where(good, values - np.mean(values), 0.0), weights[::-1], mode="valid")
        whole = _all_of(good, 2 * count) & _all_of(even, 2 * count - 1)
        jump[count - 1 : len(values) - count] = np.where(whole, kinks, np.nan)
    return jump


def _all_of(mask: Mask, count: int) -> Mask:
    """Return a mask of the places from which `count` neighbours are all true."""
    missing = np.concatenate([[0], np.cumsum(~mask)])
    found: Mask = missing[count:] == missing[:-count]
    return found


def _side_sign(jump: Floats, side: str | None) -> float:
    """Return 1 for an upper stop (velocities jump down), -1 for a lower one."""
    if side is not None:
        return 1.0 if side == "upper" else -1.0
    known = jump[np.isfinite(jump)]
    return 1.0 if known.size == 0 or -np.min(known) >= np.max(known) else -1.0


def _kinks(drop: Floats, least: float, count: int) -> list[int]:
    """Return the sampling intervals with the largest drop of the velocity around them."""
    from scipy.signal import find_peaks

    height = np.where(np.isfinite(drop), drop, -np.inf)
    # near a larger kink, the one-sided fits contain that kink
    edges = np.concatenate([[-np.inf], height, [-np.inf]])
    places = find_peaks(edges, height=least, distance=count)[0] - 1
    return [int(place) for place in places]


def _located(signal: Signal, places: list[int], count: int, stop: float | None) -> list[Impact]:
    """Return the impacts with their instants between samples."""
    instants = [0.5 * float(signal.time[place] + signal.time[place + 1]) for place in places]
    impacts = []
    for k, instant in enumerate(instants):
        earliest = instants[k - 1] if k > 0 else -math.inf
        latest = instants[k + 1] if k + 1 < len(instants) else math.inf
        impact = _meeting(signal, instant, (earliest, latest), count, stop)
        if impact is not None:
            impacts.append(impact)
    return impacts


def _meeting(
    signal: Signal, instant: float, limits: tuple[float, float], count: int, stop: float | None
) -> Impact | None:
    """Fit both sides, find where they meet, and choose the samples of each side anew; None where that fails."""
    impact = None
    reach = count * signal.interval
    for _ in range(_REFINEMENTS):
        before = _side_samples(signal, instant, max(limits[0], instant - reach), before=True)
        after = _side_samples(signal, instant, min(limits[1], instant + reach), before=False)
        if min(len(before), len(after)) < 4:
            return impact
        one, other = (_one_sided(signal, index, instant, reach) for index in (before, after))
        shift = _crossing(one, other, reach) if stop is None else _at_stop(one, other, stop, reach)
        if not abs(shift) <= 3.0 * signal.interval:
            return impact
        instant += shift
        # error at the end of a cubic of m samples: 4 sigma / sqrt(m); two sides
        error = 4.0 * signal.noise * math.sqrt(1.0 / len(before) + 1.0 / len(after))
        s = shift / reach
        level = 0.5 * (polyval(s, one) + polyval(s, other))
        slopes = [polyval(s, polyder(side)) / reach for side in (one, other)]
        jump = float(slopes[0] - slopes[1])
        if jump <= 0.0:
            return impact
        impact = Impact(
            instant, error / jump, float(level if stop is None else stop), float(slopes[0]), float(slopes[1])
        )
        if abs(shift) < 1e-9 * signal.interval:
            break
    return impact


def _side_samples(signal: Signal, instant: float, limit: float, *, before: bool) -> NDArray[np.intp]:
    """Return the good samples between an instant and a limit, on one side of it."""
    low, high = (limit, instant) if before else (instant, limit)
    first, last = np.searchsorted(signal.time, (low, high), side="right" if before else "left")
    index = np.arange(first, last)
    chosen: NDArray[np.intp] = index[signal.good[index]]
    return chosen


def _one_sided(signal: Signal, index: NDArray[np.intp], instant: float, reach: float) -> Floats:
    """Return the coefficients of the cubic through samples, in (time - instant) / reach."""
    abscissa = (signal.time[index] - instant) / reach
    vander = np.vander(abscissa, 4, increasing=True)
    return np.asarray(np.linalg.lstsq(vander, signal.values[index], rcond=None)[0], dtype=np.float64)


def _crossing(one: Floats, other: Floats, reach: float) -> float:
    """Return the time from the present instant to the intersection of two cubics, s (Newton)."""
    a, b, c, d = map(float, one - other)
    s = 0.0
    for _ in range(6):
        slope = (3.0 * d * s + 2.0 * c) * s + b
        if slope == 0.0:
            return math.inf
        s -= (((d * s + c) * s + b) * s + a) / slope
        if not abs(s) < 1.0:
            return math.inf
    return s * reach


def _at_stop(one: Floats, other: Floats, stop: float, reach: float) -> float:
    """Return the mean time to where each cubic meets the stop, weighted by their speeds squared, s."""
    level = np.array([stop, 0.0, 0.0, 0.0])
    found = [(_crossing(side, level, reach), float(side[1]) ** 2) for side in (one, other)]
    known = [(shift, weight) for shift, weight in found if math.isfinite(shift)]
    total = sum(weight for _, weight in known)
    return sum(weight * shift for shift, weight in known) / total if total > 0.0 else math.inf


def _check_stop(impacts: list[Impact], signal: Signal, stop: float) -> None:
    """Raise EstimationError if a known stop is away from the impacts."""
    if len(impacts) < _FEWEST_TO_CHECK:
        return
    middle, scatter, _ = _levels(impacts)
    error = scatter / math.sqrt(len(impacts))
    if abs(middle - stop) > max(_LEVEL_BEYOND * error, _STOP_OF_SIZE * (0.5 * signal.range)):
        raise EstimationError(
            f"stop: expected the place where the impacts are, {signal.sign * middle:.4g} +- {error:.1g}, got "
            f"{signal.sign * stop:.4g}. Correct it, or leave it out: it is estimated then."
        )


def _consistent(impacts: list[Impact], signal: Signal, count: int) -> list[Impact]:
    """Return the impacts without kinks at another level than the others, which are not at the stop."""
    if len(impacts) < 4:
        return impacts
    _, scatter, off = _levels(impacts)
    least = _LEVEL_OF_SIZE * (0.5 * signal.range)
    limit = max(_LEVEL_BEYOND * max(scatter, 4.0 * signal.noise / math.sqrt(count)), least)
    return [impact for impact, distance in zip(impacts, np.abs(off), strict=True) if distance <= limit]


def _levels(impacts: list[Impact]) -> tuple[float, float, Floats]:
    """Return the median level of impacts, the scatter about it, and the deviation of each impact."""
    levels = np.array([impact.level for impact in impacts])
    middle = float(np.median(levels))
    return middle, robust_sigma(levels - middle), levels - middle


def _flights(signal: Signal, impacts: list[Impact]) -> tuple[Flight, ...]:
    """Return the flights between consecutive impacts."""
    flights = []
    for k in range(len(impacts) - 1):
        start, end = impacts[k].time, impacts[k + 1].time
        # a sample this near an impact may belong to its other side
        margins = [DOUBTFUL * impact.time_error for impact in impacts[k : k + 2]]
        first = int(np.searchsorted(signal.time, start + margins[0], side="right"))
        last = int(np.searchsorted(signal.time, end - margins[1], side="left"))
        index = np.arange(first, last)
        index = index[signal.good[index]]
        # a gap leaves a flight that cannot be followed
        usable = len(index) >= max(FEWEST_IN_FLIGHT, 0.8 * (end - start - sum(margins)) / signal.interval - 2)
        flights.append(Flight(start, end, index, k, usable))
    return tuple(flights)
