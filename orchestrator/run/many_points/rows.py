"""Rows of many points by one call: by the loop, or by lanes."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from vibroimpact.analysis.dataset import RunRecord
from vibroimpact.analysis.dataset.columns import RunColumns
from vibroimpact.orchestrator.run.many_points.loop import PointLoop, PointValues
from vibroimpact.orchestrator.run.many_points.loop_rows import run_loop
from vibroimpact.orchestrator.run.points import PointColumns, State
from vibroimpact.orchestrator.run.runner import next_start

Alone = Callable[[Mapping[str, float], State | None], RunRecord]
"""Runs one point, by its swept values, from a start state."""


def rows_of(
    loop: PointLoop, points: PointColumns, start: State | None, deadline: float, alone: Alone
) -> tuple[RunColumns, State | None] | None:
    """Return the results of points by the loop in C or by lanes; None where points need Python in between."""
    if loop.by_lanes:
        return _lane_rows(loop, points, start, deadline, alone)
    prepared = None if points.starts else loop.prepared(PointValues(points.values, points.first))
    if prepared is None:
        return None

    def one(place: int, given: State | None) -> tuple[RunRecord, State | None]:
        record = alone(points.place(place).point.values, given)
        return record, next_start(record, given)

    return run_loop(loop, prepared, start, deadline, one)


def _lane_rows(
    loop: PointLoop, points: PointColumns, start: State | None, deadline: float, alone: Alone
) -> tuple[RunColumns, State | None]:
    # the import takes time, and only scenes in lanes need it
    from vibroimpact.orchestrator.run.many_points.lanes_rows import LaneValues, run_in_lanes

    begins = np.isin(points.index, list(points.starts)) & points.first
    starts = {int(place): points.starts[int(points.index[place])] for place in np.flatnonzero(begins)}
    whole = LaneValues(points.values, points.first, starts).piece(0, len(points), start)

    def one(place: int, given: State | None) -> RunRecord:
        return alone(points.place(place).point.values, given)

    return run_in_lanes(loop, whole, deadline, one)
