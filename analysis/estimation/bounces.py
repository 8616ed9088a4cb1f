"""Restitution from bounces without a force that oscillates: the ratio of successive flight times.

Under a constant force alone a body comes back as fast as it has left, and flies for 2 V / g: T[n+1] = r T[n].
"""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from scipy.stats import chi2
from scipy.stats import t as student

from vibroimpact.analysis.estimation.checks import check_displacement
from vibroimpact.analysis.estimation.estimates import Doubt, FittedMotion, ImpactEstimates, MethodEstimate
from vibroimpact.analysis.estimation.noise import Floats
from vibroimpact.analysis.estimation.segments import Impact, Segmentation, segment
from vibroimpact.analysis.recording import Channel, channel_of
from vibroimpact.fmus.errors import EstimationError

FLIGHT_TIMES = "flight_times"
# The fastest smooth motion is taken to turn so often in a record: windows are shortened until impacts appear.
_TURNS = 4.0
_FEWEST_FLIGHTS = 3
# Instants are known no better than this part of a sample, noise or not.
_INSTANT = 1e-4
# Ratios that differ so much by chance alone are as seldom as this.
_SELDOM = 1e-4
# A flight longer than the one before it by so much has had impacts in it that were not seen.
_LONGER = 1.02


def estimate_bounces(
    channel: Channel | xr.DataArray,
    *,
    side: str | None = None,
    window: float | None = None,
    confidence: float = 0.95,
) -> ImpactEstimates:
    """Estimate the restitution of a body that bounces under a constant force, such as its weight.

    Parameters
    ----------
    channel : Channel or xarray.DataArray
        Displacement, in any unit.
    side : str or None
        `upper` or `lower` stop; None: as the signal shows.
    window : float or None
        Of the one-sided fits at the impacts, s; None: from the noise.
    confidence : float
        Of the interval.

    Returns
    -------
    ImpactEstimates
        One method, `flight_times`; restitution and stop.

    Raises
    ------
    EstimationError
        No impacts were found, or fewer than three flights, each shorter than the one before.

    Examples
    --------
    >>> from vibroimpact.analysis.recording import TimeAxis
    >>> time, flights = np.arange(0.0, 3.0, 0.002), 0.8 ** np.arange(12)
    >>> starts = np.concatenate([[0.0], np.cumsum(flights)])
    >>> k = np.searchsorted(starts, time, side="right") - 1
    >>> height = (time - starts[k]) * (starts[k] + flights[k] - time)
    >>> ball = Channel("ball", height, "m", TimeAxis(time, 0.002), np.zeros(len(time), np.uint8))
    >>> round(estimate_bounces(ball).values["flight_times"]["restitution"].value, 4)
    0.8
    """
    channel = channel_of(channel)
    check_displacement(channel)
    cut = segment(
        channel.time,
        np.where(channel.good, channel.values, 0.0),
        channel.good,
        fastest=2.0 * math.pi * _TURNS / float(channel.time[-1] - channel.time[0]),
        side=side,
        window=window,
    )
    impacts = _falling(cut.impacts)
    if len(impacts) <= _FEWEST_FLIGHTS:
        raise EstimationError(
            f"bounces: expected at least {_FEWEST_FLIGHTS} flights, each shorter than the one before it, got "
            f"{len(impacts) - 1}. Give the part of the recording in which the body bounces freely, or, if a force "
            "drives it, its frequency."
        )
    restitution, excess = _ratio(impacts, cut.signal.interval, confidence)
    levels = cut.signal.sign * np.array([impact.level for impact in impacts])
    stop = _mean(levels, confidence)
    doubts: tuple[Doubt, ...] = ()
    if excess > 1.0:
        doubts = (
            Doubt(
                f"flight times do not shrink by one ratio (scatter {excess:.2g} times that of their errors): drag, a "
                "spring, a force, or a restitution that changes with the speed"
            ),
        )
    return ImpactEstimates(
        channel.name,
        channel.unit,
        {FLIGHT_TIMES: {"restitution": restitution, "stop_position": stop}},
        facts=_facts(cut, impacts),
        doubts=doubts,
        confidence=confidence,
        impact_times=np.array([impact.time for impact in impacts]),
        motion=FittedMotion(channel.time, channel.values, _parabolas(cut, len(impacts)), FLIGHT_TIMES),
    )


def _falling(impacts: tuple[Impact, ...]) -> list[Impact]:
    """Return the impacts up to where a flight is longer than the one before it."""
    lengths = np.diff([impact.time for impact in impacts])
    longer = np.flatnonzero(lengths[1:] > _LONGER * lengths[:-1])
    return list(impacts[: int(longer[0]) + 2] if longer.size else impacts)


def _ratio(impacts: list[Impact], interval: float, confidence: float) -> tuple[MethodEstimate, float]:
    """Return the ratio of successive flight times, and its scatter over what errors of the instants explain.

    Generalized least squares of log T[n] = log T[0] + n log r: neighbouring flights share the error of an instant.
    """
    times = np.array([impact.time for impact in impacts])
    errors = np.hypot([impact.time_error for impact in impacts], _INSTANT * interval)
    lengths = np.diff(times)
    difference = (np.eye(len(times))[1:] - np.eye(len(times))[:-1]) / lengths[:, None]
    covariance = difference @ np.diag(errors**2) @ difference.T
    root = np.linalg.cholesky(covariance)
    columns = np.linalg.solve(root, np.column_stack([np.ones(len(lengths)), np.arange(len(lengths))]))
    target = np.linalg.solve(root, np.log(lengths))
    solution = np.linalg.lstsq(columns, target, rcond=None)[0]
    freedom = len(lengths) - 2
    square = float(np.sum((target - columns @ solution) ** 2))
    widened = max(1.0, math.sqrt(square / freedom))
    error = widened * math.sqrt(float(np.linalg.inv(columns.T @ columns)[1, 1]))
    reach = float(student.ppf(0.5 + confidence / 2.0, freedom)) * error
    slope = float(solution[1])
    ratio = math.exp(slope)
    estimate = MethodEstimate(ratio, ratio * error, math.exp(slope - reach), math.exp(slope + reach))
    by_chance = square <= float(chi2.isf(_SELDOM, freedom))
    return estimate, 0.0 if by_chance else widened


def _mean(levels: Floats, confidence: float) -> MethodEstimate:
    middle, error = float(np.mean(levels)), float(np.std(levels, ddof=1)) / math.sqrt(len(levels))
    reach = float(student.ppf(0.5 + confidence / 2.0, len(levels) - 1)) * error
    return MethodEstimate(middle, error, middle - reach, middle + reach)


def _parabolas(cut: Segmentation, impacts: int) -> Floats:
    """Return the motion of constant acceleration that is nearest to each flight; NaN elsewhere."""
    signal = cut.signal
    found = np.full(len(signal.values), np.nan)
    for flight in cut.flights[: impacts - 1]:
        if flight.usable:
            time, values = signal.time[flight.index], signal.sign * signal.values[flight.index]
            found[flight.index] = np.polynomial.Polynomial.fit(time, values, 2)(time)
    return found


def _facts(cut: Segmentation, impacts: list[Impact]) -> dict[str, float | str]:
    """Return what the record is like."""
    return {
        "impacts": float(len(impacts)),
        "noise": cut.signal.noise,
        "window": cut.window,
        "side": "upper" if cut.signal.sign > 0.0 else "lower",
    }
