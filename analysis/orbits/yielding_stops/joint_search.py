"""Orbits on stops that yield from rough trains of contacts: Newton's method on phases and first state at once: 4.18."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vibroimpact.analysis.orbits.errors import OrbitError
from vibroimpact.analysis.orbits.yielding_stops.motion import TURN, Contacts, YieldingMotion
from vibroimpact.fmus.bodies.impacting_body import Floats

MOST_STEPS, MOST_HALVINGS = 30, 5
"""Number of Newton steps, and of halvings of one, after which a search from one train fails."""
NEAR = 1e-5
"""Error, over the size of the motion, below which a train is next to an orbit."""
LARGEST_STEP = 0.5
"""Largest change of a phase in a step, rad."""
CLOSING = 0.5
"""Largest part of the gap between two contacts by which one step closes the gap."""
MEETING = 1e-3
"""Gap between two contacts, rad, below which they become one: an orbit of fewer contacts."""
BACKWARDS = 1e-2
"""Speed away from a stop, over the fastest, above which a train leads to no physical orbit."""
NONE = "orbit: expected an orbit near to the train of contacts, got none."


class Rough(NamedTuple):
    """A train of contacts next to an orbit: phases, rad, and the state before the first contact."""

    phases: Floats
    start: Floats


class _Trial(NamedTuple):
    rough: Rough
    errors: Floats
    slopes: Floats
    """Derivatives of the errors by the weighted state and the phases."""
    speeds: Floats

    @property
    def size(self) -> float:
        return float(np.linalg.norm(self.errors))


def near_orbit(motion: YieldingMotion, contacts: Contacts, phases: Floats, periods: int) -> Rough:
    """Return a train next to an orbit; OrbitError where Newton's method from given phases leads to none.

    Nothing repeats on the way. A step costs one train, and not the motion that repeats with given phases.
    """
    now = _first(motion, contacts, phases, periods)
    for _ in range(MOST_STEPS):
        if np.abs(now.errors).max() <= NEAR * motion.body.scale:
            if now.speeds.min() < -BACKWARDS * float(np.abs(now.speeds).max()):
                break
            return now.rough
        if _gaps(now.rough.phases, periods).min() < MEETING:
            break
        step = np.linalg.lstsq(now.slopes, now.errors, rcond=None)[0].astype(np.float64)
        now = _nearer(motion, contacts, periods, now, step)
    raise OrbitError(NONE)


def _first(motion: YieldingMotion, contacts: Contacts, phases: Floats, periods: int) -> _Trial:
    """Return the first train that goes through all its contacts; OrbitError if there is none."""
    problem = OrbitError(NONE)
    for start in motion.guesses(contacts, phases, periods):
        try:
            return _tried(motion, contacts, periods, Rough(phases, start))
        except OrbitError as failed:
            problem = failed
    raise problem


def _nearer(motion: YieldingMotion, contacts: Contacts, periods: int, now: _Trial, step: Floats) -> _Trial:
    size = now.rough.start.size
    part = _part(step[size:], now.rough.phases, periods)
    weights = _weights(motion)
    for _ in range(MOST_HALVINGS):
        phases = now.rough.phases - part * step[size:]
        try:
            tried = _tried(
                motion, contacts, periods, Rough(phases, now.rough.start - part * step[:size] / weights)
            )
        except OrbitError:
            tried = None
        if tried is not None and tried.size < now.size:
            return tried
        part *= 0.5
    raise OrbitError(NONE)


def _part(step: Floats, phases: Floats, periods: int) -> float:
    """Return the part of a step that keeps the contacts in their order."""
    gaps = _gaps(phases, periods)
    closing = np.append(step[1:], step[0]) - step
    most = float(np.max(closing / gaps, initial=0.0))
    return min(1.0, CLOSING / max(most, CLOSING), LARGEST_STEP / max(float(np.abs(step).max()), LARGEST_STEP))


def _gaps(phases: Floats, periods: int) -> Floats:
    """Return the phases from each contact to the next, rad."""
    return np.append(phases[1:], phases[0] + TURN * periods) - phases


def _weights(motion: YieldingMotion) -> Floats:
    """Return the weights that make displacements of contacts, m, of the state."""
    w, modes = motion.body.angular_frequency, motion.body.frequencies.size
    mobility = np.sqrt(max(1.0 / each.mass for each in motion.body.contacts))
    return np.repeat([mobility, mobility / w], modes)


def _tried(motion: YieldingMotion, contacts: Contacts, periods: int, rough: Rough) -> _Trial:
    """Return the errors of a train, m: distances from the stops, and the difference of its end from its start."""
    count, own, weights = rough.phases.size, motion.forced.motion, _weights(motion)
    train = motion.train(contacts, rough.phases, periods, rough.start)
    moved, by_start = motion.derivatives(train, count)
    states, by_phase, _ = motion.at_stops(train, contacts, rough.phases)
    signs = motion.signs[contacts]
    rows = signs[:, None] * motion.beyond[contacts]
    by_state = np.einsum("ki,kij->kj", rows[:, own], by_start[:count])
    by_phases = np.einsum("ki,kij->kj", rows[:, own], moved[:count]) + np.diag(by_phase)
    slopes = np.block(
        [
            [
                weights[:, None] * (by_start[count] - np.eye(weights.size)) / weights,
                weights[:, None] * moved[count],
            ],
            [by_state / weights, by_phases],
        ]
    )
    errors = np.concatenate([weights * (train.end - rough.start), np.einsum("ij,ij->i", rows, states)])
    return _Trial(rough, errors, slopes, train.values("speed"))
