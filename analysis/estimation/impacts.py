"""All methods on one record of impacting motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
import xarray as xr

from vibroimpact.analysis.estimation.draws import (
    Resampled,
    all_loss_at_impact,
    by_speeds,
    known_damping,
    resample,
    with_intervals,
)
from vibroimpact.analysis.estimation.estimates import METHODS, ImpactEstimates, MethodEstimate, Refusal
from vibroimpact.analysis.estimation.flight_times import period_one
from vibroimpact.analysis.estimation.physics import Coordinates, Floats, Forcing, Known, Parameters
from vibroimpact.analysis.estimation.prepared import Prepared, fitted_motion, prepare
from vibroimpact.analysis.estimation.remarks import conditioning_of, doubts_of, facts_of, remarks_of
from vibroimpact.analysis.estimation.trajectory import fit_trajectory
from vibroimpact.analysis.recording import Channel, channel_of
from vibroimpact.fmus.errors import EstimationError, UsageError

Estimates = dict[str, MethodEstimate]

# Size of a damping ratio in standard errors above which it counts as separated from restitution or force, by method.
_SEPARABLE = {"energy_joint": 0.5, "energy_amplitude": 3.0}
_RESTITUTIONS = ("restitution", "energy_loss_factor")
# Standard error of the restitution, relative to noise over samples, below which the interval has no width.
_NO_WIDTH = 1e-3
# Numerical errors of a method on motion far from its model; the failure of one method leaves the others.
_FAILURES = (EstimationError, UsageError, ArithmeticError, ValueError)
# Uncertainty of the instants (rad of the fastest motion) above which impact speeds err by more than stated.
_INSTANT_ERROR = 0.1


def estimate_impacts(
    channel: Channel | xr.DataArray,
    forcing: Forcing,
    known: Known | None = None,
    *,
    methods: Sequence[str] = METHODS,
    window: float | None = None,
    draws: int = 40,
    confidence: float = 0.95,
    seed: int = 0,
) -> ImpactEstimates:
    """Estimate restitution, damping, natural frequency, forcing and stop from a displacement that hits a stop.

    Methods: energy balance (thesis eqs. 4.2 to 4.20), weak form and trajectory fit, as far as the data allow.

    Parameters
    ----------
    channel : Channel or xarray.DataArray
        Displacement of the oscillator, in any unit; measured or simulated.
    forcing : Forcing
        The force on the channel's clock, as far as it is known.
    known : Known or None
        Known values of the oscillator and its stop, which are held.
    methods : sequence of str
        Some of `METHODS`.
    window : float or None
        Window of the one-sided fits at the impacts, s; None: chosen from the noise.
    draws : int
        Draws of noise, for the intervals of the energy balance.
    confidence : float
        Confidence of the intervals.
    seed : int
        Seed of the draws.

    Returns
    -------
    ImpactEstimates
        With a refusal for each method that the data do not support.

    Raises
    ------
    EstimationError
        No impacts were found, or no flight between them follows a forced oscillator.
    """
    channel, held = channel_of(channel), known or Known()
    if not isinstance(forcing, Forcing) or not isinstance(held, Known):
        got = type(forcing if not isinstance(forcing, Forcing) else held).__name__
        raise UsageError(
            f"forcing, known: expected a Forcing and a Known, got {got}. Write Forcing(angular_frequency)."
        )
    _check(methods, draws, confidence, held)
    record = prepare(channel, forcing, held, window)
    values, refusals, resampled = _run_methods(record, methods, draws, confidence, seed)
    doubts = doubts_of(record, values, confidence)
    sign = record.signal.sign
    return ImpactEstimates(
        channel.name,
        channel.unit,
        {name: _as_measured(values[name], sign) for name in METHODS if name in values},
        conditioning_of(record, resampled),
        facts_of(record, resampled),
        tuple(refusals),
        doubts,
        tuple(remarks_of(record, values)),
        confidence,
        np.array([impact.time for impact in record.segmentation.impacts]),
        fitted_motion(channel, record),
    )


def _run_methods(
    record: Prepared, methods: Sequence[str], draws: int, confidence: float, seed: int
) -> tuple[dict[str, Estimates], list[Refusal], Resampled | None]:
    """Return the estimates of each method, the refusals of the others, and the draws of the energy balance."""
    natural, offset = record.parameters.natural_frequency, record.parameters.offset
    estimators: dict[str, Callable[[], Estimates]] = {
        "weak_form": lambda: _weak_values(record, confidence),
        "trajectory": lambda: _trajectory_values(record, confidence),
        "period_one": lambda: period_one(record.segmentation, natural, offset),
    }
    refusals: list[Refusal] = []
    energies = [name for name in methods if name.startswith("energy")]
    resampled: Resampled | None = None
    try:
        resampled = resample(record, draws, seed) if energies else None
    except _FAILURES as problem:
        refusals = [Refusal(name, _reason(name, problem)) for name in energies]
    if resampled is not None:
        for name in energies:
            estimators[name] = partial(_energy_values, name, record, resampled, confidence)
    values: dict[str, Estimates] = {}
    for name, run in estimators.items():
        if name not in methods:
            continue
        try:
            found = run()
            _check_answer(name, found, record)
        except _FAILURES as problem:
            refusals.append(Refusal(name, _reason(name, problem)))
        else:
            values[name] = found
    return values, refusals, resampled


def _reason(method: str, problem: Exception) -> str:
    """Return the reason why a method gave no answer: its own message, or its numerical failure."""
    if isinstance(problem, EstimationError):
        return str(problem)
    return (
        f"{method}: expected numbers that its fit can go on with, got none ({problem}). "
        "The motion is far from that of one oscillator."
    )


def _check_answer(method: str, found: Estimates, record: Prepared) -> None:
    """Raise EstimationError for an impossible answer: an interval without width despite noise, or unphysical values."""
    size = record.signal.range * math.sqrt(len(record.signal.time))
    restitution = found.get("restitution")
    if restitution is not None and restitution.standard_error < _NO_WIDTH * record.fit.noise / size:
        raise EstimationError(
            f"{method}: expected a restitution that the motion depends on, got {restitution.value:.3g} with an "
            "interval of no width. The fit does not go through the impacts."
        )
    for name, rule, high in (("restitution", "0 <= {} <= 1", 1.0), ("damping_ratio", "{} >= 0", math.inf)):
        one = found.get(name)
        if one is not None and (one.high < 0.0 or one.low > high):
            raise EstimationError(
                f"{method}: expected {rule.format(name.replace('_', ' '))}, got {one.value:.3g} +- "
                f"{one.standard_error:.2g}. The motion is not that of one oscillator against one stop."
            )


def _check(methods: Sequence[str], draws: int, confidence: float, held: Known) -> None:
    for method in methods:
        if method not in METHODS:
            raise EstimationError(f'methods: expected some of {", ".join(METHODS)}, got "{method}".')
    if draws < 10 or not 0.0 < confidence < 1.0:
        raise EstimationError(
            f"estimate: expected at least 10 draws and 0 < confidence < 1, got {draws} and {confidence}."
        )
    if held.damping_ratio is not None and not held.damping_ratio >= 0.0:
        raise EstimationError(f"damping_ratio: expected >= 0, got {held.damping_ratio}.")
    if held.natural_frequency is not None and not held.natural_frequency > 0.0:
        raise EstimationError(f"natural_frequency: expected > 0 rad/s, got {held.natural_frequency}.")
    if held.side not in (None, "upper", "lower"):
        raise EstimationError(f'side: expected upper or lower, got "{held.side}".')


def _with_coordinates(
    found: Parameters, names: tuple[str, ...], covariance: Floats, confidence: float
) -> Estimates:
    """Return estimates whose intervals come from the coordinates in which the equation is linear."""
    intervals = Coordinates(names, found).intervals(found, covariance, confidence)
    return {
        name: MethodEstimate(getattr(found, name), math.sqrt(float(covariance[k, k])), *intervals[name])
        for k, name in enumerate(names)
        if name in intervals
    }


def _weak_values(record: Prepared, confidence: float) -> Estimates:
    """Return the estimates of the weak form and the flights."""
    from scipy.stats import norm

    quantile = float(norm.ppf(0.5 + confidence / 2.0))
    found: Estimates = {}
    for name, error in record.fit.standard_errors.items():
        if name != "stop_position" or record.stop is None:
            widened = record.inflation * error
            found[name] = MethodEstimate.within(
                getattr(record.fit.reading, name), widened, quantile * widened
            )
    if record.names:
        covariance = record.inflation**2 * record.search.covariance
        found |= _with_coordinates(record.search.parameters, record.names, covariance, confidence)
    return found


def _trajectory_values(record: Prepared, confidence: float) -> Estimates:
    """Return the estimates of the fit of whole trajectories."""
    free = ("restitution", *record.names, *(("stop_position",) if record.stop is None else ()))
    found = fit_trajectory(record.segmentation, record.fit.fitted, record.parameters, free, record.fit.noise)
    record.trajectory = found
    return _with_coordinates(found.parameters, free, record.inflation**2 * found.covariance, confidence)


def _check_instants(method: str, record: Prepared) -> None:
    """Raise EstimationError if the instants of impact are too uncertain for speeds at the impacts."""
    fastest = max(record.parameters.angular_frequency, record.parameters.natural_frequency)
    error = fastest * float(np.median([impact.time_error for impact in record.segmentation.impacts]))
    if error > _INSTANT_ERROR:
        raise EstimationError(
            f"{method}: expected instants of impact known to {_INSTANT_ERROR} rad of the fastest motion, got "
            f"{error:.2g}. Weak impacts in this noise have no certain speeds: use the weak form or the trajectories."
        )


def _energy_values(method: str, record: Prepared, resampled: Resampled, confidence: float) -> Estimates:
    """Return the estimates of one of the energy balances."""
    held, intervals = record.held, partial(with_intervals, resampled, confidence, record.inflation)
    if method == "energy_known_damping":
        if held.damping_ratio is None:
            return intervals(all_loss_at_impact)
        found = intervals(known_damping)
        # strong damping takes more energy than an impact could: there is no energy-loss factor then
        with suppress(EstimationError):
            found = intervals(all_loss_at_impact) | found
        return found
    _check_instants(method, record)
    unknown = ["damping_ratio"]
    if method == "energy_amplitude":
        unknown = [] if held.damping_ratio is not None else ["damping_ratio"]
        unknown += ["static_deflection"] + (["phase"] if record.forcing.phase is None else [])
    found = intervals(by_speeds(unknown))
    damping = found.get("damping_ratio")
    # judged by the damping of the weak form: by its own damping, only chance excesses would pass
    if (
        damping is not None
        and not resampled.parameters.damping_ratio > _SEPARABLE[method] * damping.standard_error
    ):
        raise EstimationError(
            f"{method}: expected data that separate damping from restitution, got a damping ratio of "
            f"{damping.value:.3g} +- {damping.standard_error:.2g}. Give the damping ratio, from a free decay or a "
            "resonance curve, or use a longer or cleaner recording."
        )
    return found


def _as_measured(values: Estimates, sign: float) -> Estimates:
    """Return estimates in the coordinate of the channel, restitutions clipped at 0: a lower stop was mirrored."""
    found = dict(values)
    for name in _RESTITUTIONS:
        if name in found:
            one = found[name]
            found[name] = replace(one, value=max(one.value, 0.0), low=max(one.low, 0.0))
    for name in ("stop_position", "offset"):
        if name in found and sign < 0.0:
            one = found[name]
            found[name] = MethodEstimate(-one.value, one.standard_error, -one.high, -one.low)
    if "phase" in found:
        one = found["phase"]
        turned = one.value - (0.0 if sign > 0.0 else math.pi)
        shift = turned - 2.0 * math.pi * math.floor(turned / (2.0 * math.pi)) - one.value
        found["phase"] = MethodEstimate(
            one.value + shift, one.standard_error, one.low + shift, one.high + shift
        )
    return found
