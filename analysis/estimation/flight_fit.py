"""Velocities at the impacts, restitution and stop: the exact flow fitted to each flight by linear least squares.

With given damping, natural frequency and forcing, a flight is linear in its state (x0, v0) at its start. The motion is
y = y0 + C x0 + S v0 + forced response. The states at both ends of consecutive flights give the speed of approach V
and the velocity after the impact, -r V.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.analysis.estimation.physics import Coordinates, Floats, Parameters, central_differences
from vibroimpact.analysis.estimation.segments import DOUBTFUL, FEWEST_IN_FLIGHT, Flight
from vibroimpact.analysis.estimation.signals import Signal
from vibroimpact.fmus.core import motion
from vibroimpact.fmus.errors import EstimationError

# Step of the numerical derivatives, relative to the argument.
_STEP = 1e-5
# Unit of the search over flights, relative to a coordinate, and the step of its derivatives in that unit.
_STEP_OF_SEARCH, _DIFFERENCE = 0.1, 1e-4
_MOST_STEPS, _MOST_HALVINGS = 10, 12
# Predicted decrease of chi squared in a step below which the search ends.
_SETTLED = 1e-3
# Residual, in ranges of the signal, assigned to a trial that is no oscillator.
_UNPHYSICAL_RESIDUAL = 1e3
# Number of Newton steps to an instant on motion of constant acceleration.
_NEWTON_STEPS = 4
# Largest shift of an end of a flight, over the duration of the flight.
_REACH = 0.1


@dataclass(frozen=True, slots=True)
class FittedFlight:
    """A flight of the exact flow."""

    flight: Flight
    state: Floats
    """Displacement from the offset, and velocity, at the start; shape (2,)."""
    gain: Floats
    """The state's least-squares weights of the samples, shape (2, sample)."""
    to_end: Floats
    """End state = to_end[:, :2] @ state + to_end[:, 2]."""
    residual: Floats
    """Samples minus fit, shape (sample,)."""

    @property
    def end_state(self) -> Floats:
        """State at the end."""
        end: Floats = self.to_end[:, :2] @ self.state + self.to_end[:, 2]
        return end


def fit_flight(signal: Signal, flight: Flight, parameters: Parameters) -> FittedFlight:
    """Fit the exact flow to one flight, with all parameters given."""
    basis, forced, to_end = flow_of(signal.time[flight.index], flight, parameters)
    samples = signal.values[flight.index] - parameters.offset
    orthogonal, triangle = np.linalg.qr(basis)
    gain: Floats = np.linalg.solve(triangle, orthogonal.T)
    state: Floats = gain @ (samples - forced)
    return FittedFlight(flight, state, gain, to_end, samples - forced - basis @ state)


@dataclass(frozen=True, slots=True)
class FlightSearch:
    """Parameters with which the exact flow is nearest to all flights, each with a free start state."""

    parameters: Parameters
    names: tuple[str, ...]
    """Names of the free parameters."""
    covariance: Floats
    influence: list[Floats]
    """Change of the parameters for a change of the samples of each flight, to first order; shape (name, sample)."""


def search_flights(
    signal: Signal, flights: Sequence[Flight], start: Parameters, names: Sequence[str]
) -> FlightSearch:
    """Return the least squares of all samples of the flights, near a start: maximum likelihood for white noise.

    The start must be near the answer, for example from the weak form; `names` are the free parameters.
    """
    coordinates = Coordinates(tuple(names), start)
    origin = coordinates.of(start)
    scale = _STEP_OF_SEARCH * (np.abs(origin) + 1e-3 * float(np.max(np.abs(origin))) + 1e-300)
    counts = [len(flight.index) for flight in flights]

    def residual(x: Floats) -> Floats:
        trial = coordinates.parameters(origin + scale * x)
        if trial is None or trial.damping_ratio < 0.0:
            # no oscillator; the large residual makes the search shorten its step
            return np.full(sum(counts), _UNPHYSICAL_RESIDUAL * signal.range)
        return np.concatenate([fit_flight(signal, flight, trial).residual for flight in flights])

    freedom = max(sum(counts) - 2 * len(flights) - len(names), 1)
    x, left, columns = _gauss_newton(residual, len(names), freedom)
    best = coordinates.parameters(origin + scale * x)
    if best is None:
        raise EstimationError("weak form: expected an oscillator that fits the flights, got none.")
    noise = math.sqrt(float(left @ left) / freedom)
    gain = np.linalg.inv(coordinates.derivative(best)) @ np.linalg.pinv(columns / scale)
    parts = np.split(-gain, np.cumsum(counts)[:-1], axis=1)
    return FlightSearch(best, tuple(names), noise**2 * gain @ gain.T, parts)


def _gauss_newton(
    function: Callable[[Floats], Floats], count: int, freedom: int
) -> tuple[Floats, Floats, Floats]:
    """Return the unknowns with the least squares, searched from 0, with their residual and derivatives."""
    x = np.zeros(count)
    left = function(x)
    columns = np.empty((len(left), count))
    for _ in range(_MOST_STEPS):
        for k in range(count):
            moved = x.copy()
            moved[k] += _DIFFERENCE
            columns[:, k] = (function(moved) - left) / _DIFFERENCE
        step = np.linalg.lstsq(columns, -left, rcond=1e-12)[0]
        square = float(left @ left)
        for _ in range(_MOST_HALVINGS):
            there = function(x + step)
            if float(there @ there) <= square:
                break
            step *= 0.5
        else:
            break
        x, left = x + step, there
        if float(np.sum((columns @ step) ** 2)) * freedom <= _SETTLED * square:
            break
    return x, left, columns


def flow_of(time: Floats, flight: Flight, parameters: Parameters) -> tuple[Floats, Floats, Floats]:
    """Return the flow's displacements for unit start states, the forced displacement, and the map to the end state."""
    instants = np.append(time - flight.start, flight.duration)
    forced_one = parameters.oscillator()
    free_one = replace(forced_one, amplitude=0.0)
    # a body without force needs neither phase nor angular frequency
    one, one_speed = motion(free_one, (1.0, 0.0), instants)
    other, other_speed = motion(free_one, (0.0, 1.0), instants)
    forced, forced_speed = motion(forced_one, (0.0, 0.0), instants, phase=parameters.phase_at(flight.start))
    to_end = np.array(
        [[one[-1], other[-1], forced[-1]], [one_speed[-1], other_speed[-1], forced_speed[-1]]],
    )
    return np.column_stack([one[:-1], other[:-1]]), forced[:-1], to_end


@dataclass(frozen=True, slots=True)
class ImpactReading:
    """Impact quantities from the fitted flights."""

    restitution: float
    """Restitution, by least squares of the velocities after impacts on the velocities before."""
    impact_velocity: float
    """Root mean square of V."""
    stop_position: float
    """Mean level where flights meet, or the given stop."""
    periodic: bool = False
    """Whether no impact had a flight on both sides, and P(1,1) was assumed."""


def pairs_of(flights: Sequence[Flight]) -> list[tuple[int, int]]:
    """Return the pairs of flights that meet at an impact; a single flight, taken as P(1,1), meets itself."""
    place = {flight.first: k for k, flight in enumerate(flights)}
    found = [(k, place[flight.first + 1]) for k, flight in enumerate(flights) if flight.first + 1 in place]
    return found or [(k, k) for k in range(len(flights))]


def read_impacts(
    states: Floats,
    ends: Floats,
    flights: Sequence[Flight],
    parameters: Parameters,
    stop_position: float | None,
    interval: float,
    speed_noise: Floats,
) -> ImpactReading:
    """Return restitution, speed and stop from the states at both ends of the flights.

    States have the displacement from the offset, shape (flight, 2). Without a stop position the stop is the level where
    flights meet. Each impact lies within `interval` (s) of the cut. `speed_noise` is the variance of the speed at the
    end of each flight: squares of speeds contain it, products do not.
    """
    pairs = pairs_of(flights)
    periodic = pairs[0][0] == pairs[0][1]
    one, other = np.array(pairs).T
    earlier = with_acceleration(ends[one], [flights[k].end for k in one], parameters)
    later = with_acceleration(states[other], [flights[k].start for k in other], parameters)
    stop = stop_position
    if stop is None:
        late = [parameters.short_of_periods(flights[k].duration) if periodic else 0.0 for k in one]
        stop = float(np.mean(_meeting_levels(earlier, later, np.array(late)))) + parameters.offset
    level = stop - parameters.offset
    before, after = (_after(side, _shifts_to(side, level, interval))[1] for side in (earlier, later))
    square = float(before @ before)
    excess = float(np.sum(speed_noise[one]))
    # noise as large as the speeds allows no correction
    square -= excess if excess < 0.5 * square else 0.0
    return ImpactReading(-float(before @ after) / square, math.sqrt(square / len(before)), stop, periodic)


def with_acceleration(states: Floats, times: Sequence[float] | Floats, p: Parameters) -> Floats:
    """Return displacement, velocity and acceleration of states at times, shape (state, 3)."""
    push = p.acceleration(states[:, 0], states[:, 1], p.angular_frequency * np.asarray(times))
    return np.column_stack([states, push])


def _after(side: Floats, shift: Floats) -> tuple[Floats, Floats]:
    """Return displacement and velocity a short time later."""
    place, speed, push = side.T
    return place + shift * (speed + 0.5 * shift * push), speed + shift * push


def _meeting_levels(earlier: Floats, later: Floats, late: Floats) -> Floats:
    """Return the levels where motion before and after impacts meets; the earlier motion is `late` s short (Newton)."""
    shift = np.zeros(len(earlier))
    for _ in range(_NEWTON_STEPS):
        (place, speed), (other, other_speed) = _after(earlier, late + shift), _after(later, shift)
        shift = shift + (place - other) / (other_speed - speed)
    return _after(earlier, late + shift)[0]


def _shifts_to(side: Floats, level: float, reach: Floats | float) -> Floats:
    """Return the shifts in time to where motion meets a level, at most `reach` (Newton)."""
    shift = np.zeros(len(side))
    for _ in range(_NEWTON_STEPS):
        place, speed = _after(side, shift)
        shift = np.clip(shift + (level - place) / speed, -reach, reach)
    return shift


def flights_to_level(
    signal: Signal, fitted: Sequence[FittedFlight], level: float, p: Parameters
) -> list[Flight]:
    """Return the flights from and to the instants at which their exact flow meets a level.

    All samples of a flight contribute to these instants. Instants of kinks come from few samples, and share their noise
    with the slopes there. The level is measured from the offset.
    """
    found = []
    for one, start, end in zip(fitted, *_instants_at(fitted, level, p), strict=True):
        times = signal.time[one.flight.index]
        found.append(replace(one.flight, start=min(start, float(times[0])), end=max(end, float(times[-1]))))
    return found


def _instants_at(
    fitted: Sequence[FittedFlight], level: float, p: Parameters
) -> tuple[list[float], list[float]]:
    """Return the instants at which the exact flow of flights leaves a level and meets it again, s."""
    starts, ends = (np.array([getattr(one.flight, name) for one in fitted]) for name in ("start", "end"))
    reach = _REACH * (ends - starts)
    first = _shifts_to(with_acceleration(np.array([one.state for one in fitted]), starts, p), level, reach)
    last = _shifts_to(with_acceleration(np.array([one.end_state for one in fitted]), ends, p), level, reach)
    return (starts + first).tolist(), (ends + last).tolist()


def cut_at_level(
    signal: Signal, fitted: Sequence[FittedFlight], level: float, p: Parameters, noise: float
) -> list[Flight]:
    """Return the flights with the samples between the instants at which their exact flow meets a level.

    The instant of a kink shares its noise with the samples next to it. A choice of samples by this instant would give
    them noise of nonzero mean. With few samples in a flight, the estimates were then off by more than their errors. The
    level is measured from the offset; `noise` is the standard deviation of the samples.
    """
    found = []
    for one, start, end in zip(fitted, *_instants_at(fitted, level, p), strict=True):
        weights = one.gain[0], one.to_end[0, :2] @ one.gain
        margins = [
            DOUBTFUL * noise * float(np.linalg.norm(row)) / max(abs(float(speed)), 1e-300)
            for row, speed in zip(weights, (one.state[1], one.end_state[1]), strict=True)
        ]
        first = int(np.searchsorted(signal.time, start + margins[0], side="right"))
        last = int(np.searchsorted(signal.time, end - margins[1], side="left"))
        index = np.arange(first, last)
        index = index[signal.good[index]]
        enough = len(index) >= FEWEST_IN_FLIGHT
        found.append(replace(one.flight, start=start, end=end, index=index) if enough else one.flight)
    return found


def _speed_noise(fitted: Sequence[FittedFlight], p: Parameters, noise: float) -> Floats:
    """Return the variance of the speed at which each flight meets the stop."""
    ends = np.array([one.end_state for one in fitted])
    sides = with_acceleration(ends, np.array([one.flight.end for one in fitted]), p)
    # a displacement further on reaches the stop earlier, where the speed is different
    weights = [
        (one.to_end[1, :2] - push / speed * one.to_end[0, :2]) @ one.gain
        for one, (_, speed, push) in zip(fitted, sides, strict=True)
    ]
    return noise**2 * np.array([float(row @ row) for row in weights])


@dataclass(frozen=True, slots=True)
class FlightFit:
    """The fit of all flights."""

    reading: ImpactReading
    standard_errors: dict[str, float]
    """Errors of restitution, impact_velocity and stop_position, with the uncertainty of the parameters included."""
    fitted: list[FittedFlight]
    noise: float
    """Standard deviation of the noise, from the residuals."""


_READ = ("restitution", "impact_velocity", "stop_position")


def fit_flights(
    signal: Signal,
    flights: Sequence[Flight],
    parameters: Parameters,
    stop_position: float | None,
    names: Sequence[str] = (),
    influence: Sequence[Floats] = (),
) -> FlightFit:
    """Fit all flights and read the impacts, with standard errors to first order in the noise.

    `names` are parameters estimated from the same samples; `influence` is their change for a change of the samples of
    each flight, shape (name, sample).
    """
    fitted = [fit_flight(signal, flight, parameters) for flight in flights]
    states = np.array([one.state for one in fitted])
    maps = np.array([one.to_end for one in fitted])

    freedom = sum(len(one.residual) - 2 for one in fitted) - len(names)
    noise = math.sqrt(sum(float(one.residual @ one.residual) for one in fitted) / freedom)
    speed_noise = _speed_noise(fitted, parameters, noise)

    def reading_of(states: Floats, maps: Floats, parameters: Parameters) -> ImpactReading:
        ends = np.einsum("jab,jb->ja", maps[:, :, :2], states) + maps[:, :, 2]
        reach = 2.0 * signal.interval
        return read_impacts(states, ends, flights, parameters, stop_position, reach, speed_noise)

    def read(states: Floats, maps: Floats, parameters: Parameters) -> Floats:
        reading = reading_of(states, maps, parameters)
        return np.array([getattr(reading, name) for name in _READ])

    def of_parameters(values: Floats) -> Floats:
        changed = parameters.with_values(names, values)
        again = [fit_flight(signal, flight, changed) for flight in flights]
        return read(np.array([one.state for one in again]), np.array([one.to_end for one in again]), changed)

    def derivative(function: Callable[[Floats], Floats], at: Floats) -> Floats:
        return central_differences(function, at, _STEP, float(np.max(np.abs(at))) or 1.0)

    by_state = derivative(lambda x: read(x.reshape(states.shape), maps, parameters), states.ravel())
    by_name = derivative(of_parameters, parameters.values_of(names)) if names else None
    variance = np.zeros(len(_READ))
    for j, one in enumerate(fitted):
        weights = by_state[:, 2 * j : 2 * j + 2] @ one.gain
        if by_name is not None:
            weights = weights + by_name @ influence[j]
        variance += np.sum(weights**2, axis=1)
    errors = dict(zip(_READ, (noise * np.sqrt(variance)).tolist(), strict=True))
    return FlightFit(reading_of(states, maps, parameters), errors, fitted, noise)
