"""The logarithmic decrement of a free decay, from its peaks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.decay.estimate import Estimate
from vibroimpact.analysis.decay.exponential import Envelope, first_guess
from vibroimpact.analysis.decay.residuals import coloured_covariance, residual_test
from vibroimpact.analysis.decay.samples import DecaySamples, Floats, stretches
from vibroimpact.fmus.errors import EstimationError

_FEWEST_PEAKS = 4
_SMALLEST = 3.0
"""Height of a peak, in standard errors, below which its logarithm is biased, and the peak is left out."""
_LAGS_TURN = 1.25
"""Phase per peak, rad, at which the two periods of the residual test span ten peaks."""
_CURVED = 3.0
"""Curvature of ln(peak) over n, in standard errors, above which the logarithm counts as bent."""


@dataclass(frozen=True, slots=True)
class Peaks:
    """Turning points of a decay, both sides.

    Attributes
    ----------
    number, time : ndarray of float, shape (peak,)
        Number of half periods (a missing peak leaves its number out), and time in s.
    height, error : ndarray of float, shape (peak,)
        Height above the equilibrium, positive on both sides, and its standard error; unit of the samples.
    equilibrium : float
        Unit of the samples.
    """

    number: Floats
    time: Floats
    height: Floats
    error: Floats
    equilibrium: float


@dataclass(frozen=True, slots=True)
class Decrement:
    """Logarithmic decrement per period, the numbers that follow from it, and the peaks behind it.

    Attributes
    ----------
    decrement, damping_ratio : Estimate
    angular_frequency : Estimate
        Angular frequency of the damped motion, from the times of the peaks, rad/s.
    peaks : Peaks
    first, last : float
        Decrement per period at the first and the last peak, from a parabola through ln(height).
    bent : bool
        Whether ln(height) is no straight line: the parabola fits better, or the residual of the line is not noise.
        Then the damping is not viscous alone.
    """

    decrement: Estimate
    damping_ratio: Estimate
    angular_frequency: Estimate
    peaks: Peaks
    first: float
    last: float
    bent: bool


def logarithmic_decrement(samples: DecaySamples) -> Decrement:
    """Return the decrement from a straight line through ln(peaks).

    `decrement = (1/n) ln(x_0 / x_n)`, `damping_ratio = decrement / sqrt(4 pi^2 + decrement^2)` (thesis eq. 4.1). All
    peaks of both sides count, measured from the equilibrium. The weight is the square of a smooth height, the inverse
    variance of a logarithm. Standard errors come from the scatter about the line, neighbours correlated or not.

    Raises
    ------
    EstimationError
        Fewer than four peaks stand out of the noise.

    Examples
    --------
    >>> time = np.arange(0.0, 30.0, 0.01)
    >>> natural = 5.0
    >>> motion = np.exp(-0.03 * natural * time) * np.cos(natural * np.sqrt(1 - 0.03**2) * time)
    >>> found = logarithmic_decrement(DecaySamples(time, motion))
    >>> round(found.decrement.value, 4), round(found.damping_ratio.value, 5)
    (0.1886, 0.03)
    """
    peaks = find_peaks(samples, first_guess(samples).envelope)
    number = peaks.number - peaks.number[0]
    logarithm = np.log(peaks.height)
    weight = peaks.height / float(np.max(peaks.height))
    for _ in range(2):
        curve, bends = _weighted(number, logarithm, weight, 2)
        # The weight of a peak must not depend on its own noise: the smooth curve through all peaks gives it.
        weight = np.exp(np.polynomial.Polynomial(curve)(number) - logarithm[0])
    line, errors = _weighted(number, logarithm, weight, 1)
    off_line = (logarithm - line[0] - line[1] * number) * weight
    turns, turn_errors = _weighted(number, peaks.time, weight, 1)
    freedom = max(len(number) - 2.0, 1.0)
    # n counts half periods, a decrement counts whole ones.
    decrement, error = -2.0 * line[1], 2.0 * errors[1]
    whole = np.hypot(2.0 * np.pi, decrement)
    omega = np.pi / turns[1]
    return Decrement(
        Estimate(float(decrement), float(error), "1", freedom),
        Estimate(float(decrement / whole), float(4.0 * np.pi**2 / whole**3 * error), "1", freedom),
        Estimate(float(omega), float(omega * turn_errors[1] / turns[1]), "rad s-1", freedom),
        peaks,
        float(-2.0 * curve[1]),
        float(-2.0 * (curve[1] + 2.0 * curve[2] * number[-1])),
        bool(abs(curve[2]) > _CURVED * bends[2]) or _is_systematic(off_line),
    )


def _is_systematic(off_line: Floats) -> bool:
    """Tell whether the residual of a line is no noise; alternating sides mean a wrong equilibrium, not a bend."""
    alternates = np.mean(np.diff(off_line, 2) ** 2) >= 6.0 * np.mean(off_line**2)
    return bool(not alternates and not residual_test(off_line, 1.0, _LAGS_TURN).adequate)


def _weighted(number: Floats, value: Floats, weight: Floats, degree: int) -> tuple[Floats, Floats]:
    """Return coefficients (constant first) of a weighted polynomial, and their standard errors."""
    columns = np.vander(number, degree + 1, increasing=True) * weight[:, None]
    scale = np.linalg.norm(columns, axis=0)
    solved = np.linalg.lstsq(columns / scale, value * weight, rcond=None)[0] / scale
    covariance, _ = coloured_covariance(columns, value * weight - columns @ solved, 2)
    return solved, np.sqrt(np.diag(covariance))


def find_peaks(samples: DecaySamples, envelope: Envelope) -> Peaks:
    """Return the turning points, each fitted by a cosine through the half period around it.

    No single sample serves as a peak: sampling would miss the peak, and noise would raise it. The phase comes from the
    envelope; the equilibrium is the mean offset of the envelope.
    """
    equilibrium = float(np.mean(envelope.offset))
    phase = _phase(samples.time, envelope)
    half = np.round(phase / np.pi).astype(int)
    found: list[tuple[float, ...]] = []
    squares, spare = 0.0, 0
    for part in stretches(half):
        turn = phase[part] - np.pi * half[part[0]]
        if len(part) < 4 or np.ptp(turn) < 0.7 * np.pi:
            continue
        value = (samples.value[part] - equilibrium) * (-1.0 if half[part[0]] % 2 else 1.0)
        columns = np.column_stack([np.cos(turn), np.sin(turn)])
        (cosine, sine), *_ = np.linalg.lstsq(columns, value, rcond=None)
        squares += float(np.sum((value - columns @ (cosine, sine)) ** 2))
        spare += len(part) - 2
        time = float(np.interp(np.arctan2(sine, cosine), turn, samples.time[part]))
        found.append((float(half[part[0]]), time, float(np.hypot(cosine, sine)), (2.0 / len(part)) ** 0.5))
    return _standing_out(samples, found, float(np.sqrt(squares / max(spare, 1))), equilibrium)


def _phase(time: Floats, envelope: Envelope) -> Floats:
    """Return the phase of the oscillation at the samples, continued at the ends by its slope there."""
    slopes = np.diff(envelope.phase) / np.diff(envelope.time)
    phase = np.interp(time, envelope.time, envelope.phase)
    phase += np.minimum(time - envelope.time[0], 0.0) * slopes[0]
    phase += np.maximum(time - envelope.time[-1], 0.0) * slopes[-1]
    return np.asarray(phase, dtype=np.float64)


def _standing_out(
    samples: DecaySamples, found: list[tuple[float, ...]], noise: float, equilibrium: float
) -> Peaks:
    """Return the peaks before the first one that noise could have made."""
    number, time, height, share = np.array(found).reshape(-1, 4).T
    error = noise * share
    small = np.flatnonzero(height < _SMALLEST * error)
    kept = slice(0, int(small[0]) if len(small) else len(height))
    if len(height[kept]) < _FEWEST_PEAKS:
        raise EstimationError(
            f"{samples.name}: expected {_FEWEST_PEAKS} peaks or more above the noise of {noise:.3g}, got "
            f"{len(height[kept])}. Widen the window, or fit the exponential only."
        )
    return Peaks(number[kept], time[kept], height[kept], error[kept], equilibrium)
