"""Energy balance with intervals: the estimators on draws of the noise about the fitted motion (parametric bootstrap).

The draws give the standard error and the systematic error (smoothing, noise in squares), which is subtracted. Values
from the weak form vary with the same noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.analysis.estimation.energy import Drawn, EnergyBalance, HalfEnergies, unknowns_by_speed
from vibroimpact.analysis.estimation.estimates import MethodEstimate
from vibroimpact.analysis.estimation.flight_fit import flights_to_level
from vibroimpact.analysis.estimation.physics import Floats, Parameters
from vibroimpact.analysis.estimation.prepared import Prepared
from vibroimpact.analysis.estimation.smoothing import choose_window
from vibroimpact.fmus.errors import EstimationError

# Window of the noiseless motion, in periods of the fastest motion: short enough to leave the motion unchanged.
_NOISELESS_WINDOW = 0.15
_SAMPLES_PER_SPAN = 6
_MOST_FAILED = 0.1
# Quantities whose true value is known for the noiseless motion.
_FITTED = ("restitution", "damping_ratio", "static_deflection")

Estimator = Callable[["Resampled", HalfEnergies, Drawn], Mapping[str, Floats]]


@dataclass(frozen=True, slots=True)
class Resampled:
    """Energies of a record, of its noiseless motion, and of draws about this motion."""

    balance: EnergyBalance
    """Balance with the window that suits the noise."""
    parameters: Parameters
    """Numbers that the methods take as known."""
    measured: HalfEnergies
    exact: HalfEnergies
    drawn: HalfEnergies
    varied: Drawn
    """Parameters from the weak form, shape (draw,), which vary with the noise of the draws."""
    window: float
    """Window of the smoothing, s."""


def resample(record: Prepared, draws: int, seed: int) -> Resampled:
    """Return the energies of a record and of `draws` draws of noise about its fitted motion."""
    signal, fitted, parameters = record.signal, record.fit.fitted, record.parameters
    level = (parameters.stop_position if record.stop is None else record.stop) - parameters.offset
    flights = flights_to_level(signal, fitted, level, parameters)
    fastest = max(parameters.angular_frequency, parameters.natural_frequency)
    # samples minus residuals of the exact flow are the motion without noise
    motion = signal.values.copy()
    for one in fitted:
        motion[one.flight.index] -= one.residual
    rounding = 1e-12 * float(np.ptp(motion[signal.good]))
    noiseless = replace(signal, values=motion, noise=rounding)
    fine_window = max(_NOISELESS_WINDOW * 2.0 * np.pi / fastest, _SAMPLES_PER_SPAN * signal.interval)
    window = choose_window(noiseless, flights, fine_window, fastest, record.fit.noise)
    balance = EnergyBalance(signal, flights, parameters.angular_frequency, window)
    fine = EnergyBalance(noiseless, flights, parameters.angular_frequency, fine_window)
    errors = record.fit.noise * np.random.default_rng(seed).standard_normal((draws, len(motion)))
    shifts = sum(
        (
            errors[:, one.flight.index] @ part.T
            for one, part in zip(fitted, record.search.influence, strict=False)
        ),
        np.zeros((draws, len(record.names))),
    )
    return Resampled(
        balance,
        parameters,
        balance.energies(signal.values[None], parameters, record.stop),
        fine.energies(motion[None], parameters, record.stop),
        balance.energies(motion + errors, parameters, record.stop),
        {name: getattr(parameters, name) + shifts[:, k] for k, name in enumerate(record.names)},
        window,
    )


def with_intervals(
    resampled: Resampled, confidence: float, inflation: float, estimator: Estimator
) -> dict[str, MethodEstimate]:
    """Return an energy estimator's values minus their systematic error, with standard errors and intervals.

    `inflation` widens standard errors, for noise that is not white. The estimator returns values by name, shape
    (draw,). EstimationError comes from the estimator, or if more than a tenth of the draws fail.
    """
    from scipy.stats import t as student

    measured = estimator(resampled, resampled.measured, {})
    exact = estimator(resampled, resampled.exact, {})
    drawn = estimator(resampled, resampled.drawn, resampled.varied)
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
            # error of smoothing and first-order ends, from the noiseless motion: the only error without noise
            error = math.hypot(error, float(exact[name][0]) - getattr(resampled.parameters, name))
        centre = float(value[0] - np.mean(known))
        reach = float(student.ppf(0.5 + confidence / 2.0, len(known) - 1)) * error
        reach *= math.sqrt(1.0 + 1.0 / len(known))
        found[name] = MethodEstimate.within(centre, error, reach)
    return found


def known_damping(record: Resampled, halves: HalfEnergies, drawn: Drawn) -> dict[str, Floats]:
    """Estimate the restitution with the damping known."""
    energy = halves.energy(record.parameters, drawn)
    balance = record.balance
    return {"restitution": balance.restitution(energy), "impact_velocity": balance.speed(energy)}


def all_loss_at_impact(record: Resampled, halves: HalfEnergies, drawn: Drawn) -> dict[str, Floats]:
    """Estimate the energy-loss factor: the restitution if only impacts took energy."""
    energy = halves.energy(record.parameters, {**drawn, "damping_ratio": np.zeros(1)})
    return {"energy_loss_factor": record.balance.restitution(energy)}


def by_speeds(unknown: Sequence[str]) -> Estimator:
    """Return the estimator of restitution together with damping or forcing (`unknowns_by_speed`), from the speeds."""

    def estimate(record: Resampled, halves: HalfEnergies, drawn: Drawn) -> dict[str, Floats]:
        p, squares = record.parameters, record.exact.speed_squared[0]
        values, _ = unknowns_by_speed(halves, p, unknown, drawn, squares)
        found = {name: values[:, k] for k, name in enumerate(unknown)}
        energies = known_damping(record, halves, {**drawn, **found})
        return {
            "restitution": energies["restitution"],
            **found,
            "impact_velocity": energies["impact_velocity"],
        }

    return estimate
