"""What speaks against one oscillator, one stop and one restitution: each alternative tried as one more unknown.

The residual of a fit is regressed on what the alternative would add to it, beside all that is estimated: the size of
the alternative comes with a standard error, however alike it is to damping or to a force.
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
# Residual up to which a flight follows motion from before it, in units of the noise, or relative to the motion's size:
# parameters that are not exact lead astray through impacts that are not seen.
_FOLLOWED, _OF_SIZE = 1.5, 0.05
_POINTS = 200

Sized = tuple[float, float]
"""Size and standard error."""


def excess_of_trajectories(record: Prepared) -> float:
    """Return by how many standard errors of chance the trajectories leave more than the single flights do.

    A flight alone has a free state at its start; on a trajectory the impact before gives it. What that takes away is
    chi-squared while stop and restitution are the same at all impacts. NaN without a trajectory of several impacts.
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
    """Return how much the restitution of impacts at double the typical speed differs, with its standard error."""
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
    """Return the dry friction over the stiffness that the single flights show, with its standard error."""
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
    """Return the size of a column in the residual beside others, and its standard error; NaN where it is not seen."""
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
    """Return what dry friction of 1 (over the stiffness) adds to a flight, less what its start state takes up."""
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
            # answer to a force that begins: static, less free motion from there
            column[reached] += step * (1.0 - motion(free, (1.0, 0.0), later[reached] - begin)[0])
    basis = flow_of(time[flight.index], flight, p)[0]
    residual: Floats = column - basis @ (one.gain @ column)
    return residual


def unexplained_flights(record: Prepared) -> int:
    """Return how many of the flights that were left out the fitted motion does not go through either.

    Between weak impacts that were not seen, as of chatter, the fitted motion follows from the flight before.
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
    """Return the root mean square distance of a flight from the motion that goes on from one before it."""
    signal = record.signal
    again = fit_flight(signal, before.flight, p)
    place, state = deepest(signal, again, p)
    good = np.flatnonzero(signal.good)
    piece = Piece(good[(good >= place) & (good <= last)], state, 0)
    residual = residual_of(signal, piece, p)
    return float(np.sqrt(np.mean(residual[np.isin(piece.index, index)] ** 2)))
