"""Flights of a free mass between its bounces, under a turning load: mass, force and frequency 1, in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass

QUARTER = 0.5 * math.pi
"""Phase at which the load cos(t) changes sign."""
SERIES_BELOW = 0.5
"""Angle u, rad, below which u - sin u is summed as a series, as the difference would cancel."""
MOST_STEPS = 60
"""Most steps of Newton's method: six are usual, near a double root more."""
NOTHING_LEFT = 1e-18
"""Length of a flight over its phase, below which the bounces have come to rest."""


@dataclass(frozen=True, slots=True)
class Bounces:
    """Impacts of a mass on its stop, and their end."""

    phases: list[float]
    """Phases of the impacts, after the turn of the load."""
    speeds: list[float]
    rest: float
    """Phase at which infinitely many bounces have come to rest; NaN: the mass leaves before."""


def gained(load: float, slope: float, angle: float) -> tuple[float, float]:
    """Return the speed and the displacement that the load a cos(u) + b sin(u) gives a mass at rest."""
    versed = 2.0 * math.sin(0.5 * angle) ** 2
    if angle < SERIES_BELOW:
        rest, term = 0.0, angle
        for order in range(2, 20, 2):
            term *= -(angle**2) / (order * (order + 1))
            rest -= term
    else:
        rest = angle - math.sin(angle)
    return load * math.sin(angle) + slope * versed, load * versed + slope * rest


def flight(load: float, slope: float, rebound: float) -> tuple[float, float] | None:
    """Return length of a flight and speed at its end; None if the load lets the mass go.

    Newton's method converges from one side: displacement over time is convex, or concave, in the time.
    """
    if load <= 0.0:
        return None
    angle, change = 2.0 * rebound / load, math.inf
    for _ in range(MOST_STEPS):
        speed, way = gained(load, slope, angle)
        steepness = (speed - way / angle) / angle
        if steepness <= 0.0:
            return None
        change = (way / angle - rebound) / steepness
        angle -= change
        if abs(change) <= 1e-15 * angle:
            break
    return angle, gained(load, slope, angle)[0] - rebound


def bounces(phase: float, speed: float, restitution: float) -> Bounces:
    """Return the bounces that follow an impact at a phase after the turn, under the load |sin(phase)|.

    Before the turn the load falls, and phases are below 0.
    """
    phases, speeds = [phase], [speed]
    sign = math.copysign(1.0, phase)
    while (
        last := flight(sign * math.sin(phase), sign * math.cos(phase), restitution * speeds[-1])
    ) is not None:
        phase, speed = phase + last[0], last[1]
        phases.append(phase)
        speeds.append(speed)
        if last[0] <= NOTHING_LEFT * abs(phase):
            return Bounces(phases, speeds, phase)
    return Bounces(phases, speeds, math.nan)


def start_that_ends_at_the_turn(restitution: float, beside: float = 0.0) -> tuple[float, float]:
    """Return displacement and velocity at phase -pi/2 from which the bounces end exactly at the load's turn.

    `beside` is added to the velocity: the bounces then end earlier, or the mass leaves.

    Near the turn the load is linear, and the bounces are similar. Each is at q times the time before the turn, with
    q^2 times the speed, and r = q^2 (2 + q) / (1 + 2 q). They are followed backwards, where errors shrink.
    """
    from scipy.optimize import brentq

    q = brentq(lambda q: q * q * (2.0 + q) - restitution * (1.0 + 2.0 * q), 0.0, 1.0, xtol=1e-300, rtol=1e-15)
    before = 1e-8
    speed = (1.0 - q) * (1.0 + 2.0 * q) / (6.0 * q * q) * before**2
    while True:
        back = flight(math.sin(before), math.cos(before), speed)
        if back is None or before + back[0] >= QUARTER:
            break
        before, speed = before + back[0], back[1] / restitution
    slower, way = gained(math.sin(before), math.cos(before), QUARTER - before)
    return way - speed * (QUARTER - before), speed - slower + beside


def first_impact(
    displacement: float, velocity: float, load: float = 1.0, slope: float = 0.0
) -> tuple[float, float]:
    """Return the phase after the turn, and the speed, of the first impact of a mass that starts off its stop at 0.

    A load of cos(u) starts at phase -pi/2, a load of sin(u) at the turn. Newton's method converges from beyond the
    impact, where the displacement is convex.
    """
    time, change = QUARTER, math.inf
    for _ in range(MOST_STEPS):
        speed, way = gained(load, slope, time)
        change = (displacement + velocity * time + way) / (velocity + speed)
        time -= change
        if abs(change) <= 1e-15 * time:
            break
    return time - QUARTER * load, velocity + gained(load, slope, time)[0]


def released(phase: float, rebound: float, until: float) -> tuple[float, float]:
    """Return displacement and velocity of a mass that has left its stop for good, both below 0."""
    speed, way = gained(math.sin(-phase), -math.cos(phase), until - phase)
    return way - rebound * (until - phase), speed - rebound
