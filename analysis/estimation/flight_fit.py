"""Velocities at the impacts, restitution and stop: the exact flow fitted to each flight by linear least squares.

With damping, natural frequency and forcing given, a flight is linear in its state (x0, v0) at its start:
y = y0 + C x0 + S v0 + forced response. The states at both ends give the speed of approach V and the velocity after the
impact, -r V, of flights that follow each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.analysis.estimation.noise import Floats
from vibroimpact.analysis.estimation.physics import Parameters
from vibroimpact.analysis.estimation.segments import Flight, Signal
from vibroimpact.fmus.core import motion

# Steps of the numerical derivatives, relative to the size of what is varied.
_STEP = 1e-5


@dataclass(frozen=True, slots=True)
class FittedFlight:
    """A flight as the exact flow has it.

    Attributes
    ----------
    flight : Flight
    state : ndarray, shape (2,)
        Displacement from the offset and velocity at the start.
    gain : ndarray, shape (2, sample)
        The state's least-squares weights of the samples.
    to_end : ndarray, shape (2, 3)
        End state = to_end[:, :2] @ state + to_end[:, 2].
    rests : ndarray, shape (sample,)
        Samples minus fit.
    """

    flight: Flight
    state: Floats
    gain: Floats
    to_end: Floats
    rests: Floats

    @property
    def end_state(self) -> Floats:
        """State at the end."""
        end: Floats = self.to_end[:, :2] @ self.state + self.to_end[:, 2]
        return end


def fit_flight(signal: Signal, flight: Flight, parameters: Parameters) -> FittedFlight:
    """Fit the exact flow to one flight, with all parameters given."""
    basis, forced, to_end = flow_of(signal.time[flight.index], flight, parameters)
    samples = signal.values[flight.index] - parameters.offset
    gain = np.asarray(np.linalg.pinv(basis), dtype=np.float64)
    state: Floats = gain @ (samples - forced)
    return FittedFlight(flight, state, gain, to_end, samples - forced - basis @ state)


def flow_of(time: Floats, flight: Flight, parameters: Parameters) -> tuple[Floats, Floats, Floats]:
    """Return the flow's displacements for unit start states, the forced one, and the map to the end's state."""
    instants = np.append(time - flight.start, flight.duration)
    forced_one = parameters.oscillator()
    free_one = replace(forced_one, amplitude=0.0)
    # a body without force needs no phase, and none with a force of another frequency
    one, one_speed = motion(free_one, (1.0, 0.0), instants)
    other, other_speed = motion(free_one, (0.0, 1.0), instants)
    forced, forced_speed = motion(forced_one, (0.0, 0.0), instants, phase=parameters.phase_at(flight.start))
    to_end = np.array(
        [[one[-1], other[-1], forced[-1]], [one_speed[-1], other_speed[-1], forced_speed[-1]]],
    )
    return np.column_stack([one[:-1], other[:-1]]), forced[:-1], to_end


@dataclass(frozen=True, slots=True)
class ImpactReading:
    """What the fitted flights say of the impacts.

    Attributes
    ----------
    restitution, impact_velocity, stop_position : float
        Restitution by least squares of the velocities after on those before; root mean square of V; mean level where
        flights meet (the given stop where it is known).
    periodic : bool
        There was no impact with a flight on both sides: P(1,1) was assumed.
    """

    restitution: float
    impact_velocity: float
    stop_position: float
    periodic: bool = False


def pairs_of(flights: Sequence[Flight]) -> list[tuple[int, int]]:
    """Return which flights meet at an impact; a single flight, taken as P(1,1), meets itself."""
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
) -> ImpactReading:
    """Return restitution, speed and stop from the states at both ends of the flights.

    Parameters
    ----------
    states, ends : ndarray, shape (flight, 2)
        At the start and the end of each flight, displacement from the offset.
    stop_position : float or None
        None: where the flights meet.
    interval : float
        An impact is within this time of where the flights were cut, s.
    """
    pairs = pairs_of(flights)
    periodic = pairs[0][0] == pairs[0][1]
    stop = stop_position
    if stop is None:
        # lines through both ends: where they meet
        levels = [_meeting_level(ends[one], states[other]) for one, other in pairs]
        if periodic:
            levels = [_level_one_period_on(ends[k], states[k], flights[k], parameters) for k, _ in pairs]
        stop = float(np.mean(levels)) + parameters.offset
    before = np.array([_at_level(ends[k], flights[k].end, stop, parameters, interval) for k, _ in pairs])
    after = np.array([_at_level(states[k], flights[k].start, stop, parameters, interval) for _, k in pairs])
    restitution = -float(before @ after) / float(before @ before)
    return ImpactReading(restitution, math.sqrt(float(np.mean(before**2))), stop, periodic)


def _meeting_level(end: Floats, start: Floats) -> float:
    shift = (end[0] - start[0]) / (start[1] - end[1])
    return float(end[0] + shift * end[1])


def _level_one_period_on(end: Floats, start: Floats, flight: Flight, p: Parameters) -> float:
    """Return where a P(1,q) flight meets its own start: q periods later, not where it was cut."""
    period = 2.0 * math.pi / p.angular_frequency
    whole = max(1, round(flight.duration / period)) * period
    return _meeting_level(end + (whole - flight.duration) * np.array([end[1], 0.0]), start)


def _at_level(state: Floats, time: float, stop: float, p: Parameters, interval: float) -> float:
    """Return the velocity where the motion through `state` meets the stop."""
    shift = float(np.clip((stop - p.offset - state[0]) / state[1], -interval, interval))
    square = p.natural_frequency**2
    load = square * p.static_deflection * math.cos(p.phase_at(time))
    acceleration = load - 2.0 * p.damping_ratio * p.natural_frequency * state[1] - square * state[0]
    return float(state[1] + shift * acceleration)


@dataclass(frozen=True, slots=True)
class FlightFit:
    """All flights fitted.

    Attributes
    ----------
    reading : ImpactReading
    standard_errors : dict
        Of restitution, impact_velocity and stop_position, with the doubt of the parameters in them.
    fitted : list of FittedFlight
    noise : float
        Standard deviation of the noise that the rests show.
    """

    reading: ImpactReading
    standard_errors: dict[str, float]
    fitted: list[FittedFlight]
    noise: float


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

    Parameters
    ----------
    names : sequence of str
        The parameters that were estimated from the same samples ...
    influence : sequence of ndarray, shape (name, sample)
        ... and how: their change for a change of the samples of each flight.
    """
    fitted = [fit_flight(signal, flight, parameters) for flight in flights]
    states = np.array([one.state for one in fitted])
    maps = np.array([one.to_end for one in fitted])

    def read(states: Floats, maps: Floats, parameters: Parameters) -> Floats:
        ends = np.einsum("jab,jb->ja", maps[:, :, :2], states) + maps[:, :, 2]
        reading = read_impacts(states, ends, flights, parameters, stop_position, 2 * signal.interval)
        return np.array([getattr(reading, name) for name in _READ])

    ends = np.array([one.end_state for one in fitted])
    reading = read_impacts(states, ends, flights, parameters, stop_position, 2 * signal.interval)
    count = sum(len(one.rests) for one in fitted)
    noise = math.sqrt(
        sum(float(one.rests @ one.rests) for one in fitted) / (count - 2 * len(fitted) - len(names))
    )
    by_state = _derivative(lambda x: read(x.reshape(states.shape), maps, parameters), states.ravel())

    def of_parameters(values: Floats) -> Floats:
        changed = replace(parameters, **dict(zip(names, (float(x) for x in values), strict=True)))
        again = [fit_flight(signal, flight, changed) for flight in flights]
        return read(np.array([one.state for one in again]), np.array([one.to_end for one in again]), changed)

    by_name = _derivative(of_parameters, np.array([getattr(parameters, name) for name in names]))
    variance = np.zeros(len(_READ))
    for j, one in enumerate(fitted):
        weights = by_state[:, 2 * j : 2 * j + 2] @ one.gain
        if names:
            weights = weights + by_name @ influence[j]
        variance += np.sum(weights**2, axis=1)
    errors = dict(zip(_READ, (noise * np.sqrt(variance)).tolist(), strict=True))
    return FlightFit(reading, errors, fitted, noise)


def _derivative(function: Callable[[Floats], Floats], at: Floats) -> Floats:
    """Return central differences, shape (value, argument)."""
    if len(at) == 0:
        return np.zeros((len(_READ), 0))
    columns = []
    largest = float(np.max(np.abs(at), initial=0.0))
    for k in range(len(at)):
        step = np.zeros(len(at))
        step[k] = _STEP * (abs(at[k]) or largest or 1.0)
        columns.append((function(at + step) - function(at - step)) / (2.0 * step[k]))
    return np.array(columns).T
