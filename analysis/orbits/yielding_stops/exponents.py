"""The stretching of small changes along recorded contacts, and the states before them: equations.md 4.11, 4.18."""

from __future__ import annotations

import numpy as np

from vibroimpact.analysis.orbits.errors import OrbitError
from vibroimpact.analysis.orbits.recorded import Impacts
from vibroimpact.analysis.orbits.yielding_stops.motion import Law, yielding_motion
from vibroimpact.analysis.orbits.yielding_stops.passages import Passage
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody

ARRIVES = 1e-6
"""Error of a predicted contact, over the size of the motion, above which the state before it was not known."""
UNKNOWN = 1e8
"""Variance of the first state, over the variance that each flight adds to the state."""
MOST_DECAY = 12.0
"""Decay of the fastest motion, as a logarithm, over which directions are carried without being made orthogonal."""
MOST_PIECES = 64
"""Largest number of parts of a flight between which directions are made orthogonal."""
TINY = np.finfo(np.float64).tiny


class RecordedStretching:
    """Directions carried along a recorded motion from contact to contact, and their stretching.

    Each contact shows two numbers of the state: the point is at its stop, with the recorded speed. A contact without
    speed presses a stop again before it is left, and shows one number: its force is 0. A filter finds the whole state
    from all contacts before. A first state that cannot pass a recorded contact goes roughly by its duration. The filter
    needs no damping: modes may also grow.

    Parameters
    ----------
    body : ImpactingBody
        Without a force the directions stay across the motion: the exponent 0 along it is left out.
    impacts : Impacts
        All contacts, in their order: none may be missing.

    Attributes
    ----------
    logarithms : array, shape (contact, direction)
        Stretching of each direction since the contact before; 2 modes directions, one less without a force.
    shrinking : array, shape (contact,)
        Logarithm of the determinant since the contact before, known from durations and speeds alone.
    errors : array, shape (contact,)
        Difference of each contact from its prediction, over the size of the motion; infinite without a prediction.
    """

    def __init__(self, body: ImpactingBody, impacts: Impacts) -> None:
        self._motion, self._impacts = yielding_motion(body), impacts
        self._again = ~(impacts.velocities > 0.0)
        count, self._size = impacts.times.size, 2 * body.frequencies.size
        directions = self._size - body.has_own_period
        self._unit = body.slowest if body.has_own_period else body.angular_frequency
        self._weights = np.repeat([self._unit, 1.0], body.frequencies.size)
        self._fastest = float(np.abs(body.rates.real).max(initial=0.0))
        self.logarithms = np.zeros((count, directions))
        self.shrinking = np.zeros(count)
        self.errors = np.full(count, np.inf)
        self._is_rough = np.zeros(count, dtype=bool)
        self._carry()

    @property
    def first_known(self) -> int:
        """First contact from which on all contacts are as predicted."""
        off = np.flatnonzero(~(self.errors <= ARRIVES))
        return int(off[-1]) + 1 if off.size else 0

    def _carry(self) -> None:
        """Carry the state and the directions along all contacts."""
        size = self._size
        state, variance = np.zeros(size), UNKNOWN * np.eye(size)
        directions = self._across(self._seen(0, state, variance)[0], 0, np.eye(size))
        for k in range(self._impacts.times.size):
            state, variance, error = self._seen(k, state, variance)
            if k:
                self.errors[k] = np.inf if self._is_rough[k] else error
                directions = self._across(state, k, directions)
                directions, upper = np.linalg.qr(directions)
                self.logarithms[k] += np.log(np.maximum(np.abs(np.diag(upper)), TINY))
            if k + 1 == self._impacts.times.size:
                return
            passage = self._passage(k, state)
            if passage is None:
                state, variance = np.zeros(size), UNKNOWN * np.eye(size)
            else:
                state, variance, directions = self._to_next(k, passage, variance, directions)

    def _across(self, state: Floats, k: int, directions: Floats) -> Floats:
        """Return directions without their part along the motion, where no force has a phase."""
        body = self._motion.body
        if not body.has_own_period:
            return directions
        flow = self._flow(state, k)
        length = float(np.linalg.norm(flow))
        if directions.shape[1] == self._size:
            basis = np.linalg.qr(np.column_stack([flow, directions]))[0]
            self._length = length
            return np.asarray(basis[:, 1:])
        self.shrinking[k] -= np.log(length / self._length)
        self._length = length
        return np.asarray(directions - np.outer(flow, flow @ directions) / length**2)

    def _flow(self, state: Floats, k: int) -> Floats:
        """Return the weighted rate of a state before a contact."""
        forced = self._motion.forced
        vector = forced.vector(state, float(self._impacts.phases[k]))
        return np.asarray(self._weights * (forced.free.matrix @ vector)[forced.motion])

    def _seen(self, k: int, state: Floats, variance: Floats) -> tuple[Floats, Floats, float]:
        """Return the state that a recorded contact leaves the most likely, its variance, and the error before."""
        motion, forced = self._motion, self._motion.forced
        rows, known, units = self._shown(k)
        off = rows @ forced.vector(state, float(self._impacts.phases[k])) - known
        slopes = rows[:, forced.motion] / self._weights
        gain = np.linalg.solve(slopes @ variance @ slopes.T, slopes @ variance).T
        state = state - gain @ off / self._weights
        variance = variance - gain @ slopes @ variance
        error = float(np.abs(off / units).max()) / motion.body.scale
        return state, 0.5 * (variance + variance.T), error

    def _shown(self, k: int) -> tuple[Floats, Floats, Floats]:
        """Return rows of the vector that a recorded contact shows, their values, and the units of their errors."""
        motion, contact = self._motion, int(self._impacts.contacts[k])
        if not self._again[k]:
            rows = np.array([motion.beyond[contact], motion.approach[contact]])
            speed = motion.signs[contact] * float(self._impacts.velocities[k])
            return rows, np.array([0.0, speed]), np.array([1.0, self._unit])
        row, value = motion.passages[contact].pressing_again
        modes = slice(0, motion.forced.modes)
        steep = float(np.linalg.norm(row[modes]) / np.linalg.norm(motion.beyond[contact, modes]))
        return row[None], np.array([value]), np.array([max(self._unit, steep)])

    def _passage(self, k: int, state: Floats) -> Passage | None:
        """Return the passage of a state through a recorded contact, or roughly by its duration; None: it is unknown."""
        motion, impacts = self._motion, self._impacts
        law: Law = motion.passages[int(impacts.contacts[k])]
        before = motion.forced.vector(state, float(impacts.phases[k]))
        limit = float(impacts.times[k + 1] - impacts.times[k])
        duration = np.nan if impacts.durations is None else float(impacts.durations[k])
        try:
            if self._again[k]:
                return law.again(before, limit, recorded=duration)
            return law.through(before, limit, recorded=duration)
        except OrbitError:  # a first state far from the true one
            self._is_rough[k + 1] = True
        if not 0.0 < duration < limit:
            return None
        over, own = motion.fixed(int(impacts.contacts[k]), duration), motion.forced.motion
        flow = over[own, own]
        return Passage(0.0, 0.0, duration, 0.0, (over @ before)[own], flow, np.zeros(self._size), flow, 1.0)

    def _to_next(
        self, k: int, passage: Passage, variance: Floats, directions: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return state, variance and directions before the next contact."""
        motion, impacts, weights = self._motion, self._impacts, self._weights
        body, forced = motion.body, motion.forced
        elapsed, phase = float(impacts.times[k + 1] - impacts.times[k]), float(impacts.phases[k])
        away = forced.vector(passage.after, phase + passage.duration * body.angular_frequency)
        flight = elapsed - passage.duration
        over = forced.free.over(flight)
        moved = weights[:, None] * (over[forced.motion, forced.motion] @ passage.slope) / weights
        self.shrinking[k + 1] = np.log(passage.shrinking) - 2.0 * body.decay * elapsed
        return (
            (over @ away)[forced.motion],
            moved @ variance @ moved.T + np.eye(self._size),
            self._carried(k + 1, directions, passage, flight),
        )

    def _carried(self, k: int, directions: Floats, passage: Passage, flight: float) -> Floats:
        """Return directions after a contact and a flight; parts of a long flight are made orthogonal one by one."""
        forced, weights = self._motion.forced, self._weights
        pieces = min(1 + int(self._fastest * flight / MOST_DECAY), MOST_PIECES)
        piece = forced.free.over(flight / pieces)[forced.motion, forced.motion]
        directions = passage.tangent @ (directions / weights[:, None])
        for number in range(pieces):
            if number:
                directions, upper = np.linalg.qr(weights[:, None] * directions)
                self.logarithms[k] += np.log(np.maximum(np.abs(np.diag(upper)), TINY))
                directions = directions / weights[:, None]
            directions = piece @ directions
        return np.asarray(weights[:, None] * directions)
