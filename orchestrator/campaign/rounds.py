"""The stages of a campaign: a sweep is one stage; with adaptive axes, each round of points is a stage.

A round depends only on the rows of the rounds before. A resumed campaign therefore has the same rounds, for any
interruption and any number of workers. Runs are numbered round after round.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Direction, take_runs
from vibroimpact.analysis.dataset.merging import joined
from vibroimpact.analysis.jumps import RunClasses, classes_of
from vibroimpact.orchestrator.campaign.destination import Destination
from vibroimpact.orchestrator.campaign.extension import final_states
from vibroimpact.orchestrator.campaign.parts import StoredPart
from vibroimpact.orchestrator.campaign.refinement import Known, Refined, cut_cells, halved_intervals
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, points_of
from vibroimpact.orchestrator.run.dataset import coordinate_names
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.run.runner import CARRYING
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import Branch, Points, SweepAxis, SweepDirection, expand, run_count

_WAYS: dict[int, SweepDirection] = {Direction.up: "up", Direction.down: "down"}

Stored = Callable[[], Sequence[StoredPart]]
"""Returns the present sound parts and sealed shards of a campaign, in run order."""


@dataclass(frozen=True, slots=True)
class Stage:
    """Points that can be computed together."""

    branches: Sequence[Branch]
    held: list[StoredPart]
    """Parts of the runs before `runs` that need not be computed."""
    runs: int
    """Number of runs of the campaign including this stage."""
    said: str = ""
    """Words on the round for the progress; empty for a plain sweep."""


def adaptive_axes(scene: Scene) -> tuple[SweepAxis, ...]:
    """Return the adaptive axes of a scene, with points where the motion jumps."""
    return tuple(axis for axis in scene.sweep if axis.adaptive is not None)


@dataclass(frozen=True, slots=True)
class _Piece:
    """Rows of a round from one part or shard."""

    part: StoredPart
    rows: xr.Dataset


class _DroppedShardError(Exception):
    """A shard was dropped that has points of earlier rounds, too."""


class _Files:
    """The parts and shards of a campaign; the last shard that was read stays in memory, as rounds share it."""

    def __init__(self, destination: Destination) -> None:
        self._destination = destination
        self._read: tuple[StoredPart | None, xr.Dataset] = (None, xr.Dataset())

    def rows(self, part: StoredPart, first: int, stop: int) -> xr.Dataset:
        """Return the rows of the runs `first` to `stop - 1`."""
        if self._read[0] != part:
            self._read = (part, self._destination.rows(part.path))
        rows = self._read[1]
        if (part.chunk.first, part.chunk.stop) == (first, stop):
            return rows
        return take_runs(rows, np.arange(first, stop) - part.chunk.first)

    def drop(self, part: StoredPart, first: int) -> None:
        """Remove a part or a shard; its runs before `first` are of earlier rounds."""
        self._destination.drop(part)
        if part.chunk.first < first:
            raise _DroppedShardError


class Rounds:
    """The rounds of an adaptive campaign.

    Attributes
    ----------
    left : int
        Number of jumps in the last round for which `at_most` left no points.
    """

    def __init__(self, scene: Scene) -> None:
        self.left = 0
        self._scene = scene
        self._names = coordinate_names(scene)
        self._axes = adaptive_axes(scene)
        self._at_most = max(axis.adaptive.at_most for axis in self._axes if axis.adaptive is not None)
        self._known: Known | None = None
        self._states: NDArray[np.float64] = np.empty((0, 0))
        self._usable: NDArray[np.bool_] = np.empty(0, dtype=np.bool_)

    def stages(self, stored: Stored, destination: Destination) -> Iterator[Stage]:
        """Yield each round that is not complete; its parts must be stored before the next round is requested.

        Parts and shards with other points than their round are dropped: rows before them were computed again, and came
        out otherwise. A dropped shard may have points of earlier rounds; the rounds then begin anew.
        """
        files = _Files(destination)
        while True:
            try:
                yield from self._stages(stored, files)
                return
            except _DroppedShardError:
                self.left, self._known = 0, None

    def _stages(self, stored: Stored, files: _Files) -> Iterator[Stage]:
        branches, first, number = expand(self._scene), 0, 0
        while branches:
            stop = first + sum(len(branch.points) for branch in branches)
            pieces = self._pieces(stored(), branches, first, stop, files)
            if sum(piece.part.rows for piece in pieces) < stop - first:
                before = [StoredPart(Path(), Chunk(0, 0, first), None, first)] if first else []
                held = [*before, *(piece.part for piece in pieces)]
                yield Stage(branches, held, stop, f" of round {number + 1}")
                pieces = self._pieces(stored(), branches, first, stop, files)
            self._take(joined([one.rows for one in pieces], [os.fspath(one.part.path) for one in pieces]))
            branches, first, number = self._next(stop), stop, number + 1
        for part in stored():
            if part.chunk.stop > first:
                files.drop(part, first)

    def branch_of(self, rows: xr.Dataset, run: int) -> Branch | None:
        """Return the branch of a run; None where no round has the run, or a round before it is not complete.

        Parameters
        ----------
        rows : xarray.Dataset
            Computed runs, one-dimensional.
        run : int
            Number of the run.
        """
        branches, first = expand(self._scene), 0
        runs = rows.run_index.values
        while branches:
            last = branches[-1].points
            stop = last.first_index + len(last)
            if run < stop:
                return next(one for one in branches if run < one.points.first_index + len(one.points))
            places = np.flatnonzero((runs >= first) & (runs < stop))
            if places.size < stop - first:
                return None
            self._take(take_runs(rows, places))
            branches, first = self._next(stop), stop
        return None

    def _pieces(
        self, stored: Sequence[StoredPart], branches: Sequence[Branch], first: int, stop: int, files: _Files
    ) -> list[_Piece]:
        """Return the stored rows of a round, in run order; parts with other points are dropped."""
        found = []
        for part in stored:
            begin, end = max(part.chunk.first, first), min(part.chunk.stop, stop)
            if begin >= end:
                continue
            rows = files.rows(part, begin, end)
            if self._is_of(rows, branches):
                chunk = replace(part.chunk, first=begin, stop=end)
                found.append(_Piece(replace(part, chunk=chunk, rows=chunk.count), rows))
            else:
                files.drop(part, first)
        return sorted(found, key=lambda piece: piece.part.chunk.first)

    def _is_of(self, rows: xr.Dataset, branches: Sequence[Branch]) -> bool:
        runs = rows.run_index.values
        points = points_of(branches, Chunk(0, int(runs[0]), int(runs[-1]) + 1))
        expected = np.stack([points.values[key] for key in self._names], axis=1)
        return bool(np.array_equal(expected, self._values(rows)))

    def _values(self, rows: xr.Dataset) -> NDArray[np.float64]:
        return np.stack([rows[name].values for name in self._names.values()], axis=1)

    def _take(self, rows: xr.Dataset) -> None:
        """Add the rows of a complete round to the known points."""
        states = final_states(rows, slice(None))
        usable = np.isin(rows.outcome.values, CARRYING) & np.isfinite(states).all(axis=1)
        values, classes = self._values(rows), classes_of(rows)
        direction = rows.direction.values.astype(np.int64)
        if self._known is None:
            self._known, self._states, self._usable = Known(values, direction, classes), states, usable
            return
        known = self._known
        joined: RunClasses = known.classes.joined(classes)
        self._known = Known(
            np.concatenate([known.values, values]), np.concatenate([known.direction, direction]), joined
        )
        self._states = np.concatenate([self._states, states])
        self._usable = np.concatenate([self._usable, usable])

    def _next(self, first: int) -> tuple[Branch, ...]:
        """Return the branches of the next round; none if every jump is bracketed, or no room is left."""
        assert self._known is not None
        room = self._at_most - first
        tolerance = [axis.adaptive.tolerance for axis in self._axes if axis.adaptive is not None]
        if len(self._axes) == 1:
            place = self._scene.sweep.index(self._axes[0])
            refined = halved_intervals(self._known, place, tolerance[0], self._step(), room)
        else:
            start = [sorted(axis.values) for axis in self._axes]
            refined = cut_cells(self._known, start, tolerance, self._step(), room)
        self.left = refined.left
        return self._branches(refined, first)

    def _step(self) -> float:
        """Return the difference of ranges above which the motion jumps, m."""
        assert self._known is not None
        extent = self._known.classes.extent
        shares = [axis.adaptive.jump for axis in self._axes if axis.adaptive is not None]
        return min(shares) * float(np.fmax.reduce(extent, initial=0.0))

    def _branches(self, refined: Refined, first: int) -> tuple[Branch, ...]:
        keys = list(self._names)
        if not len(refined.values):
            return ()
        if not any(axis.continuation for axis in self._scene.sweep):
            columns = (
                SweepAxis(key, tuple(column), together="round")
                for key, column in zip(keys, refined.values.T.tolist(), strict=True)
            )
            return (Branch("independent", {}, Points(first, {}, (tuple(columns),))),)
        return tuple(
            Branch(_WAYS[way], point, Points(first + number, point, ()), self._start(refined, number))
            for number, (way, values) in enumerate(
                zip(refined.direction.tolist(), refined.values.tolist(), strict=True)
            )
            for point in [dict(zip(keys, values, strict=True))]
        )

    def _start(self, refined: Refined, number: int) -> State | None:
        """Return the start state of a point: the final state of the nearest computed point before it on its branch.

        A run that ended early is skipped, so that the point before it hands on its state, as along any path.
        """
        assert self._known is not None
        up = refined.direction[number] == Direction.up
        nearest = int((refined.below if up else refined.above)[number])
        place = self._scene.sweep.index(self._axes[0])
        along = self._known.values[:, place]
        others = np.delete(self._known.values, place, axis=1)
        behind = along <= along[nearest] if up else along >= along[nearest]
        line = (self._known.direction == refined.direction[number]) & (others == others[nearest]).all(axis=1)
        rows = np.flatnonzero(line & behind & self._usable)
        if not rows.size:
            return None
        row = rows[np.argmax(along[rows]) if up else np.argmin(along[rows])]
        return tuple(self._states[row].tolist())


def stages_of(
    scene: Scene,
    rounds: Rounds | None,
    stored: Stored,
    kept: Sequence[StoredPart],
    destination: Destination,
) -> Iterator[Stage]:
    """Yield the stages of a campaign, one after the other: its sweep, or each round of an adaptive sweep.

    `rounds` is None for a plain sweep; `kept` are stretches of runs from an earlier sweep.
    """
    if rounds is not None:
        yield from rounds.stages(stored, destination)
        return
    held = sorted([*stored(), *kept], key=lambda part: part.chunk.first)
    yield Stage(expand(scene), held, run_count(scene.sweep))
