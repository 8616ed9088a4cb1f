"""A decaying cosine fitted to a free decay: `offset + A e^(-lambda t) cos(omega t + phi)`.

Windows of one period give a first guess of frequency, decay rate and equilibrium; the fit then takes all samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.analysis.decay.estimate import Estimate
from vibroimpact.analysis.decay.residuals import ResidualTest, coloured_covariance, residual_test
from vibroimpact.analysis.decay.samples import DecaySamples, Floats, stretches
from vibroimpact.fmus.errors import EstimationError

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

FEWEST_PERIODS = 2.0
_MOST_GRID = 1 << 18
_NO_WEIGHT = 1e-9
"""Amplitude of the second largest window, relative to the largest, below which no slope is computed."""
_LEAST_EXPLAINED = 0.1
"""Share of the variance about a straight line that the fit must explain; plain noise gives a few hundredths."""


@dataclass(frozen=True, slots=True)
class Envelope:
    """Amplitude and phase of an oscillation, window by window.

    Arrays of shape (window,): middle of the window in s, amplitude, phase of `cos(phase)` in rad (unwrapped), offset.
    """

    time: Floats
    amplitude: Floats
    phase: Floats
    offset: Floats


@dataclass(frozen=True, slots=True)
class FirstGuess:
    """Start values of a fit: angular frequency (rad/s), decay rate (1/s), equilibrium (unit of the samples)."""

    angular_frequency: float
    decay_rate: float
    offset: float
    envelope: Envelope


def first_guess(samples: DecaySamples) -> FirstGuess:
    """Return frequency, decay rate and equilibrium of the strongest oscillation.

    The frequency is first the highest peak of the spectrum, with the samples interpolated to an even grid. It is then
    the mean slope of the phase of one-period windows. The decay rate is the slope of the logarithm of their amplitudes.
    EstimationError: fewer than two periods are in the window, or nothing oscillates.
    """
    omega = spectral_peak(samples)
    length = float(samples.time[-1] - samples.time[0])
    if omega * length < FEWEST_PERIODS * 2.0 * np.pi:
        raise EstimationError(
            f"{samples.name}: expected {FEWEST_PERIODS:g} periods of an oscillation or more, got "
            f"{omega * length / (2.0 * np.pi):.2g} in {length:.4g} s. Widen the window, or begin it after the shock."
        )
    decay_rate = 0.0
    for _ in range(3):
        envelope = windowed_cosines(samples, omega, decay_rate)
        weights = envelope.amplitude
        if len(weights) < 2 or not np.sort(weights)[-2] > _NO_WEIGHT * np.max(weights):
            break  # a single window has no slope
        slope = np.polyfit(envelope.time, envelope.phase, 1, w=weights)[0]
        omega = float(slope) if 0.5 * omega < slope < 2.0 * omega else omega
        logarithm = np.log(np.maximum(envelope.amplitude, 1e-300))
        decay_rate = -float(np.polyfit(envelope.time, logarithm, 1, w=weights)[0])
    return FirstGuess(omega, decay_rate, float(np.median(envelope.offset)), envelope)


def spectral_peak(samples: DecaySamples) -> float:
    """Return the angular frequency (rad/s) of the highest peak of the spectrum; EstimationError for a straight line."""
    count = min(len(samples.time), _MOST_GRID)
    grid = np.linspace(samples.time[0], samples.time[-1], count)
    value = np.interp(grid, samples.time, samples.value)
    value = value - np.polyval(np.polyfit(grid - grid[0], value, 1), grid - grid[0])
    if not np.any(np.abs(value) > 1e-12 * np.max(np.abs(samples.value))):
        raise EstimationError(
            f"{samples.name}: expected an oscillation, got a constant. Choose another channel."
        )
    # No window: it would remove the start, where the oscillation is; the decay itself tapers the end. Below one and a
    # half periods in the record the spectrum shows only drifts.
    power = np.abs(np.fft.rfft(value, 4 * count))
    peak = 6 + int(np.argmax(power[6:]))
    return 2.0 * np.pi * peak / (4 * count * float(grid[1] - grid[0]))


def windowed_cosines(samples: DecaySamples, omega: float, decay_rate: float) -> Envelope:
    """Fit `offset + e^(-decay_rate t) (C cos(omega t) + S sin(omega t))` in windows of one period.

    The decay within a window is part of the fit: without it, all windows would show the same false offset.
    Windows with fewer than six samples are left out. `omega` is in rad/s, `decay_rate` in 1/s.
    """
    length = 2.0 * np.pi / omega
    window = np.floor((samples.time - samples.time[0]) / length).astype(int)
    found = [
        _cosine(samples.time[part], samples.value[part], omega, decay_rate)
        for part in stretches(window)
        if len(part) >= 6 and np.ptp(samples.time[part]) > 0.7 * length
    ]
    if len(found) < 2:
        raise EstimationError(
            f"{samples.name}: expected two periods with six samples or more, got {len(found)}; the oscillation of "
            f"{omega / (2.0 * np.pi):.4g} Hz is sampled every {samples.mean_interval:.4g} s. Record faster, or longer."
        )
    time, amplitude, phase, offset = np.array(found).T
    # The phase beyond omega t moves slowly, so this difference is unwrapped.
    return Envelope(time, amplitude, np.unwrap(phase - omega * time) + omega * time, offset)


def _cosine(time: Floats, value: Floats, omega: float, decay_rate: float) -> tuple[float, ...]:
    """Return the middle, amplitude, phase and offset of a window."""
    middle = 0.5 * (time[0] + time[-1])
    cosine, sine, offset = _amplitudes(time - middle, value, omega, decay_rate)
    return float(middle), float(np.hypot(cosine, sine)), float(np.arctan2(-sine, cosine)), float(offset)


def _amplitudes(time: Floats, value: Floats, omega: float, decay_rate: float) -> Floats:
    """Return amplitudes of the decaying cosine and sine, and the offset, by linear least squares."""
    turn, decay = omega * time, np.exp(-decay_rate * time)
    columns = np.column_stack([decay * np.cos(turn), decay * np.sin(turn), np.ones_like(turn)])
    found: Floats = np.linalg.lstsq(columns, value, rcond=None)[0]
    return found


@dataclass(frozen=True, slots=True)
class ExponentialDecay:
    """A fitted decaying cosine.

    Attributes
    ----------
    amplitude, phase, offset : Estimate
        At `reference_time` (s): unit of the samples, rad, unit of the samples.
    angular_frequency, decay_rate : Estimate
        Damped angular frequency omega, rad/s, and lambda, 1/s.
    natural_angular_frequency, damping_ratio : Estimate
        `sqrt(omega^2 + lambda^2)`, rad/s, and lambda over it.
    fitted : ndarray of float, shape (sample,)
    """

    amplitude: Estimate
    phase: Estimate
    offset: Estimate
    angular_frequency: Estimate
    decay_rate: Estimate
    natural_angular_frequency: Estimate
    damping_ratio: Estimate
    reference_time: float
    fitted: Floats
    test: ResidualTest

    @property
    def aic(self) -> float:
        """Akaike's criterion for white residuals: five parameters and the variance."""
        return len(self.fitted) * float(np.log(max(self.test.rms**2, 1e-300))) + 12.0


def fit_exponential(samples: DecaySamples, guess: FirstGuess | None = None) -> ExponentialDecay:
    """Fit a decaying cosine by least squares.

    Standard errors allow for correlated residuals (`coloured_covariance`).

    Raises
    ------
    EstimationError
        Nothing oscillates, or the fit does not settle.
    """
    from scipy.optimize import least_squares

    guess = first_guess(samples) if guess is None else guess
    # At the start of the samples, amplitude and phase are least correlated with rate and frequency.
    time = samples.time - samples.time[0]
    omega, rate = guess.angular_frequency, guess.decay_rate
    cosine, sine, offset = _amplitudes(time, samples.value, omega, rate)
    with np.errstate(all="ignore"):  # a trial step may overflow; it is then shortened
        found = least_squares(
            lambda p: _model(p, time) - samples.value,
            np.array([cosine, sine, omega, rate, offset]),
            jac=lambda p: _derivatives(p, time),
            x_scale="jac",
            ftol=1e-14,
            xtol=1e-13,
            gtol=1e-14,
            max_nfev=200,
        )
    _refuse_nothing(samples, found)
    turn = abs(found.x[2]) * samples.mean_interval
    covariance, freedom = coloured_covariance(found.jac, found.fun, round(4.0 * np.pi / turn))
    fitted = _model(found.x, time)
    excursion = float(np.max(np.abs(fitted - found.x[4])))
    test = residual_test(samples.value - fitted, excursion, turn)
    return _described(samples, found.x, covariance, min(freedom, test.effective_samples - 5.0), fitted, test)


def _refuse_nothing(samples: DecaySamples, found: OptimizeResult) -> None:
    """Raise EstimationError if the fit did not settle, or explains hardly more than a fit of noise."""
    if not found.success or not np.all(np.isfinite(found.x)):
        raise EstimationError(f"{samples.name}: expected a decaying cosine, got no fit: {found.message}")
    line = np.polyval(np.polyfit(samples.time, samples.value, 1), samples.time)
    variation = float(np.sum((samples.value - line) ** 2))
    explained = 1.0 - 2.0 * found.cost / variation if variation > 0.0 else 0.0
    if explained < _LEAST_EXPLAINED:
        raise EstimationError(
            f"{samples.name}: expected an oscillation, got one that explains {100 * max(explained, 0.0):.2g} % of the "
            "variance. Choose another window or channel."
        )


def decaying_cosine(parameters: Floats, time: Floats) -> tuple[Floats, Floats]:
    """Return a decaying cosine and its derivatives by its parameters, shapes (sample,) and (sample, 5).

    The parameters are the amplitudes of cosine and sine, angular frequency (rad/s), decay rate (1/s) and offset.
    """
    return _model(parameters, time), _derivatives(parameters, time)


def _model(parameters: Floats, time: Floats) -> Floats:
    cosine, sine, omega, rate, offset = parameters
    turn = omega * time
    values: Floats = offset + np.exp(-rate * time) * (cosine * np.cos(turn) + sine * np.sin(turn))
    return values


def _derivatives(parameters: Floats, time: Floats) -> Floats:
    cosine, sine, omega, rate, _ = parameters
    envelope, turn = np.exp(-rate * time), omega * time
    along = envelope * np.cos(turn)
    across = envelope * np.sin(turn)
    motion = cosine * along + sine * across
    quarter = sine * along - cosine * across
    return np.column_stack([along, across, time * quarter, -time * motion, np.ones_like(time)])


def _described(
    samples: DecaySamples,
    found: Floats,
    covariance: Floats,
    freedom: float,
    fitted: Floats,
    test: ResidualTest,
) -> ExponentialDecay:
    """Return the derived quantities, with errors to first order."""
    cosine, sine, omega, rate, offset = (float(number) for number in found)
    since = samples.reference_time - float(samples.time[0])
    size, natural = float(np.hypot(cosine, sine)), float(np.hypot(omega, rate))
    amplitude = size * float(np.exp(-rate * since))
    phase = float(np.angle(np.exp(1j * (np.arctan2(-sine, cosine) + omega * since))))

    def estimate(value: float, gradient: list[float], unit: str) -> Estimate:
        weights = np.array(gradient)
        return Estimate(value, float(np.sqrt(weights @ covariance @ weights)), unit, max(freedom, 1.0))

    cos_share, sin_share = cosine / size, sine / size
    return ExponentialDecay(
        estimate(
            amplitude,
            [amplitude / size * cos_share, amplitude / size * sin_share, 0.0, -since * amplitude, 0.0],
            samples.unit,
        ),
        estimate(phase, [sin_share / size, -cos_share / size, since, 0.0, 0.0], "rad"),
        estimate(offset, [0.0, 0.0, 0.0, 0.0, 1.0], samples.unit),
        estimate(omega, [0.0, 0.0, 1.0, 0.0, 0.0], "rad s-1"),
        estimate(rate, [0.0, 0.0, 0.0, 1.0, 0.0], "s-1"),
        estimate(natural, [0.0, 0.0, omega / natural, rate / natural, 0.0], "rad s-1"),
        estimate(rate / natural, [0.0, 0.0, -rate * omega / natural**3, omega**2 / natural**3, 0.0], "1"),
        samples.reference_time,
        fitted,
        test,
    )
