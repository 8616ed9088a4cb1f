"""A decaying cosine fitted to a free decay: `offset + A e^(-lambda t) cos(omega t + phi)`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from vibroimpact.analysis.decay.covariance import coloured_covariance
from vibroimpact.analysis.decay.estimate import Estimate
from vibroimpact.analysis.decay.residuals import ResidualTest, residual_test
from vibroimpact.analysis.decay.samples import DecaySamples
from vibroimpact.analysis.decay.windows import FirstGuess, first_guess
from vibroimpact.fmus.errors import EstimationError

Floats = NDArray[np.float64]

_LEAST_EXPLAINED = 0.1
"""Part of the variance about a straight line; a cosine through plain noise explains a few hundredths."""


@dataclass(frozen=True, slots=True)
class ExponentialDecay:
    """A fitted decaying cosine.

    Attributes
    ----------
    amplitude, phase, offset : Estimate
        At `reference_time`: unit of the samples, rad, unit of the samples.
    angular_frequency, decay_rate : Estimate
        Damped angular frequency omega, rad/s, and lambda, 1/s.
    natural_angular_frequency, damping_ratio : Estimate
        `sqrt(omega^2 + lambda^2)`, rad/s, and lambda over it.
    reference_time : float
        s.
    fitted : ndarray of float, shape (sample,)
    test : ResidualTest
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


def fit_exponential(samples: DecaySamples, guess: FirstGuess | None = None) -> ExponentialDecay:
    """Fit a decaying cosine by least squares.

    Standard errors allow for residuals that are correlated (`coloured_covariance`).

    Parameters
    ----------
    samples : DecaySamples
    guess : FirstGuess, optional

    Raises
    ------
    EstimationError
        Nothing oscillates, or the fit does not settle.
    """
    guess = first_guess(samples) if guess is None else guess
    # Amplitude and phase are least correlated with rate and frequency at the start of the samples.
    time = samples.time - samples.time[0]
    with np.errstate(all="ignore"):  # a trial step may overflow; it is then shortened
        found = least_squares(
            lambda p: _model(p, time) - samples.value,
            _start(samples, guess, time),
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
    """Refuse a fit that did not settle, or that explains hardly more than noise would let it."""
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


def _start(samples: DecaySamples, guess: FirstGuess, time: Floats) -> Floats:
    """Return (C, S, omega, lambda, offset), the linear three by linear least squares."""
    envelope = np.exp(-guess.decay_rate * time)
    turn = guess.angular_frequency * time
    columns = np.column_stack([envelope * np.cos(turn), envelope * np.sin(turn), np.ones_like(time)])
    cosine, sine, offset = np.linalg.lstsq(columns, samples.value, rcond=None)[0]
    return np.array([cosine, sine, guess.angular_frequency, guess.decay_rate, offset])


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
    """Return the quantities people ask for, with errors to first order."""
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
