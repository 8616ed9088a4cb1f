"""The periodic orbit of recorded impacts: their repetition, and the exact orbit next to them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.finding import find_orbit
from vibroimpact.analysis.orbits.own_orbits import orbit_of_round, repeating_round
from vibroimpact.analysis.orbits.periodic import TURN, OrbitError, PeriodicOrbit
from vibroimpact.analysis.orbits.yielding_stops.motion import start_near
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.core.orbits import MOST_IMPACTS

REPEATS = (1e-9, 1e-6, 1e-3)
"""Differences of phases (rad), and of velocities over the largest, between rounds; tried in order.

The smallest that is met counts: next to a doubling, a transient may differ by more than the two halves of an orbit.
"""
NO_IMPACTS = "no impacts"
NEAR = 1e-2
"""Largest difference of the orbit from the recorded impacts, in the same measure."""


class Impacts(NamedTuple):
    """Impacts of one run, in the order of time.

    Attributes
    ----------
    times, phases, velocities : array, shape (impact,)
        s; forcing phases, rad; speeds towards the stops, m/s.
    contacts : array of int, shape (impact,)
        Contact of each impact, from 0.
    durations : array, shape (impact,), or None
        Durations of the contacts, s; None: they are not known.
    """

    times: Floats
    phases: Floats
    velocities: Floats
    contacts: NDArray[np.int64]
    durations: Floats | None = None


class RecordedOrbit(NamedTuple):
    """The orbit next to recorded impacts."""

    orbit: PeriodicOrbit
    distance: float
    """Largest difference of a velocity from that of the orbit, over the largest velocity: a remaining transient."""


def recorded_orbit(body: ImpactingBody, impacts: Impacts) -> RecordedOrbit:
    """Return the orbit P(p,q) that recorded impacts repeat, found by Newton's method from their last round.

    Parameters
    ----------
    body : ImpactingBody
    impacts : Impacts
        At least two rounds of the orbit, without transient.

    Raises
    ------
    OrbitError
        They do not repeat, or this body has no orbit next to them.
    """
    if not impacts.times.size:
        raise OrbitError(NO_IMPACTS)
    if body.has_own_period:
        return _own_orbit(body, impacts)
    phases = _unwrapped(impacts, body.angular_frequency)
    count, periods = _round(phases, impacts)
    last = slice(phases.size - count, None)
    first = phases[last][0]
    # counted from the period of the first impact
    begin = TURN * np.floor(first / TURN)
    velocities, hit = impacts.velocities[last], impacts.contacts[last]
    if not (velocities > 0.0).all():
        raise OrbitError("an orbit that presses a stop again before it is left, which is not followed")
    lasting = None if impacts.durations is None else impacts.durations[last]
    start = start_near(body, hit, phases[last] - begin, periods, velocities, lasting)
    found = find_orbit(body, phases[last] - begin, hit.tolist(), periods, start=start)
    order = _same_order(found.phases, phases[last] - begin, periods)
    gaps = found.velocities[order] - velocities
    away = np.abs(np.mod(found.phases[order] - phases[last] + begin + np.pi, TURN) - np.pi).max()
    distance = float(np.abs(gaps).max() / velocities.max())
    if max(away, distance) > NEAR:
        raise OrbitError(
            f"no orbit {found.name} of this body next to the recorded impacts: nearest {max(away, distance):.2g} away"
        )
    return RecordedOrbit(_once(found), distance)


def _own_orbit(body: ImpactingBody, impacts: Impacts) -> RecordedOrbit:
    """Return the orbit of a body without a force that recorded impacts repeat."""
    times, velocities, contacts = impacts.times, impacts.velocities, impacts.contacts
    for close in REPEATS:
        count = repeating_round(times, velocities, contacts, MOST_IMPACTS, close)
        if count is not None:
            found = orbit_of_round(body, times, velocities, contacts, count)
            distance = float(np.abs(found.velocities - velocities[-count:]).max() / velocities.max())
            if distance > NEAR:
                raise OrbitError(
                    f"no orbit {found.name} of this body next to the recorded impacts: {distance:.2g} away"
                )
            return RecordedOrbit(found.once, distance)
    raise OrbitError(_not_periodic(times.size))


def _not_periodic(count: int) -> str:
    return f"not periodic: {count} recorded impacts do not repeat within half of them, {MOST_IMPACTS} at most"


def _once(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """Return the shortest orbit that this orbit repeats: the limit of an alternating transient."""
    if orbit.turns == 1:
        return orbit
    count, periods = orbit.phases.size // orbit.turns, orbit.periods // orbit.turns
    hit = orbit.contacts[:count].tolist()
    return find_orbit(orbit.body, orbit.phases[:count], hit, periods, start=orbit.start)


def _unwrapped(impacts: Impacts, rate: float) -> Floats:
    """Return phases that continue over the turns of the force, which the times count."""
    passed = rate * (impacts.times - impacts.times[0])
    turns = np.round((passed - (impacts.phases - impacts.phases[0])) / TURN)
    return np.asarray(impacts.phases + TURN * turns)


def _round(phases: Floats, impacts: Impacts) -> tuple[int, int]:
    """Return the numbers of impacts and of turns after which the impacts repeat."""
    speeds = impacts.velocities / impacts.velocities.max()
    off: dict[int, float] = {}
    for count in range(1, min(phases.size // 2, MOST_IMPACTS) + 1):
        advance = phases[count:] - phases[:-count]
        periods = round(float(advance[0] / TURN))
        if periods >= 1 and (impacts.contacts[count:] == impacts.contacts[:-count]).all():
            slower = np.abs(speeds[count:] - speeds[:-count]).max()
            off[count] = float(max(slower, np.abs(advance - TURN * periods).max()))
            if off[count] <= REPEATS[0]:
                break
    for close in REPEATS:
        for count, difference in off.items():
            if difference <= close:
                return count, round(float((phases[count] - phases[0]) / TURN))
    raise OrbitError(_not_periodic(phases.size))


def _same_order(found: Floats, recorded: Floats, periods: int) -> NDArray[np.intp]:
    """Return the places of the recorded impacts in the orbit, which may begin with another impact."""
    off = np.mod(found[None, :] - recorded[:, None] + np.pi * periods, TURN * periods) - np.pi * periods
    return np.asarray(np.argmin(np.abs(off), axis=1))
