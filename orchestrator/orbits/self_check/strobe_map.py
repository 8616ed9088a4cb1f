"""The strobe map of a scene's body at one value of a number: its orbits that rest on a stop, and all its fixed points.

A body of one mode has a plane of states. Its fixed points are searched on a grid. Both parts of the change over q
periods change their sign within some cells. These cells are divided, and Newton's method starts from the impacts there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits import ImpactingBody, OrbitError, PeriodicOrbit, find_orbit
from vibroimpact.analysis.orbits.index_sum import IndexTerm, clears_stops, distinct, index
from vibroimpact.analysis.orbits.recurrences import orbits_passed
from vibroimpact.analysis.orbits.search import same_orbit
from vibroimpact.analysis.orbits.trigonometric import TURN, SumOfSines
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.core.orbits import MOST_IMPACTS
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.find import class_of_record, long_runs
from vibroimpact.orchestrator.orbits.self_check.state_plane import StatePlane, displacement_at, press_on
from vibroimpact.orchestrator.orbits.self_check.winding import Cell, Marks, Search
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.scene import Scene

GRID = 128
"""Cells of the plane of states along each axis."""
GRID_STARTS = (GRID + 1) ** 2
"""Number of its corners, from which a search starts."""
PARTS = 8
"""Parts of a cell with a change of sign along each axis."""
SAME = 1e-9
"""Difference of two states, over the size of the motion, below which an orbit that rests repeats."""
ENDED = 1e-4
"""Difference of the last states of two long runs, over their size, below which they end on one orbit."""
MOST_STARTS = 256
"""Number of parts with a change of sign from which Newton's method starts, evenly chosen among more of them."""
IMPACT_LIMIT = 2000
"""Impacts in a period above which a state counts as one without an end: a chatter that hardly loses speed."""
CELLS, EDGE_PARTS = 64, (2, 8, 32)
"""Cells along each axis from which fixed points are located; parts of an edge, until all indices add up to 1."""
MOST_ROUNDS = 4
"""Rounds in which fixed points are located, each with the orbits of the earlier ones."""
RETURNS = 1e-4
"""Change over the periods, over the size of the chart, below which the middle of a smallest cell is a fixed point."""


@dataclass(slots=True)
class Located:
    """The fixed points of a strobe map that were not known.

    Attributes
    ----------
    orbits : list of PeriodicOrbit
        Those that are orbits of equations.md 4.7.
    terms : list of IndexTerm
        A term for each other point: of orbits that rest on a stop, and of those with more impacts than 4.7 takes.
    undecided : int
        Number of fixed points that must be there, and that no run shows.
    """

    orbits: list[PeriodicOrbit] = field(default_factory=list)
    terms: list[IndexTerm] = field(default_factory=list)
    undecided: int = 0


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

    def rests(self, value: float, periods: int, starts: Iterable[State] = ()) -> list[Floats]:
        """Return the strobe states of each orbit that rests on a stop and repeats after these periods.

        A body of one mode that rests leaves its stop at one phase, so a run from each rest shows all of them. Other
        bodies, and forces of several sines, show the orbits on which long runs end. One run begins at the scene's own
        state, and one at each of the starts. Each array has the shape (own periods, 2), for the observed point.
        """
        body = self.body(value)
        if body.frequencies.size > 1 or not body.has_one_sine:
            return self._ends_of_long_runs(value, periods, starts)
        found: list[Floats] = []
        for contact in body.contacts:
            if not (press := press_on(body, contact)).zeros():
                if press.level > 0.0:
                    at = displacement_at(self.scene, contact)
                    return [np.array([[at, 0.0]])]  # it never leaves this stop
                continue
            begin, end = _pressed(press)
            record = self._runner(periods + 3).run(
                {self.parameter: value, "forcing.phase": float(np.mod(0.5 * (begin + end), TURN))},
                (displacement_at(self.scene, contact), 0.0),
                at_time_0=True,
            )
            own = _repeating_rest(record, periods)
            if own is not None and not any(_meets(own, states) for states in found):
                found.append(own)
        return found

    def _ends_of_long_runs(self, value: float, periods: int, starts: Iterable[State]) -> list[Floats]:
        found: list[Floats] = []
        with long_runs(self.scene) as record_of:
            for start in (None, *starts):
                record = record_of({self.parameter: value}, start)
                kind = class_of_record(record)
                own = max(kind.periods, 1)
                rests = kind.kind in (OrbitClass.sticking, OrbitClass.rest)
                if not rests or periods % own or record.periods is None:
                    continue
                states = record.periods[-own:, 2:4]
                if not any(_meets(states, other, ENDED) for other in found):
                    found.append(states)
        return found

    def passed(self, value: float, periods: int, starts: Iterable[State]) -> Iterator[PeriodicOrbit]:
        """Yield the orbits near which long runs pass: one run from the scene's own state, one from each start."""
        body = self.body(value)
        with long_runs(self.scene) as record_of:
            for start in (None, *starts):
                rows = record_of({self.parameter: value}, start).impacts
                if rows is not None and len(rows):
                    turned = rows[:, 0] * body.angular_frequency - rows[:, 1]
                    phases = rows[:, 1] + TURN * np.round((turned - turned[0]) / TURN)
                    yield from orbits_passed(
                        body, phases, rows[:, 2], rows[:, 4].astype(np.int64) - 1, periods
                    )

    # ---- all fixed points ----

    def plane(self, value: float, periods: int) -> StatePlane:
        """Return the plane of states of a one-mode body at a value of the number."""
        return StatePlane(self._limited(periods).with_values({self.parameter: value}), periods)

    def orbits(self, value: float, periods: int, cells: int = GRID) -> Iterator[PeriodicOrbit]:
        """Yield the physical orbits that repeat after these periods, found on a grid of states of a one-mode body."""
        known = list[PeriodicOrbit]()
        with self.plane(value, periods) as plane:
            starts = _starts(plane, cells)
            for start in starts[:: -(-len(starts) // MOST_STARTS) or 1]:
                orbit = _orbit_of(plane, self._record(plane, value, start))
                if orbit is not None and not any(same_orbit(orbit, other) for other in known):
                    known.append(orbit)
                    yield orbit

    def _record(self, plane: StatePlane, value: float, state: Floats) -> RunRecord:
        """Return the record of a run over the periods of a plane from a state of it."""
        return self._runner(plane.periods).run({self.parameter: value}, tuple(state.tolist()))

    def located(
        self, value: float, periods: int, orbits: Sequence[PeriodicOrbit], rests: Sequence[Floats]
    ) -> Located:
        """Return the fixed points of the strobe map of a one-mode body that known ones leave, by winding numbers.

        Parameters
        ----------
        value : float
        periods : int
        orbits : sequence of PeriodicOrbit
            Known orbits; equal ones count once.
        rests : sequence of array, shape (periods, 2)
            Strobe states of each known orbit that rests on a stop.

        """
        known, located = distinct(orbits, periods), Located()
        with self.plane(value, periods) as plane:
            for _ in range(MOST_ROUNDS):
                # other points of a new orbit may be in cells with points of the other sign
                marks, count = plane.marks([*known, *located.orbits], rests), len(located.orbits)
                cells, missing = _cells_of(plane, marks)
                located.terms, located.undecided = [], missing
                for cell in cells:
                    self._add(located, plane, value, cell)
                new = sum(index(each, periods) * each.periods for each in located.orbits[count:])
                total = int(marks.indices.sum()) + new + sum(each.index for each in located.terms)
                if total == 1 or len(located.orbits) == count:
                    break
        return located

    def _add(self, located: Located, plane: StatePlane, value: float, cell: Cell) -> None:
        """Add the orbit of a fixed point in a cell, or its term."""
        record = self._record(plane, value, cell.middle)
        impacts = 0 if record.impacts is None else len(record.impacts)
        rests = record.outcome is Outcome.stuck or (record.sticks is not None and bool(len(record.sticks)))
        went_well = record.outcome in (Outcome.ok, Outcome.stuck)
        if went_well and not impacts and not rests and clears_stops(plane.body):
            return  # the motion without impacts
        if not (went_well and _repeats(plane, cell) and (rests or impacts)):
            located.undecided += 1
            return
        orbit = None if rests else _orbit_of(plane, record)
        if orbit is not None:
            if not any(same_orbit(orbit, other) for other in located.orbits):
                located.orbits.append(orbit)
            return
        own = _own_periods(record, plane)
        count = "inf" if rests else str(impacts * own // plane.periods)
        located.terms.append(IndexTerm(f"P({count},{own})", cell.index, 1))


def _pressed(press: SumOfSines) -> tuple[float, float]:
    """Return the phases between which one sine presses a body on its stop."""
    zeros = press.zeros()
    first, second = zeros[0], zeros[-1]
    if press.at(np.array([0.5 * (first + second)]))[0][0] > 0.0:
        return first, second
    return second, first + TURN


def _repeating_rest(record: RunRecord, periods: int) -> Floats | None:
    """Return the strobe states of a run that comes back to its rest; None if it does not."""
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
    states: Floats = strobes[2 : 2 + own]
    return states if own and periods % own == 0 else None


def _meets(states: Floats, others: Floats, near: float = SAME) -> bool:
    """Return whether the first of some strobe states is one of other strobe states."""
    scale = np.maximum(np.abs(others).max(axis=0), 1e-300)
    return bool((np.abs((others - states[0]) / scale).max(axis=1) < near).any())


def _changes_sign(corners: Floats) -> NDArray[np.bool_]:
    """Return for each cell, shape (..., corner, 2), whether both parts of the change change their sign within it."""
    both = (corners.min(axis=-2) <= 0.0) & (corners.max(axis=-2) >= 0.0)
    return np.asarray(both.all(axis=-1))


def _cells_of(plane: StatePlane, marks: Marks) -> tuple[list[Cell], int]:
    """Return the cells of a plane with fixed points that are not marked, and the number of further ones."""
    for parts in EDGE_PARTS:
        cells = Search(plane.change_in_chart, plane.low, plane.high, CELLS, parts).missing(marks)
        total = int(marks.indices.sum()) + sum(each.index for each in cells)
        if total == 1:
            break
    return cells, abs(1 - total)


def _starts(plane: StatePlane, cells: int) -> Floats:
    """Return states of a plane next to fixed points, shape (state, 2)."""
    corner, size = plane.low, (plane.high - plane.low) / cells
    ticks = np.indices((cells + 1, cells + 1)).reshape(2, -1).T
    change = plane.change(corner + size * ticks).reshape(cells + 1, cells + 1, 2)
    corners = np.stack([change[:-1, :-1], change[1:, :-1], change[:-1, 1:], change[1:, 1:]], axis=2)
    lower = corner + size * np.argwhere(_changes_sign(corners))
    size = size / PARTS
    lower = (lower[:, None] + size * np.indices((PARTS, PARTS)).reshape(2, -1).T).reshape(-1, 2)
    states = (lower[:, None] + size * np.indices((2, 2)).reshape(2, -1).T).reshape(-1, 2)
    lower = lower[_changes_sign(plane.change(states).reshape(-1, 4, 2))]
    return np.asarray(lower + 0.5 * size)


def _orbit_of(plane: StatePlane, record: RunRecord) -> PeriodicOrbit | None:
    """Return the orbit to which Newton's method leads from the impacts of a run; None without a physical one."""
    rows, body = record.impacts, plane.body
    if record.outcome is not Outcome.ok or rows is None or not 0 < len(rows) <= MOST_IMPACTS:
        return None
    turns = np.round((rows[:, 0] * body.angular_frequency - rows[:, 1]) / TURN)
    contacts = (rows[:, 4].astype(int) - 1).tolist()
    try:
        orbit = find_orbit(body, rows[:, 1] + TURN * turns, contacts, plane.periods)
    except (OrbitError, UsageError):  # no orbit there, or impacts closer than phases can resolve
        return None
    return orbit.once if orbit.is_physical else None


def _repeats(plane: StatePlane, cell: Cell) -> bool:
    """Return whether the middle of a cell is a fixed point to the size of the cell."""
    change = plane.change_in_chart(cell.middle[None])
    return bool(np.abs(change[0]) < RETURNS)


def _own_periods(record: RunRecord, plane: StatePlane) -> int:
    """Return the fewest periods after which a run comes back to its first strobe."""
    if record.periods is None:
        return plane.periods
    states = plane.chart.points(record.periods[:, 2:4])
    for own in range(1, plane.periods):
        if plane.periods % own == 0 and abs(states[own] - states[0]) < RETURNS:
            return own
    return plane.periods
