"""The cells of a campaign's store, cut into shards: stretches of runs that are blocks of its arrays.

Runs are numbered from the slowest axis of a sweep to the fastest. A shard takes the fastest axes as a whole and a
stretch of the next axis. So its runs follow one another, and its cells are one block. The arrays of a store have the
dimensions and the order that `analysis.dataset.grid` gives them.

Rounds of points have no grid beforehand, and their number is known at the end only. Their runs lie one after the other
along the dimension `run`, and so do points in no order. Reading the store lays them on their grid.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.grid import axis_of, direction_axis, shared_axes
from vibroimpact.analysis.dataset.stores.grid import CHUNK_POINTS, SHARD_POINTS, Block, StoreGrid
from vibroimpact.orchestrator.run.dataset import coordinate_names, empty_dataset
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import DIRECTIONS, Dimension, dimensions, most_points, run_count

ROUND_POINTS = CHUNK_POINTS
"""Largest number of points of a shard of an adaptive sweep, which has at most 10^6 points in all."""
Ranks = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Shard:
    """Runs `first` to `stop - 1` of a sweep: a block of the arrays of its store."""

    number: int
    first: int
    stop: int
    block: Block
    """Cells along each dimension of the dataset."""

    @property
    def count(self) -> int:
        """Number of runs."""
        return self.stop - self.first


@dataclass(frozen=True, slots=True)
class _RunAxis:
    """One axis of the runs: its dimension in the dataset, and the place of each of its positions along it."""

    dimension: str
    ranks: Ranks

    @property
    def size(self) -> int:
        return len(self.ranks)

    @property
    def is_monotone(self) -> bool:
        return self.size < 2 or bool(np.all(np.diff(self.ranks) == self.ranks[1] - self.ranks[0]))


class Cells(ABC):
    """The cells of a store, one for each run, and its shards.

    Attributes
    ----------
    cells : StoreGrid
        The cells in chunks and shards.
    axes : dict
        Coordinates along their dimensions that are known before the first run, by name.
    is_open : bool
        Whether the number of runs is known at the end only.
    """

    cells: StoreGrid
    axes: dict[str, xr.Variable]
    is_open = False

    @abstractmethod
    def _shards(self) -> Iterator[Shard]:
        """Yield the shards in run order; without a known end, those of the largest number of runs."""

    @abstractmethod
    def places(self, shard: Shard) -> NDArray[np.int64]:
        """Return the place of each run of a shard among the cells of its block, the last dimension fastest."""

    @cached_property
    def shards(self) -> tuple[Shard, ...]:
        """The shards, in run order."""
        return tuple(self._shards())

    def shard_with(self, first: int, stop: int) -> Shard | None:
        """Return the shard with exactly these runs; None if they are none."""
        shard = self.shard_around(first)
        return shard if (shard.first, shard.stop) == (first, stop) else None

    def sealed_shard(self, first: int, stop: int) -> Shard | None:
        """Return the shard with exactly these runs, which may be the first runs of a shard if the end is open."""
        shard = self.shard_around(first)
        if self.is_open and shard.first == first < stop < shard.stop:
            return replace(shard, stop=stop, block=(slice(first, stop),))
        return self.shard_with(first, stop)

    def shard_around(self, run: int) -> Shard:
        """Return the shard of a run."""
        return self.shards[bisect_right(self._firsts, run) - 1]

    @cached_property
    def _firsts(self) -> list[int]:
        return [shard.first for shard in self.shards]


class RunLine(Cells):
    """Runs one after the other along the dimension `run`, in shards of equal length.

    Parameters
    ----------
    runs : int
        Number of runs; the largest one if the end is open.
    branch : int
        Number of runs of a branch; a shard has whole branches where they fit.
    shard_points : int
    is_open : bool
    """

    def __init__(self, runs: int, branch: int, shard_points: int, *, is_open: bool) -> None:
        self.axes, self.is_open = {}, is_open
        chunk = max(shard_points * CHUNK_POINTS // SHARD_POINTS, 1)
        if branch <= shard_points:
            chunk = max(chunk // branch, 1) * branch
        chunk = min(chunk, runs)
        length = min(max(shard_points // chunk, 1), -(-runs // chunk)) * chunk
        self.cells = StoreGrid(("run",), (runs,), (chunk,), (length,))

    def _shards(self) -> Iterator[Shard]:
        for number, block in enumerate(self.cells.blocks()):
            yield Shard(number, block[0].start, block[0].stop, block)

    def places(self, shard: Shard) -> NDArray[np.int64]:
        """Return the numbers of the runs from 0."""
        return np.arange(shard.count)


class SweepGrid(Cells):
    """The grid of the runs of a sweep."""

    def __init__(
        self, dims: tuple[str, ...], axes: dict[str, xr.Variable], runs: list[_RunAxis], shard_points: int
    ) -> None:
        self.axes, self._runs = axes, runs
        self._order = [next(k for k, axis in enumerate(runs) if axis.dimension == name) for name in dims]
        self.cells = self._cut_cells(dims, shard_points)

    def _cut_cells(self, dims: tuple[str, ...], shard_points: int) -> StoreGrid:
        """Return the cells of the dataset, in shards of about this many points."""
        sizes = [axis.size for axis in self._runs]
        chunk_points = max(shard_points * CHUNK_POINTS // SHARD_POINTS, 1)
        self._cut = next((k for k in range(len(sizes)) if math.prod(sizes[k + 1 :]) < shard_points), 0)
        beside = math.prod(sizes[self._cut + 1 :])
        thick = min(max(chunk_points // beside, 1), sizes[self._cut])
        chunks = min(max(shard_points // (beside * thick), 1), -(-sizes[self._cut] // thick))
        self._length = chunks * thick
        chunk, shard = [1] * len(sizes), [1] * len(sizes)
        chunk[self._cut], shard[self._cut] = thick, self._length
        left = max(chunk_points // thick, 1)
        for k in reversed(range(self._cut + 1, len(sizes))):
            chunk[k] = min(sizes[k], left)
            shard[k] = -(-sizes[k] // chunk[k]) * chunk[k]
            left = max(left // chunk[k], 1)
        ordered = (tuple(kind[k] for k in self._order) for kind in (sizes, chunk, shard))
        return StoreGrid(dims, *ordered)

    @property
    def follows_runs(self) -> bool:
        """Whether the runs of each shard follow one another: the values of the cut axis ascend or descend."""
        cut = self._runs[self._cut]
        return cut.is_monotone or self._length == 1 or self._length >= cut.size

    def _shards(self) -> Iterator[Shard]:
        """Yield the blocks of the grid."""
        before, at = self._runs[: self._cut], self._runs[self._cut]
        beside = math.prod(axis.size for axis in self._runs[self._cut + 1 :])
        for outer, places in enumerate(np.ndindex(*(axis.size for axis in before))):
            ranks = self._ranks(self._cut, places)
            for first, stop in self._stretches(ranks):
                inner = slice(int(ranks[first:stop].min()), int(ranks[first:stop].max()) + 1)
                begin = outer * at.size
                block = self._block([axis.ranks[k] for axis, k in zip(before, places, strict=True)], inner)
                yield Shard(
                    self.cells.number(block), (begin + first) * beside, (begin + stop) * beside, block
                )

    def _stretches(self, ranks: Ranks) -> Iterator[tuple[int, int]]:
        """Yield stretches of the cut axis, in the order of the runs, whose cells begin at whole shards."""
        size, length = len(ranks), self._length
        falls = size > 1 and length > 1 and ranks[1] < ranks[0]
        first = 0
        while first < size:
            stop = first + ((size - first - 1) % length + 1 if falls else min(length, size - first))
            yield first, stop
            first = stop

    def _block(self, outer: list[np.intp], inner: slice) -> tuple[slice, ...]:
        whole = [slice(0, axis.size) for axis in self._runs]
        whole[: self._cut] = [slice(int(place), int(place) + 1) for place in outer]
        whole[self._cut] = inner
        return tuple(whole[k] for k in self._order)

    def _ranks(self, number: int, places: tuple[int, ...]) -> Ranks:
        """Return the ranks along a run axis, at places of the axes before it; a branch down goes the other way."""
        ranks = self._runs[number].ranks
        carried = number == len(self._runs) - 1 and self._direction is not None
        return ranks[::-1] if carried and self._is_down(places[-1]) else ranks

    @property
    def _direction(self) -> int | None:
        return next((k for k, axis in enumerate(self._runs) if axis.dimension == "direction"), None)

    def _is_down(self, place: int) -> bool:
        return str(self.axes["direction"].values[place]) == "down"

    def places(self, shard: Shard) -> NDArray[np.int64]:
        """Return the place of each run of a shard among the cells of its block, the last dimension fastest."""
        found = np.empty(shard.count, dtype=np.int64)
        found[self._on_block(shard, np.arange(shard.count)).reshape(-1)] = np.arange(shard.count)
        return found

    def _on_block(self, shard: Shard, values: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the values of a shard's runs, shape (run,), on the cells of its block."""
        inner = [axis.size for axis in self._runs[self._cut + 1 :]]
        placed = values.reshape([1] * self._cut + [shard.count // math.prod(inner), *inner])
        for number in range(self._cut, len(self._runs)):
            ranks = self._runs[number].ranks
            if len(ranks) == placed.shape[number]:
                placed = np.take(placed, np.argsort(ranks), number)
            elif ranks[0] > ranks[-1]:
                placed = np.flip(placed, number)
        return self._with_branches_up(shard, placed).transpose(self._order)

    def _with_branches_up(self, shard: Shard, placed: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return values whose branches down are turned round, as the axis of a dataset ascends."""
        direction, carried = self._direction, len(self._runs) - 1
        if direction is None:
            return placed
        ways = shard.block[self.cells.dims.index("direction")]
        branches = [
            np.flip(branch, carried) if self._is_down(way) else branch
            for way, branch in zip(
                range(ways.start, ways.stop),
                np.split(placed, placed.shape[direction], direction),
                strict=True,
            )
        ]
        return np.concatenate(branches, direction)


@lru_cache(maxsize=2)
def cells_of(scene: Scene, shard_points: int = SHARD_POINTS) -> Cells:
    """Return the cells of the store of a scene's runs, with their shards: the grid of its sweep, or a line of runs."""
    grid = grid_of(scene, shard_points)
    if grid is not None:
        return grid
    carried = next((axis for axis in scene.sweep if axis.continuation), None)
    branch = 1 if carried is None else len(carried.values)
    most = most_points(scene.sweep)
    if most is None:
        return RunLine(run_count(scene.sweep), branch, shard_points, is_open=False)
    most = max(most, run_count(scene.sweep))
    return RunLine(most, branch, min(shard_points, ROUND_POINTS), is_open=True)


def grid_of(scene: Scene, shard_points: int = SHARD_POINTS) -> SweepGrid | None:
    """Return the grid of a scene's sweep with its shards; None where the points of the sweep are no grid.

    Points are no grid if a point occurs twice, if no key is swept, or if rounds add points. A grid whose unordered axis
    is longer than a shard is no grid of shards, either.
    """
    if not scene.sweep or any(axis.adaptive is not None for axis in scene.sweep):
        return None
    names, like = coordinate_names(scene), empty_dataset(scene)
    carried = next((axis for axis in scene.sweep if axis.continuation), None)
    axes: dict[str, xr.Variable] = {}
    along: dict[Dimension, _RunAxis] = {}
    for members in dimensions(scene.sweep):
        dimension = members[0].together or names[members[0].key]
        columns = {
            names[axis.key]: xr.Variable("run", np.array(axis.values), like.variables[names[axis.key]].attrs)
            for axis in members
        }
        found, ranks = axis_of(dimension, columns)
        if len(np.unique(ranks)) < len(ranks):
            return None
        axes |= found
        along[members] = _RunAxis(dimension, ranks)
    axes |= shared_axes(axes)
    dims = [one.dimension for one in along.values()]
    runs = [one for members, one in along.items() if carried not in members]
    if carried is not None:
        axes["direction"] = direction_axis(list(DIRECTIONS[carried.path]))
        dims.insert(0, "direction")
        runs.append(_RunAxis("direction", np.arange(len(DIRECTIONS[carried.path]))))
        runs += [one for members, one in along.items() if carried in members]
    grid = SweepGrid(tuple(dims), axes, runs, shard_points)
    return grid if grid.follows_runs else None
