"""An independent solution for bodies with many modes: DOP853 between impacts, nothing of the package imported.

Slow and plain. Between events it integrates the modal equations

    q'' + D q' + diag(w^2) q = f cos(Omega t + psi) + held - sum_k n_k F_k

numerically; n_k is the shape of contact k turned towards its stop. Impulsive stops answer with joint impulses P >= 0
(linear complementarity over all touching contacts), compliant stops with F = max(0, law) during penetration. A contact
at rest is held, with the constrained equations, until its force falls through zero.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import DOP853, solve_ivp

from support.reference_bodies import Body, Floats
from support.reference_stops import Forcing, Impact, Press, Stick, Stop, complementary, first_rise

# States of a contact.
OUT, PRESSED, SLACK, HELD = "out", "pressed", "slack", "held"
_SAMPLES = 16

Quantity = Callable[[Floats | float, Floats], Floats]
"""Function of the time and the state, at one instant or at many."""


@dataclass(frozen=True)
class _Mark:
    """A state from which the motion can be integrated again."""

    time: float
    y: Floats
    status: tuple[str, ...]


@dataclass
class Reference:
    """A body with stops, from a start state; `advance` integrates it and fills `impacts`, `sticks` and `presses`.

    A complete chatter is cut at velocities below `chatter_velocity` (times `scale`). The geometric tail gives a time of
    accumulation at each of the last two impacts. The two times are extrapolated to zero velocity, since their error is
    quadratic.
    """

    body: Body
    stops: Sequence[Stop]
    forcing: Forcing
    q: Floats
    p: Floats
    time: float = 0.0
    rtol: float = 1e-12
    scale: float = 1.0
    chatter_velocity: float = 3e-5
    impacts: list[Impact] = field(default_factory=list)
    sticks: list[Stick] = field(default_factory=list)
    presses: list[Press] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.y = np.concatenate([np.asarray(self.q, dtype=float), np.asarray(self.p, dtype=float)])
        self.status = [OUT] * len(self.stops)
        self._normals = np.array([s.normal for s in self.stops]).reshape(len(self.stops), self.body.modes)
        self._positions = np.array([s.side * s.position for s in self.stops])
        self._generator = self.body.generator
        self._held = np.broadcast_to(np.asarray(self.forcing.held, dtype=float), (self.body.modes,))
        self._tails: dict[int, tuple[float, float]] = {}
        self._marks: list[_Mark] = []
        self._events: set[int] = set()
        self._resolve()

    # -- the equations -------------------------------------------------------------------------------------------------

    def gaps(self, y: Floats) -> Floats:
        """Return the penetrations, shape (contacts, ...)."""
        found: Floats = ((self._normals @ y[: self.body.modes]).T - self._positions).T
        return found

    def rates(self, y: Floats) -> Floats:
        """Return the velocities into the stops, shape (contacts, ...)."""
        return self._normals @ y[self.body.modes :]

    def _free(self, time: Floats | float, y: Floats, status: Sequence[str]) -> Floats:
        """Return the modal accelerations without the forces of held contacts, shape (modes, ...)."""
        n, f = self.body.modes, self.forcing
        wave = np.cos(f.angular_frequency * np.asarray(time) + f.phase)
        load = np.multiply.outer(f.force, wave)
        load = (load.T + self._held).T
        result: Floats = load - (y[:n].T * self.body.natural**2).T - self.body.damping @ y[n:]
        for k, stop in enumerate(self.stops):
            if status[k] == PRESSED:
                gap, rate = stop.normal @ y[:n] - stop.side * stop.position, stop.normal @ y[n:]
                result = result - np.multiply.outer(stop.normal, stop.raw_force(gap, rate))
        return result

    def held_forces(self, time: Floats | float, y: Floats, status: Sequence[str]) -> tuple[Floats, Floats]:
        """Return the free accelerations and the forces of the held contacts, shape (held, ...)."""
        free = self._free(time, y, status)
        held = self._normals[[k for k, s in enumerate(status) if s == HELD]]
        return free, np.linalg.solve(held @ held.T, held @ free) if len(held) else held @ free

    def _slope(self, time: float, y: Floats, status: Sequence[str]) -> Floats:
        if HELD not in status and PRESSED not in status:
            f = self.forcing
            slope: Floats = self._generator @ y
            slope[self.body.modes :] += f.force * math.cos(f.angular_frequency * time + f.phase) + self._held
            return slope
        free, force = self.held_forces(time, y, status)
        held = self._normals[[k for k, s in enumerate(status) if s == HELD]]
        return np.concatenate([y[self.body.modes :], free - held.T @ force])

    def contact_forces(self, time: float) -> Floats:
        """Return the force of each stop at a time in the past, shape (contacts,), N."""
        mark = self._mark(time)
        y = self.integrate(mark.time, mark.y, time, mark.status)
        forces = np.zeros(len(self.stops))
        _, held = self.held_forces(time, y, mark.status)
        forces[[k for k, s in enumerate(mark.status) if s == HELD]] = held
        for k, stop in enumerate(self.stops):
            if mark.status[k] == PRESSED:
                forces[k] = stop.raw_force(self.gaps(y)[k], self.rates(y)[k])
        return forces

    # -- steps ---------------------------------------------------------------------------------------------------------

    def advance(self, end: float, impacts: int | None = None) -> Reference:
        """Integrate to a time, or to a total number of impacts."""
        while self.time < end and (impacts is None or len(self.impacts) < impacts):
            self._fly(end)
            if self._events:
                self._resolve()
        return self

    def state(self, time: float) -> tuple[Floats, Floats]:
        """Return q and q' at a time in the past (after an impact at that time)."""
        mark = self._mark(time)
        y = self.integrate(mark.time, mark.y, time, mark.status)
        return y[: self.body.modes], y[self.body.modes :]

    def _mark(self, time: float) -> _Mark:
        place = bisect_right([mark.time for mark in self._marks], time) - 1
        assert place >= 0, f"{time} is before the start"
        assert time <= self.time, f"{time} is not computed yet"
        return self._marks[place]

    def _tolerances(self) -> dict[str, float]:
        return {"rtol": max(self.rtol, 1e-13), "atol": 1e-13 * self.scale}

    def integrate(self, time: float, y: Floats, end: float, status: Sequence[str]) -> Floats:
        if end == time:
            return y
        done = solve_ivp(
            lambda u, z: self._slope(time + u, z, status),
            (0.0, end - time),
            y,
            method="DOP853",
            **self._tolerances(),
        )
        result: Floats = done.y[:, -1]
        return result

    def _fly(self, end: float) -> None:
        """Integrate to the next event, or to the end."""
        status = tuple(self.status)
        self._marks.append(_Mark(self.time, self.y, status))
        skip = min(self._skip(), end - self.time)
        if skip > 0.0:
            self.y = self.integrate(self.time, self.y, self.time + skip, status)
            self.time += skip
        origin = self.time
        if origin >= end:
            return
        solver = DOP853(
            lambda u, z: self._slope(origin + u, z, status),
            0.0,
            self.y,
            end - origin,
            **self._tolerances(),
        )
        while solver.status == "running":
            start, before = solver.t, solver.y.copy()
            message = solver.step()
            assert solver.status != "failed", message
            found = self._first_event(solver.dense_output(), start, solver.t, origin, status)
            if found is not None:
                time, self._events = found
                self.y = self.integrate(origin + start, before, origin + time, status)
                time, self.y = self._polished(origin + start, before, origin + time, status)
                self.time = time
                return
            self.time, self.y = origin + solver.t, solver.y.copy()
            self._marks.append(_Mark(self.time, self.y, status))
        self.time = end

    def _skip(self) -> float:
        """Return a time within which a contact that has just met or left its stop cannot have its next event."""
        fastest = max([*self.body.natural, self.forcing.angular_frequency])
        shortest = math.inf
        gaps, rates = self.gaps(self.y), self.rates(self.y)
        for k, stop in enumerate(self.stops):
            if abs(gaps[k]) > 1e-12 * self.scale or self.status[k] == HELD:
                continue
            if self.status[k] == PRESSED:
                mass = 1.0 / (stop.shape @ stop.shape)
                power = stop.exponent if stop.law == "hunt_crossley" else 1.5
                power = 1.0 if stop.law == "kelvin_voigt" else power
                depth = (mass * rates[k] ** 2 / stop.stiffness) ** (1.0 / (power + 1.0))
                shortest = min(shortest, 1e-3 * depth / max(abs(rates[k]), 1e-300))
                continue
            pull = abs(self._normals[k] @ self._slope(self.time, self.y, self.status)[self.body.modes :])
            flight = 0.2 * abs(rates[k]) / pull if pull > 0.0 and rates[k] != 0.0 else math.inf
            shortest = min(shortest, flight)
        return min(shortest, 1e-2 / fastest) if self._touching() else 0.0

    def _touching(self) -> bool:
        gaps = self.gaps(self.y)
        return any(abs(g) <= 1e-12 * self.scale and s != HELD for g, s in zip(gaps, self.status, strict=True))

    # -- events --------------------------------------------------------------------------------------------------------

    def _watched(self, status: Sequence[str]) -> list[tuple[int, Quantity]]:
        """Return the quantities whose rise through zero is an event, with their contacts."""
        watched: list[tuple[int, Quantity]] = []
        for k in range(len(self.stops)):
            if status[k] == HELD:
                watched.append((k, _falling(self._held_force(k, status))))
            elif status[k] == OUT:
                watched.append((k, self._gap(k)))
            elif status[k] == PRESSED:
                watched.append((k, _falling(self._pressing(k))))
            else:
                watched.append((k, _falling(self._gap(k))))
                watched.append((k, self._pressing(k)))
        return watched

    def _gap(self, k: int) -> Quantity:
        return lambda _, y: np.asarray(self.gaps(y)[k])

    def _pressing(self, k: int) -> Quantity:
        return lambda _, y: self.stops[k].pressing(self.gaps(y)[k], self.rates(y)[k])

    def _held_force(self, k: int, status: Sequence[str]) -> Quantity:
        row = list(status[:k]).count(HELD)
        return lambda time, y: np.asarray(self.held_forces(time, y, status)[1][row])

    def _first_event(
        self,
        dense: Callable[[Floats | float], Floats],
        start: float,
        end: float,
        origin: float,
        status: Sequence[str],
    ) -> tuple[float, set[int]] | None:
        """Return time and contact of the first rise through zero within a step."""
        margin = (end - start) / _SAMPLES
        u = np.linspace(start - margin, end + margin, _SAMPLES + 3)
        y = dense(u)
        first: tuple[float, set[int]] | None = None
        for k, quantity in self._watched(status):
            values = quantity(origin + u, y)

            def at(x: float, g: Quantity = quantity) -> float:
                return float(g(origin + x, dense(x)))

            root = first_rise(at, u, values, start, end)
            if root is not None and (first is None or root < first[0]):
                first = (root, {k})
        return first

    def _polished(
        self, start: float, before: Floats, time: float, status: Sequence[str]
    ) -> tuple[float, Floats]:
        """Return the time of the event by Newton's method on integrated states (the interpolant has fewer digits)."""
        (k,) = self._events
        quantities = [g for owner, g in self._watched(status) if owner == k]
        y = self.integrate(start, before, time, status)
        quantity = min(quantities, key=lambda g: abs(float(g(time, y))))
        h = 1e-6 * max(time - start, 1e-9 * self.scale)
        for _ in range(3):
            value = float(quantity(time, y))
            ahead = self.integrate(time, y, time + h, status)
            slope = (float(quantity(time + h, ahead)) - value) / h
            if abs(slope) * h < 1e-14 * self.scale or abs(value / slope) > 1e-6:
                break  # a graze: only half of the time's digits are known
            time -= value / slope
            y = self.integrate(start, before, time, status)
        return time, y

    # -- effects of an event -------------------------------------------------------------------------------------------

    def _resolve(self) -> None:
        """Change the status of the contacts, apply impulses, and hold or release."""
        events, self._events = self._events, set()
        for k in range(len(self.stops)):
            if self.stops[k].compliant:
                self._meet_compliant(k, k in events)
        released = {k for k in events if self.status[k] == HELD}
        for k in released:
            self._release(k)
        touching = [k for k in self._rigid_contacts(events) if k not in released]
        if any(self.rates(self.y)[k] > 1e-14 * self.scale and self.status[k] == OUT for k in touching):
            self._strike(touching)
        self._hold(touching)
        if not self._marks or self._marks[-1].time <= self.time:
            self._marks.append(_Mark(self.time, self.y, tuple(self.status)))

    def _rigid_contacts(self, events: set[int]) -> list[int]:
        """Return the impulsive contacts on their stops that do not move away from them."""
        gaps, rates = self.gaps(self.y), self.rates(self.y)
        near = 1e-12 * self.scale
        return [
            k
            for k, stop in enumerate(self.stops)
            if not stop.compliant
            and (k in events or self.status[k] == HELD or abs(gaps[k]) <= near)
            and (rates[k] >= -near or self.status[k] == HELD)
        ]

    def _strike(self, touching: list[int]) -> None:
        """Apply the joint impulses: P >= 0, v+ + r v- >= 0, one of them zero; v is positive for separation."""
        normals = self._normals[touching]
        approach = self.rates(self.y)[touching]
        approach[[self.status[k] == HELD for k in touching]] = 0.0
        r = np.array([self.stops[k].restitution for k in touching])
        impulses = complementary(normals @ normals.T, -(1.0 + r) * approach)
        self.y = self.y.copy()
        self.y[self.body.modes :] -= normals.T @ impulses
        for k, velocity, impulse in zip(touching, approach, impulses, strict=True):
            if impulse > 0.0 and velocity > 0.0:
                self.impacts.append(Impact(self.time, float(velocity), float(impulse), k + 1))

    def _hold(self, candidates: list[int]) -> None:
        """Hold the pressed contacts that are at rest on their stops, or in the tail of a chatter."""
        slow = self.chatter_velocity * self.scale
        rates = self.rates(self.y)
        rest = [k for k in candidates if self.status[k] == HELD or abs(rates[k]) < slow]
        others = [k for k, s in enumerate(self.status) if s == HELD and k not in rest]
        rest += others
        if not rest:
            return
        y = self._stopped(rest)
        status = [OUT if k in rest else s for k, s in enumerate(self.status)]
        normals = self._normals[rest]
        free = normals @ self._free(self.time, y, status)
        forces = complementary(normals @ normals.T, -free)
        pressed = [k for k, force in zip(rest, forces, strict=True) if force > 0.0]
        self._note_tails(pressed, y, status)
        for k in rest:
            if k in pressed and self.status[k] != HELD:
                self.sticks.append(Stick(self._accumulation(k), k + 1))
                self.status[k] = HELD
            elif k not in pressed and self.status[k] == HELD:
                self._release(k)
        if pressed:
            self.y = self._stopped(pressed)

    def _stopped(self, contacts: list[int]) -> Floats:
        """Return the state with contacts exactly on their stops, at rest, by plastic impulses."""
        normals = self._normals[contacts]
        y, n = self.y.copy(), self.body.modes
        y[:n] -= np.linalg.lstsq(normals, self.gaps(y)[contacts], rcond=None)[0]
        y[n:] -= np.linalg.lstsq(normals, self.rates(y)[contacts], rcond=None)[0]
        return y

    def _note_tails(self, pressed: list[int], y: Floats, status: Sequence[str]) -> None:
        """Store the velocity and the pull into the stop for each chatter that is about to be cut."""
        for k in pressed:
            last = [impact for impact in self.impacts if impact.contact == k + 1][-2:]
            if len(last) < 2 or last[-1].time != self.time:
                self._tails.pop(k, None)
                continue
            self._tails[k] = (last[-1].velocity, float(self._normals[k] @ self._free(self.time, y, status)))

    def _accumulation(self, k: int) -> float:
        """Return the time of accumulation of a chatter (equations.md 3.1, first order, extrapolated)."""
        if k not in self._tails:
            return self.time
        r = self.stops[k].restitution
        velocity, pull = self._tails.pop(k)
        mine = [impact for impact in self.impacts if impact.contact == k + 1][-2:]
        times = []
        for impact, speed in zip(mine, (mine[0].velocity, velocity), strict=True):
            before = self._contact_pull(k, impact.time) if impact is mine[0] else pull
            times.append(impact.time + 2.0 * r * speed / (before * (1.0 - r)))
        ratio = (mine[1].velocity / mine[0].velocity) ** 2
        return (times[1] - ratio * times[0]) / (1.0 - ratio)

    def _contact_pull(self, k: int, time: float) -> float:
        """Return the acceleration into stop k at an earlier impact, without the contact velocity."""
        mark = self._mark(time)
        y = self.integrate(mark.time, mark.y, time, mark.status)
        n, normal = self.body.modes, self._normals[k]
        y = y.copy()
        y[n:] -= normal * (normal @ y[n:]) / (normal @ normal)
        return float(normal @ self._slope(time, y, mark.status)[n:])

    def _release(self, k: int) -> None:
        self.status[k] = OUT
        for stick in reversed(self.sticks):
            if stick.contact == k + 1:
                stick.end = self.time
                break

    def _meet_compliant(self, k: int, at_event: bool) -> None:
        """Start, slacken or end a compliant contact."""
        if self.status[k] != OUT and not at_event:
            return
        stop, was = self.stops[k], self.status[k]
        gap, rate = float(self.gaps(self.y)[k]), float(self.rates(self.y)[k])
        near = 1e-13 * self.scale
        if was == OUT and (gap > near or (rate > 0.0 and (at_event or gap >= -near))):
            self.status[k] = PRESSED
            self.presses.append(Press(self.time, rate, k + 1))
        elif was == PRESSED:
            self.status[k] = SLACK if gap > near else OUT
            self.presses[self._last_press(k)].end = self.time
            self.presses[self._last_press(k)].velocity_out = -rate
        elif was == SLACK:
            pressing = float(stop.pressing(gap, rate))
            again = gap > near and abs(pressing) <= near * max(1.0, stop.stiffness)
            self.status[k] = PRESSED if again else OUT
            if again:
                self.presses.append(Press(self.time, rate, k + 1))

    def _last_press(self, k: int) -> int:
        return max(i for i, press in enumerate(self.presses) if press.contact == k + 1)


def _falling(quantity: Quantity) -> Quantity:
    """Return the negated quantity, which rises through zero when the quantity falls through it."""
    return lambda time, y: -quantity(time, y)
