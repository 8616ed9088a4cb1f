"""The flow of many states of a scene's body from one phase 0 of the force to another, by the loop in C."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import IMPACT_COLUMNS, Outcome, RunRecord
from vibroimpact.analysis.dataset.columns import RunColumns, columns_of, joined
from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.attractors.basins import Ends, Floats, Section
from vibroimpact.analysis.orbits.attractors.chaotic_groups import Blocks, block_features
from vibroimpact.analysis.orbits.classify import RunClass, class_of
from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.orchestrator.orbits.free_motion import FreeMotion
from vibroimpact.orchestrator.orbits.further_sines import FurtherSines, strobed_body
from vibroimpact.orchestrator.run.empty_record import empty_record
from vibroimpact.orchestrator.run.forces import phases_of_new_start
from vibroimpact.orchestrator.run.limits import may_go_by_lanes
from vibroimpact.orchestrator.run.many_points.lanes_rows import run_prepared_in_lanes
from vibroimpact.orchestrator.run.many_points.loop import PointLoop, PointValues, PreparedPoints
from vibroimpact.orchestrator.run.many_points.loop_rows import run_loop
from vibroimpact.orchestrator.run.point import PointRunner
from vibroimpact.orchestrator.scene import Scene

Mask = NDArray[np.bool_]

RECORDED = 64
"""Forcing periods that define the class of a run."""
SLICE = 0.25
"""Interval at which a thread checks whether it should stop, s. Ctrl-C takes at most this time and one run."""
DEADLINE = 20.0
"""Longest time of one run, s; a longer run counts as one with an unknown end."""
_PHASE, _VELOCITY, _CONTACT = (
    IMPACT_COLUMNS.index(f"impact_{name}") for name in ("phase", "velocity", "contact")
)
_RECORD = {"transient_periods": 0, "recorded_periods": 1, "impacts": False}


class _Closing(Exception):
    """Ends a thread whose work is no longer needed."""


class _OneByOne:
    """Runs states of a scene one by one, for bodies and points that neither lanes nor the loop in C can follow."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._runners: dict[tuple[int, int], PointRunner] = {}

    def close(self) -> None:
        """Close the runners."""
        for runner in self._runners.values():
            runner.close()

    def _runner(self, periods: tuple[int, int]) -> PointRunner:
        """Return the runner that records some periods after a transient."""
        if periods not in self._runners:
            record = dict(zip(("record.transient_periods", "record.recorded_periods"), periods, strict=True))
            self._runners[periods] = PointRunner(self._scene.with_values(record), execution="fused")
        return self._runners[periods]

    def run(
        self, state: Floats, periods: tuple[int, int], phases: dict[str, float], *, first: bool
    ) -> RunRecord:
        """Return the record of a run from a state, at time 0 (first) or where the phase of the clock is 0.

        `phases` are those of further sines, by key of the scene.
        """
        try:
            return self._runner(periods).run(phases, tuple(state.tolist()), at_time_0=first)
        except ComponentError as problem:
            return empty_record(self._scene, Outcome.error, str(problem), 0.0)


class BodyFlow:
    """Follows many states of a scene's body in lanes, or by the loop in C, on one thread per processor.

    Bodies that neither can follow, such as several with moving stops, run one by one.
    """

    def __init__(self, scene: Scene, workers: int | None = None) -> None:
        self.scene = scene
        bare = {**_RECORD, "extrema": False, "strobe": False}
        record = {**_RECORD, "extrema": True, "strobe": True}
        self._pool = ThreadPoolExecutor(workers or os.cpu_count() or 1)
        count = self._pool._max_workers
        self._closing = False
        self._runners: list[PointRunner] = []
        self._alone: list[_OneByOne] = []
        self._left_out: dict[PointLoop, _OneByOne] = {}
        self._bare = [self._loop(bare) for _ in range(count)]
        self._recording = [self._loop(record) for _ in range(count)]
        self._measuring = [self._loop({**bare, "impacts": True}) for _ in range(count)]
        self.names = scene.body.start_names
        body = strobed_body(scene)
        decay = body.slowest_decay * body.period
        self.decay = decay if decay > 0.0 else math.inf
        self.period = body.period
        self._sines = FurtherSines.of(scene)
        self._free = FreeMotion.of(scene, body, self._sines)
        self.turns = self._sines.turns if len(self._sines) else None

    @property
    def free_state(self) -> Floats | None:
        """State at forcing phase 0 of the steady motion without impacts; None where it hits a stop."""
        return None if self._free is None else self._free.state

    def stays_free(self, states: Floats) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Return a mask of the states from which no stop can be met: see `analysis.orbits.attractors.basins.Flow`."""
        return np.zeros(len(states), np.bool_) if self._free is None else self._free.stays_free(states)

    def _loop(self, record: dict[str, Any]) -> PointLoop | _OneByOne:
        limits = {"execution.how": "auto", "execution.deadline": DEADLINE}
        scene = self.scene.with_values({"record": record, **limits})
        by_lanes = self.scene.execution.how == "auto" and may_go_by_lanes(scene)
        self._runners.append(PointRunner(scene, execution="lanes" if by_lanes else "fused"))
        loop = self._runners[-1].loop
        alone = _OneByOne(scene)
        self._alone.append(alone)
        if loop is None and not scene.is_measured:
            return alone
        if loop is None:
            raise UsageError(
                f"{self.scene.source}: basins: expected a body without a measuring chain, got one with it."
            )
        self._left_out[loop] = alone
        return loop

    def close(self) -> None:
        """Stop the threads and close the runners."""
        self._closing = True
        self._pool.shutdown(cancel_futures=True)
        for runner in self._runners:
            runner.close()
        for alone in self._alone:
            alone.close()

    def follow(self, states: Floats, periods: int, *, first: bool = False) -> Ends:
        """Return the states after some forcing periods: see `analysis.orbits.attractors.basins.Flow`."""
        columns = self._run(self._bare, states, (0, periods), first=first)
        ends = self._final(columns, states, periods, first=first)
        return Ends(ends, np.concatenate([_went_well(each) for each in columns]))

    def _final(self, columns: list[RunColumns], states: Floats, periods: int, *, first: bool) -> Floats:
        """Return the last states of runs from some states, with the phases of further sines."""
        ends = np.concatenate([_final(each) for each in columns])
        if self.turns is None:
            return ends
        phases = self._sines.after(states[:, len(self.names) :], periods, first=first)
        return np.concatenate([ends, phases], axis=1)

    def classes(
        self, states: Floats, transient: int, *, first: bool = False
    ) -> tuple[list[RunClass], Floats]:
        """Return the class of a run from each state after a transient (forcing periods), and its last states."""
        columns = self._run(self._recording, states, (transient, RECORDED), first=first)
        ends = self._final(columns, states, transient + RECORDED, first=first)
        found = [kind for each in columns for kind in _classes(each)]
        if self.turns is not None:  # neighbours part by phases of further sines
            free = OrbitClass.no_impacts
            return [each if each.kind is free else RunClass(OrbitClass.unknown) for each in found], ends
        rests = self._rests(found, ends)
        if rests.any():
            parts = np.split(rests, np.cumsum([len(each) for each in columns])[:-1])
            both = zip(columns, parts, strict=True)
            found = [kind for each, part in both for kind in _classes(each, part)]
        return found, ends

    def _rests(self, kinds: list[RunClass], states: Floats) -> Mask:
        """Return a mask of the repeating motions that rest on a stop, by one more period of each from its last state.

        Runs that define classes keep no impacts, whose sticks would need memory.
        """
        rests = np.array([each.periods > 0 and each.kind is not OrbitClass.no_impacts for each in kinds])
        rests &= np.isfinite(states).all(axis=1)
        if rests.any():
            longest = max(kinds[place].periods for place in np.flatnonzero(rests))
            columns = self._run(self._measuring, states[rests], (0, longest), first=False)
            rests[rests] = np.concatenate([_stick_counts(each) > 0 for each in columns])
        return rests

    def measure(self, states: Floats, periods: int, blocks: int) -> Blocks:
        """Return features of impacts in consecutive blocks: see `analysis.orbits.attractors.basins.Flow`."""
        features, well = [], np.ones(len(states), np.bool_)
        for _ in range(blocks):  # one block after the other keeps few impacts in memory
            columns = self._run(self._measuring, states, (0, periods), first=False)
            features.append(np.concatenate([self._features(each, periods) for each in columns]))
            states = self._final(columns, states, periods, first=False)
            well &= np.concatenate([_went_well(each) for each in columns])
        return Blocks(np.stack(features, axis=1), states, well)

    def impacts(self, state: Floats, periods: int) -> Floats:
        """Return the impacts from a state at phase 0 on: see `analysis.orbits.attractors.edges.EdgeFlow`."""
        (columns,) = self._run(self._measuring, state[None], (0, periods), first=False)
        assert columns.impacts is not None
        return columns.impacts.rows.copy()

    def section(self, states: Floats, periods: int) -> Section:
        """Return the motions at each forcing phase 0: see `analysis.orbits.attractors.basins.Flow`."""
        tables = [each.periods for each in self._run(self._recording, states, (0, periods), first=False)]
        rows = np.concatenate([table for table in tables if table is not None])
        highest, lowest = rows[..., 0], rows[..., 1]
        extremes = np.column_stack([lowest.min(axis=1, initial=np.inf), highest.max(axis=1, initial=-np.inf)])
        return Section(rows[..., 2:4], extremes)

    def _features(self, columns: RunColumns, periods: int) -> Floats:
        assert columns.impacts is not None
        owner, rows = np.repeat(np.arange(len(columns)), columns.impacts.count), columns.impacts.rows
        impacts = rows[:, _PHASE], rows[:, _VELOCITY], rows[:, _CONTACT].astype(np.int64) - 1
        shape = len(columns), 1, len(self.scene.stops)
        return block_features(owner, np.zeros_like(owner), impacts, shape, periods)[:, 0]

    def _run(
        self, loops: Sequence[PointLoop | _OneByOne], states: Floats, periods: tuple[int, int], *, first: bool
    ) -> list[RunColumns]:
        parts = [part for part in np.array_split(states, len(loops)) if len(part)]
        jobs = [
            self._pool.submit(self._run_part, loop, part, periods, first)
            for loop, part in zip(loops, parts, strict=False)
        ]
        return [job.result() for job in jobs]

    def _run_part(
        self, loop: PointLoop | _OneByOne, states: Floats, periods: tuple[int, int], first: bool
    ) -> RunColumns:
        if isinstance(loop, _OneByOne):
            return columns_of([self._run_alone(loop, state, periods, first=first) for state in states])

        def alone(place: int, _: object) -> tuple[RunRecord, None]:
            """Return the record of a point that the loop leaves out, such as one with a rest, run by itself."""
            return self._run_alone(self._left_out[loop], states[place], periods, first=first), None

        done: list[RunColumns] = []
        while len(states):
            if self._closing:
                raise _Closing
            points, over = self._prepared(loop, states, periods, first=first), time.perf_counter() + SLICE
            if loop.by_lanes:
                done.append(run_prepared_in_lanes(loop, points, over, lambda place, _: alone(place, None)[0]))
            else:
                done.append(run_loop(loop, points, None, over, alone)[0])
            states = states[len(done[-1]) :]
        return joined(done)

    def _run_alone(
        self, loop: _OneByOne, state: Floats, periods: tuple[int, int], *, first: bool
    ) -> RunRecord:
        if self._closing:
            raise _Closing
        count, keys = len(self.names), dict[str, float]()
        if self.turns is not None:
            clock = self.scene.clock
            assert clock is not None, "further sines have a clock"
            turned = 0.0 if first else clock.phase / clock.angular_frequency
            keys = self._sines.phases_of_scene(state[count:], turned)
        return loop.run(state[:count], periods, keys, first=first)

    def _prepared(
        self, loop: PointLoop, states: Floats, periods: tuple[int, int], *, first: bool
    ) -> PreparedPoints:
        one = loop.prepared(PointValues({}, np.ones(1, np.bool_)))
        assert one is not None, "the scene has run"
        names, count = loop.driver.float_names, len(states)
        table = np.repeat(one.table, count, axis=0)
        table[:, [names.index(name) for name in self.names]] = states[:, : len(self.names)]
        period = 2.0 * math.pi / one.columns["forcing.angular_frequency"][0]
        start = float(one.begin[0]) if first else 0.0
        for name, phase in ({} if first else phases_of_new_start(self.scene)).items():
            if name in names:
                table[:, names.index(name)] = phase
        table[:, [names.index(name) for name in self._sines.names]] = states[:, len(self.names) :]
        begin = np.full(count, start + periods[0] * period)
        return PreparedPoints(
            np.ones(count, np.bool_),
            table,
            begin,
            begin + periods[1] * period,
            {name: table[:, place].copy() for place, name in enumerate(names)},
            one.forced,
            one.periods,
            one.scene,
        )


def _went_well(columns: RunColumns) -> np.ndarray[Any, np.dtype[np.bool_]]:
    return np.isin(columns.outcome, (Outcome.ok, Outcome.stuck))


def _final(columns: RunColumns) -> Floats:
    if columns.final_state is not None:
        return columns.final_state
    return np.column_stack([columns.final_displacement, columns.final_velocity])


def _stick_counts(columns: RunColumns) -> NDArray[np.int64]:
    """Return the number of sticks of each run; runs that keep no impacts keep no sticks."""
    return np.zeros(len(columns), np.int64) if columns.sticks is None else columns.sticks.count


def _classes(columns: RunColumns, rests: Mask | None = None) -> list[RunClass]:
    """Return the class of each run, with a mask of the runs that are known to rest on a stop."""
    assert columns.periods is not None
    table, stuck = columns.periods, _stick_counts(columns) > 0 if rests is None else rests
    return [
        class_of(table[run, :, :4], table[run, :, 4], Outcome(int(columns.outcome[run])), bool(stuck[run]))
        for run in range(len(columns))
    ]
