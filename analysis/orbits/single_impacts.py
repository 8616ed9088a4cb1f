"""All orbits with one impact in some periods: equations.md 4.3, 4.18."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.finding import find_orbit
from vibroimpact.analysis.orbits.periodic import (
    SAME,
    TURN,
    OrbitError,
    PeriodicOrbit,
    evaluated,
    least_speed,
    refuse_end,
)
from vibroimpact.analysis.orbits.trigonometric import FallingDistance, SumOfSines
from vibroimpact.analysis.orbits.yielding_stops.motion import yielding_motion
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody

GUESSED = 1e-3
"""Difference of a guess from a known orbit, rad and over the size of the state, below which it leads to that orbit."""


def closed_form(body: ImpactingBody, periods: int = 1, contact: int = 0) -> tuple[PeriodicOrbit, ...]:
    """Return all orbits P(1,q) of a contact, physical or not, the fastest first: equations.md 4.3, any number of modes.

    The distance from the stop at the impact is a sum of sines of the phase. One sine has at most two zeros. All zeros
    of several sines are found, also where restitution falls with speed.

    Raises
    ------
    OrbitError
        An undamped mode gives infinitely many orbits.
    """
    if body.yields:
        return _single_contacts(body, periods, contact)
    hit = np.array([contact], dtype=np.int32)
    is_linear = body.has_one_sine and not body.contacts[contact].yield_velocity > 0.0
    phases = _phases_of_one_sine if is_linear else _phases_of_sines
    orbits = []
    for phase in phases(body, hit, periods):
        velocity = evaluated(body, hit, np.array([phase]), periods).velocities
        if velocity[0] > least_speed(body):
            orbits.append(PeriodicOrbit(body, periods, np.array([phase]), hit, velocity))
    return tuple(sorted(orbits, key=lambda orbit: -orbit.velocities[0]))


def _single_contacts(body: ImpactingBody, periods: int, contact: int) -> tuple[PeriodicOrbit, ...]:
    """Return the orbits P(1,q) of a contact of a body whose stops yield: equations.md 4.18."""
    if body.contacts[contact].press is None:
        alone = closed_form(replace(body, contacts=(body.contacts[contact],)), periods)
        starts: list[tuple[float, Floats | None]] = [(float(each.phases[0]), None) for each in alone]
    else:
        starts = [*yielding_motion(body).single_contacts(contact, periods)]
    found: list[PeriodicOrbit] = []
    for phase, start in starts:
        if any(_is_near(orbit, phase, start) for orbit in found):
            continue
        try:
            orbit = find_orbit(body, [phase], [contact], periods, start=start)
        except OrbitError:
            continue
        apart = [abs(np.mod(orbit.phases - each.phases + np.pi, TURN) - np.pi).max() for each in found]
        if orbit.velocities[0] > least_speed(body) and min(apart, default=1.0) > SAME:
            found.append(orbit)
    return tuple(sorted(found, key=lambda orbit: -orbit.velocities[0]))


def _is_near(orbit: PeriodicOrbit, phase: float, start: Floats | None) -> bool:
    """Tell whether a guess of an orbit with one contact leads to a known one."""
    apart = abs(np.mod(float(orbit.phases[0]) - phase + np.pi, TURN) - np.pi)
    if start is None or orbit.start is None:
        return False
    return bool(
        apart < GUESSED and np.linalg.norm(orbit.start - start) < GUESSED * np.linalg.norm(orbit.start)
    )


def _phases_of_one_sine(body: ImpactingBody, hit: NDArray[np.int32], periods: int) -> list[float]:
    """Return the phases with distance 0, from three distances: a + b cos(phase) + c sin(phase)."""
    at = [
        evaluated(body, hit, np.array([phase]), periods).distances[0] for phase in (0.0, 0.5 * np.pi, np.pi)
    ]
    level, cosine = 0.5 * (at[0] + at[2]), 0.5 * (at[0] - at[2])
    sine = at[1] - level
    size = float(np.hypot(cosine, sine))
    if not 0.0 < size >= abs(level):
        return []
    middle, off = np.arctan2(sine, cosine), np.arccos(np.clip(-level / size, -1.0, 1.0))
    return list(dict.fromkeys(float(np.mod(middle + side * off, TURN)) for side in (1.0, -1.0)))


def _phases_of_sines(body: ImpactingBody, hit: NDArray[np.int32], periods: int) -> list[float]:
    """Return the phases with distance 0: of several sines, moving stops, or a restitution that falls with speed."""
    contact, order = body.contacts[int(hit[0])], np.array(list(body.harmonics), dtype=float)
    wave = body.kernel.wave(int(hit[0]), periods)
    refuse_end(wave.end, np.zeros(1))
    if not contact.yield_velocity > 0.0:
        return SumOfSines(wave.level, order, wave.cosine, wave.sine).zeros()
    return FallingDistance(
        wave.level,
        *wave.answer,
        order,
        wave.steady_cosine,
        wave.steady_sine,
        body.loose == 0,
        body.angular_frequency,
        contact,
    ).zeros()
