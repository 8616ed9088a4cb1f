"""Whole trajectories through impacts fitted to the samples: maximum likelihood for white noise.

The record is cut at the deepest points of some flights into pieces of several impacts. Each piece has its own start
state; all pieces share the parameters. Within a piece the exact flow is followed from contact to contact. Pieces are
as long as the motion allows: chaotic motion forgets its start after some impacts, periodic motion needs no cut.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.estimation.flight_fit import FittedFlight, fit_flight
from vibroimpact.analysis.estimation.physics import Coordinates, Floats, Parameters
from vibroimpact.analysis.estimation.segments import Flight, Segmentation
from vibroimpact.analysis.estimation.signals import Signal
from vibroimpact.fmus.core import motion, next_contact
from vibroimpact.fmus.errors import EstimationError

#: Numbers of impacts in a piece to try: the first number that follows the samples within their noise is used.
SPANS = (12, 6, 3, 1)
#: Largest number of impacts fitted at once.
MOST_IMPACTS = 60
# Residual, over the noise of the single flights, above which a fit is inadequate, and above which it is refused.
_ADEQUATE = 1.5
_REFUSED = 4.0
# Distance of the start from the samples, relative to the motion's size, above which no fit is tried.
_NEAR = 0.1
_STEP = 1e-7
# Time between contacts, relative to the natural period, below which chatter is left to the oscillator model.
_CHATTER = 1e-5
_FEWEST_IN_HEAD = 5
_MOST_TRIALS = 20
# Residual, in ranges of the signal, assigned to a trial that is no oscillator.
_UNPHYSICAL_RESIDUAL = 1e3
# Standard errors above the typical residual beyond which pieces are left out; largest share of pieces left out.
_BEYOND_CHANCE = 5.0
_MOST_LEFT_OUT = 0.34


@dataclass(frozen=True, slots=True)
class Piece:
    """Samples followed from one start state."""

    index: NDArray[np.intp]
    """Places of the good samples, shape (sample,)."""
    state: tuple[float, float]
    """Displacement from the offset, and velocity, at the first sample."""
    impacts: int
    """Number of impacts detected in the piece."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Result of the fit."""

    parameters: Parameters
    names: tuple[str, ...]
    """Names of the estimated parameters, in the order of `covariance`."""
    covariance: Floats
    noise: float
    """Standard deviation of the residual."""
    adequate: bool
    """Whether the residual is not much larger than the noise of the single flights."""
    pieces: tuple[Piece, ...]
    """Pieces with their fitted start states."""


def follow(
    signal: Signal, piece: Piece, parameters: Parameters, slope: tuple[float, float] = (0.0, 1.0)
) -> Floats:
    """Return the displacements of a piece on the exact flow, through all its impacts, at its samples.

    Parameters
    ----------
    slope : tuple of float
        Change of the restitution from a typical speed of approach to its double, and that speed.
    """
    time = signal.time[piece.index]
    body, stop = parameters.oscillator(), parameters.stop_position - parameters.offset
    found = np.empty(len(time))
    now, state, done = float(time[0]), (min(piece.state[0], stop), piece.state[1]), 0
    shortest = _CHATTER * 2.0 * math.pi / parameters.natural_frequency
    while done < len(time):
        phase = parameters.phase_at(now)
        contact = next_contact(body, state, stop, float(time[-1]) - now, phase=phase)
        if contact is not None and contact.time < shortest and state[0] == stop:
            rest = motion(
                body,
                state,
                time[done:] - now,
                position=stop,
                restitution=min(max(parameters.restitution, 0.0), 1.0),
                phase=phase,
            )
            found[done:] = rest[0]
            break
        until = len(time) if contact is None else int(np.searchsorted(time, now + contact.time, side="right"))
        if until > done:
            instants = np.maximum(time[done:until] - now, 0.0)
            found[done:until] = motion(body, state, instants, phase=phase)[0]
        if contact is None:
            break
        done, now = until, now + contact.time
        restitution = parameters.restitution + slope[0] * (contact.velocity / slope[1] - 1.0)
        state = (stop, -restitution * contact.velocity)
    return found + parameters.offset


def residual_of(signal: Signal, piece: Piece, parameters: Parameters) -> Floats:
    """Return the samples of a piece minus the exact flow."""
    residual: Floats = signal.values[piece.index] - follow(signal, piece, parameters)
    return residual


def pieces_of(
    segmentation: Segmentation, fitted: Sequence[FittedFlight], parameters: Parameters, span: int
) -> list[Piece]:
    """Cut runs of consecutive fitted flights at the deepest points of every `span`-th flight.

    A flight that was left out contains a missed impact: no piece continues through it.
    """
    pieces: list[Piece] = []
    for run in _runs(fitted):
        if sum(piece.impacts for piece in pieces) >= MOST_IMPACTS:
            break
        pieces.extend(_cut(segmentation, run, parameters, span))
    return pieces


def _runs(fitted: Sequence[FittedFlight]) -> list[list[FittedFlight]]:
    """Return the flights in groups of consecutive flights."""
    runs: list[list[FittedFlight]] = []
    for one in fitted:
        if not runs or one.flight.first != runs[-1][-1].flight.first + 1 or len(runs[-1]) >= MOST_IMPACTS:
            runs.append([])
        runs[-1].append(one)
    return runs


def _cut(
    segmentation: Segmentation, run: list[FittedFlight], parameters: Parameters, span: int
) -> list[Piece]:
    """Return the pieces of one run, with the motion before the first and after the last impact if recorded."""
    signal, impacts = segmentation.signal, segmentation.impacts
    head = _head(signal, impacts[0].time, parameters) if run[0].flight.first == 0 else None
    cuts = [head or _state_at(signal, run[0], parameters, int(run[0].flight.index[0]))]
    counts = [run[0].flight.first + (0 if head else 1)]
    for one in run:
        if one.flight.first + 1 - counts[-1] >= span:
            cuts.append(deepest(signal, one, parameters))
            counts.append(one.flight.first + 1)
    last = run[-1].flight
    end = int(last.index[-1]) + 1
    if last.first + 2 == len(impacts):
        # the tail is as long as a flight: a longer one may contain a missed impact
        length = float(np.median([one.flight.duration for one in run]))
        end = int(np.searchsorted(signal.time, last.end + length))
        counts.append(len(impacts))
    else:
        counts.append(last.first + 1)
    ends = [cut[0] for cut in cuts[1:]] + [end]
    good = np.flatnonzero(signal.good)
    return [
        Piece(good[(good >= first) & (good < stop)], state, after - before)
        for (first, state), stop, before, after in zip(cuts, ends, counts[:-1], counts[1:], strict=True)
        if np.count_nonzero((good >= first) & (good < stop)) >= _FEWEST_IN_HEAD
    ]


def _state_at(
    signal: Signal, one: FittedFlight, parameters: Parameters, place: int
) -> tuple[int, tuple[float, float]]:
    """Return a sample of a flight, and the fitted state there."""
    x, v = motion(
        parameters.oscillator(),
        (float(one.state[0]), float(one.state[1])),
        [float(signal.time[place]) - one.flight.start],
        phase=parameters.phase_at(one.flight.start),
    )
    return place, (float(x[0]), float(v[0]))


def deepest(signal: Signal, one: FittedFlight, parameters: Parameters) -> tuple[int, tuple[float, float]]:
    """Return the sample where a flight is furthest from its stop, and the fitted state there."""
    index = one.flight.index
    return _state_at(signal, one, parameters, int(index[np.argmin(signal.values[index] - one.residual)]))


def _head(
    signal: Signal, first_impact: float, parameters: Parameters
) -> tuple[int, tuple[float, float]] | None:
    """Return a start before the first impact; None where there are too few samples."""
    index = np.flatnonzero(signal.good & (signal.time < first_impact))
    if len(index) < _FEWEST_IN_HEAD:
        return None
    place = int(index[np.argmin(signal.values[index])])
    index = index[index >= place]
    if len(index) < _FEWEST_IN_HEAD or np.any(np.diff(index) > 1):
        return None
    head = Flight(float(signal.time[place]), first_impact, index, -1, True)
    state = fit_flight(signal, head, parameters).state
    return place, (float(state[0]), float(state[1]))


def fit_trajectory(
    segmentation: Segmentation,
    fitted: Sequence[FittedFlight],
    start: Parameters,
    free: Sequence[str],
    noise: float,
) -> Trajectory:
    """Fit the free parameters and start states to all samples; raise EstimationError if no pieces follow the model.

    `fitted` flights give the start states, `start` the start values and the held values. The fit is judged by `noise`,
    the noise of single flights.
    """
    signal = segmentation.signal
    size = 0.5 * signal.range
    best: Trajectory | None = None
    tried: set[int] = set()
    for span in SPANS:
        pieces = pieces_of(segmentation, fitted, start, span)
        if len(pieces) in tried:
            continue
        tried.add(len(pieces))
        problem = PathProblem(signal, pieces, start, tuple(free), size)
        if span > SPANS[-1] and problem.distance() > _NEAR * size:
            continue
        trial = problem.solve(noise)
        outlying = _misfits(signal, trial)
        if outlying and len(outlying) <= _MOST_LEFT_OUT * len(pieces):
            kept = [piece for k, piece in enumerate(trial.pieces) if k not in outlying]
            trial = PathProblem(signal, kept, trial.parameters, tuple(free), size).solve(noise)
        if best is None or trial.noise < best.noise:
            best = trial
        if trial.adequate:
            return trial
    if best is None or best.noise > _REFUSED * noise + 1e-9 * size:
        residual = math.inf if best is None else best.noise
        raise EstimationError(
            f"trajectory: expected rests of the size of the noise ({noise:.3g}), got {residual:.3g}. The model of one "
            "oscillator with a constant restitution does not follow these impacts."
        )
    return best


def _scales(coordinates: Coordinates, size: float) -> list[float]:
    """Return the typical changes of linear coordinates, for motion of this size."""
    start = coordinates.held
    square = start.natural_frequency**2
    sizes = {
        "restitution": 0.1,
        "damping_ratio": 0.2 * start.natural_frequency,
        "natural_frequency": 0.2 * square,
        "angular_frequency": 1e-3 * start.angular_frequency,
        "phase": 0.1 * square * size if coordinates.both else 0.1,
        "stop_position": 0.1 * size,
    }
    return [sizes.get(name, 0.1 * square * size) for name in coordinates.names]


class PathProblem:
    """The least-squares problem: linear coordinates of the free parameters, then place and velocity of each piece.

    Changes are counted in shares of the size of the motion, in its unit. `start` has the start values and the held
    values.
    """

    def __init__(
        self,
        signal: Signal,
        pieces: list[Piece],
        start: Parameters,
        names: tuple[str, ...],
        size: float,
    ) -> None:
        self.signal, self.pieces, self.names = signal, pieces, names
        self.coordinates = Coordinates(names, start)
        speed = size * max(start.angular_frequency, start.natural_frequency)
        self.scale = np.concatenate(
            [_scales(self.coordinates, size), np.tile([0.1 * size, 0.1 * speed], len(pieces))]
        )
        states = [x for p in pieces for x in (p.state[0] + start.offset, p.state[1])]
        self.origin = np.concatenate([self.coordinates.of(start), states])
        self.rows = np.cumsum([0, *(len(piece.index) for piece in pieces)])

    def parameters(self, x: Floats) -> Parameters | None:
        """Return the parameters; None where they describe no oscillator."""
        values = self.origin + self.scale * x
        found = self.coordinates.parameters(values[: len(self.names)])
        return None if found is None or found.damping_ratio < 0.0 else found

    def piece(self, x: Floats, k: int, parameters: Parameters) -> Piece:
        """Return a piece with its start state from the unknowns."""
        first = len(self.names) + 2 * k
        place, speed = (self.origin + self.scale * x)[first : first + 2]
        return replace(self.pieces[k], state=(float(place) - parameters.offset, float(speed)))

    def residual(self, x: Floats) -> Floats:
        """Return samples minus trajectories of all pieces."""
        parameters = self.parameters(x)
        if parameters is None:
            # the large residual makes the search shorten its step
            return np.full(self.rows[-1], _UNPHYSICAL_RESIDUAL * float(np.ptp(self.signal.values)))
        pieces = [self.piece(x, k, parameters) for k in range(len(self.pieces))]
        return np.concatenate([residual_of(self.signal, piece, parameters) for piece in pieces])

    def distance(self) -> float:
        """Return the root mean square of the residual at the start."""
        return float(np.sqrt(np.mean(self.residual(np.zeros(len(self.origin))) ** 2)))

    def jacobian(self, x: Floats) -> Floats:
        """Return derivatives by differences; the start state of a piece moves only this piece."""
        jacobian = np.zeros((self.rows[-1], len(x)))
        base = self.residual(x)
        for j in range(len(x)):
            moved = x.copy()
            moved[j] += _STEP
            parameters = self.parameters(moved)
            if parameters is None:
                # the search does not cross the boundary of oscillator parameters
                continue
            shared = j < len(self.names)
            for k in range(len(self.pieces)) if shared else [(j - len(self.names)) // 2]:
                rows = slice(self.rows[k], self.rows[k + 1])
                there = residual_of(self.signal, self.piece(moved, k, parameters), parameters)
                jacobian[rows, j] = (there - base[rows]) / _STEP
        return jacobian

    def solve(self, noise: float) -> Trajectory:
        """Return the least-squares solution, searched from the start."""
        from scipy.optimize import least_squares

        unit = max(noise, 1e-300)
        found: Any = least_squares(
            lambda x: self.residual(x) / unit,
            np.zeros(len(self.origin)),
            jac=lambda x: self.jacobian(x) / unit,
            method="lm",
            xtol=1e-11,
            ftol=1e-9,
            gtol=1e-12,
            max_nfev=_MOST_TRIALS,
        )
        freedom = max(self.rows[-1] - len(self.origin), 1)
        sigma = math.sqrt(float(np.sum(self.residual(found.x) ** 2)) / freedom)
        best = self.parameters(found.x)
        if best is None:
            raise EstimationError("trajectory: expected an oscillator that fits the impacts, got none.")
        jacobian = self.jacobian(found.x)
        inverse = np.linalg.pinv(jacobian.T @ jacobian) * np.outer(self.scale, self.scale)
        count = len(self.names)
        to_parameters = np.linalg.inv(self.coordinates.derivative(best))
        covariance: Floats = sigma**2 * to_parameters @ inverse[:count, :count] @ to_parameters.T
        size = float(np.max(np.abs(self.signal.values[self.signal.good])))
        return Trajectory(
            best,
            self.names,
            covariance,
            sigma,
            sigma <= _ADEQUATE * noise + 1e-5 * size,
            tuple(self.piece(found.x, k, best) for k in range(len(self.pieces))),
        )


def _misfits(signal: Signal, trajectory: Trajectory) -> list[int]:
    """Return the pieces whose residuals exceed those of the typical piece by more than chance."""
    residuals = [residual_of(signal, piece, trajectory.parameters) for piece in trajectory.pieces]
    squares = np.array([float(np.mean(one**2)) for one in residuals])
    counts = np.array([len(one) for one in residuals])
    limit = float(np.median(squares)) * (1.0 + _BEYOND_CHANCE * np.sqrt(2.0 / counts))
    return np.flatnonzero(squares > limit).tolist()
