"""Periodic excitation in a signal: its existence, its period, and the waveform of its cycle.

A forced system's signal repeats with the forcing; its spikes and shocks do not. The median over all cycles, phase by
phase, is the periodic part, which a shock in a few cycles cannot move. A wanted train of spikes may repeat just as
well. It differs in that the signal rests most of the time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.robust import MAD_TO_SIGMA, robust_sigma
from vibroimpact.analysis.spikes.baseline import running_median
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, message

Floats = NDArray[np.float64]

#: Smallest number of cycles for a median.
FEWEST_CYCLES = 10
#: Smallest number of samples in a cycle that show its waveform.
_FEWEST_SAMPLES = 8
#: Magnitude of the residual, relative to the signal, above which there is no periodic part.
_MOST_LEFT = 0.5
#: Relative change of the amplitude, first to last third of the cycles, above which a signal is a decaying ring.
_STEADY = 0.1
#: Highest harmonic of the fundamental that the strongest line may be.
_HARMONICS = 8
#: Ratio of the residuals below which the longer of two periods is the true one.
_LONGER_RATIO = 0.7
_REFINEMENTS = 5


@dataclass(frozen=True, slots=True)
class PeriodicPart:
    """The periodic part of a signal, or the reason why there is none.

    Attributes
    ----------
    period : float
        Samples; 0 if nothing repeats.
    periodic : ndarray of float, shape (sample,)
        The periodic part, about the signal's own mean level; zeros if there is none.
    count : int
        Cycles in the signal.
    left : float
        Noise without the periodic part, relative to the noise with it.
    reason : str
        The reason for the decision, in words.
    """

    period: float
    periodic: Floats
    count: int
    left: float
    reason: str

    @property
    def found(self) -> bool:
        """Whether there is a periodic excitation."""
        return self.period > 0.0


def find_cycle(values: Floats, period: float | None = None) -> PeriodicPart:
    """Search for a periodic excitation.

    Three conditions must hold. (a) There are at least ten cycles. (b) Without the median over its cycles, less than
    half of the signal's median magnitude is left. A train of spikes rests most of the time, so its median magnitude is
    noise, and noise has no cycle. (c) Its amplitudes in the first and the last third of the cycles agree within 10 %,
    unlike those of a decaying ring. Values are evenly sampled, without gaps. A given period (samples) is neither
    refined nor tested.
    """
    level = values - running_median(values, max(len(values) // 4, 1))
    if period is not None:
        if not 2.0 <= period <= 0.5 * (len(values) - 1):
            raise UsageError(
                message(
                    f"period: expected two samples at least and half the record at most, got {period:g} samples of "
                    f"{len(values)}. Give another ",
                    *(Argument("period"), "."),
                )
            )
        return _folded(values, period, f"a period of {period:g} samples was asked for")
    first = _strongest_line(level)
    if first is None:
        return _no_cycle(values, "too short for ten cycles")
    best = _fundamental(level, first)
    if best is None:
        return _no_cycle(values, "no ten cycles of any line in its spectrum")
    if best.left > _MOST_LEFT:
        return _no_cycle(
            values,
            f"no cycle explains it: {min(best.left, 1.0):.0%} of its noise is left without the best one",
        )
    change = _change_of_amplitude(level, best)
    if change > _STEADY:
        return _no_cycle(values, f"what repeats is not steady: its amplitude changes by {change:.0%}")
    # the drift again, now without the ripple that whole cycles leave in a running median
    drift = running_median(values - best.periodic, max(len(values) // 4, 1))
    return _folded(values - drift, refined_period(values - drift, best.period), "")


def _no_cycle(values: Floats, reason: str) -> PeriodicPart:
    return PeriodicPart(0.0, np.zeros(len(values)), 0, 1.0, reason)


def _strongest_line(values: Floats) -> float | None:
    """Return the period (samples) of the strongest line of the spectrum that has ten cycles in the signal."""
    from scipy.signal import get_window

    length = len(values)
    if length < FEWEST_CYCLES * _FEWEST_SAMPLES:
        return None
    spectrum = np.abs(np.fft.rfft(values * get_window("hann", length)))
    # lines below ten cycles, and their side lobes, are drift
    spectrum[: FEWEST_CYCLES - 1] = 0.0
    spectrum[length // _FEWEST_SAMPLES :] = 0.0
    place = int(np.argmax(spectrum))
    return length / place if spectrum[place] > 0.0 else None


def _fundamental(values: Floats, line: float) -> PeriodicPart | None:
    """Return the cycle whose period is the line's or a small multiple of it."""
    best: PeriodicPart | None = None
    exact = refined_period(values, line)
    for multiple in range(1, _HARMONICS + 1):
        period = exact * multiple
        if len(values) / period < FEWEST_CYCLES:
            break
        trial = _folded(values, period, "")
        if best is None or trial.left < _LONGER_RATIO * best.left:
            best = trial
    return best


def refined_period(values: Floats, period: float) -> float:
    """Return the period of a line from its phase, cycle by cycle.

    With an inexact trial period, the phase of the line against a clock of this period grows by a constant in each
    cycle. The median of the slopes between pairs of cycles (Theil 1950, Sen 1968) corrects the period, unaffected by a
    shock. The given period, in samples, must be right to a fraction of a cycle over the signal.

    >>> samples = np.arange(5000)
    >>> round(refined_period(np.sin(2 * np.pi * samples / 123.4567), 124.0), 3)
    123.457
    """
    from scipy.signal import get_window

    for _ in range(_REFINEMENTS):
        whole = max(2, round(period))
        count = len(values) // whole
        rotated = values[: count * whole] * np.exp(-2j * np.pi * np.arange(count * whole) / period)
        cycles = rotated.reshape(count, whole)
        # two cycles under a Hann window: harmonics and the image of the line fall on its zeros
        window = get_window("hann", 2 * whole)
        lines = cycles[:-1] @ window[:whole] + cycles[1:] @ window[whole:]
        phases = np.unwrap(np.angle(lines))
        centres = (np.arange(count - 1) + 1.0) * whole
        # each cycle against the cycle half the record later: the slopes with most weight
        half = max(1, (count - 1) // 2)
        slopes = (phases[half:] - phases[:-half]) / (centres[half:] - centres[:-half])
        frequency = 1.0 / period + float(np.median(slopes)) / (2.0 * np.pi)
        if not 0.5 / period < frequency < 2.0 / period:
            return period
        period = 1.0 / frequency
    return period


def fold(values: Floats, period: float) -> Floats:
    """Return the cycles of a signal, shape (cycle, phase): linear between samples, without the last partial cycle."""
    bins = max(2, round(period))
    count = int((len(values) - 1) / period)
    grid = (np.arange(count)[:, None] + np.arange(bins) / bins) * period
    cycles: Floats = np.interp(grid.ravel(), np.arange(len(values)), values).reshape(count, bins)
    return cycles


def unfold(waveform: Floats, period: float, length: int) -> Floats:
    """Return a waveform of one cycle, repeated over a signal of this length (samples)."""
    bins = len(waveform)
    phase = (np.arange(length) / period) % 1.0 * bins
    repeated: Floats = np.interp(phase, np.arange(bins + 1), np.append(waveform, waveform[0]))
    return repeated


def _folded(values: Floats, period: float, reason: str) -> PeriodicPart:
    cycles = fold(values, period)
    periodic = unfold(np.median(cycles, axis=0), period, len(values))
    before, after = robust_sigma(values), robust_sigma(values - periodic)
    left = after / before if before > 0.0 else 1.0
    count = len(cycles)
    words = reason or f"{count} cycles repeat; without them {left:.1%} of the noise is left"
    return PeriodicPart(period, periodic, count, left, words)


def _change_of_amplitude(values: Floats, cycle: PeriodicPart) -> float:
    """Return the relative change of the amplitude of the cycles from the first third to the last."""
    cycles = fold(values, cycle.period)
    waveform = np.median(cycles, axis=0)
    waveform = waveform - waveform.mean()
    amplitudes = cycles @ waveform / float(waveform @ waveform)
    third = max(1, len(amplitudes) // 3)
    early, late = float(np.median(amplitudes[:third])), float(np.median(amplitudes[-third:]))
    return abs(late - early) / max(abs(early), abs(late))


def cycle_scores(residual: Floats, period: float, window: int) -> Floats:
    """Return the excess of the short-window RMS over its values at the same phase in the other cycles.

    A smooth shock is small against the signal and no larger than the irregular parts of every cycle. It is large
    against other cycles at the same phase. The score is (rms - median) / (1.4826 MAD), with median and MAD over the
    cycles at that phase; the MAD is smoothed over the window. The residual is the signal without its periodic part;
    period and window are in samples.
    """
    rms = np.sqrt(_moving_mean(residual**2, window))
    cycles = fold(rms, period)
    middle = np.median(cycles, axis=0)
    spread = np.median(np.abs(cycles - middle), axis=0)
    spread = np.convolve(np.tile(spread, 3), np.ones(window) / window, "same")[len(spread) : 2 * len(spread)]
    length = len(residual)
    scale = MAD_TO_SIGMA * unfold(spread, period, length)
    floor = np.finfo(float).eps * float(np.max(np.abs(residual), initial=0.0))
    smallest = max(floor, float(np.finfo(float).tiny))
    scores: Floats = (rms - unfold(middle, period, length)) / np.maximum(scale, smallest)
    return scores


def _moving_mean(values: Floats, window: int) -> Floats:
    """Return the mean over a window about each sample, cut at the ends."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    places = np.arange(len(values))
    first = np.maximum(places - window // 2, 0)
    last = np.minimum(places - window // 2 + window, len(values))
    means: Floats = np.maximum((sums[last] - sums[first]) / (last - first), 0.0)
    return means
