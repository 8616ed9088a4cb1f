"""Runs points in lanes, the points that lanes leave out by the scalar engine, and makes columns of their records."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import STICK_COLUMNS, Outcome, RunRecord
from vibroimpact.analysis.dataset.columns import Ragged, RunColumns, columns_of, joined
from vibroimpact.fmus.core import lanes as core
from vibroimpact.fmus.core.arrays import address
from vibroimpact.orchestrator.run.many_points.lanes import lane_points
from vibroimpact.orchestrator.run.many_points.lanes_samples import LaneSamples, fits
from vibroimpact.orchestrator.run.many_points.loop import PointLoop, PointValues, PreparedPoints
from vibroimpact.orchestrator.run.many_points.loop_rows import (
    LISTEN_SECONDS,
    final_phases,
    run_loop,
)
from vibroimpact.orchestrator.run.parameters import free_state
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.run.record import refuse_abandoned
from vibroimpact.orchestrator.run.runner import CARRYING, next_start
from vibroimpact.orchestrator.run.window import TWO_PI, limit_message

ROWS_ROOM = 65_536
"""Number of impacts that the lanes can write before Python takes them."""

ROUNDING = 1e-9
"""Relative excess of a recording over a whole number of periods that counts as rounding."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Alone = Callable[[int, State | None], RunRecord]
"""Runs one point, by its place, from a start state."""


@dataclass(frozen=True, slots=True)
class LaneValues:
    """Points as arrays, with the starts of their branches."""

    values: Mapping[str, Floats]
    """Values of each swept key, shape (point,)."""
    first: NDArray[np.bool_]
    """Whether each point begins a branch, shape (point,). The first of all points always does, also within a branch."""
    starts: Mapping[int, State]
    """Start states of branches that do not begin at the scene's start, by the place of their first point."""

    def __len__(self) -> int:
        return len(self.first)

    def piece(self, begin: int, stop: int, start: State | None) -> LaneValues:
        """Return the points `begin` to `stop - 1`; the first of them continues from `start` within a branch."""
        starts = {place - begin: state for place, state in self.starts.items() if begin <= place < stop}
        if not self.first[begin] and start is not None:
            starts[0] = start
        first = self.first[begin:stop].copy()
        first[0] = True
        return LaneValues({key: each[begin:stop] for key, each in self.values.items()}, first, starts)

    @property
    def begins_as_scene(self) -> NDArray[np.bool_]:
        """Whether each point begins at the scene's start, shape (point,)."""
        own = self.first.copy()
        own[list(self.starts)] = False
        return own


def run_in_lanes(
    loop: PointLoop, points: LaneValues, deadline: float, alone: Alone
) -> tuple[RunColumns, State | None]:
    """Run points in lanes; return the records of the first points that ran, and the next start state of the branch.

    Along a branch each point starts where the point before ended. Results do not depend on the points in other lanes.
    After the deadline, s of `time.perf_counter`, no branch begins except the first; begun branches run to their end.
    An independent point is a branch of its own. `loop` runs points that the lanes leave out, and `alone` runs
    points that the loop leaves out, too.
    """
    prepared = loop.prepared(PointValues(points.values, points.begins_as_scene))
    if prepared is not None and fits(
        prepared.begin, prepared.end, loop.scene.sampling_rate, loop.scene.sampled
    ):
        return _LaneRun(loop, points, prepared, alone).run(deadline)
    if prepared is None and len(points) == 1:
        given = points.starts.get(0)
        record = alone(0, given)
        return columns_of([record]), next_start(record, given) if loop.chained else None
    return _run_halves(loop, points, deadline, alone)


def run_prepared_in_lanes(
    loop: PointLoop, points: PreparedPoints, deadline: float, alone: Alone
) -> RunColumns:
    """Run prepared independent points, see `run_in_lanes`."""
    values = LaneValues({}, np.ones(len(points.begin), dtype=np.bool_), {})
    return _LaneRun(loop, values, points, alone).run(deadline)[0]


def _run_halves(
    loop: PointLoop, points: LaneValues, deadline: float, alone: Alone
) -> tuple[RunColumns, State | None]:
    """Run points of mixed kinds, with invalid parameters or with many samples, by splitting them in halves."""
    half = len(points) // 2
    columns, carried = run_in_lanes(loop, points.piece(0, half, points.starts.get(0)), deadline, alone)
    if len(columns) < half or time.perf_counter() > deadline:
        return columns, carried
    rest = points.piece(half, len(points), carried)
    more, carried = run_in_lanes(loop, rest, deadline, lambda place, given: alone(half + place, given))
    return joined([columns, more]), carried


class _LaneRun:
    """The arrays that C fills, and the points that C leaves out with their results by the scalar engine."""

    def __init__(self, loop: PointLoop, values: LaneValues, points: PreparedPoints, alone: Alone) -> None:
        self._loop, self._values, self._points, self._alone = loop, values, points, alone
        self._is_structure = loop.scene.body.IS_STRUCTURE
        count, lanes = len(values), lane_points(points)
        self._plan, self._modal = lanes.plan, lanes.modal
        self._first = values.first if loop.chained else np.ones(count, dtype=np.bool_)
        self._given = lanes.given
        for place, state in values.starts.items():
            q, p = np.array(self._free_start(place, state)).reshape(2, -1)
            self._given["start_q"][:, place], self._given["start_p"][:, place] = q, p
        modes = self._plan.modes
        self._state = np.zeros(count, dtype=np.uint8)
        self._outcome = np.zeros(count, dtype=np.int8)
        self._reached, self._displacement, self._velocity = np.zeros((3, count))
        self._final_q, self._final_p = np.zeros((2, modes, count))
        self._periods, self._periods_of = self._period_table(), np.zeros(count, dtype=np.int64)
        self._rows_of = np.zeros(count, dtype=np.int64)
        results = {
            "state": self._state, "outcome": self._outcome, "reached": self._reached,
            "displacement": self._displacement, "velocity": self._velocity,
            "final_q": self._final_q, "final_p": self._final_p,
            "periods": self._periods, "periods_of": self._periods_of,
            "first": self._first.astype(np.uint8), "rows_of": self._rows_of,
        }  # fmt: skip
        self._samples: LaneSamples | None = None
        if self._plan.rate > 0.0:
            self._samples = LaneSamples(loop.scene.sampled, self._plan.rate, self._given)
            results |= {"samples": self._samples.values, "samples_of": self._samples.count}
        self._kept = {**self._given, **results}  # keeps the arrays alive while C uses them
        self._c = core.LanesPoints(
            count=count,
            begun_below=count,
            most_periods=self._periods.shape[2],
            most_samples=0 if self._samples is None else self._samples.values.shape[2],
            rows_room=ROWS_ROOM,
            most_seconds=LISTEN_SECONDS,
        )
        for name, array in self._kept.items():
            setattr(self._c, name, address(array))
        self._memory = core.lanes_memory(self._plan)
        self._blocks: list[tuple[Floats, Ints]] = []
        self._give_room()
        self._scalar: list[tuple[Ints, RunColumns]] = []
        self._seconds = 0.0

    # ---- running ----

    def run(self, deadline: float) -> tuple[RunColumns, State | None]:
        """Run the points, see `run_in_lanes`."""
        ends = self._call()
        while ends is not core.LanesEnd.done:
            self._run_left(deadline)
            if ends is core.LanesEnd.left and self._left().size:
                break  # the deadline is over for the points left out
            if time.perf_counter() > deadline:
                self._begin_no_more()
            ends = self._call()
        self._take_rows()
        done = self._done()
        return self._columns(done), self._start_after(done - 1) if self._loop.chained else None

    def _call(self) -> core.LanesEnd:
        """Let C go on; Python hears signals between two calls."""
        refuse_abandoned()
        began = time.perf_counter()
        end = core.run_lanes(self._plan, self._c, self._memory)
        self._seconds += time.perf_counter() - began
        if end is core.LanesEnd.full:
            self._take_rows()
        return end

    def _give_room(self) -> None:
        self._rows, self._owner = np.empty((ROWS_ROOM, core.IMPACT_WIDTH)), np.empty(ROWS_ROOM, np.int64)
        self._c.rows, self._c.owner, self._c.rows_used = address(self._rows), address(self._owner), 0

    def _take_rows(self) -> None:
        used = self._c.rows_used
        self._blocks.append((self._rows[:used], self._owner[:used]))
        self._give_room()

    def _begin_no_more(self) -> None:
        """Restrict the run to the points, or the branches, that have begun."""
        last = int(np.flatnonzero(self._state).max(initial=0))
        later = np.flatnonzero(self._first[last + 1 : self._c.begun_below])
        if later.size:
            self._c.begun_below = last + 1 + int(later[0])

    def _done(self) -> int:
        """Return the number of points that have run without a gap, from the first on."""
        has_run = np.isin(self._state, (core.PointState.has_run, core.PointState.is_answered))
        return len(has_run) if has_run.all() else int(has_run.argmin())

    # ---- points that the lanes leave out ----

    @property
    def _one_by_one(self) -> bool:
        """Whether points that the lanes leave out need Python in between."""
        return self._samples is not None or not self._loop.takes(self._points)

    def _left(self) -> Ints:
        return np.flatnonzero(self._state == core.PointState.is_left)

    def _run_left(self, deadline: float) -> None:
        """Run the points that the lanes left out by the scalar engine; along branches the deadline does not count."""
        left = self._left()
        if not left.size:
            return
        own = (
            self._values.begins_as_scene if self._loop.chained else np.ones(len(self._state), dtype=np.bool_)
        )
        given = {
            int(place): self._given_state(place)
            for place in left
            if self._one_by_one or self._values.starts or not own[place]
        }
        by_itself = [
            place
            for place, state in given.items()
            if self._one_by_one or self._is_structure or (state is None and not own[place])
        ]
        for place in by_itself:
            if self._one_by_one and not self._loop.chained and time.perf_counter() > deadline:
                return
            self._answer(np.array([place]), columns_of([self._alone(place, given[place])]))
        rest = left[~np.isin(left, by_itself)]
        if rest.size:
            points = self._scalar_points(rest, given)
            over = np.inf if self._loop.chained else deadline
            columns, _ = run_loop(self._loop, points, None, over, self._alone_of(rest, given))
            self._answer(rest[: len(columns)], columns)

    def _alone_of(
        self, places: Ints, given: Mapping[int, State | None]
    ) -> Callable[[int, State | None], tuple[RunRecord, None]]:
        def alone(number: int, _: State | None) -> tuple[RunRecord, None]:
            place = int(places[number])
            return self._alone(place, given.get(place)), None

        return alone

    def _scalar_points(self, places: Ints, given: Mapping[int, State | None]) -> PreparedPoints:
        """Return the points at some places, each as the start of a branch."""
        points, names = self._points, self._loop.driver.float_names
        table = points.table[places]
        for row, place in enumerate(places):
            state = given.get(int(place))
            if state is not None:
                start = self._free_start(int(place), state)
                table[row, [names.index(name) for name in ("displacement_start", "velocity_start")]] = start
                if points.forced:
                    table[row, names.index("forcing.phase")] = 0.0
        columns = {name: column[places] for name, column in points.columns.items()}
        first = np.ones(len(places), dtype=np.bool_)
        begin, end = points.begin[places], points.end[places]
        return PreparedPoints(first, table, begin, end, columns, points.forced, points.periods, points.scene)

    def _answer(self, places: Ints, columns: RunColumns) -> None:
        """Give the results of the scalar engine to the lanes."""
        self._scalar.append((places, columns))
        ended = np.isin(columns.outcome, CARRYING)
        self._outcome[places] = np.where(ended, Outcome.ok, columns.outcome)
        if not self._is_structure:
            self._final_q[0, places], self._final_p[0, places] = (
                columns.final_displacement,
                columns.final_velocity,
            )
        elif self._loop.chained and columns.final_state is not None:
            states = columns.final_state.T.reshape(2, -1, len(places))
            self._final_q[:, places], self._final_p[:, places] = states
        self._state[places] = core.PointState.is_answered

    # ---- states along a branch ----

    def _given_state(self, place: int) -> State | None:
        """Return the start state of a point; None: the scene's start."""
        return self._values.starts.get(int(place)) if self._first[place] else self._start_after(place - 1)

    def _start_after(self, place: int) -> State | None:
        """Return the start state of the point after `place`: the final state of the last run that came to its end."""
        while self._outcome[place] != Outcome.ok:
            if self._first[place]:
                return self._values.starts.get(int(place))
            place -= 1
        return (*self._final_q[:, place].tolist(), *self._final_p[:, place].tolist())

    def _free_start(self, place: int, state: State) -> State:
        """Return a carried state, put back where it is beyond a stop that has moved."""
        values = {key: float(each[place]) for key, each in self._values.values.items()}
        return free_state(self._loop.scene.at(values), state)

    # ---- records ----

    def _columns(self, done: int) -> RunColumns:
        """Return the records of the first points, in their order."""
        run = np.flatnonzero(self._state[:done] == core.PointState.has_run)
        pieces = [(run, self._lane_columns(run)), *self._scalar]
        pieces = [piece for piece in pieces if piece[0].size] or pieces[:1]
        if len(pieces) == 1 and len(pieces[0][0]) == done:
            return pieces[0][1]
        places = np.concatenate([piece[0] for piece in pieces])
        order = np.argsort(places)
        return joined([piece[1] for piece in pieces]).chosen(order[:done])

    def _lane_columns(self, run: Ints) -> RunColumns:
        """Return the records of the points at these places, from their lanes."""
        record, points = self._loop.scene.record, self._points
        outcome, reached = self._outcome[run], self._reached[run]
        message = np.full(len(run), "", dtype=object)
        for number in np.flatnonzero(outcome == Outcome.impact_limit):
            message[number] = limit_message(self._loop.scene.execution.impact_limit, float(reached[number]))
        frequency, phase = (self._given[name][run] for name in ("angular_frequency", "phase"))
        no_sticks = Ragged(np.zeros(len(run), dtype=np.int64), np.empty((0, len(STICK_COLUMNS))))
        return RunColumns(
            outcome=outcome,
            message=message,
            seconds=np.full(len(run), self._seconds / max(len(run), 1)),
            final_displacement=self._displacement[run],
            final_velocity=self._velocity[run],
            final_phase=final_phases(outcome, reached, frequency, phase)
            if points.forced
            else np.full(len(run), np.nan),
            final_state=self._modal.states(self._final_q, self._final_p, run),
            periods=self._periods_at(run) if points.periods else None,
            impacts=self._impacts_at(run) if record.impacts else None,
            sticks=no_sticks if record.impacts else None,
            samples=None if self._samples is None else self._samples.rows(run),
        )

    def _period_table(self) -> Floats:
        """Return room for the periods of the points, shape (column, point, period); with one for all, NaN."""
        points, count = self._points, len(self._values)
        if not points.periods:
            return np.empty((core.PERIOD_WIDTH, count, 0))
        if not self._plan.each_period:
            return np.full((core.PERIOD_WIDTH, count, 1), np.nan)
        with np.errstate(over="ignore", invalid="ignore"):  # C leaves a point with an infinite period
            turns = (points.end - points.begin) * self._given["angular_frequency"] / TWO_PI
        most = turns[np.isfinite(turns)].max(initial=0.0)
        return np.empty((core.PERIOD_WIDTH, count, math.ceil(most * (1.0 - ROUNDING))))

    def _periods_at(self, run: Ints) -> Floats:
        """Return the table of periods of some points, shape (point, period, 5); missing periods of a point are NaN."""
        count = np.minimum(self._periods_of[run], self._periods.shape[2])
        most = int(count.max(initial=0))
        whole = len(run) == self._periods.shape[1]
        table = (self._periods if whole else self._periods[:, run])[:, :, :most]
        if (count < most).any():
            table[:, np.arange(most) >= count[:, None]] = np.nan
        return np.moveaxis(table, 0, -1)

    def _impacts_at(self, run: Ints) -> Ragged:
        """Return the impacts of some points."""
        count = np.zeros_like(self._rows_of)
        count[run] = self._rows_of[run]
        return Ragged(count[run], core.impacts_by_point(self._blocks, count))
