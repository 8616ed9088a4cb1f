"""Energy balance with intervals: the estimators on draws of the noise about the fitted motion (parametric bootstrap).

The draws give the standard error and the systematic part (smoothing, noise in squares), which is subtracted. Values
that came from the weak form vary with the same noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from vibroimpact.analysis.estimation.energy import Drawn, EnergyBalance, HalfEnergies, unknowns_by_speed
from vibroimpact.analysis.estimation.estimates import MethodEstimate
from vibroimpact.analysis.estimation.flight_fit import FittedFlight, flights_to_level
from vibroimpact.analysis.estimation.noise import Floats
from vibroimpact.analysis.estimation.physics import Parameters
from vibroimpact.analysis.estimation.segments import Signal
from vibroimpact.analysis.estimation.smoothing import choose_window
from vibroimpact.fmus.errors import EstimationError

# Parts of a period of the fastest motion to which the noiseless motion is smoothed: exact for what is asked.
_FINE = 0.15
_SAMPLES_PER_SPAN = 6
_MOST_FAILED = 0.1
# Of these the noiseless motion has known values.
_FITTED = ("restitution", "damping_ratio", "static_deflection")

Estimator = Callable[[EnergyBalance, HalfEnergies, Parameters, Drawn], Mapping[str, Floats]]


@dataclass(frozen=True, slots=True)
class Resampled:
    """Energies of a record, of its noiseless motion and of draws about it.

    Attributes
    ----------
    balance, fine : EnergyBalance
        With the window that suits the noise, and with one for the noiseless motion.
    parameters : Parameters
        What the methods take as known.
    measured, exact, drawn : tuple
        HalfEnergies, and the values that differ between draws.
    window : float
        Of the smoothing, s.
    """

    balance: EnergyBalance
    fine: EnergyBalance
    parameters: Parameters
    measured: tuple[HalfEnergies, Drawn]
    exact: tuple[HalfEnergies, Drawn]
    drawn: tuple[HalfEnergies, Drawn]
    window: float


def resample(
    signal: Signal,
    fitted: Sequence[FittedFlight],
    parameters: Parameters,
    stop_position: float | None,
    noise: float,
    names: Sequence[str],
    influence: Sequence[Floats],
    draws: int,
    seed: int,
) -> Resampled:
    """Return the energies of a record and of `draws` draws of noise about its fitted motion.

    Parameters
    ----------
    signal : Signal
    fitted : sequence of FittedFlight
        The exact flow on each flight: samples minus rests are the noiseless motion.
    parameters : Parameters
        With what is known, or came from the weak form.
    stop_position : float or None
        None: where the flights meet.
    noise : float
        Standard deviation.
    names, influence : sequence
        What came from the weak form, and how it changes with the samples of each flight.
    draws, seed : int
    """
    level = (parameters.stop_position if stop_position is None else stop_position) - parameters.offset
    flights = flights_to_level(signal, fitted, level, parameters)
    fastest = max(parameters.angular_frequency, parameters.natural_frequency)
    motion = signal.values.copy()
    for one in fitted:
        motion[one.flight.index] -= one.rests
    rounding = 1e-12 * float(np.ptp(motion[signal.good]))
    noiseless = replace(signal, values=motion, noise=rounding)
    shortest = _SAMPLES_PER_SPAN * signal.interval
    fine_window = max(_FINE * 2.0 * np.pi / fastest, shortest)
    window = choose_window(noiseless, flights, fine_window, fastest, noise)
    balance = EnergyBalance(signal, flights, parameters.angular_frequency, window)
    fine = EnergyBalance(noiseless, flights, parameters.angular_frequency, fine_window)
    errors = noise * np.random.default_rng(seed).standard_normal((draws, len(motion)))
    shifts = sum(
        (errors[:, one.flight.index] @ part.T for one, part in zip(fitted, influence, strict=False)),
        np.zeros((draws, len(names))),
    )
    varied = {name: getattr(parameters, name) + shifts[:, k] for k, name in enumerate(names)}
    drawn = balance.energies(motion + errors, parameters, stop_position)
    return Resampled(
        balance,
        fine,
        parameters,
        (balance.energies(signal.values[None], parameters, stop_position), {}),
        (fine.energies(motion[None], parameters, stop_position), {}),
        (drawn, varied),
        window,
    )


def with_intervals(
    resampled: Resampled, estimator: Estimator, confidence: float, inflation: float
) -> dict[str, MethodEstimate]:
    """Return an energy estimator's values less their systematic part, with standard errors and intervals.

    Parameters
    ----------
    resampled : Resampled
    estimator : callable
        From balance, energies, parameters and drawn values to values by name, shape (draw,).
    confidence : float
        Of the intervals.
    inflation : float
        Factor of the standard errors, for noise that is not white.

    Raises
    ------
    EstimationError
        As the estimator's, or it fails on more than a tenth of the draws.
    """
    p = resampled.parameters
    measured = estimator(resampled.balance, resampled.measured[0], p, resampled.measured[1])
    exact = estimator(resampled.fine, resampled.exact[0], p, resampled.exact[1])
    drawn = estimator(resampled.balance, resampled.drawn[0], p, resampled.drawn[1])
    found = {}
    for name, value in measured.items():
        change = drawn[name] - exact[name][0]
        if name == "phase":
            change = np.angle(np.exp(1j * change))
        known = change[np.isfinite(change)]
        if len(known) < (1.0 - _MOST_FAILED) * len(change):
            raise EstimationError(
                f"energy balance: expected {name} within the noise of the record, got none in "
                f"{len(change) - len(known)} of {len(change)} draws of it. Give more of what is known."
            )
        error = inflation * float(np.std(known, ddof=1))
        if name in _FITTED:
            # what smoothing and first-order ends make of the noiseless motion: all there is without noise
            error = math.hypot(error, float(exact[name][0]) - getattr(p, name))
        centre = float(value[0] - np.mean(known))
        reach = float(student.ppf(0.5 + confidence / 2.0, len(known) - 1)) * error
        reach *= math.sqrt(1.0 + 1.0 / len(known))
        found[name] = MethodEstimate(centre, error, centre - reach, centre + reach)
    return found


def known_damping(
    balance: EnergyBalance, halves: HalfEnergies, p: Parameters, drawn: Drawn
) -> dict[str, Floats]:
    """Estimate the restitution with the damping known."""
    energy = halves.energy(p, drawn)
    return {"restitution": balance.restitution(energy), "impact_velocity": _speed(balance, energy)}


def all_loss_at_impact(
    balance: EnergyBalance, halves: HalfEnergies, p: Parameters, drawn: Drawn
) -> dict[str, Floats]:
    """Estimate the energy-loss factor: the restitution if nothing else took energy out."""
    lossless = dict(drawn) | {"damping_ratio": np.zeros(1)}
    return {"energy_loss_factor": balance.restitution(halves.energy(p, lossless))}


def by_speeds(unknown: Sequence[str], squares: Floats) -> Estimator:
    """Return the estimator of restitution together with damping or forcing, from the speeds at the impacts.

    Parameters
    ----------
    unknown : sequence of str
        As of `unknowns_by_speed`.
    squares : ndarray, shape (half,)
        Squares of the speeds of the noiseless motion.
    """

    def estimate(
        balance: EnergyBalance, halves: HalfEnergies, p: Parameters, drawn: Drawn
    ) -> dict[str, Floats]:
        values, _ = unknowns_by_speed(halves, p, unknown, drawn, squares)
        found = {name: values[:, k] for k, name in enumerate(unknown)}
        energy = halves.energy(p, dict(drawn) | found)
        return {
            "restitution": balance.restitution(energy),
            **found,
            "impact_velocity": _speed(balance, energy),
        }

    return estimate


def _speed(balance: EnergyBalance, energy: Floats) -> Floats:
    """Return the root mean square of the speeds of approach."""
    squares = np.mean([energy[:, 2 * one + 1] for one, _ in balance.pairs], axis=0)
    found: Floats = np.sqrt(np.where(squares > 0.0, squares, np.nan))
    return found
