"""Tests of the model of one oscillator, one stop and one restitution: each alternative adds one unknown.

The residual of a fit is regressed on the alternative's contribution, together with all estimated unknowns. The size of
the alternative thus has a standard error, even if the alternative resembles damping or a force.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vibroimpact.analysis.estimation.flight_fit import FittedFlight, fit_flight, flow_of
from vibroimpact.analysis.estimation.physics import Floats, Parameters, central_differences
from vibroimpact.analysis.estimation.prepared import Prepared
from vibroimpact.analysis.estimation.trajectory import PathProblem, Piece, deepest, follow, residual_of
from vibroimpact.fmus.core import motion

_STEP = 1e-5
_SLOPE_STEP = 1e-6
# Largest residual of a flight that follows the motion before it, over the noise, and over the motion's size.
# Inexact parameters diverge through missed impacts.
_FOLLOWED, _OF_SIZE = 1.5, 0.05
_POINTS = 200

Sized = tuple[float, float]
"""Size and standard error."""


def excess_of_trajectories(record: Prepared) -> float:
    """Return the excess of the trajectories' residual over that of the single flights, in standard errors of chance.

    A single flight has a free start state; on a trajectory the impact before gives the start state. The loss of freedom
    is chi-squared if stop and restitution are the same at all impacts. NaN without a trajectory of several impacts.
    """
    found = record.trajectory
    if found is None or not record.fit.noise > 0.0:
        return math.nan
    signal = record.signal
    residual = np.full(len(signal.values), np.nan)
    for piece in found.pieces:
        residual[piece.index] = residual_of(signal, piece, found.parameters)
    both = [(residual[one.flight.index], one.residual) for one in record.fit.fitted]
    both = [pair for pair in both if np.all(np.isfinite(pair[0]))]
    freedom = 2 * (len(both) - len(found.pieces)) - sum(
        name in found.names for name in ("restitution", "stop_position")
    )
    if freedom < 1:
        return math.nan
    more = sum(float(one @ one - other @ other) for one, other in both) / record.fit.noise**2
    return (more - freedom) / math.sqrt(2.0 * freedom)


def slope_of_restitution(record: Prepared) -> Sized:
    """Return the change of the restitution when the typical impact speed doubles, with its standard error."""
    found = record.trajectory
    if found is None:
        return math.nan, math.nan
    signal, typical = record.signal, record.fit.reading.impact_velocity
    problem = PathProblem(signal, list(found.pieces), found.parameters, found.names, 1.0)
    origin = np.zeros(len(problem.origin))
    column = np.concatenate(
        [
            follow(signal, piece, found.parameters, (_SLOPE_STEP, typical))
            - follow(signal, piece, found.parameters)
            for piece in found.pieces
        ]
    )
    return _size_of(column / _SLOPE_STEP, problem.jacobian(origin), problem.residual(origin))


def dry_friction(record: Prepared) -> Sized:
    """Return the dry friction over the stiffness from the single flights, with its standard error."""
    p, fitted, signal = record.parameters, record.fit.fitted, record.signal

    def residual_with(values: Floats) -> Floats:
        changed = p.with_values(record.names, values)
        return np.concatenate([fit_flight(signal, one.flight, changed).residual for one in fitted])

    residual = np.concatenate([one.residual for one in fitted])
    column = np.concatenate([_friction_column(signal.time, one, p) for one in fitted])
    columns = np.empty((len(residual), 0))
    if record.names:
        found = central_differences(residual_with, p.values_of(record.names), _STEP)
        columns = np.ascontiguousarray(found)
    return _size_of(column, columns, residual)


def _size_of(column: Floats, others: Floats, residual: Floats) -> Sized:
    """Return the size of a column in the residual next to others, with standard error; NaN if it is not separable."""
    scale = np.linalg.norm(others, axis=0)
    basis = np.linalg.qr(others[:, scale > 0.0] / scale[scale > 0.0])[0]
    own, residual = (values - basis @ (basis.T @ values) for values in (column, residual))
    square = float(own @ own)
    if not square > 1e-12 * float(column @ column):
        return math.nan, math.nan
    size = float(own @ residual) / square
    residual = residual - size * own
    freedom = max(len(residual) - basis.shape[1] - 1, 1)
    return size, math.sqrt(float(residual @ residual) / freedom / square)


def _friction_column(time: Floats, one: FittedFlight, p: Parameters) -> Floats:
    """Return the effect of unit dry friction (over the stiffness) on a flight, without the part in its start state."""
    flight, body = one.flight, p.oscillator()
    state, phase = (float(one.state[0]), float(one.state[1])), p.phase_at(flight.start)
    grid = np.linspace(0.0, flight.duration, _POINTS)
    speed = motion(body, state, grid, phase=phase)[1]
    side = -np.sign(np.where(speed == 0.0, 1.0, speed))
    turns = np.flatnonzero(np.diff(side))
    starts = [0.0, *(0.5 * (grid[turns] + grid[turns + 1]))]
    steps = [side[0], *np.diff(side)[turns]]
    later = time[flight.index] - flight.start
    free = replace(body, amplitude=0.0)
    column = np.zeros(len(later))
    for begin, step in zip(starts, steps, strict=True):
        reached = later > begin
        if np.any(reached):
            # response to a force that begins: static deflection minus free motion from there
            column[reached] += step * (1.0 - motion(free, (1.0, 0.0), later[reached] - begin)[0])
    basis = flow_of(time[flight.index], flight, p)[0]
    residual: Floats = column - basis @ (one.gain @ column)
    return residual


def unexplained_flights(record: Prepared) -> int:
    """Return the number of left-out flights that the fitted motion does not follow either.

    Through weak impacts that were missed, as in chatter, the fitted motion continues from the flight before.
    """
    p = record.parameters if record.trajectory is None else record.trajectory.parameters
    signal, cut = record.signal, record.segmentation
    used = {one.flight.first: one for one in record.fit.fitted}
    limit = max(_FOLLOWED * record.fit.noise, 0.5 * _OF_SIZE * signal.range)
    missed, before = 0, None
    for flight in cut.flights:
        if flight.first in used:
            before = used[flight.first]
        elif flight.usable:
            missed += (
                before is None or _distance(record, before, int(flight.index[-1]), flight.index, p) > limit
            )
    return missed


def _distance(record: Prepared, before: FittedFlight, last: int, index: np.ndarray, p: Parameters) -> float:
    """Return the rms distance of a flight from the continued motion of an earlier flight."""
    signal = record.signal
    again = fit_flight(signal, before.flight, p)
    place, state = deepest(signal, again, p)
    good = np.flatnonzero(signal.good)
    piece = Piece(good[(good >= place) & (good <= last)], state, 0)
    residual = residual_of(signal, piece, p)
    return float(np.sqrt(np.mean(residual[np.isin(piece.index, index)] ** 2)))
