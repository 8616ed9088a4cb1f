"""Points of a sweep in the form for runners: swept values as arrays, branches, carried states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Direction
from vibroimpact.orchestrator.scene.sweep import Branch, Paths, Point

State = tuple[float, ...]
"""Displacement (m) and velocity (m/s) of an oscillator; N displacements, then N velocities of a structure."""


@dataclass(frozen=True, slots=True)
class BranchPoint:
    """A point with the direction of its branch, whether it is first in its branch, and then its start state."""

    point: Point
    direction: Direction
    first: bool
    start: State | None = None


@dataclass(frozen=True, slots=True)
class PointColumns:
    """Points as arrays, shape (point,): swept values, direction, place in the campaign, first points of branches.

    `starts` has the start states of branches that do not begin at the scene's start, by index of their first point.
    """

    values: Mapping[str, NDArray[np.float64]]
    direction: NDArray[np.int8]
    index: NDArray[np.int64]
    first: NDArray[np.bool_]
    starts: Mapping[int, State]

    def __len__(self) -> int:
        return len(self.index)

    def chosen(self, which: slice | NDArray[np.bool_]) -> PointColumns:
        """Return the chosen points."""
        values = {key: column[which] for key, column in self.values.items()}
        return PointColumns(values, self.direction[which], self.index[which], self.first[which], self.starts)

    def taken(self, count: int) -> PointColumns:
        """Return the first points."""
        return self.chosen(slice(count))

    def place(self, number: int) -> BranchPoint:
        """Return the point at a place."""
        values = {key: float(column[number]) for key, column in self.values.items()}
        index, direction = int(self.index[number]), Direction(int(self.direction[number]))
        first = bool(self.first[number])
        return BranchPoint(Point(index, values), direction, first, self.starts.get(index) if first else None)

    def places(self) -> Iterator[BranchPoint]:
        """Yield the points one by one."""
        return map(self.place, range(len(self)))

    @property
    def are_independent(self) -> bool:
        """Whether no point starts from the final state of another point."""
        return not self.direction.any()


def independent_points(values: Mapping[str, NDArray[np.float64]], count: int) -> PointColumns:
    """Return points that each begin at the scene's start, by their swept values, shape (point,)."""
    direction = np.full(count, Direction.independent, dtype=np.int8)
    return PointColumns(values, direction, np.arange(count), np.ones(count, dtype=np.bool_), {})


def columns_of_points(branches: Sequence[Branch], first: int, stop: int) -> PointColumns:
    """Return the points `first` to `stop - 1` of branches, in the order of their index."""
    if isinstance(branches, Paths):
        index = np.arange(first, stop)
        values, place = branches.columns(index)
        return PointColumns(values, branches.directions(index), index, place == 0, {})
    pieces: list[PointColumns] = []
    for branch in branches:
        begin = branch.points.first_index
        if begin >= stop:
            break
        own, end = max(first - begin, 0), min(stop - begin, len(branch.points))
        if own >= end:
            continue
        index = np.arange(begin + own, begin + end)
        direction = np.full(len(index), Direction[branch.direction], dtype=np.int8)
        starts = {} if branch.start is None else {begin: branch.start}
        pieces.append(PointColumns(branch.points.columns(own, end), direction, index, index == begin, starts))
    return PointColumns(
        {key: np.concatenate([piece.values[key] for piece in pieces]) for key in pieces[0].values},
        np.concatenate([piece.direction for piece in pieces]),
        np.concatenate([piece.index for piece in pieces]),
        np.concatenate([piece.first for piece in pieces]),
        {begin: start for piece in pieces for begin, start in piece.starts.items()},
    )
