"""The derivative-free weak form: damping, natural frequency and forcing from flights, without a derivative of data.

On one flight, with test functions w_k that vanish at both ends with all derivatives that matter,

    int y w_k'' - 2 zeta wn int y w_k' + wn^2 (int (y - y0) w_k - y_st int w_k cos(Omega t + psi)) = 0

holds for the exact motion, whatever the impacts at its ends. With samples y of noise sigma, the left sides have the
covariance sigma^2 G, with G = L L' and the weights L of the samples. The G-weighted least squares is the maximum of the
likelihood of the flights, so more test functions never hurt. Noise in the columns (errors in variables) biases the
plain linear least squares; it does not bias this one to first order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legder, legval

from vibroimpact.analysis.estimation.physics import Coordinates, Floats, Parameters
from vibroimpact.analysis.estimation.segments import Flight
from vibroimpact.analysis.estimation.signals import Signal
from vibroimpact.fmus.errors import EstimationError

#: Power of s (1 - s) in the test functions: high enough for sums of samples to be accurate integrals.
POWER = 5
# Test functions on each flight: the smallest number, and the number for each radian of the fastest motion ...
_FEWEST_FUNCTIONS, _FUNCTIONS_PER_RADIAN = 3, 1.0
# ... and at most one for this many samples.
_SAMPLES_PER_FUNCTION = 4
# Eigenvalue of G, relative to the largest, below which a test function is a sum of the others.
_DEPENDENT = 1e-8
# Singular value of the Jacobian, relative to the largest, below which the parameters are not separable.
_SINGULAR = 1e-9
# Probability of a larger misfit by noise alone, below which a flight does not follow the model.
_REJECTION = 1e-4
# Factor on the limit of the misfit, for the uncertainty of the noise variance.
_NOISE_MARGIN = 1.2
# Share of the flights dropped in a round, the worst, until all follow the model; smallest share that is kept.
_LEFT_OUT = 0.25
_FEWEST_KEPT = 0.2
_FUNCTIONS_OF_START = 3
# Parameters whose coordinates are the unknowns of the linear system, in its order.
_LINEAR = ("damping_ratio", "natural_frequency", "static_deflection", "phase", "offset")
# Natural frequencies, over the frequency of the force, from which the search starts.
_RATIOS_OF_START = tuple(np.geomspace(0.1, 2.5, 24).tolist())
_MOST_CLOCKS = 500
# Relative error of the sums of samples as integrals.
_EXACT = 1e-4


@dataclass(frozen=True, slots=True)
class WeightedFlight:
    """A flight with its test functions."""

    time: Floats
    values: Floats
    weights: Floats
    """Weights of the samples in the integrals with w, w' and w''; shape (3, function, sample)."""


def weighted(time: Floats, values: Floats, functions: int, power: int = POWER) -> WeightedFlight:
    """Return a flight with its test functions s^p (1-s)^p Legendre_k(2 s - 1), s from 0 to 1 over its samples.

    Integrals are trapezoidal sums, exact to the order of `power`, at least 3; time is in s.
    """
    length = float(time[-1] - time[0])
    s = (time - time[0]) / length
    weight = np.empty_like(time)
    weight[1:-1] = 0.5 * (time[2:] - time[:-2])
    weight[0] = weight[-1] = 0.0
    rows = _functions(s, functions, power) * (weight / length ** np.arange(3)[:, None])[:, None, :]
    return WeightedFlight(time, values, rows)


def _functions(s: Floats, functions: int, power: int) -> Floats:
    """Return s^p (1-s)^p Legendre_k(2 s - 1), scaled to one size, and two derivatives; shape (3, function, sample)."""
    basis = np.eye(functions)
    legendre = np.stack(
        [2.0**order * legval(2.0 * s - 1.0, legder(basis, order) if order else basis) for order in range(3)]
    )
    product = s * (1.0 - s)
    envelope = np.stack(
        [
            product**power,
            power * product ** (power - 1) * (1.0 - 2.0 * s),
            power * product ** (power - 2) * ((power - 1) * (1.0 - 2.0 * s) ** 2 - 2.0 * product),
        ]
    )
    size = 4.0**power * np.sqrt(2.0 * np.arange(functions) + 1.0)[:, None]
    found: Floats = size * np.stack(
        [
            envelope[0] * legendre[0],
            envelope[1] * legendre[0] + envelope[0] * legendre[1],
            envelope[2] * legendre[0] + 2.0 * envelope[1] * legendre[1] + envelope[0] * legendre[2],
        ]
    )
    return found


def weighted_flights(signal: Signal, flights: Sequence[Flight], fastest: float) -> list[WeightedFlight]:
    """Return the usable flights with their test functions, more of them on long and well-sampled flights."""
    found = []
    for flight in flights:
        if flight.usable:
            needed = _FEWEST_FUNCTIONS + math.ceil(_FUNCTIONS_PER_RADIAN * fastest * flight.duration)
            functions = max(2, min(needed, len(flight.index) // _SAMPLES_PER_FUNCTION))
            found.append(weighted(signal.time[flight.index], signal.values[flight.index], functions))
    return found


def linear_estimate(flights: Sequence[WeightedFlight], known: Parameters, free: Sequence[str]) -> Parameters:
    """Return the plain linear least squares of the weak form: the start of `weak_form`.

    `free` are some of damping_ratio, natural_frequency, static_deflection, phase, offset; all others are known.
    """
    columns, target = _linear_system(flights, known, free)
    scale = np.linalg.norm(columns, axis=0)
    if not np.all(scale > 0.0):
        raise EstimationError("weak form: expected motion that depends on all free parameters, got none.")
    solution = np.linalg.lstsq(columns / scale, target, rcond=None)[0] / scale
    return _from_linear(solution, known, free)


def _linear_system(
    flights: Sequence[WeightedFlight], known: Parameters, free: Sequence[str]
) -> tuple[Floats, Floats]:
    """Return the free columns of (2 zeta wn, wn^2, wn^2 y_st (cos psi, sin psi), wn^2 y0), and their target."""
    stiffness = known.natural_frequency**2
    drag = 2.0 * known.damping_ratio * known.natural_frequency
    wave_free = "static_deflection" in free or "phase" in free
    blocks, targets = [], []
    for whole in flights:
        # only the lowest functions: unweighted, the highest functions would count most
        flight = WeightedFlight(whole.time, whole.values, whole.weights[:, : _FUNCTIONS_OF_START + len(free)])
        plain, first, second = flight.weights @ flight.values
        angle = known.angular_frequency * flight.time
        waves = [flight.weights[0] @ np.cos(angle), -flight.weights[0] @ np.sin(angle)]
        wave = math.cos(known.phase) * waves[0] + math.sin(known.phase) * waves[1]
        one = flight.weights[0].sum(axis=1)
        elastic = plain - (0.0 if "offset" in free else known.offset * one)
        if not wave_free:
            elastic = elastic - known.static_deflection * wave
        columns, target = [], -second
        if "damping_ratio" in free:
            columns.append(-first)
        else:
            target = target + drag * first
        if "natural_frequency" in free:
            columns.append(elastic)
        else:
            target = target - stiffness * elastic
        if "phase" in free:
            columns.extend(-wave for wave in waves)
        elif wave_free:
            columns.append(-wave)
        if "offset" in free:
            columns.append(-one)
        blocks.append(np.column_stack(columns) if columns else np.empty((len(target), 0)))
        targets.append(target)
    return np.concatenate(blocks), np.concatenate(targets)


def _from_linear(solution: Floats, known: Parameters, free: Sequence[str]) -> Parameters:
    """Return parameters from the solution of the linear system, whose unknowns are their coordinates."""
    # a free phase has two columns, for amplitude and phase
    unknowns = {*free, "static_deflection"} if "phase" in free else set(free)
    names = [name for name in _LINEAR if name in unknowns]
    found = Coordinates(tuple(names), known).parameters(solution)
    if found is None:
        square = dict(zip(names, solution, strict=True)).get("natural_frequency", known.natural_frequency**2)
        raise EstimationError(
            f"weak form: expected a positive stiffness, got a natural frequency squared of {square:.4g} (rad/s)^2. "
            "The flights do not follow a spring: give the natural frequency, or look at the signal."
        )
    return found if "static_deflection" in free else replace(found, static_deflection=known.static_deflection)


def weak_form(
    flights: Sequence[WeightedFlight], start: Parameters, free: Sequence[str]
) -> tuple[Parameters, Floats]:
    """Return the G-weighted least squares of the weak form, and the mean square of each flight's whitened residuals.

    `start` also has the values of all other parameters. EstimationError: there are no flights, fewer equations than
    unknowns, or data that do not determine the unknowns.
    """
    from scipy.optimize import least_squares

    stacked = _Stacked(flights)
    if stacked.rows <= len(free):
        raise EstimationError(
            f"weak form: expected more than {len(free)} equations, got {stacked.rows} from {len(flights)} flights. "
            "Give a longer recording."
        )
    scale = _scales(start, free)
    origin = start.values_of(free)

    def residual(x: Floats) -> Floats:
        return stacked.whitened(start.with_values(free, origin + scale * x)).ravel()

    noise = max(float(np.linalg.norm(residual(np.zeros(len(free))))) / math.sqrt(stacked.rows), 1e-300)
    found: Any = least_squares(
        lambda x: residual(x) / noise, np.zeros(len(free)), method="lm", xtol=1e-13, ftol=1e-13, gtol=1e-13
    )
    sizes = np.linalg.svd(found.jac, compute_uv=False)
    if not sizes[-1] > _SINGULAR * sizes[0]:
        raise EstimationError(
            f"weak form: expected motion that separates {', '.join(free)}, got flights that do not. "
            "Hold one of them at a known value."
        )
    best = start.with_values(free, origin + scale * found.x)
    return best, stacked.misfit(best)


def robust_weak_form(
    flights: Sequence[WeightedFlight], start: Parameters, free: Sequence[str], noise: float
) -> tuple[Parameters, list[int]]:
    """Return the weak form over the flights that follow the model, and their places among all flights.

    A flight with a missed impact does not follow. The worst flights are left out until the misfit of all others is
    noise; then all flights are judged once more. `noise` is the standard deviation, from the samples alone.
    """
    kept = list(range(len(flights)))
    fewest = max(1, math.ceil(_FEWEST_KEPT * len(flights)))
    smallest = max(noise, _EXACT * float(np.max(np.abs(flights[0].values)))) ** 2
    limits = _misfit_limits(flights)

    def better(misfit: Floats) -> list[int]:
        """Return the flights to keep: flights within the limits, and at least the better share."""
        count = max(fewest, min(len(kept) - 1, math.ceil((1.0 - _LEFT_OUT) * len(kept))))
        good = set(np.argsort(misfit)[:count].tolist())
        good |= set(np.flatnonzero(misfit <= smallest * limits[kept]).tolist())
        return [k for place, k in enumerate(kept) if place in good]

    def fit(best: Parameters) -> tuple[Parameters, Floats]:
        chosen = [flights[k] for k in kept]
        return weak_form(chosen, _nearest_start(chosen, best, free), free)

    best = _nearest_start(flights, start, free, _RATIOS_OF_START)
    everything = _Stacked(flights)
    kept = better(everything.misfit(best))
    best, misfit = fit(best)
    while len(kept) > fewest and np.any(misfit > smallest * limits[kept]):
        kept = better(misfit)
        best, misfit = fit(best)
    typical = max(smallest, float(np.median(misfit)))
    again = np.flatnonzero(everything.misfit(best) <= typical * limits).tolist()
    if again and again != kept:
        kept = again
        best, _ = fit(best)
    return best, kept


def _misfit_limits(flights: Sequence[WeightedFlight]) -> Floats:
    """Return the largest mean square of whitened residuals from noise of unit variance, for each flight."""
    from scipy.stats import chi2

    ranks = np.array([flight.weights.shape[1] for flight in flights])
    limits: Floats = _NOISE_MARGIN * chi2.isf(_REJECTION, ranks) / ranks
    return limits


def _nearest_start(
    flights: Sequence[WeightedFlight], start: Parameters, free: Sequence[str], ratios: Sequence[float] = ()
) -> Parameters:
    """Return the start nearest to most flights: as given, linear, or linear at a held natural frequency.

    Noise biases the plain linear stiffness, with many samples in a period even below zero. `ratios` are natural
    frequencies to try, over the frequency of the force.
    """
    linear = [name for name in free if name != "angular_frequency"]
    if not linear:
        return start
    trials = [start]
    with suppress(EstimationError):
        trials.append(linear_estimate(flights, start, linear))
    others = [name for name in linear if name != "natural_frequency"]
    if len(others) < len(linear):
        held = [replace(start, natural_frequency=ratio * start.angular_frequency) for ratio in ratios]
        trials += [linear_estimate(flights, one, others) if others else one for one in held]
    stacked = _Stacked(flights)
    return min(trials, key=lambda one: float(np.median(stacked.misfit(one))))


def _scales(start: Parameters, free: Sequence[str]) -> Floats:
    """Return a size for each parameter, so that all unknowns of the search have one size."""
    size = {
        "damping_ratio": 0.1,
        "natural_frequency": 0.1 * start.natural_frequency,
        "static_deflection": 0.1 * abs(start.static_deflection) or 1.0,
        "phase": 0.1,
        "angular_frequency": 1e-3 * start.angular_frequency,
        "offset": 0.1 * abs(start.static_deflection) or 1.0,
    }
    return np.array([size[name] for name in free])


def _factors(p: Parameters) -> Floats:
    """Return the factors of the integrals with w, w', w''."""
    return np.array([p.natural_frequency**2, -2.0 * p.damping_ratio * p.natural_frequency, 1.0])


class _Stacked:
    """All flights in arrays of one shape, padded with zeros: a trial of parameters is a few array operations."""

    def __init__(self, flights: Sequence[WeightedFlight]) -> None:
        self.flights = list(flights)
        functions = max((flight.weights.shape[1] for flight in flights), default=0)
        samples = max((len(flight.time) for flight in flights), default=0)
        count = len(self.flights)
        self.weights = np.zeros((3, count, functions, samples))
        self.time, self.values = np.zeros((count, samples)), np.zeros((count, samples))
        self.pad = np.zeros((count, functions))
        for j, flight in enumerate(flights):
            k, n = flight.weights.shape[1:]
            self.weights[:, j, :k, :n] = flight.weights
            self.time[j, :n], self.values[j, :n] = flight.time, flight.values
            self.pad[j, k:] = 1.0
        self.ranks = functions - self.pad.sum(axis=1)
        self.rows = int(self.ranks.sum())
        # all products of weights for G, and the integrals of the samples
        self.products = np.einsum("ajkn,bjln->abjkl", self.weights, self.weights)
        self.integrals = np.einsum("ajkn,jn->ajk", self.weights, self.values)
        self.ones = self.weights[0].sum(axis=2)
        self.identity = np.eye(functions) * self.pad[:, :, None]

    def roots(self, p: Parameters) -> Floats:
        """Return the Cholesky factors of G, shape (flight, function, function)."""
        factors = _factors(p)
        gram = np.einsum("a,b,abjkl->jkl", factors, factors, self.products)
        largest = np.einsum("jkk->j", gram)[:, None, None]
        roots: Floats = np.linalg.cholesky(
            gram + self.identity * largest + _DEPENDENT * largest * np.eye(gram.shape[1])
        )
        return roots

    def whitened(self, p: Parameters) -> Floats:
        """Return the residuals, of unit covariance for unit noise, shape (flight, function)."""
        wave = p.static_deflection * np.cos(p.angular_frequency * self.time + p.phase)
        load = np.einsum("jkn,jn->jk", self.weights[0], wave) + p.offset * self.ones
        residual = np.einsum("a,ajk->jk", _factors(p), self.integrals) - p.natural_frequency**2 * load
        solved: Floats = np.linalg.solve(self.roots(p), residual[:, :, None])[:, :, 0]
        return solved

    def misfit(self, p: Parameters) -> Floats:
        """Return the mean square of the whitened residuals of each flight."""
        squares: Floats = np.sum(self.whitened(p) ** 2, axis=1) / self.ranks
        return squares


def with_own_clock(
    flights: Sequence[WeightedFlight], start: Parameters, free: Sequence[str], spread: float = 5e-3
) -> Parameters:
    """Return the start with the angular frequency that the flights fit best, scanned near its own.

    Over a long record a slightly wrong clock puts the force out of phase; steps are a quarter radian over the record.
    """
    length = max(float(flight.time[-1]) for flight in flights) - float(flights[0].time[0])
    steps = min(_MOST_CLOCKS, math.ceil(spread * start.angular_frequency * length / 0.25))
    trials = [
        replace(start, angular_frequency=start.angular_frequency * (1.0 + part))
        for part in (spread * np.linspace(-1.0, 1.0, 2 * steps + 1)).tolist()
    ]
    costs = []
    for trial in trials:
        columns, target = _linear_system(flights, trial, free)
        solution = np.linalg.lstsq(columns, target, rcond=None)[0] if columns.size else np.empty(0)
        costs.append(float(np.linalg.norm(target - columns @ solution)))
    return trials[int(np.argmin(costs))]
