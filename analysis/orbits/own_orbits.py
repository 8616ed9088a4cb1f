"""Orbits of bodies without a force, found from a first guess, from many starts, or next to recorded impacts: 4.16."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.finding import MOST_HALVINGS
from vibroimpact.analysis.orbits.own_period import TURN, shortened, speed_unit, unknowns_of
from vibroimpact.analysis.orbits.periodic import CLOSE, OrbitError, PeriodicOrbit, Trial, tried
from vibroimpact.fmus.bodies.impacting_body import Contact, Floats, ImpactingBody
from vibroimpact.fmus.core.orbits import MOST_IMPACTS, OrbitEnd
from vibroimpact.fmus.errors import UsageError

MOST_NEWTON = 25
"""Number of Newton steps after which the search for an orbit fails."""
LONGEST = 2.0
"""Longest period of the orbits of one impact that are searched, in turns of the slowest mode."""
SAMPLES = 48
"""Periods that are tried in a turn of the fastest mode, in the search for orbits of one impact."""
MOST_SAMPLES = 4096
"""Largest number of these periods: modes faster than this resolves may hide orbits."""
MOST_STARTS = 64
"""Largest number of random starts; each takes longer than one with a force."""
FASTEST_START = 3.0
"""Largest velocity of a random start, in the size of the motion times its slowest frequency."""


def find_own_orbit(
    body: ImpactingBody,
    period: float,
    phases: Floats,
    velocities: Floats,
    contacts: NDArray[np.int32],
) -> PeriodicOrbit:
    """Find the orbit near given impacts and a period by Newton's method: equations.md 4.16.

    Parameters
    ----------
    body : ImpactingBody
        Without a force.
    period : float
        s.
    phases, velocities : array, shape (p,)
        rad, ascending within a turn; speeds before the impacts, m/s.
    contacts : array of int, shape (p,)
        Contact of each impact, from 0.

    Raises
    ------
    OrbitError
        There is no orbit near them.
    """
    guess = PeriodicOrbit(body.with_period(period), 1, phases - phases[0], contacts, velocities)
    at = unknowns_of(guess.body, guess.phases, velocities)
    found = tried(body, guess, at)
    for _ in range(MOST_NEWTON):
        step = np.linalg.lstsq(found.slopes, found.errors, rcond=None)[0].astype(np.float64)
        nearer = _damped_step(body, guess, at, shortened(step, at, contacts.size), found)
        if nearer is None:
            break
        at, found = nearer
    error = float(np.abs(found.errors).max())
    if error <= 1e3 * CLOSE * body.scale:
        return found.orbit
    raise OrbitError(
        f"orbit: expected an orbit P({phases.size},1) near to the period {period:.6g}, got none: Newton's method ends "
        f"{error:.2g} m from the stops."
    )


def _damped_step(
    body: ImpactingBody, like: PeriodicOrbit, at: Floats, step: Floats, now: Trial
) -> tuple[Floats, Trial] | None:
    """Return unknowns nearer to an orbit, a part of a step away; None if there are none."""
    error = float(np.linalg.norm(now.errors))
    for _ in range(MOST_HALVINGS):
        try:
            found = tried(body, like, at - step)
        except OrbitError:
            found = None
        if found is not None and float(np.linalg.norm(found.errors)) < error:
            return at - step, found
        step = 0.5 * step
    return None


def own_closed_form(body: ImpactingBody, contact: int = 0) -> tuple[PeriodicOrbit, ...]:
    """Return the orbits P(1,1) of a contact up to `LONGEST`, physical or not, the fastest first: equations.md 4.16.

    Each sign change of one equation for the period is an orbit. Impacts at one period take a velocity at most.
    """
    hit, own = np.array([contact], dtype=np.int32), body.contacts[contact]
    periods = _periods(body)
    values = [_balance(body, own, hit, period)[0] for period in periods]
    found = []
    for low, high, first, last in zip(periods, periods[1:], values, values[1:], strict=False):
        if first * last < 0.0:
            orbit = _between(body, own, hit, low, high)
            if orbit is not None and orbit.velocities[0] > 0.0:
                found.append(orbit)
    return tuple(sorted(found, key=lambda orbit: -orbit.velocities[0]))


def _periods(body: ImpactingBody) -> Floats:
    """Return the periods at which an orbit of one impact is looked for, s."""
    rates = np.abs(body.rates.imag)
    swinging = rates[rates > 0.0]
    slow = swinging.min() if swinging.size else body.slowest
    fast = max(rates.max(), slow)
    longest = LONGEST * TURN / slow
    return np.linspace(0.0, longest, min(int(LONGEST * SAMPLES * fast / slow), MOST_SAMPLES) + 1)[1:]


def _balance(body: ImpactingBody, own: Contact, hit: NDArray[np.int32], period: float) -> tuple[float, float]:
    """Return the balance of speeds of an impact that recurs after a period, 0 for an orbit, and its velocity, m/s.

    The distance gives the speed of equal impulse. The balance is the velocity over it less that of the motion.
    """
    end, errors, slopes = body.with_period(period).kernel.errors(hit, np.zeros(1), np.zeros(1))
    if end is not OrbitEnd.done or 0.0 in (errors[0], slopes[0, 1]):
        return float(
            "nan"
        ), 0.0  # nothing fixes the speed: the impulse of one contact on a body without a spring
    equal = -errors[0] / slopes[0, 1]
    velocity = own.speed_of(equal)
    return velocity / equal - (1.0 - slopes[1, 1]), velocity


def _between(
    body: ImpactingBody, own: Contact, hit: NDArray[np.int32], low: float, high: float
) -> PeriodicOrbit | None:
    """Return the orbit of one impact between two periods with opposite balances; None at a pole."""
    from scipy.optimize import brentq

    try:
        period = float(brentq(lambda each: _balance(body, own, hit, each)[0], low, high, xtol=1e-6 * low))
        return find_own_orbit(body, period, np.zeros(1), np.array([_balance(body, own, hit, period)[1]]), hit)
    except (OrbitError, ValueError):  # no number at the pole itself
        return None


def own_starts(body: ImpactingBody, impacts: int, starts: int) -> Iterator[PeriodicOrbit]:
    """Yield the orbits of several impacts that Newton's method finds from random starts, the same each time."""
    from scipy.stats import qmc

    periods = _periods(body)
    for row in qmc.Halton(3 * impacts + 1, seed=0).random(min(starts, MOST_STARTS)):
        phases, hit, speeds = np.split(row[1:], 3)
        contacts = np.floor(hit * len(body.contacts)).astype(np.int32)
        period = periods[0] + row[0] * (0.5 * impacts * periods[-1] - periods[0])
        velocities = FASTEST_START * speed_unit(body) * speeds
        try:
            yield find_own_orbit(body, period, TURN * np.sort(phases), velocities, contacts)
        except OrbitError:
            continue


def repeating_round(
    times: Floats, velocities: Floats, contacts: NDArray[np.int_], most: int, close: float
) -> int | None:
    """Return the number of impacts after which the last impacts repeat; None unless two rounds agree.

    Times between impacts and velocities differ by less than `close`, over the largest.
    """
    gaps = np.diff(times)
    rows = np.column_stack([gaps / gaps.max(), velocities[1:] / velocities.max()])[::-1]
    hit = contacts[1:][::-1]
    for count in range(1, min(most, len(rows) // 2) + 1):
        same = np.abs(rows[count : 2 * count] - rows[:count]).max() <= close
        if same and (hit[count : 2 * count] == hit[:count]).all():
            return count
    return None


def own_orbit_of_impacts(
    body: ImpactingBody, times: Floats, velocities: Floats, contacts: NDArray[np.int_], close: float
) -> PeriodicOrbit | None:
    """Return the physical orbit on which recorded impacts end; None unless they repeat."""
    if times.size < 3 or not (velocities > 0.0).all():
        return None
    count = repeating_round(times, velocities, contacts, MOST_IMPACTS, close)
    if count is None:
        return None
    try:
        orbit = orbit_of_round(body, times, velocities, contacts, count).once
    except (OrbitError, UsageError):  # chatter: impacts closer than phases can resolve
        return None
    return orbit if orbit.is_physical else None


def orbit_of_round(
    body: ImpactingBody, times: Floats, velocities: Floats, contacts: NDArray[np.int_], count: int
) -> PeriodicOrbit:
    """Return the orbit next to the last `count` impacts, which repeat; OrbitError if there is none."""
    last = slice(times.size - count, None)
    period = float(times[-1] - times[-1 - count])
    phases = TURN * (times[last] - times[last][0]) / period
    return find_own_orbit(body, period, phases, velocities[last], contacts[last].astype(np.int32))
