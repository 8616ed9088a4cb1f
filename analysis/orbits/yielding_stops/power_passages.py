"""The passage of a state through a contact whose force is a power of the depth: equations.md 4.18.

The modes move by their exact flow between the values of the force at Gauss nodes. The nodes are dense at both ends,
where the depth then grows with the square of their variable. So a force d^1.5 has a power series in this variable.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.errors import OrbitError
from vibroimpact.analysis.orbits.yielding_stops.linear_flow import LinearFlow
from vibroimpact.analysis.orbits.yielding_stops.passages import ForcedModes, LinearPassage, Passage
from vibroimpact.fmus.bodies.impacting_body import Contact, Floats, Press

NODES = (24, 48, 96, 192)
"""Numbers of Gauss nodes, tried in order."""
TAIL = 1e-12
"""Last Legendre coefficients of the force, over its largest, below which the nodes suffice."""
MOST_NEWTON = 30
QUADRATIC, ROUGH = 1e-10, 1e-7
"""Change of the forces or of the duration, over their size, below which the next one is rounding, or stagnates."""
EVEN = np.linspace(0.0, 1.0, 65)
"""Shares of the duration of a contact at which the forces of a first guess are known."""
WEAK = 0.05
"""Force of a contact, over the force that brings the body back, below which it hardly changes the motion."""
COARSE_STEPS = (64, 512)
"""Numbers of steps over a contact without other forces in the search for its end; the second for recorded contacts."""
MOST_COARSE = 400_000
SPEEDS = 10.0 ** np.arange(-1.5, 1.0, 0.5)
"""Speeds, over that of the force's motion, for which an equivalent spring and dashpot guesses orbits."""
ALIKE = 2.0
"""Ratio of the speed of a guess to that of its equivalent spring up to which it counts."""


class Grid(NamedTuple):
    """Gauss nodes of x in 0 to 1, and time over duration: s = x^2 (3 - 2 x)."""

    x: Floats
    share: Floats
    """s at the nodes."""
    weights: Floats
    """Weights of integrals over s."""
    integral: Floats
    """Weights of integrals over s up to each node, shape (node, node)."""
    to_series: Floats
    """Legendre coefficients of unit values at the nodes, shape (order, node)."""


@cache
def grid(count: int) -> Grid:
    """Return a grid of Gauss nodes."""
    at, weights = legendre.leggauss(count)
    orders = np.arange(count)
    values = legendre.legvander(at, count - 1)
    to_series = (2.0 * orders[:, None] + 1.0) / 2.0 * values.T * weights
    # the integral of P_n from -1 is (P_n+1 - P_n-1)/(2n + 1)
    beyond = legendre.legvander(at, count)
    integrals = np.column_stack(
        [at + 1.0, *((beyond[:, n + 1] - beyond[:, n - 1]) / (2.0 * n + 1.0) for n in range(1, count))]
    )
    x = 0.5 * (at + 1.0)
    rate = 6.0 * x * (1.0 - x)
    return Grid(
        x, x**2 * (3.0 - 2.0 * x), 0.5 * weights * rate, 0.5 * integrals @ to_series * rate, to_series
    )


@dataclass(frozen=True, eq=False)
class PressedPath:
    """The motion while a stop is pressed: a polynomial of the variable of its nodes."""

    duration: float
    nodes: Grid
    values: Callable[[], Floats]
    """Returns the vectors of `ForcedModes` at the nodes, shape (node, size)."""

    @property
    def step(self) -> float:
        """Time between samples that show each maximum, s."""
        return self.duration / (2.0 * self.nodes.x.size)

    @cached_property
    def series(self) -> Floats:
        """Legendre coefficients of the vector, shape (order, size)."""
        return self.nodes.to_series @ self.values()

    def along(self, state: Floats, times: Floats) -> Floats:
        """Return the vectors after times, shape (size, times); the state at the beginning is known."""
        share = np.clip(times / self.duration, 0.0, 1.0)
        x = 0.5 - np.sin(np.arcsin(1.0 - 2.0 * share) / 3.0)
        return np.asarray(legendre.legval(2.0 * x - 1.0, self.series))


@dataclass(frozen=True, eq=False)
class _Hint:
    """A contact that is known roughly: its duration, its forces at equal times, the number of nodes that it needs."""

    duration: float
    forces: Floats
    count: int
    pulls: bool = False
    """Whether the contact ends where the force would pull, before the stop is left."""


class _Contact(NamedTuple):
    """Forces at the nodes, N, with the maps by which they act."""

    nodes: Grid
    duration: float
    force: Floats
    depth: Floats
    by_depth: Floats
    by_rate: Floats
    answer: Floats
    """Depth and rate at the nodes for unit forces, shape (2, node, node)."""
    kicks: Floats
    """Vectors at time 0 that answer alike to forces at the nodes, shape (size, node)."""
    end: Floats
    """Depth and rate at the end."""


class PowerPassage:
    """Contacts with the force stiffness d^exponent (1 + damping d'), which never pulls."""

    def __init__(self, forced: ForcedModes, contact: Contact, press: Press) -> None:
        self._forced, self._contact, self._press = forced, contact, press
        self.direction = contact.direction
        self._beyond = contact.direction * forced.beyond(contact)
        self._beyond[forced.offset] = -contact.direction  # depths count from the offset of the surface
        self._approach = contact.direction * forced.approach(contact)
        self._second = self._approach @ forced.free.matrix
        self._kick = np.zeros(forced.size)
        self._kick[forced.velocity] = contact.direction * contact.shape
        rate = forced.free.rate
        self._back = forced.free.reversed()
        self._rows = LinearFlow(forced.free.matrix.T, rate)
        self._hint: _Hint | None = None

    # ---- equivalent springs ----

    def usual_duration_at(self, speed: float) -> float:
        """Return the duration of a contact without other forces and without damping, s: equations.md 6.10."""
        press, power = self._press, self._press.exponent + 1.0
        deepest = (0.5 * power * self._contact.mass * speed**2 / press.stiffness) ** (1.0 / power)
        integral = math.sqrt(math.pi) * math.gamma(1.0 / power) / math.gamma(1.0 / power + 0.5) / power
        return float(2.0 * deepest / speed * integral)

    @cached_property
    def usual_duration(self) -> float:
        """Duration of a contact without other forces at a speed of the force's motion, s."""
        return self.usual_duration_at(0.3 * self._size)

    @property
    def _size(self) -> float:
        return self._forced.body.scale * self._forced.body.angular_frequency

    def fixed(self, duration: float) -> Floats:
        """Return the linear map of an equivalent spring that is pressed for a duration, s."""
        spring = self._contact.mass * (np.pi / duration) ** 2 if duration > 0.0 else 0.0
        return self._forced.pressed(self._contact, spring, 0.0)[0].over(duration)

    def equivalents(self) -> Iterator[tuple[float, LinearPassage]]:
        """Yield speeds, m/s, and springs and dashpots that answer alike to them: equations.md 6.10."""
        for speed in self._size * SPEEDS:
            spring = self._contact.mass * (np.pi / self.usual_duration_at(speed)) ** 2
            lost = 2.0 / 3.0 * self._press.damping * speed / np.pi
            drag = 2.0 * min(lost, 0.7) * np.sqrt(spring * self._contact.mass)
            yield speed, LinearPassage(self._forced, self._contact, spring, drag)

    def _half_turn(self, depth: float) -> float:
        """Return half the period of small motions about a depth, s; OrbitError unless the depth is positive."""
        if not depth > 0.0:
            raise OrbitError("orbit: expected a stop that is pressed again within it, got a point outside.")
        press = self._press
        spring = press.exponent * press.stiffness * depth ** (press.exponent - 1.0)
        return float(np.pi * np.sqrt(self._contact.mass / spring))

    # ---- one contact ----

    def presses(self, states: Floats) -> NDArray[np.bool_]:
        """Return whether the force of a stop in its place would be positive at vectors, shape (size, n)."""
        return np.asarray(1.0 + self._press.damping * (self._approach @ states) > 0.0)

    def through(self, before: Floats, limit: float, *, recorded: float = np.nan) -> Passage:
        """Return the passage of a vector of `ForcedModes`; OrbitError if it takes longer than a limit, s.

        A contact with a `recorded` duration (s) has an end, so finer steps search for it.
        """
        forced, speed = self._forced, float(self._approach @ before)
        if not speed > 0.0:
            own, same = forced.motion, np.eye(2 * forced.modes)
            begins = (forced.free.matrix @ before)[own]
            return Passage(speed, -speed, 0.0, 0.0, before[own], same, -begins, same, 1.0)
        entry = before.copy()
        entry[forced.offset] = self.direction * float(self._beyond @ before)
        found = self._contact_of(entry, limit, COARSE_STEPS if recorded > 0.0 else COARSE_STEPS[:1])
        passage, by_offset = self._passed(entry, found)
        normal = np.concatenate([self._contact.shape, np.zeros(forced.modes)])
        drift = self.direction * float(self._approach[2 * forced.modes :] @ before[2 * forced.modes :])
        return replace(
            passage,
            slope=passage.slope + np.outer(by_offset, normal),
            shift=passage.shift + by_offset * drift,
        )

    @property
    def pressing_again(self) -> tuple[Floats, float]:
        """Row and value of vectors where a stop is pressed again before it is left, m/s; OrbitError: no damping."""
        if not self._press.damping > 0.0:
            raise OrbitError("orbit: expected a stop with damping, which presses again, got one without.")
        return self.direction * self._approach, -self.direction / self._press.damping

    def again(self, before: Floats, limit: float, *, recorded: float = np.nan) -> Passage:
        """Return the passage of a vector within a stop whose force begins at 0; OrbitError beyond a limit, s."""
        found = self._near(before, self._coarse(before, limit, COARSE_STEPS[-1]), limit)
        if found is None:
            raise OrbitError(f"orbit: expected a stop that is pressed again within {limit:.6g} s, got none.")
        return self._passed(before, found[0])[0]

    def _passed(self, before: Floats, found: _Contact) -> tuple[Passage, Floats]:
        """Return the passage of a vector with a fixed offset, and the derivative of its end by the offset."""
        forced, speed = self._forced, float(self._approach @ before)
        own = forced.motion
        begins = (forced.free.matrix @ before)[own]
        over, nodes = forced.free.over(found.duration), found.nodes
        times = found.duration * nodes.share
        # forces act on all that comes later: at each node, and at the end
        pushed = found.duration * nodes.weights * found.force
        after = over @ (before - found.kicks @ pushed)
        rows = self._rows.along(self._beyond, times).T, self._rows.along(self._approach, times).T
        driven = found.by_depth[:, None] * rows[0] + found.by_rate[:, None] * rows[1]
        system = (
            np.eye(times.size)
            + found.by_depth[:, None] * found.answer[0]
            + found.by_rate[:, None] * found.answer[1]
        )
        changes = np.linalg.solve(system, np.column_stack([driven[:, own], -self.direction * found.by_depth]))
        ends = -(over @ found.kicks)[own] * (found.duration * nodes.weights)
        flow, by_offset = over[own, own] + ends @ changes[:, :-1], ends @ changes[:, -1]
        lost = self._press.damping * self._press.stiffness * found.depth**self._press.exponent
        after[forced.impulse] = pushed.sum()
        passage = Passage(
            *(speed, -float(self._approach @ after), found.duration, float(pushed.sum()), after[own]),
            *(flow, -flow @ begins, flow),
            float(np.exp(-found.duration * nodes.weights @ lost / self._contact.mass)),
            PressedPath(found.duration, nodes, partial(self._vectors, found, before)),
        )
        return passage, by_offset

    def _vectors(self, found: _Contact, before: Floats) -> Floats:
        """Return the vectors at the nodes of a contact, shape (node, size)."""
        pushes = found.duration * found.nodes.integral * found.force
        starts = before - pushes @ found.kicks.T
        times = found.duration * found.nodes.share
        return np.array(
            [self._forced.free.over(time) @ each for time, each in zip(times, starts, strict=True)]
        )

    def _contact_of(self, before: Floats, limit: float, coarse: tuple[int, ...]) -> _Contact:
        """Return the contact of a state, near to the last contact or near to a coarse one."""
        for hint in self._hints(before, limit, coarse):
            near = self._near(before, hint, limit)
            if near is not None:
                found, self._hint = near
                return found
        raise OrbitError(
            f"orbit: expected contacts that {NODES[-1]} values of the force describe, got a longer one on a power law."
        )

    def _hints(self, before: Floats, limit: float, coarse: tuple[int, ...]) -> Iterator[_Hint]:
        """Yield contacts that are known roughly; OrbitError if the finest steps find no end."""
        if self._hint is not None:
            yield self._hint
        weak = self._weak(before)
        if weak is not None:
            yield weak
        for steps in coarse:
            try:
                yield self._coarse(before, limit, steps)
            except OrbitError:  # steps may miss a short way out of the stop
                if steps == coarse[-1]:
                    raise

    def _near(self, before: Floats, hint: _Hint, limit: float) -> tuple[_Contact, _Hint] | None:
        """Return the contact near to a hint, with as few nodes as suffice, and its own hint; None without one."""
        for count in (each for each in NODES if each >= hint.count):
            found = self._solved(before, grid(count), hint, limit)
            if found is None:  # a long contact needs more nodes
                continue
            forces = np.interp(EVEN, found.nodes.share, found.force)
            hint = _Hint(found.duration, forces, count, hint.pulls)
            tail = np.abs(found.nodes.to_series[-2:] @ found.force).max()
            if tail <= TAIL * np.abs(found.force).max() or count == NODES[-1]:
                return found, hint
        return None

    def _solved(self, before: Floats, nodes: Grid, hint: _Hint, limit: float) -> _Contact | None:
        """Return the contact with a duration near to a hint; None without one."""
        duration = hint.duration
        force = np.interp(nodes.share, EVEN, hint.forces)
        for _ in range(MOST_NEWTON):
            if not 0.0 < duration <= limit:
                return None
            found = self._forces(before, nodes, duration, force)
            if found is None:
                return None
            force, (end, rate) = found.force, self._end(before, found, pulls=hint.pulls)
            change = end / rate if rate < 0.0 else np.nan
            if not np.isfinite(change):
                return None
            duration -= np.clip(change, -0.5 * duration, 0.5 * duration)
            if abs(change) <= QUADRATIC * duration:
                found = self._forces(before, nodes, duration, force)
                presses = found is not None and (found.depth > 0.0).all() and (found.force > 0.0).all()
                return found if presses else None
        return None

    def _end(self, before: Floats, found: _Contact, *, pulls: bool) -> tuple[float, float]:
        """Return the depth, or the factor 1 + damping d' of the force where it `pulls`, at the end, and its rate."""
        depth, rate = (float(each) for each in found.end)
        if not pulls:
            return depth, rate
        time, pushed = np.array([found.duration]), found.duration * found.nodes.weights * found.force
        free = self._second @ self._forced.free.along(before, time)[:, 0]
        faster = free - float(self._rows.along(self._second, time)[:, 0] @ (found.kicks @ pushed))
        return 1.0 + self._press.damping * rate, float(self._press.damping * faster)

    def _free_depth(self, before: Floats, times: Floats) -> tuple[Floats, Floats]:
        """Return depths and rates of the free motion from the beginning of a contact on."""
        flow = self._forced.free
        rows = np.vstack([self._beyond, self._approach])
        if times[-1] <= flow.step:
            series = flow.polynomial(rows, before)
            if float(self._approach @ before) > 0.0:
                series[0, 0] = 0.0  # no digits are lost to the place of the stop
            depth, rate = np.polynomial.polynomial.polyval(times, series)
        else:
            depth, rate = rows @ flow.along(before, times)
        return depth, rate

    def _forces(self, before: Floats, nodes: Grid, duration: float, force: Floats) -> _Contact | None:
        """Return the forces over a duration, by Newton's method."""
        press, times = self._press, duration * np.append(nodes.share, 1.0)
        free = self._free_depth(before, times)
        kicks = self._back.along(self._kick, times[:-1])
        weights = duration * np.vstack([nodes.integral, nodes.weights])
        whole = [self._rows.along(row, times).T @ kicks * weights for row in (self._beyond, self._approach)]
        answer = np.array([each[:-1] for each in whole])
        least = np.inf
        for _ in range(MOST_NEWTON):
            depth, rate = (each[:-1] - by @ force for each, by in zip(free, answer, strict=True))
            inside = np.maximum(depth, 0.0)
            spring = press.stiffness * inside**press.exponent
            drag = 1.0 + press.damping * rate
            by_depth = press.stiffness * press.exponent * inside ** (press.exponent - 1.0) * drag
            by_rate = spring * press.damping
            system = np.eye(force.size) + by_depth[:, None] * answer[0] + by_rate[:, None] * answer[1]
            step = np.linalg.solve(system, spring * drag - force)
            force = force + step
            if not (np.isfinite(force).all() and force.any()):
                return None
            change = float(np.abs(step).max() / np.abs(force).max())
            if change <= QUADRATIC or change >= 0.5 * least < ROUGH:
                end = np.array([each[-1] - by[-1] @ force for each, by in zip(free, whole, strict=True)])
                return _Contact(nodes, duration, force, depth, by_depth, by_rate, answer, kicks, end)
            least = change
        return None

    def _weak(self, before: Floats) -> _Hint | None:
        """Return a contact that hardly changes the motion; None for a strong one, or a motion that does not turn."""
        press, speed, back = self._press, float(self._approach @ before), float(self._second @ before)
        if not back < 0.0 < speed:
            return None
        time = 2.0 * speed / -back
        arc, rates = speed * time * EVEN * (1.0 - EVEN), speed * (1.0 - 2.0 * EVEN)
        weak = press.stiffness * arc**press.exponent * (1.0 + press.damping * rates)
        is_weak = weak.max() < WEAK * -back * self._contact.mass and press.damping * speed < 1.0
        return _Hint(time, weak, NODES[0]) if is_weak else None

    def _coarse(self, before: Floats, limit: float, steps: int) -> _Hint:
        """Return a contact to about a hundredth, by steps with kicks."""
        forced, press = self._forced, self._press
        speed, back = float(self._approach @ before), float(self._second @ before)
        usual = (
            self.usual_duration_at(speed) if speed > 0.0 else self._half_turn(float(self._beyond @ before))
        )
        step = (min(usual, 2.0 * speed / -back) if back < 0.0 < speed else usual) / steps
        half, state, forces = forced.free.over(0.5 * step), before.copy(), [0.0]
        for _ in range(min(MOST_COARSE, int(limit / step) + 2)):
            state = half @ state
            depth, rate = float(self._beyond @ state), float(self._approach @ state)
            force = press.stiffness * max(depth, 0.0) ** press.exponent * (1.0 + press.damping * rate)
            if len(forces) > 1 and not force > 0.0:
                even = np.linspace(0.0, 1.0, len(forces) + 1)
                known = np.interp(EVEN, even, [*forces, 0.0])
                return _Hint((len(forces) - 1) * step, known, NODES[0], depth > 0.0)
            forces.append(force)
            state = half @ (state - step * force * self._kick)
        raise OrbitError(
            f"orbit: expected a stop that is left within {limit:.6g} s, got one that stays pressed."
        )
