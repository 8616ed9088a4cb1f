"""Cut a displacement at its impacts, found as kinks of the signal alone, with the instants between samples.

Symbols: V speed of approach, r restitution. At an impact the velocity jumps by -(1 + r) V; on both sides the motion is
smooth. Each side has its own one-sided cubic over a window fixed in time; the instant is where the two meet, or, with
the stop known, where each meets the stop (weights by their speeds). The window balances noise against the motion's
curvature; where flights are shorter than it, a shorter one shows more impacts and is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks, oaconvolve

from vibroimpact.analysis.estimation.noise import Floats, Mask, noise_level, one_sided_window
from vibroimpact.analysis.robust import robust_sigma
from vibroimpact.fmus.errors import EstimationError

# A jump of the velocity counts from this many standard errors on ...
_JUMPS_BEYOND = 5.0
# ... and from this many times what motion of the largest size and the fastest rate makes of it.
_BIAS_BEYOND = 1.5
_FEWEST_IN_FLIGHT = 10
# A sampling step off the median by this part is a gap or a repeated sample: no kink is looked for across it.
_UNEVEN = 0.5
_REFINEMENTS = 4
# A kink that meets its neighbours' level worse than this many standard errors is not at the stop.
_LEVEL_BEYOND = 8.0
# ... and by more than this part of the motion's size.
_LEVEL_OF_SIZE = 0.02
# Each shorter window is this part of the one before it, down to as many samples ...
_SHORTER = 0.6
_FEWEST_IN_WINDOW = 6
# ... and is taken where it shows more than so many times as many impacts ...
_MORE = 1.1
# ... which is not tried where impacts lie so many windows apart.
_APART = 2.5
# A window has no other kink in it where the next one is this many of its halves away.
_CLEAR_OF = 1.1
# Jumps the other way count from this part of the largest one on: smooth motion makes small ones.
_PART_OF_LARGEST = 0.1
# A known stop is wrong that is this part of the motion's size off the impacts; told from so many of them on.
_STOP_OF_SIZE, _FEWEST_TO_CHECK = 0.1, 5
# Samples within so many standard errors of an impact's instant are in no flight.
_DOUBTFUL = 2.5


@dataclass(frozen=True, slots=True)
class Signal:
    """A displacement with an upper stop, mirrored where the stop is a lower one.

    Attributes
    ----------
    time, values : ndarray of float, shape (sample,)
        s, unit of the displacement.
    good : ndarray of bool, shape (sample,)
        Samples that are plain measurements.
    interval : float
        Mean sampling interval, s.
    sign : float
        -1 where the signal was mirrored, else 1.
    noise : float
        Standard deviation of the noise.
    """

    time: Floats
    values: Floats
    good: Mask
    interval: float
    sign: float
    noise: float


@dataclass(frozen=True, slots=True)
class Impact:
    """One kink.

    Attributes
    ----------
    time, time_error : float
        Instant and its standard error, s.
    level : float
        Displacement where the two sides meet.
    before, after : float
        Velocities of the two sides there.
    """

    time: float
    time_error: float
    level: float
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class Flight:
    """Smooth motion between two impacts that follow each other.

    Attributes
    ----------
    start, end : float
        s.
    index : ndarray of int, shape (sample,)
        Good samples between, less those so near an impact that they may be on its other side.
    first : int
        Index of the impact at its start; that at its end is the next.
    usable : bool
        Has samples enough.
    """

    start: float
    end: float
    index: NDArray[np.intp]
    first: int
    usable: bool

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.end - self.start


@dataclass(frozen=True, slots=True)
class Segmentation:
    """A signal cut at its impacts.

    Attributes
    ----------
    signal : Signal
    impacts : tuple of Impact
    flights : tuple of Flight
        Those between impacts, first to last.
    window : float
        Of the one-sided cubics, s.
    stray : int
        Kinks that are at no stop: their level is not that of the others.
    opposite : int
        Kinks the other way, far from all others: those of a stop on the other side.
    """

    signal: Signal
    impacts: tuple[Impact, ...]
    flights: tuple[Flight, ...]
    window: float
    stray: int = 0
    opposite: int = 0

    @property
    def stop_position(self) -> float:
        """Level of the kinks: mean weighted by the square of their jumps."""
        weight = np.array([(impact.before - impact.after) ** 2 for impact in self.impacts])
        return float(np.average([impact.level for impact in self.impacts], weights=weight))


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
    """Find the impacts of a displacement and cut it there.

    Parameters
    ----------
    time, values, good : ndarray, shape (sample,)
        s, unit of the displacement, and which samples are plain measurements.
    fastest : float
        Angular frequency of the fastest smooth part of the motion, such as that of the force, rad/s.
    side : str or None
        `upper` or `lower`; None: as the kinks show.
    stop_position : float or None
        Where it is known.
    window : float or None
        Of the one-sided cubics, s; None: from the noise.

    Raises
    ------
    EstimationError
        Too few samples, or fewer than two impacts.
    """
    noise = noise_level(values, good)
    interval = float(np.median(np.diff(time)))
    size = 0.5 * float(np.ptp(values[good]))
    if window is None:
        longest = 0.25 * 2.0 * math.pi / fastest
        window = one_sided_window(noise, interval, size, fastest, longest)
        counts = _counts(window / interval)
    else:
        counts = [max(_FEWEST_IN_WINDOW, round(window / interval))]
    scales = _Scales(noise, interval, size, fastest)
    signal = Signal(time, values, good, interval, 1.0, noise)
    found: Segmentation | None = None
    for count in counts:
        trial = _cut(signal, scales, count, side, stop_position)
        if found is None or len(trial.impacts) > _MORE * len(found.impacts):
            found = trial
        if _uncrowded(trial, count):
            break
    if found is None or len(found.impacts) < 2:
        raise EstimationError(
            f"segmentation: expected at least two impacts with a jump of the velocity above the noise "
            f"({noise:.3g}), got {0 if found is None else len(found.impacts)}. Give a longer recording of impacting "
            "motion, or one with less noise or more samples between impacts."
        )
    shorter = [count for count in counts if count * interval <= found.window]
    return replace(found, opposite=max(_opposite(found.signal, scales, count) for count in shorter))


@dataclass(frozen=True, slots=True)
class _Scales:
    """Noise, sampling interval (s), amplitude and fastest smooth rate (rad/s) of a signal."""

    noise: float
    interval: float
    size: float
    fastest: float


def _counts(most: float) -> list[int]:
    """Return the samples in a one-sided window, longest first."""
    counts = [max(_FEWEST_IN_WINDOW, round(most))]
    while counts[-1] > _FEWEST_IN_WINDOW:
        counts.append(max(_FEWEST_IN_WINDOW, round(_SHORTER * counts[-1])))
    return counts


def _uncrowded(cut: Segmentation, count: int) -> bool:
    """Tell whether no impact has another so near that a shorter window would show more."""
    apart = np.diff([impact.time for impact in cut.impacts])
    return bool(len(apart) and not cut.stray and np.min(apart) > _APART * count * cut.signal.interval)


def _cut(
    raw: Signal, scales: _Scales, count: int, side: str | None, stop_position: float | None
) -> Segmentation:
    """Return a signal cut at the impacts that windows of `count` samples on each side show."""
    noise, interval, size = scales.noise, scales.interval, scales.size
    jump, least = _jumps_and_least(raw, scales, count)
    sign = _side_sign(jump, side)
    signal = replace(raw, values=sign * raw.values, sign=sign)
    places = _kinks(-sign * jump, least, count)
    stop = None if stop_position is None else sign * stop_position
    located = _located(signal, places, count, stop)
    if stop is not None and len(located) < 0.5 * len(places):
        _check_stop(_consistent(_located(signal, places, count, None), noise, count, size), stop, size, sign)
    impacts = _consistent(located, noise, count, size)
    stray = len(located) - len(impacts)
    return Segmentation(signal, tuple(impacts), _flights(signal, impacts), count * interval, stray)


def _opposite(signal: Signal, scales: _Scales, count: int) -> int:
    """Return how many kinks the other way windows of `count` samples show, away from those of the stop."""
    jump, least = _jumps_and_least(signal, scales, count)
    ours = _kinks(-jump, least, count)
    largest = float(np.max(-jump[ours])) if ours else 0.0
    others = _kinks(jump, max(least, _PART_OF_LARGEST * largest), count)
    return sum(all(abs(place - one) > _CLEAR_OF * count for one in ours) for place in others)


def _jumps_and_least(signal: Signal, scales: _Scales, count: int) -> tuple[Floats, float]:
    """Return the jumps of the velocity, and what the least is that counts."""
    even = np.abs(np.diff(signal.time) - scales.interval) < _UNEVEN * scales.interval
    error, bias = _hinge_errors(scales, count)
    jump = _jumps(signal.values, signal.good, even, count, scales.interval)
    return jump, max(_JUMPS_BEYOND * error, _BIAS_BEYOND * bias)


def _hinge(count: int) -> Floats:
    """Return the weights of 2 `count` samples that give the kink in their middle beside a cubic, per interval.

    Least squares of a cubic + kink * max(0, t): what the cubic can follow has no weight.
    """
    abscissa = np.arange(2 * count) - (count - 0.5)
    cubic = np.vander(abscissa / count, 4)
    hinge = np.maximum(0.0, abscissa)
    rest = hinge - cubic @ np.linalg.lstsq(cubic, hinge, rcond=None)[0]
    weights: Floats = rest / (rest @ rest)
    return weights


def _jumps(values: Floats, good: Mask, even: Mask, count: int, interval: float) -> Floats:
    """Return the jump of the velocity in the middle of each sampling interval; NaN where it is not known."""
    jump = np.full(len(values) - 1, np.nan)
    if len(values) < 2 * count:
        return jump
    kinks = oaconvolve(np.where(good, values - np.mean(values), 0.0), _hinge(count)[::-1], mode="valid")
    whole = _all_of(good, 2 * count) & _all_of(even, 2 * count - 1)
    jump[count - 1 : len(values) - count] = np.where(whole, kinks, np.nan) / interval
    return jump


def _all_of(mask: Mask, count: int) -> Mask:
    """Return whether `count` neighbours from each one on are all true."""
    missing = np.concatenate([[0], np.cumsum(~mask)])
    found: Mask = missing[count:] == missing[:-count]
    return found


def _side_sign(jump: Floats, side: str | None) -> float:
    """Return 1 for an upper stop (velocities jump down), -1 for a lower one."""
    if side is not None:
        return 1.0 if side == "upper" else -1.0
    known = jump[np.isfinite(jump)]
    return 1.0 if known.size == 0 or -np.min(known) >= np.max(known) else -1.0


def _hinge_errors(scales: _Scales, count: int) -> tuple[float, float]:
    """Return what noise, and what the fourth derivative of smooth motion, make of a jump where there is none."""
    weights = _hinge(count)
    fourth = (np.arange(2 * count) - (count - 0.5)) ** 4 / 24.0
    error = scales.noise * float(np.linalg.norm(weights)) / scales.interval
    bend = scales.size * scales.fastest**4 * scales.interval**3
    return error, bend * abs(float(weights @ fourth))


def _kinks(drop: Floats, least: float, count: int) -> list[int]:
    """Return the sampling intervals with the largest drop of the velocity around them."""
    height = np.where(np.isfinite(drop), drop, -np.inf)
    # within a window of a larger kink the one-sided fits have that kink in them
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
    """Fit both sides, let them meet, and choose the samples of each side anew; None where that fails."""
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
        # of the end of a cubic of m samples: 4 sigma / sqrt(m); two sides
        error = 4.0 * signal.noise * math.sqrt(1.0 / len(before) + 1.0 / len(after))
        s = shift / reach
        level = 0.5 * (np.polynomial.polynomial.polyval(s, one) + np.polynomial.polynomial.polyval(s, other))
        slopes = [
            np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(side)) / reach
            for side in (one, other)
        ]
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
    """Return the time from the present instant to where two cubics meet, s (Newton)."""
    difference = one - other
    s = 0.0
    for _ in range(6):
        slope = np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(difference))
        if slope == 0.0:
            return math.inf
        s -= float(np.polynomial.polynomial.polyval(s, difference) / slope)
        if not abs(s) < 1.0:
            return math.inf
    return s * reach


def _at_stop(one: Floats, other: Floats, stop: float, reach: float) -> float:
    """Return the time to where each cubic meets the stop, weighted by their speeds squared, s."""
    shifts, weights = [], []
    for side in (one, other):
        level = np.array([stop, 0.0, 0.0, 0.0])
        shifts.append(_crossing(side, level, reach))
        weights.append(float(side[1]) ** 2)
    known = [k for k in (0, 1) if math.isfinite(shifts[k])]
    if not known or sum(weights[k] for k in known) == 0.0:
        return math.inf
    return sum(weights[k] * shifts[k] for k in known) / sum(weights[k] for k in known)


def _check_stop(impacts: list[Impact], stop: float, size: float, sign: float) -> None:
    """Refuse a known stop that is not where the impacts are."""
    if len(impacts) < _FEWEST_TO_CHECK:
        return
    levels = np.array([impact.level for impact in impacts])
    middle = float(np.median(levels))
    error = robust_sigma(levels - middle) / math.sqrt(len(levels))
    if abs(middle - stop) > max(_LEVEL_BEYOND * error, _STOP_OF_SIZE * size):
        raise EstimationError(
            f"stop: expected the place where the impacts are, {sign * middle:.4g} +- {error:.1g}, got "
            f"{sign * stop:.4g}. Correct it, or leave it out: it is estimated then."
        )


def _consistent(impacts: list[Impact], noise: float, count: int, size: float) -> list[Impact]:
    """Leave out kinks that are not where the others are: they are not at the stop."""
    if len(impacts) < 4:
        return impacts
    levels = np.array([impact.level for impact in impacts])
    middle = float(np.median(levels))
    scatter = robust_sigma(levels - middle)
    limit = max(_LEVEL_BEYOND * max(scatter, 4.0 * noise / math.sqrt(count)), _LEVEL_OF_SIZE * size)
    return [impact for impact in impacts if abs(impact.level - middle) <= limit]


def _flights(signal: Signal, impacts: list[Impact]) -> tuple[Flight, ...]:
    """Return the flights between impacts that follow each other."""
    flights = []
    for k in range(len(impacts) - 1):
        start, end = impacts[k].time, impacts[k + 1].time
        # a sample so near an impact may belong to the other side of it
        doubt = [_DOUBTFUL * impact.time_error for impact in impacts[k : k + 2]]
        first = int(np.searchsorted(signal.time, start + doubt[0], side="right"))
        last = int(np.searchsorted(signal.time, end - doubt[1], side="left"))
        index = np.arange(first, last)
        index = index[signal.good[index]]
        # a gap leaves a flight that cannot be followed
        usable = len(index) >= max(_FEWEST_IN_FLIGHT, 0.8 * (end - start - sum(doubt)) / signal.interval - 2)
        flights.append(Flight(start, end, index, k, usable))
    return tuple(flights)
