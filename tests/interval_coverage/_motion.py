"""Motion against stops by piecewise exact flow, written only for these records: independent of the package.

Modes q_k with q_k'' + 2 z_k w_k q_k' + w_k^2 (q_k - s_k f) = p_k w_1^2 y_st cos(Omega t + psi), and y = sum p_k q_k.
f is the side of dry friction (-sign of y', for one mode only). At a stop the velocity V of y becomes -r(V) V, by an
impulse on all modes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

# Points per period of the fastest mode in the search for an event.
_POINTS = 80
# Impact speed over natural frequency times deflection, below which chatter has ended.
_AT_REST = 1e-6


@dataclass(frozen=True)
class Body:
    """An oscillator that hits stops.

    Attributes
    ----------
    natural, damping, shape : ndarray, shape (mode,)
        Angular frequencies (rad/s), damping ratios (below 1), and the part of each mode in y.
    deflection, frequency, phase : float
        Static deflection of the first mode, angular frequency and phase of the force.
    stops : tuple of (float, float)
        Position and side (1 upper, -1 lower).
    restitution : callable
        Function of the speed of approach.
    friction : float
        Dry friction over the stiffness; 0: none.
    """

    natural: np.ndarray
    damping: np.ndarray
    shape: np.ndarray
    deflection: float
    frequency: float
    phase: float
    stops: tuple[tuple[float, float], ...]
    restitution: Callable[[float], float]
    friction: float = 0.0


@dataclass(frozen=True)
class Impact:
    """An impact: instant, speed of approach, and side of the stop."""

    instant: float
    speed: float
    side: float


@dataclass
class _Flow:
    """The exact motion from one instant on."""

    body: Body
    start: float
    state: np.ndarray
    side: float
    factor: np.ndarray = field(init=False)
    steady: np.ndarray = field(init=False)
    rate: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        b = self.body
        decay, turn = b.damping * b.natural, b.natural * np.sqrt(1.0 - b.damping**2)
        self.rate = -decay + 1j * turn
        force = b.shape * b.natural[0] ** 2 * b.deflection
        self.steady = force / (b.natural**2 - b.frequency**2 + 2j * b.damping * b.natural * b.frequency)
        wave = self.steady * np.exp(1j * (b.frequency * self.start + b.phase))
        x = self.state[0] - wave.real - self.side * b.friction
        v = self.state[1] - (1j * b.frequency * wave).real
        self.factor = x - 1j * (v + decay * x) / turn

    def modes(self, time: np.ndarray) -> np.ndarray:
        """Return displacement and velocity of the modes, shape (2, mode, time)."""
        b, later = self.body, np.asarray(time) - self.start
        free = self.factor[:, None] * np.exp(np.multiply.outer(self.rate, later))
        forced = np.multiply.outer(self.steady, np.exp(1j * (b.frequency * np.asarray(time) + b.phase)))
        x = (free + forced).real + self.side * b.friction
        return np.stack([x, (self.rate[:, None] * free + 1j * b.frequency * forced).real])

    def at(self, time: float) -> np.ndarray:
        """Return the state of the modes at one instant, shape (2, mode)."""
        return self.modes(np.array([time]))[:, :, 0]

    def y(self, time: np.ndarray, order: int = 0) -> np.ndarray:
        return self.body.shape @ self.modes(time)[order]


def simulate(body: Body, state: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, list[Impact]]:
    """Return y at ascending instants, starting from the first, and the impacts.

    Parameters
    ----------
    body : Body
    state : ndarray, shape (2, mode)
        Displacement and velocity of the modes at the first instant.
    time : ndarray, shape (sample,)
    """
    found = np.empty(len(time))
    impacts: list[Impact] = []
    now, done, end = float(time[0]), 0, float(time[-1])
    side = _friction_side(float(body.shape @ state[1]))
    while done < len(time):
        flow = _Flow(body, now, state, side if body.friction else 0.0)
        event, stop = _next_event(flow, now, end)
        last = int(np.searchsorted(time, event, side="right")) if event < end else len(time)
        found[done:last] = flow.y(time[done:last])
        done, now, state = last, event, flow.at(event)
        if event >= end:
            break
        place = float(body.shape @ state[0])
        if stop is not None:
            speed = float(body.shape @ state[1])
            impacts.append(Impact(now, abs(speed), stop[1]))
            after = -body.restitution(abs(speed)) * speed
            state[1] += body.shape * (after - speed) / float(body.shape @ body.shape)
            side, place = _friction_side(after), stop[0]
            if abs(after) >= _AT_REST * float(body.natural[0]) * body.deflection:
                continue
        now, side = _release(body, place, stop, now, end)
        last = int(np.searchsorted(time, now, side="right")) if now < end else len(time)
        found[done:last] = place
        done, state = last, np.array([[place], [0.0]])
    return found, impacts


def _friction_side(speed: float) -> float:
    return -1.0 if speed > 0.0 else 1.0


def _next_event(flow: _Flow, now: float, end: float) -> tuple[float, tuple[float, float] | None]:
    """Return the next impact with its stop, or the next reversal of dry friction, or the end."""
    body = flow.body
    step = 2.0 * np.pi / max(float(np.max(body.natural)), body.frequency) / _POINTS
    first = now
    while first < end:
        grid = first + step * np.arange(_POINTS + 1)
        found = [
            (instant, stop)
            for stop in body.stops
            for instant in [_crossing(lambda t, s=stop: s[1] * (s[0] - flow.y(t)), grid, now)]
            if instant is not None
        ]
        if body.friction:
            instant = _crossing(lambda t: -flow.side * flow.y(t, 1), grid, now)
            found += [(instant, None)] if instant is not None else []
        if found:
            event = min(found, key=lambda one: one[0])
            return event if event[0] < end else (end, None)
        first = float(grid[-1])
    return end, None


def _crossing(gap: Callable[[np.ndarray], np.ndarray], grid: np.ndarray, now: float) -> float | None:
    """Return the first instant of a negative gap; a graze between two points of the grid is detected too."""
    value = gap(grid)
    if grid[0] == now:
        # it starts on the stop: the result is the time of its return
        grid = np.concatenate([[now + 1e-6 * (grid[1] - now), now + 1e-3 * (grid[1] - now)], grid[1:]])
        value = gap(grid)
    low = (value[1:-1] < value[:-2]) & (value[1:-1] < value[2:])
    for k in np.flatnonzero(low) + 1:
        bend = value[k - 1] - 2.0 * value[k] + value[k + 1]
        if value[k] >= 0.0 and value[k] - (value[k + 1] - value[k - 1]) ** 2 / (8.0 * bend) < 0.0:
            fine = np.linspace(grid[k - 1], grid[k + 1], 401)
            fine_value = gap(fine)
            if np.any(fine_value < 0.0):
                grid, value = fine, fine_value
                break
        if np.any(value[: k + 1] < 0.0):
            break
    below = np.flatnonzero(value < 0.0)
    if not below.size:
        return None
    k = int(below[0])
    return _zero(gap, float(grid[max(k - 1, 0)]), float(grid[k]))


def _zero(gap: Callable[[np.ndarray], np.ndarray], low: float, high: float) -> float:
    """Return the instant between two others at which a gap becomes negative."""

    def one(time: float) -> float:
        return float(gap(np.array([time]))[0])

    # an instant alone may be rounded otherwise than in a grid
    if one(low) <= 0.0:
        return low
    return high if one(high) >= 0.0 else float(brentq(one, low, high, xtol=1e-15, rtol=1e-14))


def _release(
    body: Body, place: float, stop: tuple[float, float] | None, now: float, end: float
) -> tuple[float, float]:
    """Return the time at which a resting body of one mode leaves (stop or dry friction), and friction's side then."""

    def push(time: np.ndarray) -> np.ndarray:
        return body.deflection * np.cos(body.frequency * time + body.phase) - place

    def held(time: np.ndarray) -> np.ndarray:
        force = push(time)
        if stop is None:
            return body.friction - np.abs(force)
        return stop[1] * force + body.friction

    def free(time: float) -> tuple[float, float]:
        return time, _friction_side(float(push(np.array([time]))[0]))

    if held(np.array([now]))[0] < 0.0:
        return free(now)
    grid = np.linspace(now, now + 2.0 * np.pi / body.frequency, 400)
    away = np.flatnonzero(held(grid) < 0.0)
    if not away.size:
        return end, 0.0
    k = int(away[0])
    return free(_zero(held, float(grid[k - 1]), float(grid[k])))
