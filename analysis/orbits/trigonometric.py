"""All zeros of periodic functions in a turn, by certified subdivision: equations.md 4.3."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import FALLING, Contact, Floats

TURN = 2.0 * np.pi
SPLITS = 60
"""Largest number of halvings of a part; rounding is reached before."""
MOST_PARTS = 1_000_000
"""Number of undecided parts above which they are not halved: zeros of so high a multiplicity hardly have a place."""
BISECTIONS = 54
EXTREMUM_STEPS = 4
MOST_NEWTON = 40
"""Most Newton steps for the speed of an impact: its equation is convex or concave, and they double the digits."""
ROUNDING = 8.0 * np.finfo(float).eps
"""Rounding of a sum, over the sum of its amplitudes times one plus their phase's size."""


class PeriodicFunction(ABC):
    """A function of a phase with a period of one turn."""

    @property
    @abstractmethod
    def most_turns(self) -> float:
        """Largest number of turns of a sine in it."""

    @property
    @abstractmethod
    def rounding(self) -> float:
        """Error of its values."""

    @abstractmethod
    def at(self, phase: Floats) -> tuple[Floats, Floats]:
        """Return the value and its derivative at phases, rad."""

    @abstractmethod
    def reach(self, phase: Floats, half: float) -> tuple[Floats, Floats]:
        """Return bounds within `half` of phases: distance of the value from its tangent, change of the derivative."""

    @abstractmethod
    def extremum(self, phase: float, low: float, high: float) -> float:
        """Return the extremum near a phase, within bounds."""

    def zeros(self) -> list[float]:
        """Return all zeros in [0, 2 pi), rad, ascending; none where the function is zero throughout.

        A part of the turn has no zero if its middle is farther from zero than the derivatives allow. It has at most one
        if the derivative keeps its sign. Other parts are halved. Two zeros that rounding cannot separate count once.
        """
        rounding = self.rounding
        steep = rounding * self.most_turns
        first = 4.0 * self.most_turns
        parts, place, found = first, np.arange(first), []
        for _ in range(SPLITS):
            half = 0.5 * TURN / parts
            middle = (place + 0.5) * (TURN / parts)
            value, slope = self.at(middle)
            bent, turned = self.reach(middle, half)
            maybe = np.abs(value) <= half * np.abs(slope) + bent + rounding
            monotonic = np.abs(slope) > turned + steep
            found += self._crossings(place[maybe & monotonic], parts)
            narrow = np.all(bent[maybe & ~monotonic] <= rounding)
            place = place[maybe & ~monotonic]
            if not place.size:
                return sorted(found)
            if narrow:
                break
            place = np.concatenate([2.0 * place, 2.0 * place + 1.0])
            parts *= 2.0
            if place.size > MOST_PARTS:
                break
        if place.size == parts:
            return []
        return sorted([*found, *self._touching(np.sort(place), parts)])

    def _crossings(self, place: Floats, parts: float) -> list[float]:
        """Return the zeros in parts where the function is monotonic: those whose ends have different signs."""
        low, high = place * (TURN / parts), (place + 1.0) * (TURN / parts)
        rising = self.at(low)[0] < 0.0
        # the end of the turn has the value of its start, so that a zero between two parts counts once
        crosses = rising != (self.at(np.mod(place + 1.0, parts) * (TURN / parts))[0] < 0.0)
        if not crosses.any():
            return []
        low, high, rising = low[crosses], high[crosses], rising[crosses]
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            before = (self.at(middle)[0] < 0.0) == rising
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return [float(np.mod(each, TURN)) for each in 0.5 * (low + high)]

    def _touching(self, place: Floats, parts: float) -> list[float]:
        """Return one zero for each row of neighbouring parts with zeros to rounding and hardly a change."""
        rows: list[NDArray[np.float64]] = np.split(place, np.flatnonzero(np.diff(place) > 1.0) + 1)
        if len(rows) > 1 and rows[0][0] == 0.0 and rows[-1][-1] == parts - 1.0:  # a row across phase 0
            rows = [np.concatenate([rows[-1] - parts, rows[0]]), *rows[1:-1]]
        zeros = []
        for row in rows:
            if row.size:
                low, high = row[0] * (TURN / parts), (row[-1] + 1.0) * (TURN / parts)
                zeros.append(float(np.mod(self.extremum(0.5 * (low + high), low, high), TURN)))
        return zeros


@dataclass(frozen=True, eq=False)
class SumOfSines(PeriodicFunction):
    """level + cosine cos(order phase) + sine sin(order phase), summed over the orders.

    Attributes
    ----------
    level : float
    order, cosine, sine : array, shape (harmonics,)
        Whole numbers from 1; coefficients in the unit of the level.
    """

    level: float
    order: Floats
    cosine: Floats
    sine: Floats

    def at(self, phase: Floats) -> tuple[Floats, Floats]:
        """Return the sum and its derivative at phases, rad."""
        value, slope = np.full_like(phase, self.level), np.zeros_like(phase)
        for order, cosine, sine in zip(self.order, self.cosine, self.sine, strict=True):
            c, s = np.cos(order * phase), np.sin(order * phase)
            value += cosine * c + sine * s
            slope += order * (sine * c - cosine * s)
        return value, slope

    def zeros(self) -> list[float]:
        """Return all zeros in [0, 2 pi), rad, ascending: see `PeriodicFunction`.

        Examples
        --------
        >>> one, none = np.array([1.0, 2.0]), np.zeros(2)
        >>> [round(float(zero), 6) for zero in SumOfSines(0.0, one, np.array([0.0, 1.0]), none).zeros()]
        [0.785398, 2.356194, 3.926991, 5.497787]
        """
        return super().zeros() if np.abs(self.level) <= self._size.sum() else []

    @property
    def _size(self) -> Floats:
        return np.hypot(self.cosine, self.sine)

    @property
    def most_turns(self) -> float:
        """Largest order."""
        return float(self.order.max())

    @property
    def rounding(self) -> float:
        """Error of a value."""
        return ROUNDING * (abs(self.level) + float((self._size * (1.0 + TURN * self.order)).sum()))

    @property
    def _bend(self) -> float:
        """Bound of the second derivative."""
        return float((self.order**2 * self._size).sum())

    def reach(self, phase: Floats, half: float) -> tuple[Floats, Floats]:
        """Return bounds within `half` of phases: see `PeriodicFunction`."""
        return np.full_like(phase, 0.5 * half**2 * self._bend), np.full_like(phase, half * self._bend)

    def extremum(self, phase: float, low: float, high: float) -> float:
        """Return the extremum near a phase, within bounds, by Newton's method for the derivative."""
        for _ in range(EXTREMUM_STEPS):
            c, s = np.cos(self.order * phase), np.sin(self.order * phase)
            slope = float((self.order * (self.sine * c - self.cosine * s)).sum())
            bend = -float((self.order**2 * (self.cosine * c + self.sine * s)).sum())
            if bend == 0.0:
                break
            phase = min(max(phase - slope / bend, low), high)
        return phase


@dataclass(frozen=True, eq=False)
class FallingDistance(PeriodicFunction):
    """Distance of one impact beyond its stop over its phase, where restitution falls with speed: equations.md 4.3.

    It is the level, the steady motion, and `answer` times the speed of equal impulse e(V). The approach speed V solves
    V - feedback e(V) = steady velocity.

    Attributes
    ----------
    level, answer, feedback : float
        m, s, 1.
    order, cosine, sine : array, shape (harmonics,)
        Steady motion of the contact relative to its stop, m.
    is_placed : bool
        Whether springs place the body: otherwise the steady motion does not count in the distance.
    angular_frequency : float
        rad/s.
    contact : Contact
    """

    level: float
    answer: float
    feedback: float
    order: Floats
    cosine: Floats
    sine: Floats
    is_placed: bool
    angular_frequency: float
    contact: Contact

    @property
    def most_turns(self) -> float:
        """Largest order."""
        return float(self.order.max())

    @property
    def _bounds(self) -> list[float]:
        """Bounds of the derivatives of the steady motion over the phase, from order 0 to 3."""
        size = np.hypot(self.cosine, self.sine)
        return [float((self.order**k * size).sum()) for k in range(4)]

    @property
    def rounding(self) -> float:
        """Error of a value."""
        bounds = self._bounds
        fastest = self.angular_frequency * bounds[1] * abs(self.answer) * float(self._gain(np.zeros(1))[0])
        return ROUNDING * (
            abs(self.level) + bounds[0] + TURN * bounds[1] + fastest * (1.0 + TURN * self.most_turns)
        )

    def _steady(self, phase: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the steady motion with its first two derivatives over the phase, m."""
        angle = self.order[:, None] * phase
        c, s = np.cos(angle), np.sin(angle)
        along, across = self.cosine[:, None], self.sine[:, None]
        order = self.order[:, None]
        moved = along * c + across * s
        return (
            moved.sum(axis=0),
            (order * (across * c - along * s)).sum(axis=0),
            -(order**2 * moved).sum(axis=0),
        )

    def _speed(self, steady: Floats) -> Floats:
        """Return the approach speeds for steady velocities, by Newton's method from a side where it is monotonic."""
        speed = steady / (1.0 - self.feedback)
        for _ in range(MOST_NEWTON):
            equal, slope = self._equal(speed)
            change = (speed - self.feedback * equal - steady) / (1.0 - self.feedback * slope)
            speed = speed - change
            if (np.abs(change) <= np.finfo(float).eps * np.abs(speed)).all():
                break
        return speed

    def _equal(self, speed: Floats) -> tuple[Floats, Floats]:
        """Return the speeds of equal impulse, with their derivatives."""
        whole, kept = 1.0 + self.contact.restitution, self.contact.restitution_at(speed)
        share = np.where(speed > self.contact.yield_velocity, FALLING, 1.0)
        return (1.0 + kept) / whole * speed, (1.0 + share * kept) / whole

    def _gain(self, steady: Floats) -> Floats:
        """Return the derivative of the speed of equal impulse over the steady velocity: positive, and falling."""
        slope = self._equal(self._speed(steady))[1]
        return np.asarray(slope / (1.0 - self.feedback * slope))

    def at(self, phase: Floats) -> tuple[Floats, Floats]:
        """Return the distance and its derivative at phases, rad."""
        moved, faster, bent = self._steady(phase)
        steady = self.angular_frequency * faster
        equal = self._equal(self._speed(steady))[0]
        placed = 1.0 if self.is_placed else 0.0
        pushed = self.answer * self.angular_frequency * bent * self._gain(steady)
        return self.level + placed * moved + self.answer * equal, placed * faster + pushed

    def reach(self, phase: Floats, half: float) -> tuple[Floats, Floats]:
        """Return bounds within `half` of phases: see `PeriodicFunction`.

        The gain falls with the steady velocity, so its values at the ends of the range of velocities bound it.
        """
        w, bounds = self.angular_frequency, self._bounds
        _, faster, bent = self._steady(phase)
        room = w * (half * np.abs(bent) + 0.5 * half**2 * bounds[3])
        most, least = self._gain(w * faster - room), self._gain(w * faster + room)
        own = self._gain(w * faster)
        other = np.maximum(most - own, own - least)
        pushed = abs(self.answer) * w * (most * half * bounds[3] + other * np.abs(bent))
        turned = pushed + (half * bounds[2] if self.is_placed else 0.0)
        return half * turned, turned

    def extremum(self, phase: float, low: float, high: float) -> float:
        """Return the extremum within bounds, where the derivative changes its sign; else the phase."""
        rising, end = (self.at(np.array([each]))[1][0] > 0.0 for each in (low, high))
        if rising == end:
            return phase
        for _ in range(BISECTIONS):
            phase = 0.5 * (low + high)
            if (self.at(np.array([phase]))[1][0] > 0.0) == rising:
                low = phase
            else:
                high = phase
        return phase
