"""First guesses of all orbits with one contact of a spring and a dashpot: equations.md 4.18.

For a given duration of the contact the periodic motion is linear in the cosines and sines of the phase at which the
contact begins. The phases at which the contact point is on its stop follow. The force at the end of the contact is then
a function of the duration alone, and its zeros are the orbits.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vibroimpact.analysis.orbits.trigonometric import SumOfSines
from vibroimpact.analysis.orbits.yielding_stops.passages import ForcedModes, LinearPassage
from vibroimpact.fmus.bodies.impacting_body import Floats

TURN = 2.0 * np.pi
DURATIONS = 128
"""Number of durations of each grid: up to the whole time, and up to a multiple of a contact without other forces."""
USUAL = 3.0
"""Longest duration of the second grid, over that of a contact without other forces."""


class Guess(NamedTuple):
    """Phase at which a contact begins, rad, and the state before it."""

    phase: float
    start: Floats


def guesses(forced: ForcedModes, law: LinearPassage, beyond: Floats, period: float) -> Iterator[Guess]:
    """Yield guesses of orbits with one contact in a time that is a whole number of forcing periods.

    Parameters
    ----------
    forced : ForcedModes
    law : LinearPassage
        The contact.
    beyond : array
        Row of its displacement relative to the stop.
    period : float
        s.
    """
    approach = law.direction * (beyond @ forced.free.matrix)
    for longest in dict.fromkeys((min(USUAL * law.usual_duration, period), period)):
        for guess in _on_grid(forced, law, beyond, period, longest):
            if approach @ forced.vector(guess.start, guess.phase) > 0.0:
                yield guess


def _on_grid(
    forced: ForcedModes, law: LinearPassage, beyond: Floats, period: float, longest: float
) -> Iterator[Guess]:
    last: list[tuple[float, float, Floats]] = []
    for starts, gaps, forces in zip(*_motions(forced, law, beyond, period, longest), strict=True):
        phases = _zeros(forced.orders, gaps)
        tails = [_tail(forced.orders, phase) for phase in phases]
        now = [
            (phase, float(forces @ tail), starts @ tail) for phase, tail in zip(phases, tails, strict=True)
        ]
        if len(now) != len(last) and last and now:
            yield from (Guess(phase, start) for phase, _, start in [*last, *now])
        elif not now and len(last) > 1:
            yield from (Guess(phase, start) for phase, _, start in last)
        elif not last and len(now) > 1:
            yield from (Guess(phase, start) for phase, _, start in now)
        for phase, force, start in now:
            near = min(last, key=lambda each: abs(_apart(each[0], phase)), default=None)
            if near is not None and near[1] * force <= 0.0:
                part = abs(near[1]) / max(abs(near[1]) + abs(force), 1e-300)
                yield Guess(near[0] + part * _apart(phase, near[0]), near[2] + part * (start - near[2]))
        last = now


def _motions(
    forced: ForcedModes, law: LinearPassage, beyond: Floats, period: float, longest: float
) -> tuple[Floats, Floats, Floats]:
    """Return rows over the tail (cosines, sines, 1) for each duration: states, distances and forces at the end."""
    own, tail = forced.motion, slice(2 * forced.modes, forced.one + 1)
    step = longest / (DURATIONS + 1)
    pressed, flown = law.flow.over(step), forced.free.over(step)
    contacts, flights = [pressed], [forced.free.over(period - longest) @ flown]
    for _ in range(DURATIONS - 1):
        contacts.append(pressed @ contacts[-1])
        flights.append(flown @ flights[-1])
    contact, flight = np.array(contacts), np.array(flights[::-1])
    whole = flight @ contact
    left = np.eye(2 * forced.modes) - whole[:, own, own]
    starts = np.linalg.solve(left, whole[:, own, tail])
    gaps = beyond[own] @ starts + beyond[tail]
    end = law.force @ contact
    forces = np.einsum("ki,kij->kj", end[:, own], starts) + end[:, tail]
    return np.asarray(starts), np.asarray(gaps), np.asarray(forces)


def _zeros(orders: Floats, row: Floats) -> list[float]:
    """Return the zeros of a sum of sines whose row has cosines, sines and a constant."""
    count = orders.size
    if count > 1:
        return SumOfSines(float(row[-1]), orders, row[:count], row[count:-1]).zeros()
    size = float(np.hypot(row[0], row[1]))
    if not size > abs(row[2]):
        return []
    middle, off = np.arctan2(row[1], row[0]), np.arccos(-row[2] / size)
    return [float(np.mod(middle + side * off, TURN)) for side in (1.0, -1.0)]


def _tail(orders: Floats, phase: float) -> Floats:
    return np.concatenate([np.cos(orders * phase), np.sin(orders * phase), [1.0]])


def _apart(phase: float, other: float) -> float:
    return float(np.mod(phase - other + np.pi, TURN) - np.pi)
