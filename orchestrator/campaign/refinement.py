"""The points of the next round: halfway between neighbours whose motion jumps, down to the tolerance.

The points depend only on the rows of the rounds before. They are the same bit for bit, whatever computed these rows
and in whatever order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.jumps import RunClasses

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Known:
    """The computed points.

    Attributes
    ----------
    values : ndarray of float, shape (point, axis)
        Swept values of the points, in the order of the axes.
    direction : ndarray of int, shape (point,)
        `Direction` of each point.
    classes : RunClasses
    """

    values: Floats
    direction: NDArray[np.int64]
    classes: RunClasses


@dataclass(frozen=True, slots=True)
class Refined:
    """The points of a round."""

    values: Floats
    """Swept values of the points, shape (point, axis)."""
    direction: NDArray[np.int64]
    """`Direction` of each point, shape (point,)."""
    below: NDArray[np.intp]
    """Known point just below each value, from which an up branch starts, shape (point,); -1 in a plane."""
    above: NDArray[np.intp]
    """Known point just above each value, from which a down branch starts, shape (point,); -1 in a plane."""
    left: int
    """Number of jumps of the motion for which there was no room."""


def halved_intervals(known: Known, axis: int, tolerance: float, step: float, room: int) -> Refined:
    """Return the middle of each interval of one axis in which the motion jumps, at most `room`, the widest first.

    Neighbours are compared along each line of the axis. Only intervals wider than the tolerance are halved; ranges
    that differ by more than `step` (m) jump.
    """
    others = np.delete(known.values, axis, axis=1)
    along = known.values[:, axis]
    order = np.lexsort((along, *others.T[::-1], known.direction))
    low, high = order[:-1], order[1:]
    same_line = (known.direction[low] == known.direction[high]) & (others[low] == others[high]).all(axis=1)
    width = along[high] - along[low]
    open_ones = np.flatnonzero(same_line & (width > tolerance) & known.classes.jump(low, high, step))
    widest = open_ones[np.argsort(-width[open_ones], kind="stable")][:room]
    chosen = np.sort(widest)
    low, high = low[chosen], high[chosen]
    values = known.values[low]
    values[:, axis] = along[low] + 0.5 * (along[high] - along[low])
    return Refined(values, known.direction[low], low, high, open_ones.size - chosen.size)


class _Cell(NamedTuple):
    """A rectangle of the plane of two axes."""

    left: float
    right: float
    bottom: float
    top: float

    def mid(self, tolerance: Sequence[float]) -> tuple[list[float], list[float]]:
        """Return the cuts of the cell along each axis: its ends, and the middle where it is too wide."""
        return _cut(self.left, self.right, tolerance[0]), _cut(self.bottom, self.top, tolerance[1])


def _cut(low: float, high: float, tolerance: float) -> list[float]:
    return [low, low + 0.5 * (high - low), high] if high - low > tolerance else [low, high]


def cut_cells(
    known: Known, start: Sequence[Sequence[float]], tolerance: Sequence[float], step: float, room: int
) -> Refined:
    """Return the points that cut each cell of a plane whose corners and edges have different motions.

    `start` are the first values of the two axes, ascending. A cell is cut along an axis while it is wider than the
    tolerance; for `step` and `room` see `halved_intervals`.
    """
    plane = _Plane(known, tolerance, step)
    found: dict[tuple[float, float], None] = {}
    left = 0
    for left_edge, right_edge in pairwise(start[0]):
        for bottom, top in pairwise(start[1]):
            for points in plane.cuts(_Cell(left_edge, right_edge, bottom, top)):
                new = [point for point in points if point not in found]
                if len(found) + len(new) > room:
                    left += 1
                else:
                    found.update(dict.fromkeys(new))
    values = np.array(sorted(found), dtype=np.float64).reshape(-1, 2)
    nobody = np.full(len(values), -1, dtype=np.intp)
    return Refined(values, np.zeros(len(values), dtype=np.int64), nobody, nobody, left)


class _Plane:
    """The cells of a plane, cut where their points are known."""

    def __init__(self, known: Known, tolerance: Sequence[float], step: float) -> None:
        self._rows = {(x, y): row for row, (x, y) in enumerate(known.values.tolist())}
        self._label = list(map(tuple, known.classes.label.tolist()))
        self._extent = known.classes.extent
        self._tolerance, self._step = tolerance, step

    def cuts(self, cell: _Cell) -> Iterator[list[tuple[float, float]]]:
        """Yield the new points of each cell that must be cut, in the order of the cells."""
        across, along = cell.mid(self._tolerance)
        points = [(x, y) for x in across for y in along]
        new = [point for point in points if point not in self._rows]
        if new:
            if self._jumps(cell):
                yield new
        elif len(points) > 4:
            for left, right in pairwise(across):
                for bottom, top in pairwise(along):
                    yield from self.cuts(_Cell(left, right, bottom, top))

    def _jumps(self, cell: _Cell) -> bool:
        rows = [self._rows[point] for point in self._around(cell)]
        extent = self._extent[rows]
        compared = extent[np.isfinite(extent)]
        spread = float(np.ptp(compared)) if compared.size else 0.0
        return spread > self._step or len({self._label[row] for row in rows}) > 1

    def _around(self, cell: _Cell) -> set[tuple[float, float]]:
        """Return the known points at the corners of a cell, and points of finer neighbours on its edges."""
        found = {(x, y) for x in (cell.left, cell.right) for y in (cell.bottom, cell.top)}
        for y in (cell.bottom, cell.top):
            self._between((cell.left, y), (cell.right, y), found)
        for x in (cell.left, cell.right):
            self._between((x, cell.bottom), (x, cell.top), found)
        return found

    def _between(
        self, one: tuple[float, float], other: tuple[float, float], found: set[tuple[float, float]]
    ) -> None:
        middle = (one[0] + 0.5 * (other[0] - one[0]), one[1] + 0.5 * (other[1] - one[1]))
        if middle in self._rows and middle not in (one, other):
            found.add(middle)
            self._between(one, middle, found)
            self._between(middle, other, found)
