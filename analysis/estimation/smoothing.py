"""Velocities of flights by regression splines, one-sided at both ends, with windows for the motion and its noise.

Each flight has its own least-squares spline with knots one window apart. So no impact is smoothed over, and the only
end effect is the larger noise of one-sided derivatives. Values, slopes and integrals are linear or quadratic in the
samples; the known contribution of the noise to squares is subtracted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.estimation.physics import Floats
from vibroimpact.analysis.estimation.segments import Flight
from vibroimpact.analysis.estimation.signals import Signal
from vibroimpact.fmus.errors import EstimationError

_DEGREE = 5
_GAUSS_POINTS = 6
# Windows to try, in periods of the fastest motion.
_WINDOWS = (4.0, 2.0, 1.0, 0.75, 0.5, 0.35, 0.25, 0.18, 0.125, 0.09, 0.06)
_SAMPLES_PER_COEFFICIENT = 2.0
_FLIGHTS_TRIED = 5


@dataclass(frozen=True, slots=True)
class Smoother:
    """The linear maps from the samples of one flight to its spline."""

    flight: Flight
    gain: Floats
    """Map from samples to coefficients, shape (coefficient, sample)."""
    knots: Floats
    """Knots, s, from the start of the flight."""

    def row(self, time: Floats, order: int = 0) -> Floats:
        """Return the weights of the samples for the value, or a derivative, at times; shape (time, sample)."""
        from scipy.interpolate import BSpline

        count = len(self.knots) - _DEGREE - 1
        basis = BSpline(self.knots, np.eye(count), _DEGREE, extrapolate=True)
        part = basis(np.asarray(time) - self.flight.start, nu=order)
        weights: Floats = part @ self.gain
        return weights

    def integration(self, start: float, end: float) -> tuple[Floats, Floats]:
        """Return times and weights of an integral over a part of the flight, exact for the spline's square."""
        inner = np.unique(self.knots) + self.flight.start
        edges = np.concatenate([[start], inner[(inner > start) & (inner < end)], [end]])
        node, weight = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
        half = 0.5 * np.diff(edges)
        middle = 0.5 * (edges[1:] + edges[:-1])
        return (middle[:, None] + half[:, None] * node).ravel(), (half[:, None] * weight).ravel()


def smoother(signal: Signal, flight: Flight, window: float) -> Smoother:
    """Return the spline of a flight with knots about one window apart."""
    from scipy.interpolate import BSpline

    spans = max(1, round(flight.duration / window))
    inner = np.linspace(0.0, flight.duration, spans + 1)
    knots = np.concatenate([np.zeros(_DEGREE), inner, np.full(_DEGREE, flight.duration)])
    design = BSpline.design_matrix(signal.time[flight.index] - flight.start, knots, _DEGREE).toarray()
    return Smoother(flight, np.linalg.pinv(design), knots)


def choose_window(
    motion: Signal, flights: Sequence[Flight], fine: float, fastest: float, noise: float
) -> float:
    """Return the window (s) with the smallest mean square error of the slopes at the ends of flights.

    The noiseless motion shows the error of smoothing. A choice by the samples would suit their own noise, and no draw
    of other noise would show the effect on the answer. The `fine` window (s) leaves the motion unchanged; `fastest` is
    the highest angular frequency of the motion, rad/s; `noise` is the standard deviation. EstimationError: flights
    have too few samples for a spline.
    """
    tried = flights[:_FLIGHTS_TRIED]
    exact = [_end_slopes(smoother(motion, flight, fine)) @ motion.values[flight.index] for flight in tried]
    costs: dict[float, float] = {}
    for periods in _WINDOWS:
        window, cost = periods * 2.0 * math.pi / fastest, 0.0
        for flight, slopes in zip(tried, exact, strict=True):
            coefficients = max(1, round(flight.duration / window)) + _DEGREE
            if len(flight.index) < _SAMPLES_PER_COEFFICIENT * coefficients:
                break
            weights = _end_slopes(smoother(motion, flight, window))
            wrong = weights @ motion.values[flight.index] - slopes
            cost += float(np.sum(wrong**2) + noise**2 * np.sum(weights**2))
        else:
            costs[window] = cost
    if not costs:
        raise EstimationError(
            "energy balance: expected flights of at least 12 samples, got shorter ones. "
            "Use the weak form or the trajectory fit, or a higher sampling rate."
        )
    return min(costs, key=lambda window: costs[window])


def _end_slopes(one: Smoother) -> Floats:
    """Return the weights of the samples for the slopes at both ends of a flight, shape (2, sample)."""
    return one.row(np.array([one.flight.start, one.flight.end]), 1)
