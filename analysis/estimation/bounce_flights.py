"""The flights of a bouncing body, found as parabolas of one acceleration, otherwise as motion between kinks.

Parabolas use all samples of a flight, so they work with strong noise or few samples. Drag, a spring and a contact of
some length bend the flights; kinks make no assumption about their form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.estimation.bounce_fit import FittedBounces, fitted_bounces
from vibroimpact.analysis.estimation.estimates import Doubt, MethodEstimate
from vibroimpact.analysis.estimation.physics import Floats, Known
from vibroimpact.analysis.estimation.segments import Impact, Segmentation, segment_channel
from vibroimpact.analysis.estimation.signals import refuse_other_quantities, signal_of
from vibroimpact.analysis.recording import Channel
from vibroimpact.fmus.errors import EstimationError

FEWEST_FLIGHTS = 3
# Assumed number of periods of the fastest smooth motion in a record; windows are shortened until impacts appear.
_TURNS = 4.0
# Smallest error of an instant, in sampling intervals.
_INSTANT = 1e-4
# Ratio of a flight's length to the length before, above which impacts in the flight were missed ...
_LONGER = 1.02
# ... if the flight is also longer by more than this many standard errors.
_LONGER_BEYOND = 3.0
# Relative standard error of the first flight's length above which this flight is left out.
_LEAST_KNOWN = 0.1


@dataclass(frozen=True, slots=True)
class BounceFlights:
    """Successive flights, each shorter than the one before."""

    lengths: Floats
    """Lengths of the flights, s, shape (flight,)."""
    covariance: Floats
    """Covariance of the logarithms of the lengths: neighbours share the error of an instant."""
    acceleration: float
    """Acceleration towards the stop, unit of the channel per s^2; 0 where no flight shows it."""
    impact_times: Floats
    """Observed instants of impact, s, shape (impact,)."""
    stop_position: float
    """Position in the channel's own coordinate and unit."""
    stop_error: float
    stop_freedom: float
    """Degrees of freedom of the standard error."""
    fitted: Floats
    """Motion of constant acceleration nearest to the flights, shape (sample,); NaN elsewhere."""
    facts: dict[str, float | str]
    doubts: tuple[Doubt, ...] = ()

    def stop(self, confidence: float) -> MethodEstimate:
        """Return the position of the stop with its interval."""
        from scipy.stats import t as student

        reach = float(student.ppf(0.5 + confidence / 2.0, self.stop_freedom)) * self.stop_error
        return MethodEstimate.within(self.stop_position, self.stop_error, reach)


def flights_of(channel: Channel, side: str | None, window: float | None) -> BounceFlights:
    """Return the flights of a displacement channel at an `upper` or `lower` stop; None: the flights decide.

    The window of one-sided fits at kinks is in s; None: parabolas, or kinks with an automatic window. EstimationError:
    the channel has another quantity, or no impacts.
    """
    refuse_other_quantities(channel)
    if window is not None:
        return _between_kinks(channel, side, window)
    found = fitted_bounces(signal_of(channel), side)
    parabolas = None if found is None else _of_parabolas(channel, found)
    enough = parabolas is not None and len(parabolas.lengths) >= FEWEST_FLIGHTS
    if parabolas is not None and enough and not parabolas.doubts:
        return parabolas
    try:
        kinks = _between_kinks(channel, side, None)
    except EstimationError:
        if parabolas is None or not enough:
            raise
        return parabolas
    # doubtful parabolas are better than too few kinks
    return parabolas if parabolas is not None and enough and len(kinks.lengths) < FEWEST_FLIGHTS else kinks


def _of_parabolas(channel: Channel, found: FittedBounces) -> BounceFlights | None:
    """Return the flights with a known length from parabolas, up to the first flight longer than its predecessor."""
    fit, signal = found.fit, found.signal
    # only the first half of the last flight is known: it gives the start, and hardly the end
    instants = fit.instants[:-1]
    lengths, step = np.diff(instants), _differences(len(instants))
    covariance = step @ found.covariance[2:-1, 2:-1] @ step.T
    covariance += 2.0 * (_INSTANT * signal.interval) ** 2 * np.eye(len(lengths))
    if not lengths.size:
        return None
    # too little of the first flight may have been recorded
    first = int(math.sqrt(covariance[0, 0]) > _LEAST_KNOWN * lengths[0])
    end = first + _shrinking(lengths[first:], covariance[first:, first:])
    used, scale = slice(first, end), 1.0 / lengths[first:end]
    impacts = instants[max(first, 1) : end + 1]
    return BounceFlights(
        lengths[used],
        covariance[used, used] * np.outer(scale, scale),
        fit.acceleration,
        impacts,
        signal.sign * fit.stop,
        math.sqrt(found.covariance[0, 0]),
        float(len(found.index) - len(found.covariance)),
        _fitted(channel, found, instants[first], instants[end]),
        {
            "impacts": float(len(impacts)),
            "noise": found.noise,
            "acceleration": fit.acceleration,
            "side": signal.side,
            "flights from": "parabolas",
        },
        () if found.adequate else (_not_parabolas(found.excess),),
    )


def _not_parabolas(excess: float) -> Doubt:
    return Doubt(
        f"flights are no parabolas of one acceleration (each by itself takes {excess:.2g} times what chance takes "
        "from the residuals): drag, a spring, a force, or a contact of some length"
    )


def _fitted(channel: Channel, found: FittedBounces, start: float, end: float) -> Floats:
    """Return the fitted motion of the flights from start to end; NaN elsewhere."""
    fitted = np.full(len(channel.time), np.nan)
    fitted[found.index] = found.signal.sign * found.fit.fitted
    fitted[(channel.time < start) | (channel.time > end)] = np.nan
    return fitted


def _shrinking(lengths: Floats, covariance: Floats) -> int:
    """Return the number of flights before the first one that is longer, beyond its error, than its predecessor."""
    step = _differences(len(lengths))
    errors = np.sqrt(np.diag(step @ covariance @ step.T))
    longer = np.flatnonzero(lengths[1:] > _LONGER * lengths[:-1] + _LONGER_BEYOND * errors)
    return int(longer[0]) + 1 if longer.size else len(lengths)


def _differences(count: int) -> Floats:
    """Return the matrix of the differences of neighbours."""
    found: Floats = np.eye(count)[1:] - np.eye(count)[:-1]
    return found


def _between_kinks(channel: Channel, side: str | None, window: float | None) -> BounceFlights:
    """Return the flights between kinks, up to the first flight longer than its predecessor."""
    fastest = 2.0 * math.pi * _TURNS / float(channel.time[-1] - channel.time[0])
    cut = segment_channel(channel, fastest, Known(side=side), window)
    impacts = _falling(cut.impacts)
    lengths, covariance = _lengths(impacts, cut.signal.interval)
    levels = cut.signal.sign * np.array([impact.level for impact in impacts])
    return BounceFlights(
        lengths,
        covariance,
        _acceleration(cut, len(impacts)),
        np.array([impact.time for impact in impacts]),
        float(np.mean(levels)),
        float(np.std(levels, ddof=1)) / math.sqrt(len(levels)),
        len(levels) - 1.0,
        _parabolas(cut, len(impacts)),
        {
            "impacts": float(len(impacts)),
            "noise": cut.signal.noise,
            "window": cut.window,
            "side": cut.signal.side,
            "flights from": "kinks",
        },
    )


def _falling(impacts: tuple[Impact, ...]) -> list[Impact]:
    """Return the impacts up to the first flight longer than its predecessor."""
    lengths = np.diff([impact.time for impact in impacts])
    longer = np.flatnonzero(lengths[1:] > _LONGER * lengths[:-1])
    return list(impacts[: int(longer[0]) + 2] if longer.size else impacts)


def _lengths(impacts: list[Impact], interval: float) -> tuple[Floats, Floats]:
    """Return the flight times, s, and the covariance of their logarithms: neighbours share the error of an instant."""
    times = np.array([impact.time for impact in impacts])
    errors = np.hypot([impact.time_error for impact in impacts], _INSTANT * interval)
    lengths = np.diff(times)
    difference = _differences(len(times)) / lengths[:, None]
    return lengths, difference @ np.diag(errors**2) @ difference.T


def _acceleration(cut: Segmentation, impacts: int) -> float:
    """Return the acceleration towards the stop, unit of the channel per s^2: the median of the flights' parabolas."""
    signal = cut.signal
    bends = [
        2.0
        * np.polynomial.Polynomial.fit(signal.time[one.index], signal.values[one.index], 2).convert().coef[-1]
        for one in cut.flights[: impacts - 1]
        if one.usable
    ]
    return float(np.median(bends)) if bends else 0.0


def _parabolas(cut: Segmentation, impacts: int) -> Floats:
    """Return the motion of constant acceleration nearest to each flight; NaN elsewhere."""
    signal = cut.signal
    found = np.full(len(signal.values), np.nan)
    for flight in cut.flights[: impacts - 1]:
        if flight.usable:
            time, values = signal.time[flight.index], signal.sign * signal.values[flight.index]
            found[flight.index] = np.polynomial.Polynomial.fit(time, values, 2)(time)
    return found
