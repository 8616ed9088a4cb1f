"""The plane of states of a scene's body of one mode at phase 0 of the clock, and its change over some periods."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits import ImpactingBody, PeriodicOrbit
from vibroimpact.analysis.orbits.index_sum import clears_stops, index
from vibroimpact.analysis.orbits.trigonometric import TURN, SumOfSines
from vibroimpact.fmus.bodies import Contact
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.orchestrator.orbits.bodies import impacting_body, modal_displacements
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.orbits.self_check.plane_chart import PlaneChart, Wall
from vibroimpact.orchestrator.orbits.self_check.winding import Marks
from vibroimpact.orchestrator.scene import Scene

RINGS, RING_POINTS, RING_RATIO = 40, 64, 1.25
"""Rings of one energy that are tried as bound of all fixed points: their number, their states, their ratio."""
AT_ONCE = 1024
"""States in one call; those with a rest run one by one, and slow down larger calls."""
ROOM = 1e-9
"""Distance of the plane from the stops, over its width, since a state on a stop is that after its impact."""
INSIDE = 1e-9
"""Distance from the edge of the rectangle, over its size, at which a fixed point at rest on a stop is marked."""


class StatePlane:
    """States of a body at phase 0: the rectangle that holds all fixed points, and the change over some periods.

    Parameters
    ----------
    scene : Scene
        The scene at the value of its number.
    periods : int
        Forcing periods of the strobe map.

    Attributes
    ----------
    low, high : array, shape (2,)
        Corners of the rectangle, m and m/s.
    chart : PlaneChart
    """

    def __init__(self, scene: Scene, periods: int) -> None:
        self.body, self.periods = impacting_body(scene), periods
        self._flow, self._per_mode = BodyFlow(scene, 1), _per_mode(scene)
        walls = _walls(self.body, scene)
        low = max((each.at for each in walls if each.side < 0.0), default=-np.inf)
        high = min((each.at for each in walls if each.side > 0.0), default=np.inf)
        radius, rate = self._radius((low, high)), float(self.body.frequencies[0])
        low, high = max(low, -radius / rate), min(high, radius / rate)
        room = ROOM * (high - low)
        self.low, self.high = np.array([low + room, -radius]), np.array([high - room, radius])
        self.chart = PlaneChart(low, high, radius, walls)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._flow.close()

    def change(self, states: Floats) -> Floats:
        """Return the change of states over the periods, shape (state, 2); NaN where a run failed."""
        parts = [states[begin : begin + AT_ONCE] for begin in range(0, len(states), AT_ONCE)]
        ends = [self._flow.follow(part, self.periods) for part in parts]
        changes = [
            np.where(end.well[:, None], end.states[:, :2] - part, np.nan)
            for part, end in zip(parts, ends, strict=True)
        ]
        return np.concatenate([np.empty((0, 2)), *changes])

    def change_in_chart(self, states: Floats) -> NDArray[np.complex128]:
        """Return the change in the coordinates of the chart, shape (state,), which is continuous."""
        return np.asarray(self.chart.points(states + self.change(states)) - self.chart.points(states))

    def marks(self, orbits: Sequence[PeriodicOrbit], rests: Sequence[Floats]) -> Marks:
        """Return the known fixed points: those of orbits, of rests, and of the motion without impacts.

        Parameters
        ----------
        orbits : sequence of PeriodicOrbit
        rests : sequence of array, shape (periods, 2)
            Strobe states of orbits that rest on a stop.

        """
        states = [*(self._strobes(each) for each in orbits), *rests]
        indices = [index(each, self.periods) for each in orbits for _ in range(each.periods)]
        free = self._flow.free_state if clears_stops(self.body) else None
        states.append(np.empty((0, 2)) if free is None else free[None, :2])
        indices += [1] * (sum(map(len, rests)) + len(states[-1]))
        known = np.concatenate(states)
        # a state at rest on a stop is on the edge
        room = INSIDE * (self.high - self.low)
        return Marks(np.clip(known, self.low + room, self.high - room), np.array(indices, dtype=np.int64))

    def _strobes(self, orbit: PeriodicOrbit) -> Floats:
        """Return the states of an orbit at phase 0, shape (periods, 2)."""
        first = TURN * np.ceil(orbit.phases[0] / TURN)
        displacement, velocity = orbit.at(first + TURN * np.arange(orbit.periods))
        scale = self._per_mode / float(self.body.observed[0])
        return np.asarray(scale * np.column_stack([displacement, velocity]))

    def _radius(self, span: tuple[float, float]) -> float:
        """Return a bound of all fixed points: the speed of the smallest ring beyond which each ring loses energy."""
        rate = float(self.body.frequencies[0])
        smallest = 0.1 * max(self.body.scale, *(abs(each.position) for each in self.body.contacts)) * rate
        radii = smallest * RING_RATIO ** np.arange(RINGS)
        rings = []
        for radius in radii:
            low, high = max(span[0], -radius / rate), min(span[1], radius / rate)
            x = np.linspace(low, high, RING_POINTS // 2 + 2)[1:-1] if low < high else np.empty(0)
            v = np.sqrt(np.maximum(radius**2 - (rate * x) ** 2, 0.0))
            rings.append(np.column_stack([np.tile(x, 2), np.append(v, -v)]))
        owner = np.repeat(np.arange(RINGS), [len(each) for each in rings])
        starts = np.concatenate(rings)
        ends = starts + self.change(starts)
        # runs that failed, with too many impacts, are no fixed points either
        gains = np.hypot(rate * ends[:, 0], ends[:, 1]) >= radii[owner]
        # a stop may leave no state on the smallest rings
        empty = [place for place, ring in enumerate(rings) if not len(ring)]
        last = int(owner[gains].max(initial=max(empty, default=-1)))
        return float(radii[min(last + 2, RINGS - 1)])


def displacement_at(scene: Scene, contact: Contact) -> float:
    """Return the state's displacement at which the contact of a one-mode body touches its stop."""
    return contact.position / (float(contact.shape[0]) * _per_mode(scene))


def press_on(body: ImpactingBody, contact: Contact) -> SumOfSines:
    """Return the acceleration towards a stop of a one-mode body at rest on it, over the phase."""
    orders = np.array(list(body.harmonics), dtype=float)
    forces = contact.direction * np.array([force @ contact.shape for force in body.harmonics.values()])
    level = float(body.held @ contact.shape) - float(body.frequencies[0]) ** 2 * contact.position
    return SumOfSines(contact.direction * level, orders, forces.real, -forces.imag)


def _per_mode(scene: Scene) -> float:
    return float(modal_displacements(scene, np.ones((1, 1)))[0, 0])


def _walls(body: ImpactingBody, scene: Scene) -> tuple[Wall, ...]:
    """Return the nearest stop of each side."""
    nearest: dict[float, Wall] = {}
    for contact in body.contacts:
        speed = float(contact.shape[0]) * _per_mode(scene)
        side = 1.0 if contact.direction * speed > 0.0 else -1.0
        wall = Wall(displacement_at(scene, contact), side, abs(speed), contact)
        other = nearest.get(side)
        if other is None or side * wall.at < side * other.at:
            nearest[side] = wall
    return tuple(nearest.values())
