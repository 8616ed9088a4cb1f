"""Fit all flights of a bouncing body at once: parabolas of one acceleration g that meet at one stop.

In the coordinate of an upper stop, a flight from a to b is y = stop - g/2 (t - a)(b - t). The next flight starts at b.
The unknowns are the stop, g, and the instants. A flight recorded in part has an instant outside the record, where its
parabola passes the stop. So its length T still gives the speed of the body on arrival, g T / 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.estimation.parabolas import FEWEST_IN_PIECE, Piece, Points, cuts, points_of
from vibroimpact.analysis.estimation.physics import Floats
from vibroimpact.analysis.estimation.signals import Signal

# Probability of a larger deviation by chance alone, below which a flight does not follow the others' parabolas.
_REJECTION = 1e-4
# Relative difference of two bends up to which they have one acceleration, even where their errors are smaller.
_SAME_BEND = 0.25
# Jump of the velocity over g (T1 + T2) below which a boundary is no impact: half of the 1/2 at a true impact.
_LEAST_JUMP = 0.25
# Number of pairs of neighbouring pieces, the longest first, from which a chain of flights is grown.
_MOST_SEEDS = 4
_MOST_STEPS, _HALVINGS = 40, 8
# Number of samples above which instants are not shifted by a sample: each side then has many samples.
_MOST_TO_RELOCATE = 2_000
# Relative change of the sum of squares below which a fit has converged.
_CONVERGED = 1e-12
# Residual, over the range, below which it is rounding: simulated flights follow their parabolas to the last digits.
_EXACT = 1e-9
# Degree of the polynomials of single flights, for comparison with the parabolas of one acceleration.
_DEGREE = 4


@dataclass(frozen=True, slots=True)
class BounceFit:
    """Parabolas of one acceleration between neighbouring instants."""

    instants: Floats
    """Starts and ends of flights, s, shape (instant,); the first and the last instant lie outside the samples."""
    stop: float
    acceleration: float
    """`stop` and `acceleration` in the coordinate of an upper stop: unit of the displacement, and this unit per s^2."""
    covariance: Floats
    """Covariance of stop, acceleration, instants, per variance of the noise; shape (2 + instant, 2 + instant)."""
    square: float
    """Sum of squared residuals."""
    fitted: Floats
    """Fitted displacements, shape (sample,)."""


@dataclass(frozen=True, slots=True)
class FittedBounces:
    """The flights of a record, and the quality of their fit by parabolas of one acceleration."""

    signal: Signal
    """The signal, mirrored for a lower stop."""
    index: NDArray[np.intp]
    """Places of the samples of the flights, shape (sample,)."""
    fit: BounceFit
    noise: float
    """Standard deviation of the residuals."""
    excess: float
    """Variance that polynomials of single flights remove from the residuals, over the noise variance; 1 by chance."""
    adequate: bool
    """Whether chance explains the excess."""

    @property
    def covariance(self) -> Floats:
        """Covariance of stop, acceleration and instants, widened where residuals are more than noise."""
        found: Floats = max(1.0, self.excess) * self.noise**2 * self.fit.covariance
        return found


def fitted_bounces(raw: Signal, side: str | None) -> FittedBounces | None:
    """Return the longest chain of flights in a record, all fitted together; None where there is none.

    The signal is not mirrored. `side` names an `upper` or `lower` stop; None: the flights decide.
    """
    plain = np.flatnonzero(raw.good)
    points = points_of(raw.time[plain], raw.values[plain])
    best: tuple[list[Piece], float] | None = None
    for pieces in cuts(points, raw.noise):
        for sign in (-1.0, 1.0) if side is None else (1.0 if side == "upper" else -1.0,):
            chain = _longest_chain(points, pieces, sign)
            if best is None or _reach(chain) > _reach(best[0]):
                best = (chain, sign)
    if best is None or len(best[0]) < 2:
        return None
    chain, sign = best
    signal = Signal(raw.time, sign * raw.values, raw.good, raw.interval, sign, raw.noise)
    # the end of the last piece may hold samples of flights too short to be seen
    half = chain[-1].first + (chain[-1].count + 1) // 2
    index = plain[chain[0].first * points.size : half * points.size]
    start = _start(points, chain, sign)
    fit = fit_bounces(signal.time[index], signal.values[index], *start)
    if fit is None:
        return None
    if len(index) <= _MOST_TO_RELOCATE:
        fit = _relocated(signal.time[index], signal.values[index], fit)
    return _judged(signal, index, fit)


def _reach(chain: Sequence[Piece]) -> tuple[int, int]:
    """Return the numbers of flights and points of a chain; larger is better."""
    return len(chain), sum(piece.count for piece in chain)


def _relocated(time: Floats, values: Floats, fit: BounceFit) -> BounceFit:
    """Return the best fit after shifting instants by a sample: each side of a sample has its own minimum."""
    step = float(np.median(np.diff(time)))
    for k in range(1, len(fit.instants) - 1):
        for shift in (-step, step):
            instants = fit.instants.copy()
            instants[k] += shift
            if np.all(np.diff(instants) > 0.0):
                trial = fit_bounces(time, values, instants, fit.stop, fit.acceleration)
                if trial is not None and trial.square < fit.square:
                    fit = trial
    return fit


def _judged(signal: Signal, index: NDArray[np.intp], fit: BounceFit) -> FittedBounces | None:
    """Return a fit with its noise, and its excess over polynomials of single flights; None without any freedom."""
    from scipy.special import fdtrc

    time, residual = signal.time[index], signal.values[index] - fit.fitted
    freedom = len(index) - len(fit.covariance)
    if freedom < 1:
        return None
    noise = math.sqrt(fit.square / freedom)
    least = _EXACT * signal.range
    places = np.searchsorted(time, fit.instants[1:-1])
    left, spent = 0.0, 0
    for since, rest in zip(np.split(time, places), np.split(residual, places), strict=True):
        degree = min(_DEGREE, len(since) - 1)
        if degree >= 0:
            abscissa = (since - since[0]) / max(float(np.ptp(since)), 1e-300)
            columns = np.polynomial.legendre.legvander(2.0 * abscissa - 1.0, degree)
            after = rest - columns @ np.linalg.lstsq(columns, rest, rcond=None)[0]
            left, spent = left + float(after @ after), spent + degree + 1
    more, over = spent - len(fit.covariance), len(index) - spent
    if noise < least or more < 1 or over < 1 or not left > 0.0:
        return FittedBounces(signal, index, fit, max(noise, signal.noise), 1.0, True)
    ratio = (fit.square - left) / more / (left / over)
    adequate = bool(fdtrc(more, over, ratio) > _REJECTION)
    return FittedBounces(signal, index, fit, noise, 1.0 if adequate else ratio, adequate)


def fit_bounces(
    time: Floats, values: Floats, instants: Floats, stop: float, acceleration: float
) -> BounceFit | None:
    """Fit stop, acceleration and instants by least squares (Gauss-Newton); None where flights vanish.

    Time is in s, shape (sample,); values are displacements with an upper stop. Instants (s), stop and acceleration are
    start values.
    """
    unknown = np.concatenate([[stop, acceleration], instants])
    fitted = _motion(time, unknown)
    square = float(np.sum((values - fitted) ** 2))
    for _ in range(_MOST_STEPS):
        normal, slope = _normal_equations(time, values - fitted, unknown)
        try:
            step = _solved(normal, slope)
        except np.linalg.LinAlgError:
            return None
        for _ in range(_HALVINGS):
            trial = unknown + step
            if np.all(np.diff(trial[2:]) > 0.0):
                trial_fitted = _motion(time, trial)
                smaller = float(np.sum((values - trial_fitted) ** 2))
                if smaller <= square:
                    break
            step = 0.5 * step
        else:
            break
        done = square - smaller <= _CONVERGED * square
        unknown, fitted, square = trial, trial_fitted, smaller
        if done:
            break
    if not unknown[1] > 0.0:
        return None
    normal, _ = _normal_equations(time, values - fitted, unknown)
    try:
        covariance = _solved(normal, np.eye(len(normal)))
    except np.linalg.LinAlgError:
        return None
    return BounceFit(unknown[2:], float(unknown[0]), float(unknown[1]), covariance, square, fitted)


def _solved(normal: Floats, aim: Floats) -> Floats:
    """Return the solution of normal equations, each unknown scaled to its own curvature."""
    curvature = np.diag(normal)
    if not np.all(curvature > 0.0):
        raise np.linalg.LinAlgError("an unknown that no sample depends on")
    scale = 1.0 / np.sqrt(curvature)
    solved = np.linalg.solve(normal * np.outer(scale, scale), (aim.T * scale).T)
    found: Floats = (solved.T * scale).T
    return found


def _motion(time: Floats, unknown: Floats) -> Floats:
    """Return the parabolas of the instants at the samples."""
    instants = unknown[2:]
    flight = np.searchsorted(instants[1:-1], time, side="right")
    found: Floats = unknown[0] - 0.5 * unknown[1] * (time - instants[flight]) * (instants[flight + 1] - time)
    return found


def _normal_equations(time: Floats, residual: Floats, unknown: Floats) -> tuple[Floats, Floats]:
    """Return the normal equations of a step: a sample depends on stop, acceleration, and both ends of its flight."""
    instants, half = unknown[2:], 0.5 * unknown[1]
    normal, slope = np.zeros((len(unknown), len(unknown))), np.zeros(len(unknown))
    places = [0, *np.searchsorted(time, instants[1:-1], side="left"), len(time)]
    for k in range(len(instants) - 1):
        part = slice(places[k], places[k + 1])
        since, until = time[part] - instants[k], instants[k + 1] - time[part]
        columns = np.column_stack([np.ones(len(since)), -0.5 * since * until, half * until, -half * since])
        own = np.array([0, 1, 2 + k, 3 + k])
        normal[np.ix_(own, own)] += columns.T @ columns
        slope[own] += columns.T @ residual[part]
    return normal, slope


def _longest_chain(points: Points, pieces: Sequence[Piece], sign: float) -> list[Piece]:
    """Return the longest chain of neighbouring pieces that are flights between impacts on one stop."""
    pairs = [k for k in range(len(pieces) - 1) if _is_impact(points, pieces[k], pieces[k + 1], sign)]
    pairs.sort(key=lambda k: -(pieces[k].count + pieces[k + 1].count))
    best: list[Piece] = []
    used: set[int] = set()
    for k in [k for k in pairs if pieces[k].count + pieces[k + 1].count >= 2 * FEWEST_IN_PIECE][:_MOST_SEEDS]:
        if k in used:
            continue
        first, end = _grown(points, pieces, k, sign)
        used.update(range(first, end - 1))
        if end - first > len(best):
            best = list(pieces[first:end])
    return best


def _grown(points: Points, pieces: Sequence[Piece], k: int, sign: float) -> tuple[int, int]:
    """Return the start and end of the chain around pieces k and k + 1: neighbours join while they follow it."""
    first, end = k, k + 2
    while end < len(pieces) and _joins(points, pieces[first : end + 1], True, sign):
        end += 1
    while first > 0 and _joins(points, pieces[first - 1 : end], False, sign):
        first -= 1
    return first, end


def _joins(points: Points, chain: Sequence[Piece], last: bool, sign: float) -> bool:
    """Tell whether the last (else the first) piece of a chain is a flight beyond an impact, and follows the others."""
    inner = chain[-2:] if last else chain[:2]
    return _is_impact(points, inner[0], inner[1], sign) and _follows(points, chain, last, sign)


def _is_impact(points: Points, one: Piece, other: Piece, sign: float) -> bool:
    """Tell whether two pieces have one acceleration, and the velocity between them jumps away from the stop."""
    bends = sign * one.bend, sign * other.bend
    if not min(bends) > 0.0:
        return False
    errors = [
        _bend_error(points, piece, one.square + other.square, one.count + other.count - 6)
        for piece in (one, other)
    ]
    if abs(bends[0] - bends[1]) > max(_SAME_BEND * max(bends), 4.0 * math.hypot(*errors)):
        return False
    time = points.time
    instant = 0.5 * float(time[one.end - 1] + time[other.first])
    jump = sign * (one.at(instant)[1] - other.at(instant)[1])
    length = float(time[other.end - 1] - time[one.first])
    return jump > _LEAST_JUMP * bends[int(other.count > one.count)] * length


def _bend_error(points: Points, piece: Piece, square: float, freedom: int) -> float:
    """Return the standard error of a bend: n even samples over a length L give 2 sqrt(180 / n) sigma / L^2."""
    length = float(points.time[piece.end - 1] - points.time[piece.first])
    return 2.0 * math.sqrt(180.0 / piece.count * square / max(freedom, 1)) / length**2


def _follows(points: Points, chain: Sequence[Piece], last: bool, sign: float) -> bool:
    """Tell whether the last (else the first) piece of a chain follows the parabolas of all its pieces."""
    from scipy.special import chdtri

    index = np.concatenate([np.arange(piece.first, piece.end) for piece in chain])
    time, values = points.time[index], sign * points.values[index]
    fit = fit_bounces(time, values, *_start(points, chain, sign))
    if fit is None:
        return False
    free = sum(piece.count - 3 for piece in chain)
    variance = sum(piece.square for piece in chain) / free + (_EXACT * float(np.ptp(points.values))) ** 2
    piece = chain[-1 if last else 0]
    part = slice(len(index) - piece.count, None) if last else slice(0, piece.count)
    square = float(np.sum((values[part] - fit.fitted[part]) ** 2))
    return square <= variance * float(chdtri(piece.count, _REJECTION)) * (1.0 + 3.0 / math.sqrt(free))


def _start(points: Points, chain: Sequence[Piece], sign: float) -> tuple[Floats, float, float]:
    """Return start values: instants, stop and acceleration, in the coordinate of an upper stop."""
    time = points.time
    inner = [0.5 * float(time[one.end - 1] + time[two.first]) for one, two in pairwise(chain)]
    sides = [piece.at(t)[0] for k, t in enumerate(inner) for piece in chain[k : k + 2]]
    stop = sign * float(np.mean(sides))
    weights = np.array([float(piece.count) for piece in chain])
    bends = np.array([sign * piece.bend for piece in chain])
    middle = np.argsort(bends)
    acceleration = float(bends[middle][np.searchsorted(np.cumsum(weights[middle]), 0.5 * np.sum(weights))])
    ends = [
        _outer(chain[0], sign, stop, acceleration, float(time[chain[0].first]), inner[0], -1.0),
        _outer(chain[-1], sign, stop, acceleration, float(time[chain[-1].end - 1]), inner[-1], 1.0),
    ]
    return np.array([ends[0], *inner, ends[1]]), stop, acceleration


def _outer(
    piece: Piece, sign: float, stop: float, acceleration: float, edge: float, impact: float, direction: float
) -> float:
    """Return the instant at which the parabola of the first or last flight passes the stop, away from its impact."""
    # the flight lasts 2 V / g from the impact on; an edge beyond this instant means a longer flight
    speed = abs(piece.at(impact)[1])
    return impact + direction * max(2.0 * speed / acceleration, abs(edge - impact))
