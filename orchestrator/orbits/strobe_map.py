"""The strobe map of a scene's body at one value of a number: its orbits that rest on a stop, and all its fixed points.

A body of one mode has a plane of states. Its fixed points are searched on a grid. Both parts of the change over q
periods change their sign within some cells. These cells are divided, and Newton's method starts from the impacts there.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits import ImpactingBody, OrbitError, PeriodicOrbit, find_orbit
from vibroimpact.analysis.orbits.search import same_orbit
from vibroimpact.analysis.orbits.trigonometric import TURN, SumOfSines
from vibroimpact.fmus.bodies import Contact
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.core.orbits import MOST_IMPACTS
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.bodies import impacting_body, modal_displacements
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.orbits.find import class_of_record, long_runs
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.scene import Scene

GRID = 128
"""Cells of the plane of states along each axis."""
GRID_STARTS = (GRID + 1) ** 2
"""Number of its corners, from which a search starts."""
PARTS = 8
"""Parts of a cell with a change of sign along each axis."""
RINGS, RING_POINTS, RING_RATIO = 40, 64, 1.25
"""Rings of one energy that are tried as bound of all fixed points: their number, their states, their ratio."""
SAME = 1e-9
"""Difference of two states, over the size of the motion, below which an orbit that rests repeats."""
AT_ONCE = 1024
"""States in one call; those with a rest run one by one, and slow down larger calls."""
MOST_STARTS = 256
"""Number of parts with a change of sign from which Newton's method starts, evenly chosen among more of them."""
IMPACT_LIMIT = 2000
"""Impacts in a period above which a state counts as one without an end: a chatter that hardly loses speed."""
ROOM = 1e-9
"""Distance of the grid from the stops, over its width, since a state on a stop is that after its impact."""


class StrobeMap:
    """Runs of a scene's body at values of one number, each over few periods of the force.

    Parameters
    ----------
    scene : Scene
    parameter : str
        Key of the number.
    """

    def __init__(self, scene: Scene, parameter: str) -> None:
        self.scene, self.parameter = scene, parameter
        record = {
            "transient_periods": 0,
            "extrema": True,
            "strobe": True,
            "impacts": True,
            "each_period": True,
        }
        self._values = {f"record.{name}": value for name, value in record.items()}
        self._runners: dict[int, PointRunner] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        for runner in self._runners.values():
            runner.close()

    def _runner(self, periods: int) -> PointRunner:
        """Return the runner that records some periods from the start on."""
        if periods not in self._runners:
            values = {**self._values, "record.recorded_periods": periods}
            scene = self._limited(periods).with_values(values)
            self._runners[periods] = PointRunner(scene, execution="fused")
        return self._runners[periods]

    def _limited(self, periods: int) -> Scene:
        """Return the scene with a limit of impacts for runs over some periods."""
        return self.scene.with_values({"execution.impact_limit": IMPACT_LIMIT * periods})

    def body(self, value: float) -> ImpactingBody:
        """Return the body at a value of the number; SceneError where the scene has none."""
        return impacting_body(self.scene.with_values({self.parameter: value}))

    # ---- orbits that rest on a stop ----

    def resting(self, value: float, periods: int) -> list[int]:
        """Return the own periods of each orbit that rests on a stop and repeats after these periods.

        A body of one mode that rests leaves its stop at one phase, so a run from each rest shows all of them. Other
        bodies, and forces of several sines, show the orbit on which a long run ends.
        """
        body = self.body(value)
        if body.frequencies.size > 1 or not body.has_one_sine:
            return self._end_of_long_run(value, periods)
        found: list[tuple[int, Floats]] = []
        for contact in body.contacts:
            if not (press := _press(body, contact)).zeros():
                if press.level > 0.0:
                    return [1]  # it never leaves this stop
                continue
            begin, end = _pressed(press)
            record = self._runner(periods + 3).run(
                {self.parameter: value, "forcing.phase": float(np.mod(0.5 * (begin + end), TURN))},
                (self._displacement(contact.position, contact), 0.0),
                at_time_0=True,
            )
            own = _repeating_rest(record, periods)
            if own is not None and not any(_meets(own[1], states) for _, states in found):
                found.append(own)
        return [each for each, _ in found]

    def _displacement(self, position: float, contact: Contact) -> float:
        """Return the state's displacement at which the contact of a one-mode body is at a position."""
        per_mode = float(modal_displacements(self.scene, np.ones((1, 1)))[0, 0])
        return position / (float(contact.shape[0]) * per_mode)

    def _end_of_long_run(self, value: float, periods: int) -> list[int]:
        with long_runs(self.scene) as record_of:
            kind = class_of_record(record_of({self.parameter: value}, None))
        rests = kind.kind in (OrbitClass.sticking, OrbitClass.rest)
        own = max(kind.periods, 1)
        return [own] if rests and periods % own == 0 else []

    # ---- all fixed points ----

    def orbits(self, value: float, periods: int, cells: int = GRID) -> Iterator[PeriodicOrbit]:
        """Yield the physical orbits that repeat after these periods, found on a grid of states of a one-mode body."""
        scene = self._limited(periods).with_values({self.parameter: value})
        body, known = impacting_body(scene), list[PeriodicOrbit]()
        with closing(BodyFlow(scene, 1)) as flow:
            starts = self._starts(body, flow, periods, cells)
        for start in starts[:: -(-len(starts) // MOST_STARTS) or 1]:
            orbit = self._orbit_near(body, value, start, periods)
            if orbit is not None and not any(same_orbit(orbit, other) for other in known):
                known.append(orbit)
                yield orbit

    def _starts(self, body: ImpactingBody, flow: BodyFlow, periods: int, cells: int) -> Floats:
        """Return states next to fixed points, shape (state, 2)."""
        low, high = self._span(body)
        radius = _radius(body, flow, periods, (low, high))
        rate = float(body.frequencies[0])
        low, high = max(low, -radius / rate), min(high, radius / rate)
        room = ROOM * (high - low)
        size = np.array([high - low - 2.0 * room, 2.0 * radius]) / cells
        corner = np.array([low + room, -radius])
        ticks = np.indices((cells + 1, cells + 1)).reshape(2, -1).T
        change = _change(flow, corner + size * ticks, periods).reshape(cells + 1, cells + 1, 2)
        corners = np.stack([change[:-1, :-1], change[1:, :-1], change[:-1, 1:], change[1:, 1:]], axis=2)
        lower = corner + size * np.argwhere(_changes_sign(corners))
        size = size / PARTS
        lower = (lower[:, None] + size * np.indices((PARTS, PARTS)).reshape(2, -1).T).reshape(-1, 2)
        states = (lower[:, None] + size * np.indices((2, 2)).reshape(2, -1).T).reshape(-1, 2)
        lower = lower[_changes_sign(_change(flow, states, periods).reshape(-1, 4, 2))]
        return lower + 0.5 * size

    def _span(self, body: ImpactingBody) -> tuple[float, float]:
        """Return the displacements between the stops of a one-mode body; infinite without a stop."""
        low, high = -np.inf, np.inf
        for contact in body.contacts:
            at = self._displacement(contact.position, contact)
            if contact.direction * float(contact.shape[0]) > 0.0:
                high = min(high, at)
            else:
                low = max(low, at)
        return low, high

    def _orbit_near(
        self, body: ImpactingBody, value: float, start: Floats, periods: int
    ) -> PeriodicOrbit | None:
        """Return the orbit to which Newton's method leads from the impacts of a run; None without a physical one."""
        record = self._runner(periods).run({self.parameter: value}, tuple(start.tolist()))
        rows = record.impacts
        if record.outcome is not Outcome.ok or rows is None or not 0 < len(rows) <= MOST_IMPACTS:
            return None
        turns = np.round((rows[:, 0] * body.angular_frequency - rows[:, 1]) / TURN)
        try:
            orbit = find_orbit(
                body, rows[:, 1] + TURN * turns, (rows[:, 4].astype(int) - 1).tolist(), periods
            )
        except (OrbitError, UsageError):  # no orbit there, or impacts closer than phases can resolve
            return None
        return orbit.once if orbit.is_physical else None


def _press(body: ImpactingBody, contact: Contact) -> SumOfSines:
    """Return the acceleration towards a stop of a one-mode body at rest on it, over the phase."""
    orders = np.array(list(body.harmonics), dtype=float)
    forces = contact.direction * np.array([force @ contact.shape for force in body.harmonics.values()])
    level = float(body.held @ contact.shape) - float(body.frequencies[0]) ** 2 * contact.position
    return SumOfSines(contact.direction * level, orders, forces.real, -forces.imag)


def _pressed(press: SumOfSines) -> tuple[float, float]:
    """Return the phases between which one sine presses a body on its stop."""
    zeros = press.zeros()
    first, second = zeros[0], zeros[-1]
    if press.at(np.array([0.5 * (first + second)]))[0][0] > 0.0:
        return first, second
    return second, first + TURN


def _repeating_rest(record: RunRecord, periods: int) -> tuple[int, Floats] | None:
    """Return the own periods and the strobe states of a run that comes back to its rest; None if it does not."""
    if record.periods is None or len(record.periods) < periods + 3 or record.sticks is None:
        return None
    if len(record.sticks) < 2:
        return None
    strobes = record.periods[:, 2:4]
    scale = np.maximum(np.abs(strobes).max(axis=0), 1e-300)
    # the first two strobes may lie before the body leaves its stop
    off = np.abs((strobes[3:] - strobes[2]) / scale).max(axis=1)
    repeats = np.flatnonzero(off[:periods] < SAME)
    own = int(repeats[0]) + 1 if repeats.size else 0
    return (own, strobes[2 : 2 + own]) if own and periods % own == 0 else None


def _meets(states: Floats, others: Floats) -> bool:
    """Return whether the first of some strobe states is one of other strobe states."""
    scale = np.maximum(np.abs(others).max(axis=0), 1e-300)
    return bool((np.abs((others - states[0]) / scale).max(axis=1) < SAME).any())


def _radius(body: ImpactingBody, flow: BodyFlow, periods: int, span: tuple[float, float]) -> float:
    """Return a bound of all fixed points: the speed of the smallest ring beyond which each ring loses energy."""
    rate = float(body.frequencies[0])
    smallest = 0.1 * max(body.scale, *(abs(each.position) for each in body.contacts)) * rate
    radii = smallest * RING_RATIO ** np.arange(RINGS)
    rings = []
    for radius in radii:
        low, high = max(span[0], -radius / rate), min(span[1], radius / rate)
        x = np.linspace(low, high, RING_POINTS // 2 + 2)[1:-1] if low < high else np.empty(0)
        v = np.sqrt(np.maximum(radius**2 - (rate * x) ** 2, 0.0))
        rings.append(np.column_stack([np.tile(x, 2), np.append(v, -v)]))
    owner = np.repeat(np.arange(RINGS), [len(each) for each in rings])
    starts = np.concatenate(rings)
    ends = starts + _change(flow, starts, periods)
    # runs that failed, with too many impacts, are no fixed points either
    gains = np.hypot(rate * ends[:, 0], ends[:, 1]) >= radii[owner]
    growing = owner[gains]
    last = int(growing.max(initial=-1))
    return float(radii[min(last + 2, RINGS - 1)])


def _change(flow: BodyFlow, states: Floats, periods: int) -> Floats:
    """Return the change of states over some periods, shape (state, 2); NaN where a run failed."""
    parts = [states[begin : begin + AT_ONCE] for begin in range(0, len(states), AT_ONCE)]
    ends = [flow.follow(part, periods) for part in parts]
    changes = [
        np.where(end.well[:, None], end.states - part, np.nan) for part, end in zip(parts, ends, strict=True)
    ]
    return np.concatenate([np.empty((0, 2)), *changes])


def _changes_sign(corners: Floats) -> NDArray[np.bool_]:
    """Return for each cell, shape (..., corner, 2), whether both parts of the change change their sign within it."""
    both = (corners.min(axis=-2) <= 0.0) & (corners.max(axis=-2) >= 0.0)
    return np.asarray(both.all(axis=-1))
