"""The passage of a state through one contact: a rigid impact, or a stop that is pressed for a while: 4.2, 4.18."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.errors import OrbitError
from vibroimpact.analysis.orbits.yielding_stops.linear_flow import LinearFlow, value_of, zero_of
from vibroimpact.fmus.bodies.impacting_body import Contact, Floats, ImpactingBody

FIRST_SAMPLES = 4
"""Binary logarithm of the number of steps that the first search for a release samples."""
SHALLOW = 1e-3
"""Least force between two samples, over the force at them, below which the exact minimum decides."""


class ForcedModes:
    """The modes of a body with its sines as one linear system, free and pressed on a stop: equations.md 4.18.

    The vector of the system has modal displacements and velocities, then cosines and sines of the clock's harmonics.
    Its last elements are 1, the offset of the pressed surface (m), and the impulse (N s).
    """

    def __init__(self, body: ImpactingBody) -> None:
        self.body = body
        self.modes = body.frequencies.size
        self.orders = np.array(list(body.harmonics), dtype=np.float64)
        count = self.orders.size
        self.size = 2 * self.modes + 2 * count + 3
        self.motion = slice(0, 2 * self.modes)
        self.velocity = slice(self.modes, 2 * self.modes)
        self.cosines = slice(2 * self.modes, 2 * self.modes + count)
        self.sines = slice(2 * self.modes + count, 2 * self.modes + 2 * count)
        self.one, self.offset, self.impulse = self.size - 3, self.size - 2, self.size - 1
        self.damping = (
            np.diag(2.0 * body.damping_ratios * np.abs(body.frequencies))
            if body.coupling is None
            else body.coupling
        )
        self._spring = float((body.frequencies**2).max())
        self._drag = float(np.linalg.norm(self.damping, 2))
        self.free = LinearFlow(self._free_matrix(), self._rate(0.0, 0.0))

    def _rate(self, spring: float, drag: float) -> float:
        half = 0.5 * (self._drag + drag)
        clock = float(self.orders.max()) * self.body.angular_frequency
        return float(half + np.sqrt(half**2 + self._spring + spring)) + clock

    def _free_matrix(self) -> Floats:
        body, found = self.body, np.zeros((self.size, self.size))
        turns = np.diag(self.orders * body.angular_frequency)
        forces = np.array(list(body.harmonics.values())).T
        found[: self.modes, self.velocity] = np.eye(self.modes)
        found[self.velocity, : self.modes] = -np.diag(body.stiffnesses)
        found[self.velocity, self.velocity] = -self.damping
        found[self.velocity, self.cosines], found[self.velocity, self.sines] = forces.real, -forces.imag
        found[self.velocity, self.one] = body.held
        found[self.cosines, self.sines], found[self.sines, self.cosines] = -turns, turns
        return found

    def vector(self, state: Floats, phase: float) -> Floats:
        """Return the vector of a state at a phase of the clock."""
        turned = self.orders * phase
        return np.concatenate([state, np.cos(turned), np.sin(turned), [1.0, 0.0, 0.0]])

    def beyond(self, contact: Contact) -> Floats:
        """Return the row that gives the displacement of a contact relative to its stop, m."""
        row = np.zeros(self.size)
        moved = np.array([contact.motion.get(int(order), 0j) for order in self.orders])
        row[: self.modes] = contact.shape
        row[self.cosines], row[self.sines], row[self.one] = -moved.real, moved.imag, -contact.position
        return row

    def approach(self, contact: Contact) -> Floats:
        """Return the row that gives the velocity of a contact relative to its stop, m/s."""
        return np.asarray(self.beyond(contact) @ self.free.matrix)

    def pressed(self, contact: Contact, stiffness: float, damping: float) -> tuple[LinearFlow, Floats]:
        """Return the flow on a pressed spring and dashpot (N/m, N s/m), and the row that gives their force, N."""
        force = stiffness * self.beyond(contact) + damping * self.approach(contact)
        force[self.offset] = -stiffness
        matrix = self.free.matrix.copy()
        matrix[self.velocity] -= np.outer(contact.shape, force)
        force = contact.direction * force
        matrix[self.impulse] = force
        mobility = 1.0 / contact.mass
        return LinearFlow(matrix, self._rate(stiffness * mobility, damping * mobility)), force


class Path(Protocol):
    """A motion that is known at all times."""

    @property
    def step(self) -> float:
        """Time between samples that show each maximum, s."""

    def along(self, state: Floats, times: Floats) -> Floats:
        """Return the vectors after times from a vector, shape (size, times)."""


@dataclass(frozen=True, eq=False)
class Passage:
    """A state that passed a contact.

    Attributes
    ----------
    speed, rebound : float
        Speeds relative to the stop: towards it before, away from it after the contact, m/s.
    duration, impulse : float
        s, N s.
    after : array, shape (2 modes,)
        State after the contact.
    slope : array, shape (2 modes, 2 modes)
        Derivative of that state by the state before, for a contact that begins at a given time.
    shift : array, shape (2 modes,)
        Its derivative by the time of the beginning, 1/s.
    tangent : array, shape (2 modes, 2 modes)
        Derivative along the motion: saltation matrix, and flow while the stop is pressed.
    shrinking : float
        Determinant of the tangent, without the damping of the modes.
    path : Path or None
        Motion while the stop is pressed; None without one.
    """

    speed: float
    rebound: float
    duration: float
    impulse: float
    after: Floats
    slope: Floats
    shift: Floats
    tangent: Floats
    shrinking: float
    path: Path | None = None


class RigidPassage:
    """Impacts on a restitution stop: equations.md 4.2."""

    def __init__(self, forced: ForcedModes, contact: Contact) -> None:
        self._forced, self._contact = forced, contact
        self._approach = forced.approach(contact)
        moved = self._approach.copy()
        moved[forced.motion] = 0.0
        self._second = moved @ forced.free.matrix
        self.pushed = contact.shape * contact.mass

    @property
    def matrix(self) -> Floats:
        """The impact as a linear map of vectors, for a restitution that does not fall with speed."""
        found = np.eye(self._forced.size)
        found[self._forced.velocity] -= (1.0 + self._contact.restitution) * np.outer(
            self.pushed, self._approach
        )
        return found

    def through(self, before: Floats, limit: float, *, recorded: float = np.nan) -> Passage:
        """Return the passage of a vector of `ForcedModes`; a rigid impact has no duration."""
        forced, contact = self._forced, self._contact
        free, sign, own = forced.free.matrix, contact.direction, forced.motion
        speed = sign * float(self._approach @ before)
        taken = (1.0 + float(contact.restitution_at(speed))) * speed
        slope_taken = 1.0 + float(contact.restitution_slope(speed))
        after = before.copy()
        after[forced.velocity] -= sign * taken * self.pushed
        jump = np.eye(2 * forced.modes)
        jump[forced.velocity] -= np.outer(self.pushed, slope_taken * self._approach[own])
        by_time = np.zeros(2 * forced.modes)  # the velocity of the stop changes with time
        by_time[forced.velocity] = -slope_taken * self.pushed * float(self._second @ before)
        rates = (free @ before)[own], (free @ after)[own]
        normal = np.concatenate([contact.shape, np.zeros(forced.modes)])
        with np.errstate(divide="ignore", invalid="ignore"):
            salted = np.outer(rates[1] - jump @ rates[0] - by_time, normal) / (sign * speed)
        kept = float(contact.restitution_at(speed))
        return Passage(
            *(speed, kept * speed, 0.0, taken * contact.mass),
            *(after[own], jump, by_time - rates[1], jump + salted),
            float(contact.restitution_slope(speed)) * kept,
        )

    @property
    def pressing_again(self) -> tuple[Floats, float]:
        """Raise OrbitError: a rigid stop is not pressed."""
        raise OrbitError("orbit: expected a stop that yields, which presses again, got a rigid one.")

    def again(self, before: Floats, limit: float, *, recorded: float = np.nan) -> Passage:
        """Raise OrbitError: a rigid stop is not pressed."""
        raise OrbitError("orbit: expected a stop that yields, which presses again, got a rigid one.")


class LinearPassage:
    """Contacts with a spring and a dashpot that never pull, whose surface relaxes at once: equations.md 4.18."""

    def __init__(self, forced: ForcedModes, contact: Contact, stiffness: float, damping: float) -> None:
        self._forced, self._contact, self._damping = forced, contact, damping
        self.direction = contact.direction
        self.flow, self.force = forced.pressed(contact, stiffness, damping)
        self._back = self.flow.reversed()
        # a body without a spring is placed by its stops alone: its depth counts from the stop itself
        self._is_shifted = forced.body.loose == 0
        self._rate = self.force @ self.flow.matrix
        self._beyond, self._approach = forced.beyond(contact), forced.approach(contact)

    @cached_property
    def usual_duration(self) -> float:
        """Duration of a contact without other forces, s: equations.md 6.9."""
        return float(
            np.pi / np.sqrt(self._contact.direction * self.force[: self._forced.modes] @ self._contact.shape)
        )

    def presses(self, states: Floats) -> NDArray[np.bool_]:
        """Return whether the force of a stop in its place would be positive at vectors, shape (size, n)."""
        force = self.force.copy()
        force[self._forced.offset] = 0.0
        return np.asarray(force @ states > 0.0)

    def fixed(self, duration: float) -> Floats:
        """Return the linear map of a contact of a given duration, s, with the surface of the stop in its place."""
        return self.flow.over(duration)

    def through(self, before: Floats, limit: float, *, recorded: float = np.nan) -> Passage:
        """Return the passage of a vector of `ForcedModes`; OrbitError if it takes longer than a limit, s.

        A `recorded` duration (s) makes the passage linear in the vector.
        """
        forced = self._forced
        speed = self._contact.direction * float(self._approach @ before)
        pressed = before.copy()
        pressed[forced.offset] = self._beyond @ before if self._is_shifted else 0.0
        if speed > 0.0 and 0.0 < recorded < limit:
            return self._of_duration(pressed, recorded)
        return self._of_duration(
            pressed, self.release(pressed, limit) if speed > 0.0 else -self._began(pressed)
        )

    @property
    def pressing_again(self) -> tuple[Floats, float]:
        """Row and value of vectors where a stop is pressed again before it is left, m/s; OrbitError: no dashpot."""
        if not self._damping > 0.0:
            raise OrbitError("orbit: expected a stop with damping, which presses again, got one without.")
        return self.force / self._damping, 0.0

    def again(self, before: Floats, limit: float, *, recorded: float = np.nan) -> Passage:
        """Return the passage of a vector within a stop whose force begins at 0; OrbitError beyond a limit, s."""
        own, is_known = self._forced.motion, 0.0 < recorded < limit
        duration = recorded if is_known else self.release(before, limit, from_zero=True)
        flow = self.flow.over(duration)[own, own]
        return replace(
            self._of_duration(before, duration),
            slope=flow,
            shift=-flow @ (self.flow.matrix @ before)[own],
            tangent=flow,  # the force does not jump
        )

    def _of_duration(self, pressed: Floats, duration: float) -> Passage:
        """Return the passage of a vector with its offset, if the stop is pressed for a duration, s.

        A negative duration continues the motions with contacts beyond a graze: their speed and duration pass through 0.
        """
        forced, contact = self._forced, self._contact
        own, sign = forced.motion, contact.direction
        over = self.flow.over(duration) if duration >= 0.0 else self._back.over(-duration)
        after = over @ pressed
        flow, by_offset = over[own, own], over[own, forced.offset] * self._is_shifted
        normal = np.concatenate([contact.shape, np.zeros(forced.modes)])
        salted = np.eye(2 * forced.modes)
        salted[forced.velocity, : forced.modes] -= self._damping * np.outer(contact.shape, contact.shape)
        drift = float(self._approach[forced.modes * 2 :] @ pressed[forced.modes * 2 :])
        return Passage(
            sign * float(self._approach @ pressed),
            -sign * float(self._approach @ after),
            *(duration, float(after[forced.impulse]), after[own]),
            flow + np.outer(by_offset, normal),
            by_offset * drift - flow @ (self.flow.matrix @ pressed)[own],
            flow @ salted,
            float(np.exp(-self._damping * duration / contact.mass)),
            self.flow if duration > 0.0 else None,
        )

    def release(self, pressed: Floats, limit: float, *, from_zero: bool = False) -> float:
        """Return the time after which the force is 0 again, s; OrbitError if it takes longer than a limit.

        The force begins at 0 without a dashpot, or where a stop is pressed again (`from_zero`).
        """
        from_zero |= self._damping == 0.0 and self._is_shifted
        state, passed, step = pressed, 0.0, self.flow.step
        rows = np.vstack([self.force, self._rate])
        for bit in range(FIRST_SAMPLES, 63):
            samples = self.flow.samples(state, bit)
            ahead = np.column_stack([samples, self.flow.one_step @ samples[:, -1]])
            forces, rates = rows @ ahead
            if (
                not self._is_shifted and not from_zero and passed == 0.0 and forces[0] < 0.0
            ):  # beside an orbit a stop may be met late
                if not (forces > 0.0).any():
                    raise OrbitError(
                        "orbit: expected a contact that presses its stop, got one that does not reach it."
                    )
                forces[: int(np.argmax(forces > 0.0)) + 1] = np.inf
            for k in _may_release(forces, rates, step):
                time = self._zero(ahead[:, k], from_zero and passed == 0.0 and k == 0)
                if time is not None:
                    return passed + float(k) * step + time
            passed += samples.shape[1] * step
            if passed > limit:
                break
            state = ahead[:, -1]
        raise OrbitError(
            f"orbit: expected a stop that is left within {limit:.6g} s, got one that stays pressed."
        )

    def _began(self, pressed: Floats) -> float:
        """Return the time before which the force of a contact without speed was 0, s; OrbitError if it is long."""
        series = self._back.polynomial(self.force[None], pressed)[:, 0]
        # without a dashpot the force begins at 0, and is divided by the time
        series = -series if self._damping > 0.0 else series[1:]
        time = 0.0 if series[0] == 0.0 else _first_fall(series, self._back.step)
        if time is not None:
            return time
        raise OrbitError("orbit: expected contacts with a speed towards their stops, got one away from it.")

    def _zero(self, state: Floats, from_zero: bool) -> float | None:
        """Return the time within a step from a state at which the force falls through 0; None without one."""
        step = self.flow.step
        series = self.flow.polynomial(self.force[None], state)[:, 0]
        if from_zero:
            series = series[1:]
        return _first_fall(series, step)


def _first_fall(series: Floats, step: float) -> float | None:
    """Return the first time within a step at which a polynomial falls through 0; None without one."""
    if value_of(series, step) < 0.0:
        return zero_of(series, 0.0, step)
    slopes = series[1:] * np.arange(1, series.size)
    if not (slopes[0] < 0.0 < value_of(slopes, step)):
        return None
    lowest = zero_of(slopes, 0.0, step)
    return zero_of(series, 0.0, lowest) if value_of(series, lowest) < 0.0 else None


def _may_release(forces: Floats, rates: Floats, step: float) -> list[int]:
    """Return the steps at whose end the force is negative, or within which its cubic comes near to 0."""
    left, right = forces[:-1], forces[1:]
    dips = (rates[:-1] < 0.0) & (rates[1:] > 0.0)
    lowest = np.minimum(left + rates[:-1] * step / 3.0, right - rates[1:] * step / 3.0)
    near = dips & (lowest < SHALLOW * np.maximum(left, right))
    return [int(k) for k in np.flatnonzero((right < 0.0) | near)]
