"""The common preparation of all methods: a record cut at its impacts, its weak form, and the exact flow per flight."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.analysis.estimation.estimates import FittedMotion
from vibroimpact.analysis.estimation.flight_fit import (
    FlightFit,
    FlightSearch,
    cut_at_level,
    fit_flights,
    search_flights,
)
from vibroimpact.analysis.estimation.physics import Floats, Forcing, Known, Parameters
from vibroimpact.analysis.estimation.segments import Flight, Segmentation, segment_channel
from vibroimpact.analysis.estimation.signals import Signal
from vibroimpact.analysis.estimation.trajectory import Trajectory, follow
from vibroimpact.analysis.estimation.weak_form import (
    robust_weak_form,
    weak_form,
    weighted_flights,
    with_own_clock,
)
from vibroimpact.analysis.recording import Channel
from vibroimpact.fmus.errors import EstimationError

# Correlation of neighbouring residuals, in standard errors, above which it widens the intervals.
_CORRELATED = 3.0
_LEAST_DAMPING = 1e-6
# Standard errors of chance beyond which the size or correlation of a flight's residuals reveals an impact in it.
_BEYOND_CHANCE = 4.5
# Natural frequency, over the frequency assumed for the cut, above which a record is cut again; and ratio above which it
# belongs to no oscillator.
_FASTER, _MUCH_FASTER = 1.05, 4.0


@dataclass(slots=True)
class Prepared:
    """A record with the preparation that all methods share."""

    forcing: Forcing
    held: Known
    segmentation: Segmentation
    flights: list[Flight]
    """Flights that follow the model."""
    search: FlightSearch
    """Estimates of the free parameters by weak form and exact flow."""
    fit: FlightFit
    parameters: Parameters
    """Held values, and values of the rest from the search and the flights."""
    left_out: int
    """Number of flights that do not follow the model."""
    correlation: float
    inflation: float
    """Factor by which the correlation of neighbouring residuals widens standard errors."""
    trajectory: Trajectory | None = None
    """Set once it is fitted."""

    @property
    def signal(self) -> Signal:
        """The displacement, mirrored for a lower stop."""
        return self.segmentation.signal

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that weak form and search estimated."""
        return self.search.names

    @property
    def stop(self) -> float | None:
        """The known stop, mirrored for a lower stop."""
        return None if self.held.stop_position is None else self.signal.sign * self.held.stop_position


def prepare(channel: Channel, forcing: Forcing, held: Known, window: float | None) -> Prepared:
    """Cut a record, estimate the weak form, and fit the exact flow to each flight.

    A natural frequency above that of the force means faster motion than the cut assumed: the record is cut again.
    EstimationError: there are no impacts, or no flight follows a forced oscillator.
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
    cut = segment_channel(channel, fastest, held, window)
    signal = cut.signal
    stop = None if held.stop_position is None else signal.sign * held.stop_position
    start, free = _start(forcing, held, cut)
    usable = [flight for flight in cut.flights if flight.usable]
    if not usable:
        raise EstimationError(
            f"estimate: expected flights of at least 10 samples between impacts, got none between "
            f"{len(cut.impacts)} impacts. Use a higher sampling rate."
        )
    start, flights = _followed_by_weak_form(signal, usable, start, free, fastest)
    search, parameters, fit = _searched(signal, flights, start, free, stop)
    followed = _followed(fit)
    if free and len(followed) < len(flights):
        # residuals of all samples reveal a weak impact that the few integrals of the weak form miss
        flights = [flights[k] for k in followed]
        start, _ = weak_form(weighted_flights(signal, flights, fastest), search.parameters, free)
        search, parameters, fit = _searched(signal, flights, start, free, stop)
    level = (fit.reading.stop_position if stop is None else stop) - parameters.offset
    flights = cut_at_level(signal, fit.fitted, level, parameters, fit.noise)
    search, parameters, fit = _searched(signal, flights, search.parameters, free, stop)
    parameters = replace(
        parameters,
        restitution=min(max(fit.reading.restitution, 0.0), 1.0),
        stop_position=fit.reading.stop_position,
    )
    left_out = len(usable) - len(flights)
    return Prepared(forcing, held, cut, flights, search, fit, parameters, left_out, *_coloured(fit))


def _start(forcing: Forcing, held: Known, cut: Segmentation) -> tuple[Parameters, tuple[str, ...]]:
    """Return the held values (start values for the others), and the names of the free parameters."""
    unknown = {
        "damping_ratio": held.damping_ratio is None,
        "natural_frequency": held.natural_frequency is None,
        "static_deflection": forcing.static_deflection is None,
        "phase": forcing.phase is None,
        "angular_frequency": forcing.clock_drifts,
        "offset": held.offset is None,
    }
    sign = cut.signal.sign
    parameters = Parameters(
        restitution=1.0,
        damping_ratio=0.0 if held.damping_ratio is None else held.damping_ratio,
        natural_frequency=held.natural_frequency or forcing.angular_frequency,
        angular_frequency=forcing.angular_frequency,
        static_deflection=1.0 if forcing.static_deflection is None else forcing.static_deflection,
        # mirrored for a lower stop: the force then has the opposite sign
        phase=(forcing.phase or 0.0) + (0.0 if sign > 0.0 else math.pi),
        stop_position=cut.stop_position,
        offset=sign * (held.offset or 0.0),
    )
    return parameters, tuple(name for name, is_free in unknown.items() if is_free)


def _followed_by_weak_form(
    signal: Signal, flights: list[Flight], start: Parameters, free: tuple[str, ...], fastest: float
) -> tuple[Parameters, list[Flight]]:
    """Return the weak form over the flights that follow the model, and these flights."""
    if not free:
        return start, flights
    whole = weighted_flights(signal, flights, fastest)
    if "angular_frequency" in free:
        start = with_own_clock(whole, start, [name for name in free if name != "angular_frequency"])
    found, kept = robust_weak_form(whole, start, free, signal.noise)
    return found, [flights[k] for k in kept]


def _searched(
    signal: Signal, flights: list[Flight], start: Parameters, free: tuple[str, ...], stop: float | None
) -> tuple[FlightSearch, Parameters, FlightFit]:
    """Return the search for the free parameters, all parameters of the flow, and the exact flow on each flight."""
    if not free:
        nothing = FlightSearch(start, (), np.empty((0, 0)), [])
        return nothing, start, fit_flights(signal, flights, start, stop)
    search = search_flights(signal, flights, _damped(start), free)
    parameters = _damped(search.parameters)
    return search, parameters, fit_flights(signal, flights, parameters, stop, free, search.influence)


def _damped(parameters: Parameters) -> Parameters:
    """Return the parameters of a damped flow: noise may give weak damping below zero, where no flow exists."""
    return replace(parameters, damping_ratio=max(parameters.damping_ratio, _LEAST_DAMPING))


def _followed(fit: FlightFit) -> list[int]:
    """Return the flights with residuals like noise in size and correlation; all flights where most are not."""
    found = []
    for k, one in enumerate(fit.fitted):
        correlation, square, count = _correlation([one.residual])
        excess = (square / fit.noise**2 - count) / math.sqrt(2.0 * count) if fit.noise > 0.0 else 0.0
        if max(excess, correlation * math.sqrt(count)) < _BEYOND_CHANCE:
            found.append(k)
    return found if len(found) > 0.5 * len(fit.fitted) else list(range(len(fit.fitted)))


def _coloured(fit: FlightFit) -> tuple[float, float]:
    """Return the correlation of neighbouring residuals, and the factor by which it widens standard errors."""
    correlation, _, count = _correlation([one.residual for one in fit.fitted])
    if correlation * math.sqrt(count) < _CORRELATED:
        return correlation, 1.0
    return correlation, math.sqrt((1.0 + correlation) / (1.0 - min(correlation, 0.99)))


def _correlation(residuals: Sequence[Floats]) -> tuple[float, float, int]:
    """Return the correlation of neighbours in residuals, the sum of squares, and the number of samples."""
    product = sum(float(one[1:] @ one[:-1]) for one in residuals)
    square = sum(float(one @ one) for one in residuals)
    return product / square if square > 0.0 else 0.0, square, sum(len(one) for one in residuals)


def fitted_motion(channel: Channel, record: Prepared) -> FittedMotion:
    """Return the motion of the trajectories, or of the single flights without trajectories."""
    signal, found = record.signal, record.trajectory
    fitted = np.full(len(signal.values), np.nan)
    for one in record.fit.fitted:
        fitted[one.flight.index] = signal.values[one.flight.index] - one.residual
    if found is not None:
        for piece in found.pieces:
            fitted[piece.index] = follow(signal, piece, found.parameters)
    measured = np.where(channel.good, channel.values, np.nan)
    return FittedMotion(channel.time, measured, signal.sign * fitted, "trajectory" if found else "weak_form")
