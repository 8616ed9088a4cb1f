"""Missed and spurious spikes of a motion with one spike per period, from the lattice of its intervals.

True spikes of a period-1 motion lie one interval I apart. A missed spike makes an interval 2I, so the points of the
delay plot lie on the lattice (iI, jI). A spurious spike cuts an interval in two. Their points lie on the lines x = I,
y = I and x + y = I (thesis 5.4.2 and figure 5.13). The estimate goes back to the events. Events at the phase of the
lattice are true, others are spurious, and places of the lattice without an event were missed.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.intervals.density import interval_density
from vibroimpact.analysis.intervals.trains import Floats, IntervalTrain
from vibroimpact.analysis.robust import robust_sigma

FEWEST_EVENTS = 30
# Number of events whose phases are averaged for the place of the lattice, which may drift slowly.
WINDOW = 41
# Largest distance of a lattice event from its place, in standard deviations of the true events; its lower and upper
# limit, relative to the interval. A lattice beyond the upper limit is blurred.
SIGMAS, NEAREST, FARTHEST = 5.0, 0.005, 0.2
# Smallest share of all events on the lattice.
LEAST_ON_LATTICE = 0.7
ROUNDS = 4
# Longest span that sharpens the interval, in events; distance of its end from the lattice, relative to the interval.
LONGEST_SPAN, NEAR_LATTICE = 64, 0.25


@dataclass(frozen=True, slots=True)
class Share:
    """A probability from a count: its estimate, standard error, and one-sided 95 % upper bound (Clopper-Pearson)."""

    value: float = float("nan")
    standard_error: float = float("nan")
    upper: float = float("nan")


@dataclass(frozen=True, slots=True)
class Lattice:
    """Lattice of a period-1 train; only the reason is set if there is no lattice."""

    interval: float = float("nan")
    """I, s."""
    jitter: float = float("nan")
    """Standard deviation of true spikes about their places, s."""
    missed: Share = Share()
    """p: probability that a true spike is missed."""
    spurious: Share = Share()
    """s: probability that an interval of the true motion has a spurious spike."""
    places: int = 0
    """Number of places of the lattice."""
    counted_missed: int = 0
    """Number of places without an event."""
    counted_spurious: int = 0
    """Number of events between places."""
    on_lattice: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    """Mask of the events on the lattice, shape (event,)."""
    reason: str = ""
    """Reason why there is no lattice; empty if there is one."""


def interval_lattice(train: IntervalTrain) -> Lattice:
    """Return missed and spurious spikes of a motion with one spike per period.

    The estimate holds under three conditions. Misses are independent. Spurious spikes have any phase, at most one in an
    interval. True spikes keep the phase of a clock (a forcing) that drifts slowly or not at all. Spurious spikes on the
    lattice are invisible; the estimate corrects for their number. The most frequent interval is the first guess of I.

    >>> from vibroimpact.analysis.intervals import interval_train
    >>> times = np.delete(np.arange(200.0), [10, 50, 51, 120])
    >>> lattice = interval_lattice(interval_train(np.sort(np.append(times, [30.4, 77.7]))))
    >>> lattice.interval, lattice.counted_missed, lattice.counted_spurious
    (1.0, 4, 2)
    """
    times = train.times
    if len(times) < FEWEST_EVENTS:
        return Lattice(reason=f"expected at least {FEWEST_EVENTS} events, got {len(times)}")
    density = interval_density(train.intervals, resolution=train.resolution)
    guess = float(density.at[np.argmax(density.kernel)])
    if not guess > 0.0:
        return Lattice(reason="the most frequent interval is 0 s")
    interval, offset = _clock(times, guess)
    jitter, width = _widths(offset, train.resolution / interval)
    on_lattice = np.abs(offset) < width
    if width > FARTHEST:
        return Lattice(
            reason=f"no single lattice: events scatter by {100 * jitter:.0f} % of the most frequent interval "
            f"({interval:.4g} s) about its multiples; expected at most {100 * FARTHEST / SIGMAS:.0f} %"
        )
    if np.mean(on_lattice) < LEAST_ON_LATTICE:
        return Lattice(
            reason=f"no single lattice: {100 * np.mean(on_lattice):.0f} % of the events lie at multiples of the most "
            f"frequent interval ({interval:.4g} s); expected at least {100 * LEAST_ON_LATTICE:.0f} %",
        )
    return _shares(train, interval, jitter, width, offset, on_lattice)


def _clock(times: Floats, guess: float) -> tuple[float, Floats]:
    """Return the interval of the lattice and each event's offset from its nearest place, in intervals (-.5 to .5).

    The place of the lattice near an event is the mean phase of the events around it. Later rounds use only events
    found on the lattice.
    """
    interval, weight = _sharpened(times, guess), np.ones(len(times))
    phase = np.exp(2j * np.pi * (times - times[0]) / interval)
    offset = np.zeros(len(times))
    for _ in range(ROUNDS):
        mean = _running_sum(phase * weight)
        # each round reduces the drift
        phase = phase * np.exp(-1j * np.angle(mean))
        offset = np.angle(phase) / (2.0 * np.pi)
        weight = (np.abs(offset) < max(_widths(offset, 0.0)[1], NEAREST)).astype(np.float64)
    return interval, offset


def _sharpened(times: Floats, guess: float) -> float:
    """Return the interval of the lattice from longer and longer spans; each result counts the next span."""
    interval, reach = guess, 1
    while reach <= min(LONGEST_SPAN, len(times) // 4):
        spans = times[reach:] - times[:-reach]
        number = np.rint(spans / interval)
        deviation = spans / interval - number
        near = (np.abs(deviation) < NEAR_LATTICE) & (number > 0.0)
        if not near.any():
            break
        interval *= 1.0 + float(np.median(deviation[near] / number[near]))
        reach *= 2
    return interval


def _running_sum(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the sum over the neighbours of each value, fewer at the ends."""
    half = min(WINDOW, len(values)) // 2
    total = np.concatenate([[0.0], np.cumsum(values)])
    first = np.maximum(np.arange(len(values)) - half, 0)
    last = np.minimum(np.arange(len(values)) + half + 1, len(values))
    return np.asarray(total[last] - total[first])


def _widths(offset: Floats, resolution: float) -> tuple[float, float]:
    """Return the jitter, and the largest distance of an event from its place, in intervals."""
    jitter = robust_sigma(offset)
    return jitter, max(SIGMAS * jitter, NEAREST, 1.5 * resolution)


def _shares(
    train: IntervalTrain,
    interval: float,
    jitter: float,
    width: float,
    offset: Floats,
    on_lattice: NDArray[np.bool_],
) -> Lattice:
    """Count places from one true event to the next, unless a masked instant lies between them."""
    true = np.flatnonzero(on_lattice)
    steps = np.rint(np.diff(train.times[true]) / interval - np.diff(offset[true])).astype(np.int64)
    masked = np.concatenate([[0], np.cumsum(~train.kept)])
    clear = masked[true[1:]] == masked[true[:-1]]
    # of two events at one place, one is true and one is spurious
    double = clear & (steps == 0)
    between = np.where(clear, np.diff(true) - 1, 0)
    places = int(steps[clear].sum())
    if not places:
        return Lattice(reason="masked spans leave no two places of it side by side")
    empty = int(np.maximum(steps[clear] - 1, 0).sum())
    extra = int(between.sum())
    # a spurious event within `width` of a place counts as a true one, or replaces a missed one
    spurious = _share(extra, places, 1.0 - 2.0 * width)
    missed = _share(empty, places, 1.0 - 2.0 * width * spurious.value)
    return Lattice(
        interval, jitter * interval, missed, spurious, places, empty, extra + int(double.sum()), on_lattice
    )


def _share(count: int, trials: int, seen: float) -> Share:
    """Return the probability of an event that is visible only in the share `seen` of all cases."""
    from scipy.stats import beta

    value = count / trials
    error = np.sqrt(value * (1.0 - value) / trials) if value < 1.0 else float("nan")
    upper = float(beta.ppf(0.95, count + 1, trials - count)) if count < trials else 1.0
    return Share(min(value / seen, 1.0), float(error / seen), min(upper / seen, 1.0))
