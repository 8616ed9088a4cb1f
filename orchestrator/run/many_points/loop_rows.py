"""Runs the points of a `PointLoop` and makes columns of their records."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import STICK_COLUMNS, Outcome, RunRecord
from vibroimpact.analysis.dataset.columns import Ragged, RunColumns, columns_of, joined
from vibroimpact.fmus.core import runs as core
from vibroimpact.fmus.core.arrays import address
from vibroimpact.orchestrator.run.many_points.loop import PointLoop, PreparedPoints
from vibroimpact.orchestrator.run.parameters import state_variables
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.run.record import (
    OBSERVED,
    ROW_CAPACITY,
    ROW_IMPACT,
    ROW_PERIOD,
    ROW_STICK,
    ROW_WIDTH,
    TOUCH_DOWN,
    impact_rows,
    in_time_order,
    open_contacts,
    refuse_abandoned,
)
from vibroimpact.orchestrator.run.window import TWO_PI, late_message, limit_message, no_load_message

LISTEN_SECONDS = 0.05
"""Time after which the loop lets Python hear signals, s; a step in it may add some hundredths of a second."""

ROWS_ROOM = 64 * ROW_CAPACITY
"""Number of rows of impacts, sticks and periods that the loop can write before Python takes them."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Alone = Callable[[int, State | None], tuple[RunRecord, State | None]]
"""Runs one point, by its place, from a start state; returns its record and the state that it hands on."""


def run_loop(
    loop: PointLoop, points: PreparedPoints, start: State | None, deadline: float, alone: Alone
) -> tuple[RunColumns, State | None]:
    """Run points in their order; along a branch each starts where the point before ended.

    Parameters
    ----------
    loop : PointLoop
    points : PreparedPoints
    start : tuple of float or None
        Start state of the first point, where it does not begin a branch.
    deadline : float
        Time after which no point begins, except the first; s of `time.perf_counter`.
    alone : callable
        Runs a point that the loop leaves out.

    Returns
    -------
    columns : RunColumns
        Records of the points that ran, from the first point on.
    carried : tuple of float or None
        Start state of the next point of the branch.
    """
    work = LoopArrays(loop, points, start)
    records: dict[int, RunRecord] = {}
    while (end := work.call()) is not core.RunsEnd.done:
        if end is core.RunsEnd.refused:
            place = work.state.at
            records[place], carried = alone(place, work.carried)
            work.leave_out(carried)
        if work.state.stage == 0 and work.state.at > 0 and time.perf_counter() > deadline:
            break
    columns, done = work.columns(), work.state.at
    if not records:
        return columns, work.carried
    edges = sorted(records)
    pieces = []
    for before, place in zip([-1, *edges], [*edges, done], strict=True):
        pieces.append(columns.taken(before + 1, place))
        if place < done:
            pieces.append(columns_of([records[place]]))
    return joined([piece for piece in pieces if len(piece)]), work.carried


class LoopArrays:
    """The arrays that C fills, and its progress."""

    def __init__(self, loop: PointLoop, points: PreparedPoints, start: State | None) -> None:
        count, contacts = len(points.begin), len(loop.scene.stops)
        self._loop, self._points = loop, points
        self._plan = loop.plan(forced=points.forced)
        self._own_deadline = loop.scene.execution.deadline
        self._arrays: dict[str, NDArray[Any]] = {
            "values": points.table,
            "begin": points.begin,
            "end": points.end,
            "first": points.first.astype(np.uint8),
            "outcome": np.zeros(count, dtype=np.int8),
            "reached": np.zeros(count),
            "seconds": np.zeros(count),
            "finals": np.zeros((count, loop.finals_size)),
            "flags": np.zeros((count, 2 * contacts), dtype=np.bool_),
            "rows_of": np.zeros(count, dtype=np.int64),
            "rows": np.zeros((ROWS_ROOM, ROW_WIDTH)),
        }
        self.state = core.RunsPoints(count=count, rows_room=ROWS_ROOM, most_seconds=LISTEN_SECONDS)
        for name, array in self._arrays.items():
            setattr(self.state, name, address(array))
        self._blocks: list[Floats] = []
        self._give_up_at = (0, math.inf)  # a point under way, and the end of its time
        self._carry(start)

    def begin_again(self) -> None:
        """Go back to the first point, before anything has run."""
        state = self.state
        state.at = state.stage = state.rows_used = state.give_up = 0
        self._blocks = []

    def only_rows(self) -> Floats | None:
        """Return the rows of a single point that came to a plain end, without contact; None for any other end.

        The rows are a view of the arrays, which the next point overwrites.
        """
        arrays = self._arrays
        if self._blocks or arrays["outcome"][0] or arrays["flags"].any():
            return None
        rows: Floats = arrays["rows"][: self.state.rows_used]
        return rows

    @property
    def finals(self) -> Floats:
        """Final values of `PointLoop.finals` of each point, shape (point, variable)."""
        return self._arrays["finals"]

    def _carry(self, state: State | None) -> None:
        self.state.has_carried = self._loop.chained and state is not None
        if self.state.has_carried:
            self.state.carried[:] = state

    @property
    def carried(self) -> State | None:
        """Start state of the next point of the branch."""
        if not (self._loop.chained and self.state.has_carried):
            return None
        return (self.state.carried[0], self.state.carried[1])

    def call(self) -> core.RunsEnd:
        """Let C go on; Python hears signals between two calls."""
        refuse_abandoned()
        self._watch_deadline()
        end = core.run_points(self._loop.fmu, self._plan, self.state)
        if end is core.RunsEnd.full:
            self._take_rows()
        return end

    def _watch_deadline(self) -> None:
        if self._own_deadline is None:
            return
        now, (place, over) = time.perf_counter(), self._give_up_at
        if self.state.stage == 0 or place != self.state.at:
            self._give_up_at = (self.state.at, now + self._own_deadline)
        elif now > over:
            self.state.give_up = 1

    def _take_rows(self) -> None:
        self._blocks.append(self._arrays["rows"][: self.state.rows_used].copy())
        self.state.rows_used = 0

    def leave_out(self, carried: State | None) -> None:
        """Go on after a point that ran alone and handed on a state."""
        self._take_rows()
        written = int(self._arrays["rows_of"][self.state.at])
        self._blocks = [np.concatenate(self._blocks)]
        self._blocks[0] = self._blocks[0][: len(self._blocks[0]) - written]
        self._arrays["rows_of"][self.state.at] = 0
        self._carry(carried)
        self.state.at += 1
        self.state.stage = 0

    # ---- records ----

    def columns(self) -> RunColumns:
        """Return the records of the points that ran."""
        self._take_rows()
        done, record, scene = self.state.at, self._loop.scene.record, self._loop.scene
        arrays = {name: array[:done] for name, array in self._arrays.items() if name != "rows"}
        contacts = len(scene.stops)
        arrays["stuck"], arrays["open"] = arrays["flags"][:, :contacts], arrays["flags"][:, contacts:]
        rows = np.concatenate(self._blocks)
        owner = np.repeat(np.arange(done), arrays["rows_of"])
        finals, elements = arrays["finals"], len(state_variables(scene))
        outcome, message = self._ended(arrays)
        return RunColumns(
            outcome=outcome,
            message=message,
            seconds=arrays["seconds"],
            final_displacement=finals[:, 0],
            final_velocity=finals[:, 1],
            final_phase=self._final_phase(outcome, arrays["reached"]),
            final_state=finals[:, len(OBSERVED) : len(OBSERVED) + elements] if elements else None,
            periods=period_table(rows, owner, done) if self._points.periods else None,
            impacts=self._impacts(rows, owner, arrays) if record.impacts else None,
            sticks=self._sticks(rows, owner, arrays) if record.impacts else None,
        )

    def _of_contacts(self, arrays: dict[str, NDArray[Any]], block: int, width: int = 1) -> Floats:
        """Return a block of final values of the contacts, shape (run, contact * width)."""
        contacts = arrays["stuck"].shape[1]
        begin = len(OBSERVED) + len(state_variables(self._loop.scene)) + block * contacts
        found: Floats = arrays["finals"][:, begin : begin + width * contacts]
        return found

    def _stick_starts(self, arrays: dict[str, NDArray[Any]]) -> Floats:
        """Return the start of the rest on each contact, s; NaN where no load presses the resting body on it."""
        return np.where(self._pressed(arrays), self._of_contacts(arrays, 0), np.nan)

    def _pressed(self, arrays: dict[str, NDArray[Any]]) -> NDArray[np.bool_]:
        """Return whether a load presses the resting body on each contact."""
        pressed: NDArray[np.bool_] = arrays["stuck"] & (self._of_contacts(arrays, 1) > 0.0)
        return pressed

    def _ended(self, arrays: dict[str, NDArray[Any]]) -> tuple[NDArray[np.int8], NDArray[np.object_]]:
        """Return the outcome and the message of each point."""
        outcome: NDArray[np.int8] = arrays["outcome"].copy()
        message = np.full(len(outcome), "", dtype=object)
        execution = self._loop.scene.execution
        for place in np.flatnonzero(outcome == Outcome.impact_limit):
            message[place] = limit_message(execution.impact_limit, float(arrays["reached"][place]))
        for place in np.flatnonzero(outcome == Outcome.timeout):
            message[place] = late_message(execution.deadline, float(arrays["reached"][place]))
        if arrays["stuck"].any():
            pressed = self._pressed(arrays)
            outcome[(outcome == Outcome.ok) & self._rests_for_ever(pressed, arrays)] = Outcome.stuck
            idle = arrays["stuck"] & ~pressed
            for place in np.flatnonzero((outcome == Outcome.ok) & idle.any(axis=1)):
                message[place] = no_load_message(self._loop.scene.stop_keys[int(idle[place].argmax())])
        return outcome, message

    def _rests_for_ever(self, rests: NDArray[np.bool_], arrays: dict[str, NDArray[Any]]) -> NDArray[np.bool_]:
        """Return whether each body rests for good, by the rule of `point`: pressed for good, or at rest long enough."""
        scene, columns, points = self._loop.scene, self._points.columns, self._points
        resting, count = rests.any(axis=1), len(rests)
        if scene.body.IS_STRUCTURE:
            starts = self._stick_starts(arrays)
            began = np.fmin.reduce(starts, axis=1)
            long_enough = points.end[:count] - points.begin[:count]
            slowest = arrays["finals"][:, len(self._loop.finals) - 1]
            if self._loop.scene.body.size == 1:
                slowest = np.abs(slowest)  # a spring that pushes
            if not points.forced:
                long_enough = np.where(
                    slowest > 0.0, TWO_PI / np.where(slowest > 0.0, slowest, 1.0), long_enough
                )
            is_settled: NDArray[np.bool_] = arrays["reached"] - began >= long_enough
            return resting & is_settled
        pressed = np.zeros(count, dtype=np.bool_)
        lifting = np.abs(columns.get("forcing.amplitude", np.zeros(count))[:count])
        contact = rests.argmax(axis=1)
        for k, stop in enumerate(scene.stops):
            sign = 1.0 if stop.side == "upper" else -1.0
            spring = columns["stiffness"][:count] * columns[f"contact[{k + 1}].position"][:count]
            press = sign * (columns.get("force", np.zeros(count))[:count] - spring)
            pressed |= (contact == k) & (press > lifting if points.forced else True)
        return resting & pressed

    def _final_phase(self, outcome: NDArray[np.int8], reached: Floats) -> Floats:
        if not self._points.forced:
            return np.full(len(outcome), np.nan)
        names, table = self._loop.driver.float_names, self._points.table[: len(outcome)]
        frequency, phase = (
            table[:, names.index(f"forcing.{name}")] for name in ("angular_frequency", "phase")
        )
        return final_phases(outcome, reached, frequency, phase)

    def _impacts(self, rows: Floats, owner: Ints, arrays: dict[str, NDArray[Any]]) -> Ragged:
        """Return the impacts of each point, including open contacts."""
        run, contact = np.nonzero(arrays["open"] & ~arrays["stuck"])
        width = len(TOUCH_DOWN)
        touch_downs = self._of_contacts(arrays, 2, width).reshape(len(arrays["stuck"]), -1, width)
        still = open_contacts(touch_downs[run, contact], contact + 1.0)
        own = owner[rows[:, 0] == ROW_IMPACT]
        return _with_open(impact_rows(rows), own, still, run, len(arrays["stuck"]))

    def _sticks(self, rows: Floats, owner: Ints, arrays: dict[str, NDArray[Any]]) -> Ragged:
        """Return the sticks of each point, including sticks that have not ended."""
        run, contact = np.nonzero(arrays["stuck"] & arrays["open"])
        starts = self._of_contacts(arrays, 0)[run, contact]
        still = np.column_stack([starts, np.full(len(run), np.nan), contact + 1.0])
        ended = rows[:, 0] == ROW_STICK
        found = rows[ended, 1 : 1 + len(STICK_COLUMNS)]
        return _with_open(found, owner[ended], still, run, len(arrays["stuck"]))


def _with_open(found: Floats, owner: Ints, still: Floats, run: Ints, done: int) -> Ragged:
    """Return rows by their run, including the rows of open contacts or sticks."""
    owners = np.concatenate([owner, run])
    order = np.argsort(owners, kind="stable")
    return ragged_of(np.concatenate([found, still])[order], owners[order], done)


def final_phases(
    outcome: NDArray[np.int8], reached: Floats, angular_frequency: Floats, phase: Floats
) -> Floats:
    """Return the phase of the force at the end of each run, rad: 0 unless a limit ended the run."""
    came_to_end = (outcome == Outcome.ok) | (outcome == Outcome.stuck)
    return np.where(came_to_end, 0.0, (angular_frequency * reached + phase) % TWO_PI)


def period_table(rows: Floats, owner: Ints, done: int) -> Floats:
    """Return the table of periods, shape (run, period, 5); missing periods of a run are NaN."""
    chosen = rows[:, 0] == ROW_PERIOD
    owner = owner[chosen]
    count = np.bincount(owner, minlength=done)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    table = np.full((done, int(count.max(initial=0)), 5), np.nan)
    table[owner, place] = rows[chosen, 2:7]
    return table


def ragged_of(found: Floats, owner: Ints, done: int) -> Ragged:
    """Return the rows of runs, sorted by time within each run; the given rows of a run are contiguous."""
    back = (np.diff(found[:, 0]) < 0.0) & (np.diff(owner) == 0)
    for run in np.unique(owner[1:][back]):
        own = slice(*np.searchsorted(owner, (run, run + 1)))
        found[own] = in_time_order(found[own])
    return Ragged(np.bincount(owner, minlength=done), found)
