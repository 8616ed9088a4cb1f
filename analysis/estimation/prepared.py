"""What all methods share: a record cut at its impacts, its weak form, and the exact flow on each flight."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.analysis.estimation.estimates import FittedMotion
from vibroimpact.analysis.estimation.flight_fit import FlightFit, fit_flights, search_flights
from vibroimpact.analysis.estimation.noise import Floats
from vibroimpact.analysis.estimation.physics import Forcing, Known, Parameters
from vibroimpact.analysis.estimation.segments import Flight, Segmentation, segment
from vibroimpact.analysis.estimation.trajectory import Trajectory, follow
from vibroimpact.analysis.estimation.weak_form import (
    WeakForm,
    robust_weak_form,
    weak_form,
    weighted_flights,
    with_own_clock,
)
from vibroimpact.analysis.recording import Channel
from vibroimpact.fmus.errors import EstimationError

# Correlation of neighbouring rests beyond so many standard errors widens the intervals.
_CORRELATED = 3.0
_LEAST_DAMPING = 1e-6
# Rests of a flight larger or more alike than those of noise by so many standard errors show that it has an impact.
_BEYOND_CHANCE = 4.5
# A natural frequency over that for which a record was cut by such a factor is cut for; beyond, it is no oscillator's.
_FASTER, _MUCH_FASTER = 1.05, 4.0


@dataclass(slots=True)
class Prepared:
    """A record with what all methods share.

    Attributes
    ----------
    segmentation : Segmentation
    flights : list of Flight
        Those that follow the model.
    weak : WeakForm or None
        None: nothing was left to estimate.
    fit : FlightFit
    parameters : Parameters
        What is held, and what weak form and flights say of the rest.
    stop : float or None
        The known stop, mirrored where it is a lower one.
    free : tuple of str
        What the weak form estimates.
    left_out : int
        Flights that do not follow the model.
    correlation, inflation : float
        Of neighbouring rests, and the factor by which it widens standard errors.
    trajectory : Trajectory or None
        Set when it was fitted.
    """

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
        """What the weak form estimated."""
        return self.weak.names if self.weak else ()

    @property
    def influence(self) -> list[Floats]:
        """How that changes with the samples of each flight."""
        return self.weak.influence if self.weak else []


def prepare(channel: Channel, forcing: Forcing, held: Known, window: float | None) -> Prepared:
    """Cut a record, find what the weak form says and fit the exact flow to each flight.

    A natural frequency above that of the force makes the motion faster than the record was cut for: it is cut again.

    Raises
    ------
    EstimationError
        No impacts were found, or no flight between them follows a forced oscillator.
    """
    fastest = max(forcing.angular_frequency, held.natural_frequency or 0.0)
    found = _prepared(channel, forcing, held, window, fastest)
    natural = found.parameters.natural_frequency
    if not _FASTER * fastest < natural < _MUCH_FASTER * fastest:
        return found
    try:
        again = _prepared(channel, forcing, held, window, natural)
    except EstimationError:
        return found
    return again if len(again.flights) >= len(found.flights) else found


def _prepared(
    channel: Channel, forcing: Forcing, held: Known, window: float | None, fastest: float
) -> Prepared:
    """Return a record cut for motion of this fastest angular frequency, rad/s."""
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
    weak, flights = _weak(segmentation, flights, start, free, fastest)
    weak, parameters, fit = _fitted(segmentation, flights, start, weak, stop)
    followed = _followed(fit)
    if weak is not None and len(followed) < len(flights):
        # rests of all samples show a weak impact that the few integrals of the weak form do not
        flights = [flights[k] for k in followed]
        whole = weighted_flights(segmentation.signal, flights, fastest)
        weak = weak_form(whole, weak.parameters, free)
        weak, parameters, fit = _fitted(segmentation, flights, start, weak, stop)
    parameters = replace(
        parameters,
        restitution=min(max(fit.reading.restitution, 0.0), 1.0),
        stop_position=fit.reading.stop_position,
    )
    correlation, inflation = _coloured(fit)
    left_out = sum(flight.usable for flight in segmentation.flights) - len(flights)
    return Prepared(
        segmentation, flights, weak, fit, parameters, stop, free, left_out, correlation, inflation
    )


def _fitted(
    segmentation: Segmentation,
    flights: list[Flight],
    start: Parameters,
    weak: WeakForm | None,
    stop: float | None,
) -> tuple[WeakForm | None, Parameters, FlightFit]:
    """Return the weak form, the parameters that it found or were held, and the exact flow with them on each flight."""
    signal = segmentation.signal
    if weak is None:
        return None, start, fit_flights(signal, flights, start, stop)
    found = search_flights(signal, flights, _damped(weak.parameters), weak.names)
    weak = replace(weak, parameters=found.parameters, covariance=found.covariance, influence=found.influence)
    parameters = _damped(weak.parameters)
    return weak, parameters, fit_flights(signal, flights, parameters, stop, weak.names, weak.influence)


def _damped(parameters: Parameters) -> Parameters:
    """Return parameters of a flow: noise may put weak damping below zero, where there is none."""
    return replace(parameters, damping_ratio=max(parameters.damping_ratio, _LEAST_DAMPING))


def _followed(fit: FlightFit) -> list[int]:
    """Return the flights whose rests are no larger and no more alike than noise; all where most are not."""
    found = []
    for k, one in enumerate(fit.fitted):
        count = len(one.rests)
        square = float(one.rests @ one.rests)
        excess = (square / fit.noise**2 - count) / math.sqrt(2.0 * count) if fit.noise > 0.0 else 0.0
        alike = float(one.rests[1:] @ one.rests[:-1]) / square * math.sqrt(count) if square > 0.0 else 0.0
        if max(excess, alike) < _BEYOND_CHANCE:
            found.append(k)
    return found if len(found) > 0.5 * len(fit.fitted) else list(range(len(fit.fitted)))


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
) -> tuple[WeakForm | None, list[Flight]]:
    """Return the weak form over the flights that follow the model, and those flights."""
    if not free:
        return None, flights
    whole = weighted_flights(segmentation.signal, flights, fastest)
    if "angular_frequency" in free:
        start = with_own_clock(whole, start, [name for name in free if name != "angular_frequency"])
    found, kept = robust_weak_form(whole, start, free, segmentation.signal.noise)
    return found, [flights[k] for k in kept]


def _coloured(fit: FlightFit) -> tuple[float, float]:
    """Return the correlation of neighbouring rests, and the factor by which it widens standard errors."""
    product = sum(float(one.rests[1:] @ one.rests[:-1]) for one in fit.fitted)
    square = sum(float(one.rests @ one.rests) for one in fit.fitted)
    count = sum(len(one.rests) for one in fit.fitted)
    correlation = product / square if square > 0.0 else 0.0
    if correlation * math.sqrt(count) < _CORRELATED:
        return correlation, 1.0
    return correlation, math.sqrt((1.0 + correlation) / (1.0 - min(correlation, 0.99)))


def fitted_motion(channel: Channel, record: Prepared) -> FittedMotion:
    """Return the motion of the trajectories, or of the single flights where there are none."""
    signal, found = record.segmentation.signal, record.trajectory
    fitted = np.full(len(signal.values), np.nan)
    for one in record.fit.fitted:
        fitted[one.flight.index] = signal.values[one.flight.index] - one.rests
    if found is not None:
        for piece in found.pieces:
            fitted[piece.index] = follow(signal, piece, found.parameters)
    measured = np.where(channel.good, channel.values, np.nan)
    return FittedMotion(channel.time, measured, signal.sign * fitted, "trajectory" if found else "weak_form")
