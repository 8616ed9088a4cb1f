"""Estimates from the instants of impact alone: bounces under a constant force, and start values of P(1,1) motion.

Under a constant force a body arrives as fast as it left, and flies for 2 V / g: T[n+1] = r T[n]. For P(1,1) motion,
natural frequency and stop follow as if it were free and undamped (thesis eq. 2.35).
"""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from vibroimpact.analysis.estimation.bounce_flights import FEWEST_FLIGHTS, BounceFlights, flights_of
from vibroimpact.analysis.estimation.estimates import (
    Doubt,
    FittedMotion,
    ImpactEstimates,
    MethodEstimate,
    RestitutionOfSpeed,
)
from vibroimpact.analysis.estimation.physics import Floats
from vibroimpact.analysis.estimation.segments import Segmentation
from vibroimpact.analysis.recording import Channel, channel_of
from vibroimpact.fmus.errors import EstimationError

FLIGHT_TIMES = "flight_times"
# Probability of a larger scatter of the ratios by chance alone, below which they are not one ratio.
_REJECTION = 1e-4
# Probability of the scatter about r(v) below which r(v) gets one more power of the speed's logarithm.
_TERM_PROBABILITY = 0.1
# Change of r(v) below which one ratio is given; largest share of the scatter about one ratio that r(v) may leave.
_SAME_RATIO, _CLEARER = 2e-3, 0.1
# Deviation from the median length, relative, above which a flight is not of P(1,1); largest share of such flights.
_SAME_LENGTH, _OTHER_LENGTHS = 0.05, 0.2


def estimate_bounces(
    channel: Channel | xr.DataArray,
    *,
    side: str | None = None,
    window: float | None = None,
    confidence: float = 0.95,
) -> ImpactEstimates:
    """Estimate the restitution of a body that bounces under a constant force, such as its weight.

    Flights are parabolas of one acceleration, fitted together. Where they are no parabolas, kinks cut the record.

    Parameters
    ----------
    channel : Channel or xarray.DataArray
        Displacement, in any unit.
    side : str or None
        `upper` or `lower` stop; None: the signal decides.
    window : float or None
        Window of one-sided fits at kinks, s; None: parabolas, otherwise kinks with a window from the noise.
    confidence : float
        Confidence of the interval.

    Returns
    -------
    ImpactEstimates
        One method, `flight_times`; restitution and stop. Where the restitution differs between speeds, `of_speed` has
        r(v) instead of a single number.

    Raises
    ------
    EstimationError
        No impacts were found, or fewer than three flights, each shorter than the one before; side or confidence is
        invalid.

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
    if side not in (None, "upper", "lower"):
        raise EstimationError(f"side: expected upper or lower, got {side!r}.")
    if not 0.0 < confidence < 1.0:
        raise EstimationError(f"confidence: expected 0 < confidence < 1, got {confidence!r}.")
    seen = flights_of(channel, side, window)
    count = len(seen.lengths)
    if count < FEWEST_FLIGHTS:
        raise EstimationError(
            f"bounces: expected at least {FEWEST_FLIGHTS} flights, each shorter than the one before it, got "
            f"{count}. Give the part of the recording in which the body bounces freely, or, if a force "
            "drives it, its frequency."
        )
    restitution, excess = _ratio(seen, confidence)
    values, of_speed = {"restitution": restitution, "stop_position": seen.stop(confidence)}, None
    doubts = seen.doubts
    remarks: tuple[str, ...] = ()
    scatter = excess
    if excess > 1.0:
        of_speed, scatter = _of_speed(seen, confidence)
    if of_speed is not None and float(np.ptp(of_speed.fitted)) > _SAME_RATIO and scatter < _CLEARER * excess:
        excess = scatter
        del values["restitution"]
        remarks += (
            f"{of_speed.words(channel.unit)}. Drag, a spring or a force changes flight times alike: r(v) counts what "
            "they do as loss at the impact.",
        )
    else:
        of_speed = None
    if excess > 1.0:
        doubts += (
            Doubt(
                f"flight times do not shrink by one ratio, nor by one that depends on the speed alone (scatter "
                f"{excess:.2g} times that of their errors): drag, a spring, or a force"
            ),
        )
    return ImpactEstimates(
        channel.name,
        channel.unit,
        {FLIGHT_TIMES: values},
        facts=seen.facts,
        doubts=doubts,
        remarks=remarks,
        confidence=confidence,
        impact_times=seen.impact_times,
        of_speed=of_speed,
        motion=FittedMotion(channel.time, channel.values, seen.fitted, FLIGHT_TIMES),
        kind="bounces",
    )


def _ratio(seen: BounceFlights, confidence: float) -> tuple[MethodEstimate, float]:
    """Return the ratio of successive flight times, and its scatter over the scatter from errors of the instants.

    Generalized least squares of log T[n] = log T[0] + n log r: neighbouring flights share the error of an instant.
    """
    from scipy.stats import t as student

    lengths, covariance = seen.lengths, seen.covariance
    columns = np.column_stack([np.ones(len(lengths)), np.arange(float(len(lengths)))])
    solution, found, square = _generalized(columns, np.log(lengths), covariance)
    freedom = len(lengths) - 2
    widened = max(1.0, math.sqrt(square / freedom))
    error = widened * math.sqrt(float(found[1, 1]))
    reach = float(student.ppf(0.5 + confidence / 2.0, freedom)) * error
    slope = float(solution[1])
    ratio = math.exp(slope)
    estimate = MethodEstimate(ratio, ratio * error, math.exp(slope - reach), math.exp(slope + reach))
    return estimate, 0.0 if _by_chance(square, freedom) else widened


def _generalized(columns: Floats, target: Floats, covariance: Floats) -> tuple[Floats, Floats, float]:
    """Return the generalized least-squares solution, its covariance, and the sum of squares in standard errors."""
    root = np.linalg.cholesky(covariance)
    scaled, aim = np.linalg.solve(root, columns), np.linalg.solve(root, target)
    solution: Floats = np.linalg.lstsq(scaled, aim, rcond=None)[0]
    uncertain: Floats = np.linalg.inv(scaled.T @ scaled)
    return solution, uncertain, float(np.sum((aim - scaled @ solution) ** 2))


def _by_chance(square: float, freedom: int, probability: float = _REJECTION) -> bool:
    from scipy.stats import chi2

    return square <= float(chi2.isf(probability, freedom))


def _of_speed(seen: BounceFlights, confidence: float) -> tuple[RestitutionOfSpeed | None, float]:
    """Return r(v), and its scatter over the scatter from errors of the instants; 0 where errors explain the scatter.

    The logarithm of the ratio of the flights before and after an impact is a polynomial in the logarithm of the speed.
    It is a line, or a parabola where a line is not enough; the effect of one more power widens the interval. v = g T /
    2, with the acceleration g of the flights' parabolas.
    """
    from scipy.stats import t as student

    lengths, covariance, gravity = seen.lengths, seen.covariance, seen.acceleration
    step = np.eye(len(lengths))[1:] - np.eye(len(lengths))[:-1]
    ratios, covariance = step @ np.log(lengths), step @ covariance @ step.T
    speeds = 0.5 * gravity * lengths[:-1]
    relative = np.log(speeds) - np.mean(np.log(speeds))
    found, excess = None, 1.0
    for degree in (1, 2):
        freedom = len(ratios) - degree - 1
        if freedom < 1 or not gravity > 0.0:
            break
        columns = np.vander(relative, degree + 1)
        solution, uncertain, square = _generalized(columns, ratios, covariance)
        widened = max(1.0, math.sqrt(square / freedom))
        error = widened * np.sqrt(np.einsum("ij,jk,ik->i", columns, uncertain, columns))
        reach = float(student.ppf(0.5 + confidence / 2.0, freedom)) * error
        level = columns @ solution
        if freedom > 1:
            # the next power shows the possible error in the form of r(v)
            columns = np.vander(relative, degree + 2)
            reach = reach + np.abs(columns @ _generalized(columns, ratios, covariance)[0] - level)
        found = RestitutionOfSpeed(
            speeds, np.exp(ratios), np.exp(level), np.exp(level - reach), np.exp(level + reach)
        )
        excess = 0.0 if _by_chance(square, freedom) else widened
        if _by_chance(square, freedom, _TERM_PROBABILITY):
            break
    return found, excess


def natural_frequency_of(stop_position: float, deepest: float, flight_time: float) -> float:
    """Return the natural angular frequency of free, undamped motion cut off by a stop, rad/s.

    wn = (2 pi / T) arccos(-a / x_m) / pi (thesis eq. 2.35). The stop position a and the deepest excursion x_m > |a| are
    measured from rest; T is the flight time. Driven or damped motion biases it by several percent: it is a start value.

    >>> round(natural_frequency_of(0.0, 1.0, 1.0), 12)  # half of each swing is missing
    3.14159265359
    """
    return 2.0 / flight_time * math.acos(max(-1.0, min(1.0, -stop_position / deepest)))


def stop_position_of(natural_frequency: float, deepest: float, flight_time: float) -> float:
    """Return the stop position from rest of the same motion, from its natural frequency.

    >>> abs(round(stop_position_of(3.141592653589793, 1.0, 1.0), 12))
    0.0
    """
    return -deepest * math.cos(0.5 * natural_frequency * flight_time)


def period_one(
    segmentation: Segmentation, natural_frequency: float, offset: float
) -> dict[str, MethodEstimate]:
    """Return both start values; the stop uses the natural frequency and offset of the better methods.

    EstimationError: the motion is not P(1,1), or its deepest point is not further from rest than the stop.
    """
    lengths = np.array([flight.duration for flight in segmentation.flights])
    typical = float(np.median(lengths))
    # a few impacts may have been missed
    if np.mean(np.abs(lengths - typical) > _SAME_LENGTH * typical) > _OTHER_LENGTHS:
        raise EstimationError(
            f"period_one: expected flights of one length, got {lengths.min():.4g} to {lengths.max():.4g} s. "
            "Only P(1,1) motion gives these start values."
        )
    signal, stop = segmentation.signal, segmentation.stop_position - offset
    depth = float(
        np.median([offset - np.min(signal.values[one.index]) for one in segmentation.flights if one.usable])
    )
    if not depth > abs(stop):
        raise EstimationError(
            f"period_one: expected a deepest point further from rest than the stop, got {depth:.4g} and {stop:.4g}."
        )
    return {
        "natural_frequency": MethodEstimate(natural_frequency_of(stop, depth, typical)),
        "stop_position": MethodEstimate(offset + stop_position_of(natural_frequency, depth, typical)),
    }
