"""All methods on one record of impacting motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from vibroimpact.analysis.estimation.draws import (
    Resampled,
    by_speeds,
    known_damping,
    resample,
    with_intervals,
)
from vibroimpact.analysis.estimation.energy import sensitivities
from vibroimpact.analysis.estimation.estimates import METHODS, Estimate, ImpactEstimates, Refusal
from vibroimpact.analysis.estimation.flight_fit import FlightFit, fit_flights
from vibroimpact.analysis.estimation.noise import Floats
from vibroimpact.analysis.estimation.period_one import period_one
from vibroimpact.analysis.estimation.physics import Forcing, Known, Parameters
from vibroimpact.analysis.estimation.segments import Flight, Segmentation, segment
from vibroimpact.analysis.estimation.trajectory import Trajectory, fit_trajectory
from vibroimpact.analysis.estimation.weak_form import (
    WeakForm,
    robust_weak_form,
    weighted_flights,
    with_own_clock,
)
from vibroimpact.analysis.recording import Channel
from vibroimpact.fmus.errors import EstimationError

# Correlation of neighbouring rests beyond so many standard errors widens the intervals.
_CORRELATED = 3.0
# A damping ratio of fewer standard errors than this is not told from restitution, or from the force.
_CLEAR = 3.0
_LEAST_DAMPING = 1e-6


def estimate_impacts(
    channel: Channel,
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

    Energy balance (thesis eqs. 4.2 to 4.20), weak form and trajectory fit, each as far as the data allow.

    Parameters
    ----------
    channel : Channel
        Displacement of the oscillator, in any unit; measured or simulated.
    forcing : Forcing
        What is known of the force, on the channel's clock.
    known : Known or None
        What is known of the oscillator and its stop, and so held.
    methods : sequence of str
        Of `METHODS`.
    window : float or None
        Of the one-sided fits at the impacts, s; None: from the noise.
    draws : int
        Of noise, for the intervals of the energy balance.
    confidence : float
        Of the intervals.
    seed : int
        Of the draws.

    Returns
    -------
    ImpactEstimates
        With a refusal for each method that the data do not support.

    Raises
    ------
    EstimationError
        No impacts were found, or no flight between them follows a forced oscillator.
    """
    held = known or Known()
    _check(methods, draws, confidence)
    _check_known(held)
    record = _prepared(channel, forcing, held, window)
    values: dict[str, dict[str, Estimate]] = {}
    refusals: list[Refusal] = []

    def attempt(method: str, run: Callable[[], dict[str, Estimate]]) -> None:
        if method not in methods:
            return
        try:
            values[method] = run()
        except EstimationError as problem:
            refusals.append(Refusal(method, str(problem)))

    z = float(norm.ppf(0.5 + confidence / 2.0))
    attempt("weak_form", lambda: _weak_values(record, held, z))
    attempt("trajectory", lambda: _trajectory_values(record, held, z))
    energy_methods = [name for name in methods if name.startswith("energy")]
    resampled: Resampled | None = None
    try:
        resampled = _resampled(record, held, draws, seed) if energy_methods else None
    except EstimationError as problem:
        refusals.extend(Refusal(name, str(problem)) for name in energy_methods)
    if resampled is not None:
        for name in energy_methods:
            attempt(
                name,
                lambda name=name: _energy_values(
                    name, resampled, forcing, held, confidence, record.inflation
                ),  # type: ignore[misc]
            )
    attempt(
        "period_one",
        lambda: period_one(
            record.segmentation, record.parameters.natural_frequency, record.parameters.offset
        ),
    )
    return ImpactEstimates(
        channel.name,
        channel.unit,
        {
            name: _as_measured(values[name], record.segmentation.signal.sign)
            for name in METHODS
            if name in values
        },
        _conditioning(record, resampled),
        _facts(record, resampled),
        tuple(refusals),
        tuple(_remarks(record, forcing, held, values)),
        confidence,
        np.array([impact.time for impact in record.segmentation.impacts]),
    )


def _check(methods: Sequence[str], draws: int, confidence: float) -> None:
    for method in methods:
        if method not in METHODS:
            raise EstimationError(f'methods: expected some of {", ".join(METHODS)}, got "{method}".')
    if draws < 10 or not 0.0 < confidence < 1.0:
        raise EstimationError(
            f"estimate: expected at least 10 draws and 0 < confidence < 1, got {draws} and {confidence}."
        )


def _check_known(held: Known) -> None:
    if held.damping_ratio is not None and not held.damping_ratio >= 0.0:
        raise EstimationError(f"damping_ratio: expected >= 0, got {held.damping_ratio}.")
    if held.natural_frequency is not None and not held.natural_frequency > 0.0:
        raise EstimationError(f"natural_frequency: expected > 0 rad/s, got {held.natural_frequency}.")
    if held.side not in (None, "upper", "lower"):
        raise EstimationError(f'side: expected upper or lower, got "{held.side}".')


@dataclass(slots=True)
class _Record:
    """A record with what all methods share: segmentation, weak form and the exact flow on each flight."""

    segmentation: Segmentation
    flights: list[Flight]
    weak: WeakForm | None
    fit: FlightFit
    parameters: Parameters
    stop: float | None
    free: tuple[str, ...]
    left_out: int
    correlation: float
    inflation: float
    trajectory: Trajectory | None = None

    @property
    def names(self) -> tuple[str, ...]:
        return self.weak.names if self.weak else ()

    @property
    def influence(self) -> list[Floats]:
        return self.weak.influence if self.weak else []


def _prepared(channel: Channel, forcing: Forcing, held: Known, window: float | None) -> _Record:
    """Cut a record, find what the weak form says and fit the exact flow to each flight."""
    fastest = max(forcing.angular_frequency, held.natural_frequency or 0.0)
    segmentation = segment(
        channel.time,
        np.where(channel.good, channel.values, 0.0),
        channel.good,
        fastest=fastest,
        side=held.side,
        stop_position=held.stop_position,
        window=window,
    )
    sign = segmentation.signal.sign
    stop = None if held.stop_position is None else sign * held.stop_position
    start, free = _start(forcing, held, segmentation, sign)
    flights = [flight for flight in segmentation.flights if flight.usable]
    if not flights:
        raise EstimationError(
            f"estimate: expected flights of at least 10 samples between impacts, got none between "
            f"{len(segmentation.impacts)} impacts. Use a higher sampling rate."
        )
    weak, flights, left_out = _weak(segmentation, flights, start, free, fastest)
    parameters = weak.parameters if weak else start
    # noise may put weak damping below zero, where there is no flow
    parameters = replace(parameters, damping_ratio=max(parameters.damping_ratio, _LEAST_DAMPING))
    fit = fit_flights(
        segmentation.signal,
        flights,
        parameters,
        stop,
        weak.names if weak else (),
        weak.influence if weak else (),
    )
    parameters = replace(
        parameters,
        restitution=min(max(fit.reading.restitution, 0.0), 1.0),
        stop_position=fit.reading.stop_position,
    )
    correlation, inflation = _coloured(fit)
    return _Record(segmentation, flights, weak, fit, parameters, stop, free, left_out, correlation, inflation)


def _start(
    forcing: Forcing, held: Known, segmentation: Segmentation, sign: float
) -> tuple[Parameters, tuple[str, ...]]:
    """Return the held values (start values for the others), and the names of what is estimated."""
    unknown = {
        "damping_ratio": held.damping_ratio is None,
        "natural_frequency": held.natural_frequency is None,
        "static_deflection": forcing.static_deflection is None,
        "phase": forcing.phase is None,
        "angular_frequency": forcing.clock_drifts,
        "offset": held.offset is None,
    }
    # mirrored for a lower stop: the force then has the opposite sign
    phase = (forcing.phase or 0.0) + (0.0 if sign > 0.0 else math.pi)
    parameters = Parameters(
        1.0,
        0.0 if held.damping_ratio is None else held.damping_ratio,
        held.natural_frequency or forcing.angular_frequency,
        forcing.angular_frequency,
        1.0 if forcing.static_deflection is None else forcing.static_deflection,
        phase,
        segmentation.stop_position,
        sign * (held.offset or 0.0),
    )
    return parameters, tuple(name for name, is_free in unknown.items() if is_free)


def _weak(
    segmentation: Segmentation,
    flights: list[Flight],
    start: Parameters,
    free: tuple[str, ...],
    fastest: float,
) -> tuple[WeakForm | None, list[Flight], int]:
    """Return the weak form over the flights that follow the model, those flights, and how many do not."""
    if not free:
        return None, flights, 0
    whole = weighted_flights(segmentation.signal, flights, fastest)
    if "angular_frequency" in free:
        start = with_own_clock(whole, start, [name for name in free if name != "angular_frequency"])
    found, kept = robust_weak_form(whole, start, free, segmentation.signal.noise)
    return found, [flights[k] for k in kept], len(flights) - len(kept)


def _coloured(fit: FlightFit) -> tuple[float, float]:
    """Return the correlation of neighbouring rests, and the factor by which it widens standard errors."""
    product = sum(float(one.rests[1:] @ one.rests[:-1]) for one in fit.fitted)
    square = sum(float(one.rests @ one.rests) for one in fit.fitted)
    count = sum(len(one.rests) for one in fit.fitted)
    correlation = product / square if square > 0.0 else 0.0
    if correlation * math.sqrt(count) < _CORRELATED:
        return correlation, 1.0
    return correlation, math.sqrt((1.0 + correlation) / (1.0 - min(correlation, 0.99)))


def _with_normal(value: float, error: float, z: float) -> Estimate:
    return Estimate(value, error, value - z * error, value + z * error)


def _weak_values(record: _Record, held: Known, z: float) -> dict[str, Estimate]:
    """Return what weak form and flights say."""
    errors = record.fit.standard_errors
    found = {
        "restitution": _with_normal(
            record.fit.reading.restitution, record.inflation * errors["restitution"], z
        )
    }
    if record.weak is not None:
        for k, name in enumerate(record.weak.names):
            error = record.inflation * math.sqrt(record.weak.covariance[k, k])
            found[name] = _with_normal(getattr(record.weak.parameters, name), error, z)
    if held.stop_position is None:
        error = record.inflation * errors["stop_position"]
        found["stop_position"] = _with_normal(record.fit.reading.stop_position, error, z)
    error = record.inflation * errors["impact_velocity"]
    found["impact_velocity"] = _with_normal(record.fit.reading.impact_velocity, error, z)
    return found


def _trajectory_values(record: _Record, held: Known, z: float) -> dict[str, Estimate]:
    """Return what the fit of whole trajectories says."""
    free = ("restitution", *record.free, *(("stop_position",) if held.stop_position is None else ()))
    found = fit_trajectory(record.segmentation, record.fit.fitted, record.parameters, free, record.fit.noise)
    record.trajectory = found
    return {
        name: _with_normal(getattr(found.parameters, name), record.inflation * found.standard_error(name), z)
        for name in free
    }


def _resampled(record: _Record, held: Known, draws: int, seed: int) -> Resampled:
    return resample(
        record.segmentation.signal,
        record.fit.fitted,
        record.parameters,
        record.stop,
        record.fit.noise,
        record.names,
        record.influence,
        draws,
        seed,
    )


def _energy_values(
    method: str, resampled: Resampled, forcing: Forcing, held: Known, confidence: float, inflation: float
) -> dict[str, Estimate]:
    """Return what one of the energy balances says."""
    if method == "energy_known_damping":
        return with_intervals(resampled, known_damping(held.damping_ratio), confidence, inflation)
    unknown = ["damping_ratio"]
    if method == "energy_amplitude":
        unknown = [] if held.damping_ratio is not None else ["damping_ratio"]
        unknown += ["static_deflection"] + (["phase"] if forcing.phase is None else [])
    found = with_intervals(resampled, by_speeds(unknown), confidence, inflation)
    damping = found.get("damping_ratio")
    # judged by the size that the weak form gives: judged by its own, only chance excesses would pass
    if damping is not None and not resampled.parameters.damping_ratio > _CLEAR * damping.standard_error:
        raise EstimationError(
            f"{method}: expected data that separate damping from restitution, got a damping ratio of "
            f"{damping.value:.3g} +- {damping.standard_error:.2g}. Give the damping ratio, from a free decay or a "
            "resonance curve, or use a longer or cleaner recording."
        )
    restitution = found.get("restitution")
    if restitution is not None and (restitution.low > 1.0 or restitution.high < 0.0):
        raise EstimationError(
            f"{method}: expected a restitution from 0 to 1, got {restitution.value:.3g} +- "
            f"{restitution.standard_error:.2g}. Damping or forcing are not what the motion shows."
        )
    return found


def _as_measured(values: dict[str, Estimate], sign: float) -> dict[str, Estimate]:
    """Return estimates in the coordinate of the channel: a lower stop was mirrored."""
    found = dict(values)
    for name in ("stop_position", "offset"):
        if name in found and sign < 0.0:
            one = found[name]
            found[name] = Estimate(-one.value, one.standard_error, -one.high, -one.low)
    if "phase" in found:
        one = found["phase"]
        turned = one.value - (0.0 if sign > 0.0 else math.pi)
        shift = turned - 2.0 * math.pi * math.floor(turned / (2.0 * math.pi)) - one.value
        found["phase"] = Estimate(one.value + shift, one.standard_error, one.low + shift, one.high + shift)
    return found


def _conditioning(record: _Record, resampled: Resampled | None) -> dict[str, float]:
    """Return the sensitivities of the energy balance at the estimates."""
    if resampled is None:
        return {}
    drag = np.abs(resampled.exact[0].drag[0])
    reading = record.fit.reading
    flight, half = float(np.mean(drag[0::2] + drag[1::2])), float(np.mean(drag[1::2]))
    if not (reading.restitution > 0.0 and half > 0.0):
        return {}
    natural = record.parameters.natural_frequency
    return sensitivities(reading.restitution, reading.impact_velocity, flight, half, natural)


def _facts(record: _Record, resampled: Resampled | None) -> dict[str, float | str]:
    """Return what the record is like."""
    cut = record.segmentation
    peak = float(np.max(np.abs(cut.signal.values[cut.signal.good] - record.parameters.offset)))
    facts: dict[str, float | str] = {
        "impacts": float(len(cut.impacts)),
        "flights_used": float(len(record.flights)),
        "flights_left_out": float(len(cut.flights) - len(record.flights)),
        "noise": record.fit.noise,
        "noise_over_peak": record.fit.noise / peak,
        "noise_correlation": record.correlation,
        "window": cut.window,
        "side": "upper" if cut.signal.sign > 0.0 else "lower",
        "restitution_scatter": _scatter(record),
    }
    if resampled is not None:
        facts["smoothing_window"] = resampled.window
    if record.trajectory is not None:
        facts["trajectory_pieces"] = float(len(record.trajectory.pieces))
        facts["trajectory_noise"] = record.trajectory.noise
    return facts


def _scatter(record: _Record) -> float:
    """Return the standard deviation of the restitution of single impacts; NaN of less than two."""
    ratios = [
        -other.state[1] / one.end_state[1]
        for one, other in zip(record.fit.fitted, record.fit.fitted[1:], strict=False)
        if other.flight.first == one.flight.first + 1
    ]
    return float(np.std(ratios, ddof=1)) if len(ratios) > 1 else math.nan


def _remarks(
    record: _Record, forcing: Forcing, held: Known, values: dict[str, dict[str, Estimate]]
) -> Sequence[str]:
    """Return what a reader must know."""
    remarks = []
    if record.fit.reading.periodic:
        remarks.append("No impact has a usable flight on both sides: P(1,1) was assumed.")
    if record.left_out:
        remarks.append(
            f"{record.left_out} flights do not follow the model and were left out: an impact in them was not seen, "
            "or it is not one oscillator there."
        )
    if record.inflation > 1.0:
        remarks.append(
            f"Neighbouring rests are correlated ({record.correlation:.2f}): coloured noise or motion that the model "
            f"lacks. Standard errors are {record.inflation:.2f} times those of white noise."
        )
    if record.trajectory is not None and not record.trajectory.adequate:
        hint = (
            ""
            if forcing.clock_drifts
            else " If the clocks of force and recording differ, say so (clock_drifts)."
        )
        remarks.append(
            f"The fitted trajectories leave rests of {record.trajectory.noise:.3g}, the single flights only "
            f"{record.fit.noise:.3g}: restitution or forcing is not constant, and the intervals of the trajectory fit "
            f"are too narrow.{hint}"
        )
    energy = [name for name in values if name.startswith("energy")]
    if energy and record.names:
        remarks.append(
            f"The energy balance took {', '.join(record.names)} from the weak form where it does not estimate them; "
            "their doubt is in its intervals."
        )
    if energy and held.damping_ratio is None:
        remarks.append(
            "No damping ratio was given: the energy balance with known damping gives the energy-loss factor, "
            "which counts all damping as loss at the impact."
        )
    if "period_one" in values:
        remarks.append(
            "period_one assumes undamped free motion between impacts: a start value without an interval, "
            "off by several percent for driven, damped motion."
        )
    return remarks
