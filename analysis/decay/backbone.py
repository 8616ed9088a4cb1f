"""Frequency and damping of a free decay as functions of its amplitude."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.decay.exponential import ExponentialDecay, FirstGuess, first_guess, fit_exponential
from vibroimpact.analysis.decay.samples import FEWEST_SAMPLES, DecaySamples, Floats, stretches
from vibroimpact.analysis.recording.units import unit_label
from vibroimpact.fmus.errors import EstimationError

_FEWEST_PERIODS = 4.0
_MOST_WINDOWS = 16
_TENTH = 0.1
_SMALLEST = 3.0
"""Amplitude in standard errors below which a window is noise; it is noise below the rms of its residual as well."""


@dataclass(frozen=True, slots=True)
class Backbone:
    """Amplitude, frequency and damping of successive windows of a decay.

    Attributes
    ----------
    time, amplitude : ndarray of float, shape (window,)
        Middle of the window, s, and the amplitude there, unit of the samples.
    angular_frequency, angular_frequency_error : ndarray of float, shape (window,)
        Undamped natural angular frequency, rad/s.
    damping_ratio, damping_ratio_error : ndarray of float, shape (window,)
    periods : float
        Length of a window.
    """

    time: Floats
    amplitude: Floats
    angular_frequency: Floats
    angular_frequency_error: Floats
    damping_ratio: Floats
    damping_ratio_error: Floats
    periods: float

    def words(self, unit: str) -> str:
        """Return the change of the frequency as a sentence: the largest window against those below a tenth of it."""
        high = int(np.argmax(self.amplitude))
        small = self.amplitude <= max(_TENTH * self.amplitude[high], float(np.min(self.amplitude)))
        weights = 1.0 / self.angular_frequency_error[small] ** 2
        slow = float(np.average(self.angular_frequency[small], weights=weights))
        slow_error = float(1.0 / np.sqrt(np.sum(weights)))
        fast, error = float(self.angular_frequency[high]), float(self.angular_frequency_error[high])
        ends = (
            f"{_hertz(fast, error)} at {self.amplitude[high]:.3g}{_short(unit)} to "
            f"{_hertz(slow, slow_error)} at {np.max(self.amplitude[small]):.3g}{_short(unit)} and less"
        )
        change = slow / fast - 1.0
        if abs(change) * fast < 3.0 * np.hypot(error, slow_error):
            return f"the frequency does not change with the amplitude by more than its errors: {ends}."
        damping = float(np.average(self.damping_ratio[small], weights=weights))
        return (
            f"the frequency {'rises' if change > 0 else 'falls'} by {100 * abs(change):.2g} % as the motion decays: "
            f"{ends}; the damping ratio goes from {self.damping_ratio[high]:.3g} to {damping:.3g}."
        )


def _hertz(omega: float, error: float) -> str:
    return f"{omega / (2.0 * np.pi):.6g} +- {error / (2.0 * np.pi):.1g} Hz"


def _short(unit: str) -> str:
    return "" if unit == "1" else f" {unit_label(unit)}"


def backbone(samples: DecaySamples, periods: float | None = None) -> Backbone:
    """Return frequency and damping against amplitude, window by window.

    A decaying cosine with its own frequency and decay rate is fitted to each window; the amplitude refers to the
    middle. Nothing is filtered: a Hilbert transform would smear the start of the decay, where the amplitude is largest.
    A window is `periods` long, by default a sixteenth of the decay, but four periods at least. EstimationError is
    raised if fewer than two windows can be fitted.
    """
    guess = first_guess(samples)
    length = 2.0 * np.pi / guess.angular_frequency
    total = float(samples.time[-1] - samples.time[0]) / length
    periods = max(_FEWEST_PERIODS, total / _MOST_WINDOWS) if periods is None else periods
    number = np.floor((samples.time - samples.time[0]) / (periods * length)).astype(int)
    fits = (_window(samples, part, guess, 0.7 * periods * length) for part in stretches(number))
    found = [fit for fit in fits if fit is not None]
    if len(found) < 2:
        raise EstimationError(
            f"{samples.name}: expected two windows of {periods:.3g} periods with an oscillation above the noise, got "
            f"{len(found)} in {total:.3g} periods. Widen the window of the decay."
        )
    frequency = [fit.natural_angular_frequency for fit in found]
    damping = [fit.damping_ratio for fit in found]
    return Backbone(
        time=np.array([fit.reference_time for fit in found]),
        amplitude=np.array([fit.amplitude.value for fit in found]),
        angular_frequency=np.array([item.value for item in frequency]),
        angular_frequency_error=np.array([item.standard_error for item in frequency]),
        damping_ratio=np.array([item.value for item in damping]),
        damping_ratio_error=np.array([item.standard_error for item in damping]),
        periods=periods,
    )


def _window(
    samples: DecaySamples, part: NDArray[np.int64], guess: FirstGuess, shortest: float
) -> ExponentialDecay | None:
    """Return the fit of one window; None where it is too short, or holds only noise."""
    time = samples.time[part]
    if len(part) < FEWEST_SAMPLES or time[-1] - time[0] < shortest:
        return None
    middle = float(0.5 * (time[0] + time[-1]))
    piece = replace(samples, time=time, value=samples.value[part], reference_time=middle)
    slope = np.diff(guess.envelope.phase) / np.diff(guess.envelope.time)
    omega = float(np.interp(middle, guess.envelope.time[1:], slope))
    try:
        fit = fit_exponential(piece, replace(guess, angular_frequency=omega))
    except EstimationError:
        return None
    # A frequency far from that of its neighbours belongs to noise, or to another mode.
    lost = abs(fit.angular_frequency.value / omega - 1.0) > 0.2
    least = max(_SMALLEST * fit.amplitude.standard_error, fit.test.rms)
    return None if lost or fit.amplitude.value < least else fit
