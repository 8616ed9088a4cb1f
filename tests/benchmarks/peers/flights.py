"""The loop of a careful user around an integrator with events: impacts, chatter, rest, release, compliant contacts.

Each event ends an integration; the loop changes the state, and the integration starts again. A flight that starts on
the stop gets a first step of half its ballistic length. A longer step, over the whole bounce, shows no change of sign.
A chatter ends at a slow rebound: the geometric sum gives the rest of it (equations.md 3.1, first order).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from peers.problems import Phase, Problem
from peers.ways import Clock, Found, observed
from vibroimpact.orchestrator.study.observation import Floats

SLOW, SLOWEST = 0.1, 1e-4
"""Rebound velocity below which the body rests, over the root of the tolerance: the geometric sum errs by about its
square. And its largest value, m/s: faster impacts are compared."""
HELD_STEP = 1.0 / 16.0
"""Largest step of a rest, over the period: a motion that only rests shows no zero at the release."""
LEAVING_STEP = 1e-3
"""First step after a release, over the period."""
MOST_IMPACTS = 100_000

Integrate = Callable[[Phase, float, Floats, float], tuple[float, Floats, bool]]
"""Takes the piece, the time, the state and a first step (0: free to choose). Returns the time and the state of its
event or of the end, and whether it was an event."""


def slow_rebound(tolerance: float) -> float:
    """Return the rebound velocity below which the body rests, m/s."""
    return min(SLOW * math.sqrt(tolerance), SLOWEST)


def follow(problem: Problem, integrate: Integrate, slow: float, clock: Clock) -> Found:
    """Simulate a problem by an integrator.

    Parameters
    ----------
    problem : Problem
    integrate : callable
    slow : float
        Rebound velocity below which the body rests, m/s.
    clock : Clock
    """
    impacts: list[tuple[float, float]] = []
    rests: list[float] = []
    t, y, phase, first = 0.0, problem.start.copy(), Phase.FREE, 0.0
    failure = ""
    while t < problem.end:
        clock.check()
        t, y, met = integrate(phase, t, y, first)
        if not met:
            break
        phase, y, first = _after(problem, phase, t, y, slow, impacts, rests)
        if len(impacts) > MOST_IMPACTS:
            failure = f"more than {MOST_IMPACTS} impacts"
            break
    return Found(observed(impacts, problem.contact(y), failure), np.array(rests))


def _after(
    problem: Problem,
    phase: Phase,
    t: float,
    y: Floats,
    slow: float,
    impacts: list[tuple[float, float]],
    rests: list[float],
) -> tuple[Phase, Floats, float]:
    """Return the next piece, the state after an event, and the next first step (0: free to choose)."""
    if phase == Phase.HELD:
        return Phase.FREE, y, LEAVING_STEP * problem.period
    if phase == Phase.PRESSED:
        return Phase.SLACK, y, 0.0
    if phase == Phase.SLACK:
        return Phase.FREE, y, 0.0
    speed = problem.contact(y)[1]
    impacts.append((t, speed))
    if not problem.is_rigid:
        return Phase.PRESSED, y, 0.0
    n, r = problem.modes, problem.stop.restitution
    y = y.copy()
    y[:n] += problem.direction * (problem.stop.position - problem.contact(y)[0])
    pull = problem.pull(t, y)
    if r * speed < slow and pull > 0.0:
        y[n:] -= problem.direction * speed
        rests.append(t + 2.0 * r * speed / (pull * (1.0 - r)))
        return Phase.HELD, y, 0.0
    y[n:] -= problem.direction * (1.0 + r) * speed
    return Phase.FREE, y, r * speed / pull if pull > 0.0 else 0.0


def slope_of(problem: Problem, phase: Phase) -> Callable[[float, Floats], list[float] | Floats]:
    """Return y' of a piece; one mode uses plain floats, which cost less than arrays of two."""
    piece, w, shift = problem.pieces[phase], problem.angular_frequency, problem.forcing_phase
    if problem.modes == 1:
        (_, _), (a, b) = piece.matrix.tolist()
        load, constant, cos = float(piece.load[1]), float(piece.constant[1]), math.cos

        def plain(t: float, y: Floats) -> list[float]:
            x, v = y
            return [v, a * x + b * v + load * cos(w * t + shift) + constant]

        return plain
    matrix, forcing, held = piece.matrix, piece.load, piece.constant

    def slope(t: float, y: Floats) -> Floats:
        found: Floats = matrix @ y + forcing * math.cos(w * t + shift) + held
        return found

    return slope


def event_of(problem: Problem, phase: Phase, clock: Clock) -> Callable[[float, Floats], float]:
    """Return a function that rises through zero at the end of a piece; it also checks the clock at each step."""
    piece, w, shift = problem.pieces[phase], problem.angular_frequency, problem.forcing_phase
    row, load, constant = piece.event_row, piece.event_load, piece.event_constant

    def event(t: float, y: Floats) -> float:
        clock.check()
        return float(row @ y) + load * math.cos(w * t + shift) + constant

    return event


def longest_step(problem: Problem, phase: Phase) -> float:
    """Return the largest step of a piece, s; infinite where any step is allowed."""
    return HELD_STEP * problem.period if phase == Phase.HELD else math.inf
