"""The sets S and W of the impact map: impacts that lead to a graze next, and impacts that follow a graze (2.3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.orbits.normal_forms import one_mode
from vibroimpact.analysis.orbits.periodic import TURN
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody

STEPS = 256
"""Samples in 8 radians of a flight's fastest part: between two of them the velocity changes its sign at most once."""
LONGEST = 40
"""Forcing periods after which a flight counts as one that meets no stop."""
BISECTIONS = 60
JUMP = 0.5
"""Jump of a flight's length, in forcing periods, that ends a curve: a graze comes in between."""


@dataclass(frozen=True, eq=False)
class GrazingSets:
    """Both sets, along the phase of the graze; NaN without a flight, and between two pieces of a curve."""

    grazes: Floats
    """Phases at which an impact without speed is possible: the body leaves the stop after it, rad."""
    before_phase: Floats
    before_velocity: Floats
    """`before_phase` and `before_velocity`: S, impacts that lead to the graze next, rad and m/s."""
    after_phase: Floats
    after_velocity: Floats
    """`after_phase` and `after_velocity`: W, the impacts after the graze."""


@dataclass(frozen=True, eq=False)
class _Flight:
    """Free flights from grazes at several phases; times count from the graze, and may be negative."""

    body: ImpactingBody
    phases: Floats

    def at(self, time: Floats) -> tuple[Floats, Floats]:
        """Return height above the stop (m) and velocity (m/s) along its direction, shape of `time` (phase, instant)."""
        natural, decay, toward = one_mode(self.body)
        contact, w = self.body.contacts[0], self.body.angular_frequency
        stop = contact.direction * contact.position
        force, held = toward * float(self.body.force[0]), toward * float(self.body.held[0])
        response = force / complex(natural**2 - w**2, 2.0 * decay * w)
        angle = self.phases[:, None] + w * time
        steady = np.real(response * np.exp(1j * angle)) + held / natural**2
        steady_rate = np.real(1j * w * response * np.exp(1j * angle))
        first = self.phases[:, None]
        x = stop - np.real(response * np.exp(1j * first)) - held / natural**2
        v = -np.real(1j * w * response * np.exp(1j * first))
        root = np.sqrt(complex(decay**2 - natural**2))
        root = root if abs(root) > 1e-8 * natural else complex(1e-8 * natural)  # critical damping, to 1e-16
        rates = -decay + root, -decay - root
        one = (v - rates[1] * x) / (rates[0] - rates[1])
        other = x - one
        free = one * np.exp(rates[0] * time) + other * np.exp(rates[1] * time)
        free_rate = rates[0] * one * np.exp(rates[0] * time) + rates[1] * other * np.exp(rates[1] * time)
        return np.real(free) + steady - stop, np.real(free_rate) + steady_rate


def grazing_sets(body: ImpactingBody, points: int = 2000) -> GrazingSets:
    """Return S and W of a one-mode body.

    Parameters
    ----------
    body : ImpactingBody
    points : int
        Number of phases of the graze.

    Raises
    ------
    OrbitError
        The body has several modes, stops or sines, or a moving stop.
    """
    natural, decay, toward = one_mode(body)
    contact, w = body.contacts[0], body.angular_frequency
    phases = np.linspace(0.0, TURN, points, endpoint=False)
    stop = contact.direction * contact.position
    pull = toward * float(body.force[0]) * np.cos(phases) + toward * float(body.held[0]) - natural**2 * stop
    grazes = phases[pull < 0.0]
    if not grazes.size:
        return GrazingSets(*(np.empty(0) for _ in range(5)))
    # in the order of a curve: it starts where the body no longer presses on the stop
    start = int(np.argmax(np.diff(grazes, append=grazes[0] + TURN))) + 1
    grazes = np.roll(grazes, -start % grazes.size)
    fastest = max(natural, 2.0 * decay, w)
    # backward in time a damped body comes from infinity, with no stop on its way
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        after, after_velocity = _first_meeting(_Flight(body, grazes), 1.0, fastest)
        before, before_velocity = _first_meeting(_Flight(body, grazes), -1.0, fastest)
        # the flight that ends in the graze begins with the velocity -r V
        speeds = contact.speed_before(np.where(before_velocity < 0.0, -before_velocity, np.nan))
    speeds[~np.isfinite(speeds)] = np.nan
    for length, columns in ((after, (after_velocity,)), (before, (speeds,))):
        broken = np.abs(np.diff(length, prepend=length[0])) > JUMP * TURN / w
        for column in columns:
            column[broken] = np.nan
    return GrazingSets(
        grazes,
        np.where(np.isnan(speeds), np.nan, np.mod(grazes + w * before, TURN)),
        speeds,
        np.where(np.isnan(after_velocity), np.nan, np.mod(grazes + w * after, TURN)),
        after_velocity,
    )


def _first_meeting(flight: _Flight, sense: float, fastest: float) -> tuple[Floats, Floats]:
    """Return time and velocity of the first meeting with the stop after the graze (sense -1: the last before it).

    Heights are checked at their maxima: between two sign changes of the velocity they are monotonic.
    """
    count = flight.phases.size
    times, velocities = np.full(count, np.nan), np.full(count, np.nan)
    waiting = np.arange(count)
    step = sense * 8.0 / (STEPS * fastest)
    span = LONGEST * flight.body.period
    low = np.zeros(count)
    block = 128
    while waiting.size and abs(float(low[waiting].max() if sense > 0 else low[waiting].min())) < span:
        some = _Flight(flight.body, flight.phases[waiting])
        grid = low[waiting, None] + step * np.arange(block + 1)
        _, speed = some.at(grid)
        turns = (sense * speed[:, :-1] > 0.0) & (sense * speed[:, 1:] <= 0.0)
        turns[:, 0] &= low[waiting] != 0.0  # the graze itself
        rows, columns = np.nonzero(turns)
        of = _Flight(flight.body, some.phases[rows])
        tops = _root(of, grid[rows, columns], grid[rows, columns + 1], lambda x, v: sense * v)
        reaching = np.flatnonzero(of.at(tops[:, None])[0][:, 0] >= 0.0)
        hit, first = np.unique(rows[reaching], return_index=True)
        top = tops[reaching[first]]
        of = _Flight(flight.body, some.phases[hit])
        at = _root(of, _last_low(of, top, step), top, lambda x, v: -x)
        times[waiting[hit]] = at
        velocities[waiting[hit]] = of.at(at[:, None])[1][:, 0]
        low[waiting] += step * block
        waiting = waiting[np.isnan(times[waiting])]
    return times, velocities


def _last_low(flight: _Flight, top: Floats, step: float) -> Floats:
    """Return instants before the tops at which the body is below the stop."""
    at = top - step
    for _ in range(64 * STEPS):
        height, _ = flight.at(at[:, None])
        below = height[:, 0] < 0.0
        if below.all():
            break
        at = np.where(below, at, at - step)
    return at


def _root(flight: _Flight, low: Floats, high: Floats, of: object) -> Floats:
    """Return the sign change of a function that is > 0 at `low` and <= 0 at `high`."""
    assert callable(of)
    low, high = low.copy(), high.copy()
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        x, v = flight.at(middle[:, None])
        above = of(x[:, 0], v[:, 0]) > 0.0
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return 0.5 * (low + high)
