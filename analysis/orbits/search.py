"""Orbits of p impacts in q periods, found from many starts, also the unstable ones."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.finding import find_orbit
from vibroimpact.analysis.orbits.own_orbits import own_closed_form, own_starts
from vibroimpact.analysis.orbits.periodic import SAME, TURN, OrbitError, PeriodicOrbit
from vibroimpact.analysis.orbits.single_impacts import closed_form
from vibroimpact.analysis.orbits.symmetry import differences
from vibroimpact.analysis.orbits.yielding_stops.joint_search import near_orbit
from vibroimpact.analysis.orbits.yielding_stops.motion import yielding_motion
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.core.orbits import MOST_IMPACTS
from vibroimpact.fmus.errors import UsageError

STARTS = 256
"""Number of trains of impacts from which Newton's method starts, for orbits without a closed form."""
MOST_SPEEDS = 1e-6
"""Speed of an impact, over the fastest, below which it does not count: the orbit has fewer impacts."""


def orbits_of(
    body: ImpactingBody,
    impacts: int = 1,
    periods: int = 1,
    *,
    starts: int = STARTS,
    penetrating: bool = False,
) -> list[PeriodicOrbit]:
    """Return the physical orbits P(p,q) that are found, stable or not, the fastest impact first.

    Orbits of one impact are complete (equations.md 4.3). Other orbits are found by Newton's method from `starts` trains
    of impacts, the same trains each time.

    Parameters
    ----------
    body : ImpactingBody
    impacts, periods : int
        p and q.
    starts : int
        Number of trains to try.
    penetrating : bool
        Whether orbits that pass through a stop between impacts are included; they are formal solutions only.

    Raises
    ------
    UsageError
        The numbers of impacts or periods are out of range.
    """
    found = each_orbit(body, impacts, periods, starts=starts, penetrating=penetrating)
    return sorted(found, key=fastest_first)


def fastest_first(orbit: PeriodicOrbit) -> float:
    """Return the key by which orbits are sorted: the negative velocity of the fastest impact."""
    return -float(orbit.velocities.max())


def each_orbit(
    body: ImpactingBody, impacts: int, periods: int, *, starts: int = STARTS, penetrating: bool = False
) -> Iterator[PeriodicOrbit]:
    """Yield the orbits of `orbits_of` as they are found.

    Bodies without a force have P(p,1) only; orbits of one impact are complete up to `own_orbits.LONGEST`.
    """
    if not (1 <= impacts <= MOST_IMPACTS and periods >= 1):
        raise UsageError(
            f"orbit: expected 1 to {MOST_IMPACTS} impacts in 1 or more periods, got {impacts} in {periods}."
        )
    if body.has_own_period and periods > 1:
        raise UsageError(
            f"orbit: periods: expected 1 of a body without a force, whose orbits set it, got {periods}."
        )
    found: Iterator[PeriodicOrbit]
    contacts = range(len(body.contacts))
    if impacts == 1 and body.has_own_period:
        found = (orbit for contact in contacts for orbit in own_closed_form(body, contact))
    elif impacts == 1:
        found = (orbit for contact in contacts for orbit in closed_form(body, periods, contact))
    else:
        found = _from_starts(body, impacts, periods, starts)
    for orbit in found:
        if orbit.turns == 1 and (penetrating or orbit.is_physical):
            yield orbit


def same_orbit(one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    """Tell whether two orbits are equal, apart from the impact or period with which they begin."""
    if one.name != other.name or one.phases.size != other.phases.size:
        return False
    if one.body.has_own_period:
        apart = differences(one, other)
        return apart is not None and bool(np.abs(apart).max() < SAME)
    p, whole = one.phases.size, TURN * one.periods
    for shift in range(p):
        turned = np.roll(np.arange(p), -shift)
        difference = other.phases[turned] - one.phases
        difference = np.mod(difference - difference[0] + 0.5 * whole, whole) - 0.5 * whole
        periods = (other.phases[turned][0] - one.phases[0]) / TURN
        whole_periods = abs(periods - round(periods)) * TURN < SAME
        same_contacts = (other.contacts[turned] == one.contacts).all()
        if whole_periods and same_contacts and np.abs(difference).max() < SAME:
            return True
    return False


def _from_starts(body: ImpactingBody, impacts: int, periods: int, starts: int) -> Iterator[PeriodicOrbit]:
    found: list[PeriodicOrbit] = []
    own = body.has_own_period
    for orbit in own_starts(body, impacts, starts) if own else _near_trains(body, impacts, periods, starts):
        hits = orbit.velocities.min() > MOST_SPEEDS * float(np.abs(orbit.velocities).max())
        if hits and not any(same_orbit(orbit, other) for other in found):
            found.append(orbit)
            yield orbit


def _near_trains(body: ImpactingBody, impacts: int, periods: int, starts: int) -> Iterator[PeriodicOrbit]:
    for phases, contacts in _trains(impacts, periods, len(body.contacts), starts):
        try:
            start = None
            if body.yields:
                phases, start = near_orbit(yielding_motion(body), contacts, phases, periods)
            yield find_orbit(body, phases, contacts.tolist(), periods, start=start)
        except OrbitError:
            continue


def _trains(impacts: int, periods: int, contacts: int, starts: int) -> list[tuple[Floats, NDArray[np.int32]]]:
    from scipy.stats import qmc

    draw = qmc.Halton(2 * impacts, seed=0).random(starts)
    phases = np.sort(draw[:, :impacts], axis=1) * TURN * periods
    hit = np.floor(draw[:, impacts:] * contacts).astype(np.int32)
    return [(row, own) for row, own in zip(phases, hit, strict=True) if (np.diff(row) > SAME).all()]
