"""The threshold that noise alone passes a stated number of times in a record, for any tail of the noise.

The peaks of noise above a high level follow a generalised Pareto law (Pickands 1975; Balkema and de Haan 1974):

    P(peak > level + y | peak > level) = (1 + shape y / scale)^(-1 / shape)

Its shape is 0 for normal or exponential tails and 1 / nu for Student's t with nu degrees of freedom. Shape and scale
are estimated from the peaks of the record itself. Spikes are not part of the noise. So the fit starts from the lower
peaks and adds peaks that the present law explains, until nothing changes. All peaks of the noise are then included,
and spikes stay excluded behind the gap before them.

Ringing after a spike leaves no such gap. But it raises a whole stretch, while an outlier of heavy-tailed noise raises
one sample. Stretches whose median magnitude is far above that of the record are therefore left out. There are long
stretches, and short ones for the pulses and the ring of a load cell, which last a few milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.robust import robust_sigma

Floats = NDArray[np.float64]

#: Quantile above which peaks form the tail; of few peaks more are used, at most the upper half.
_TAIL_QUANTILE = 0.8
_PEAKS_WANTED = 50
#: Number of peaks below which a normal tail is assumed.
_FEWEST_PEAKS = 20
#: Share of the tail with which the fit starts; all of it counts as noise.
_FIRST_PART = 0.5
_MOST_ROUNDS = 200
#: Expected number of peaks, relative to false alarms, below which a peak is excluded from the noise. The number is
#: small, since without its largest peaks heavy-tailed noise would seem to have a light tail.
_EXPECTED_PEAKS = 0.01
#: Number of stretches in which the record is searched for ringing, and smallest number of samples in one.
_STRETCHES = 200
_SHORTEST_STRETCH = 32
_FEWEST_STRETCHES = 4
#: Median magnitude, relative to that of the median stretch, above which a stretch rings. Noise alone, even Cauchy's in
#: 32 samples, stays below.
_RINGING = 3.0
#: Number of half waves in a short stretch, and the same ratio for it. Narrow-band noise with a Rayleigh envelope
#: exceeds this ratio once in 1e10 stretches.
_HALF_WAVES = 20
_SHORT_RINGING = 6.0
#: Magnitude, relative to the noise, of high samples; number of near ones that form an excursion beyond noise.
STANDS_OUT = 4.0
_AS_A_SPIKE = 4
_HALF_CYCLE = 8
#: Mean samples between two changes of sign above which a signal is a motion and no noise; its peaks are no spikes.
HALF_WAVE_OF_MOTION = 12.0
#: RMS relative to the noise, over this number of samples, above which an excursion continues.
_LOUD, _LOUD_SAMPLES = 1.5, 16
_MOST_PASSES = 20
#: Share of quiet samples below which all samples count as quiet: the record is never at rest.
_LEAST_OUTSIDE = 0.5
#: Largest threshold relative to the largest peak of the noise: a hundred times rarer, with Student's t of 3 degrees.
_MOST_BEYOND = 5.0


@dataclass(frozen=True, slots=True)
class Tail:
    """The noise of a record and the threshold derived from it.

    Attributes
    ----------
    sigma : float
        Robust standard deviation of the noise, in units of the signal.
    shape : float
        Shape of the tail, with one standard error added where it is positive.
    threshold : float
        Level that noise passes `false_alarms` times in a record of this kind.
    """

    sigma: float
    shape: float
    threshold: float


def half_wave_peaks(values: Floats) -> Floats:
    """Return the largest magnitude in each stretch of one sign, the first and last stretch included.

    >>> half_wave_peaks(np.array([1.0, 3.0, -2.0, -1.0, 4.0]))
    array([3., 2., 4.])
    """
    # an exact 0 has no sign, and ends no stretch
    values = values[values != 0.0]
    if not values.size:
        return np.zeros(0)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(np.signbit(values))) + 1))
    peaks: Floats = np.maximum.reduceat(np.abs(values), starts)
    return peaks


def _peaks_of_one_sign(values: Floats) -> Floats:
    """Return the largest value in each stretch of positive values."""
    positive = values > 0.0
    starts = np.flatnonzero(positive & ~np.append(False, positive[:-1]))
    if not starts.size:
        return np.zeros(0)
    peaks: Floats = np.maximum.reduceat(values, starts)
    return peaks


def samples_in_half_wave(values: Floats) -> float:
    """Return the mean length, in samples, of the stretches of one sign in the quiet parts of a signal."""
    rest = values[at_rest(values)]
    return len(rest) / max(1, half_wave_peaks(rest).size)


def at_rest(values: Floats) -> NDArray[np.bool_]:
    """Return a mask of the samples outside excursions, in stretches that do not ring."""
    rest = outside_excursions(values)
    rest[rest] = quiet(values[rest])
    return rest


def quiet(values: Floats) -> NDArray[np.bool_]:
    """Return a mask of the samples in stretches that do not ring; the values are without their baseline."""
    long = max(_SHORTEST_STRETCH, len(values) // _STRETCHES)
    short = max(_SHORTEST_STRETCH, _HALF_WAVES * len(values) // max(1, half_wave_peaks(values).size))
    still = _still(values, long, _RINGING)
    return still & _still(values, short, _SHORT_RINGING) if short < long else still


def _still(values: Floats, stretch: int, ratio: float) -> NDArray[np.bool_]:
    """Return a mask of samples neither in nor next to a stretch with a median magnitude far above the usual."""
    length = len(values)
    count = length // stretch
    if count < _FEWEST_STRETCHES:
        return np.ones(length, dtype=bool)
    magnitudes = np.abs(values[: count * stretch]).reshape(count, stretch)
    medians = np.median(magnitudes, axis=1)
    rings = medians > ratio * np.median(medians)
    # ringing begins and ends somewhere in the neighbouring stretches
    still = ~(rings | np.append(rings[1:], False) | np.append(False, rings[:-1]))
    place = np.minimum(np.arange(length) // stretch, count - 1)
    return np.asarray(still[place])


def outside_excursions(values: Floats) -> NDArray[np.bool_]:
    """Return a mask of the samples, without their baseline, that lie in no excursion as long as a spike.

    Shorter excursions are kept: they are the tail of the noise.
    """
    outside = np.ones(len(values), dtype=bool)
    for _ in range(_MOST_PASSES):
        sigma = robust_sigma(values[outside])
        found = ~_long_excursions(values, sigma) if sigma > 0.0 else outside
        if np.count_nonzero(found) < _LEAST_OUTSIDE * len(values):
            # a signal that is never at rest
            return np.ones(len(values), dtype=bool)
        if np.array_equal(found, outside):
            break
        outside = found
    return outside


def _long_excursions(values: Floats, sigma: float) -> NDArray[np.bool_]:
    """Return a mask of the samples in excursions as long as a spike, or next to one where the signal is still loud."""
    high = np.flatnonzero(np.abs(values) > STANDS_OUT * sigma)
    found = np.zeros(len(values), dtype=bool)
    half_wave = len(values) / max(1, half_wave_peaks(values).size)
    fewest = half_wave if half_wave > HALF_WAVE_OF_MOTION else _AS_A_SPIKE
    if high.size < fewest:
        return found
    # half cycles of ringing are one excursion
    for part in np.split(high, np.flatnonzero(np.diff(high) > _HALF_CYCLE) + 1):
        if part.size >= fewest:
            margin = int(part[-1] - part[0]) + 1
            found[max(0, part[0] - margin) : part[-1] + 1 + margin] = True
    power = np.convolve(values**2, np.full(_LOUD_SAMPLES, 1.0 / _LOUD_SAMPLES), "same")
    loud = found | (power > (_LOUD * sigma) ** 2)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], loud, [False])).astype(np.int8)))
    for first, stop in zip(edges[::2], edges[1::2], strict=True):
        if np.any(found[first:stop]):
            found[first:stop] = True
    return found


def tail_threshold(values: Floats, false_alarms: float, polarity: int = 0) -> Tail:
    """Return the threshold that noise passes `false_alarms` times a record, estimated from the record itself.

    The values are without their baseline; a polarity of 1 or -1 uses peaks of one sign only, 0 of both.
    """
    from scipy.special import ndtri

    values = values[at_rest(values)]
    sigma = robust_sigma(values)
    if sigma == 0.0:
        # a signal that is constant except for its spikes has no noise
        return Tail(0.0, 0.0, 0.0)
    signed = values * polarity if polarity else values
    peaks = half_wave_peaks(signed) if not polarity else _peaks_of_one_sign(signed)
    part = float(np.clip(1.0 - _PEAKS_WANTED / max(peaks.size, 1), 0.5, _TAIL_QUANTILE))
    level = float(np.quantile(peaks, part)) if peaks.size else 0.0
    # the squares of normal noise fall exponentially: their shape is 0
    excesses = np.sort(peaks[peaks > level] ** 2 - level**2)
    if excesses.size < _FEWEST_PEAKS:
        normal = -float(ndtri(min(0.5, false_alarms / (2.0 * max(1, len(values))))))
        return Tail(sigma, 0.0, sigma * normal)
    shape, height = _grown_fit(excesses, false_alarms)
    threshold = float(np.sqrt(level**2 + height))
    return Tail(sigma, shape / 2.0, min(threshold, _MOST_BEYOND * float(peaks.max())))


def _grown_fit(excesses: Floats, false_alarms: float) -> tuple[float, float]:
    """Return shape and height above the level that noise exceeds `false_alarms` times, from the noise peaks alone."""
    count = max(_FEWEST_PEAKS // 2, int(_FIRST_PART * excesses.size))
    for _ in range(_MOST_ROUNDS):
        height = _exceeded(*_pareto(excesses[:count], 0.0), count / (_EXPECTED_PEAKS * false_alarms))
        grown = int(np.searchsorted(excesses, height, side="right"))
        if grown <= count:
            break
        count = grown
    shape, scale = _pareto(excesses[:count], 1.0)
    return shape, _exceeded(shape, scale, count / false_alarms)


def _exceeded(shape: float, scale: float, ratio: float) -> float:
    """Return the height that one of `ratio` peaks exceeds."""
    if shape < 1e-9:
        return scale * float(np.log(ratio))
    return scale * float(np.expm1(shape * np.log(ratio))) / shape


def _pareto(excesses: Floats, errors: float) -> tuple[float, float]:
    """Return shape and scale from probability-weighted moments (Hosking and Wallis 1987).

    A shape below 0 would mean that the noise is bounded; it becomes 0, with the mean as scale. `errors` standard errors
    are added to the shape: too high a threshold misses a weak spike, too low a one invents spikes.
    """
    count = excesses.size
    mean = float(excesses.mean())
    weights = (count - 1.0 - np.arange(count)) / (count - 1.0)
    weighted = float(np.mean(weights * excesses))
    shape = 2.0 - mean / (mean - 2.0 * weighted) if mean > 2.0 * weighted else 1.0
    # asymptotic variance of the shape near 0 is 1 / count; it grows slowly with the shape
    shape = shape + errors * (1.0 + max(shape, 0.0)) / np.sqrt(count)
    if shape <= 0.0:
        return 0.0, mean
    shape = min(shape, 2.0)
    return float(shape), float(mean * max(1.0 - shape, 0.05)) if shape < 1.0 else float(np.median(excesses))
