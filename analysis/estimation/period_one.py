"""Natural frequency and stop from P(1,1) motion alone, as if free and undamped: start values (thesis eq. 2.35)."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.analysis.estimation.estimates import MethodEstimate
from vibroimpact.analysis.estimation.segments import Segmentation
from vibroimpact.fmus.errors import EstimationError

# Flights whose lengths differ by more than this part are not those of P(1,1).
_SAME_LENGTH = 0.05
_OTHER_LENGTHS = 0.2


def natural_frequency_of(stop_position: float, deepest: float, flight_time: float) -> float:
    """Return the natural angular frequency of free, undamped motion cut off by a stop, rad/s.

    wn = (2 pi / T) arccos(-a / x_m) / pi: a stop position, x_m > |a| deepest excursion, both from rest, T flight time
    (thesis eq. 2.35). For driven or damped motion it is biased, by several percent: a start value.

    Examples
    --------
    >>> round(natural_frequency_of(0.0, 1.0, 1.0), 12)  # half of each swing is missing
    3.14159265359
    """
    return 2.0 / flight_time * math.acos(max(-1.0, min(1.0, -stop_position / deepest)))


def stop_position_of(natural_frequency: float, deepest: float, flight_time: float) -> float:
    """Return the stop position from rest of the same motion, the natural frequency being known.

    Examples
    --------
    >>> abs(round(stop_position_of(3.141592653589793, 1.0, 1.0), 12))
    0.0
    """
    return -deepest * math.cos(0.5 * natural_frequency * flight_time)


def period_one(
    segmentation: Segmentation, natural_frequency: float, offset: float
) -> dict[str, MethodEstimate]:
    """Return both start values; the stop with the natural frequency and offset that the better methods found.

    Raises
    ------
    EstimationError
        The motion is not P(1,1), or its deepest point is not further from rest than the stop.
    """
    lengths = np.array([flight.duration for flight in segmentation.flights])
    typical = float(np.median(lengths))
    # a few impacts may not have been seen
    if np.mean(np.abs(lengths - typical) > _SAME_LENGTH * typical) > _OTHER_LENGTHS:
        raise EstimationError(
            f"period_one: expected flights of one length, got {lengths.min():.4g} to {lengths.max():.4g} s. "
            "Only P(1,1) motion gives these start values."
        )
    signal = segmentation.signal
    depths = [
        offset - float(np.min(signal.values[flight.index]))
        for flight in segmentation.flights
        if flight.usable
    ]
    depth, length, stop = (
        float(np.median(depths)),
        typical,
        segmentation.stop_position - offset,
    )
    if not depth > abs(stop):
        raise EstimationError(
            f"period_one: expected a deepest point further from rest than the stop, got {depth:.4g} and {stop:.4g}."
        )
    return {
        "natural_frequency": MethodEstimate(natural_frequency_of(stop, depth, length)),
        "stop_position": MethodEstimate(offset + stop_position_of(natural_frequency, depth, length)),
    }
