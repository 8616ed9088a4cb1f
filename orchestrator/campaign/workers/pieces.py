"""The points of a chunk run piece by piece: the memory of a worker does not grow with the points of its chunk.

A runner keeps rows of all impacts and periods of its points until it has made columns of them. A piece bounds these
rows. Its columns are small, and a chunk ends early where they reach its size.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from vibroimpact.analysis.dataset import RunRecord
from vibroimpact.analysis.dataset.columns import RunColumns, columns_of, joined, of_all_periods
from vibroimpact.orchestrator.run import Runner
from vibroimpact.orchestrator.run.points import PointColumns, State
from vibroimpact.orchestrator.run.runner import Rows

PIECE_POINTS = 20_000
"""Number of points of a piece; rows of 20 recorded periods of each take 30 MB."""

PIECE_BRANCHES = 32
"""Least number of branches of a piece, so that few lanes wait for the longest branch."""

MOST_BYTES = 1 << 27
"""Size of the results of a worker's chunk, bytes, above which it ends early; writing them takes as much again."""


def run_in_pieces(
    runner: Runner, points: PointColumns, start: State | None, deadline: float, most_bytes: int = MOST_BYTES
) -> Rows:
    """Run points piece by piece, see `Runner.rows`; they also end early before their results take `most_bytes`.

    Pieces change no bit of the results.
    """
    pieces: list[Sequence[RunRecord] | RunColumns] = []
    carried, size, each_period = start, 0, runner.scene.record.each_period
    for first, stop in pairwise(_ends(points)):
        records, carried = runner.rows(points.chosen(slice(first, stop)), carried, deadline)
        if isinstance(records, RunColumns):
            records = records if each_period or records.periods is None else _of_all_periods(records)
            size += records.nbytes
        pieces.append(records)
        is_late = len(records) < stop - first or time.perf_counter() > deadline
        if is_late or size * (1 + 1 / len(pieces)) > most_bytes:
            break
    return _together(pieces), carried


def _of_all_periods(columns: RunColumns) -> RunColumns:
    """Return columns with one element for all periods, as it is stored; a second call changes nothing."""
    assert columns.periods is not None
    return replace(columns, periods=of_all_periods(columns.periods))


def _ends(points: PointColumns) -> Iterator[int]:
    """Yield the ends of pieces, with 0 first: between branches where there are several, else anywhere."""
    yield 0
    count, begins = len(points), np.flatnonzero(points.first)
    if points.are_independent or begins.size < 2:
        yield from range(PIECE_POINTS, count, PIECE_POINTS)
    else:
        branches = max(PIECE_BRANCHES, math.ceil(PIECE_POINTS * begins.size / count))
        yield from begins[branches::branches].tolist()
    yield count


def _together(pieces: list[Sequence[RunRecord] | RunColumns]) -> Sequence[RunRecord] | RunColumns:
    """Return the results of pieces as one, columns if a piece has columns; the list is emptied."""
    records = [piece for piece in pieces if not isinstance(piece, RunColumns)]
    if len(records) == len(pieces):
        return [record for piece in records for record in piece]
    columns = [piece if isinstance(piece, RunColumns) else columns_of(piece) for piece in pieces]
    pieces.clear()
    return joined(columns)
