"""The overview of a large map: what blocks of its points hold, written with the shards, so that drawing reads no point.

Each block keeps the smallest and the largest value, the value of one point, and the number of points without a value.
Classes keep the rarest class of the block. So isolated extremes, thin regions and rare classes stay in the overview.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.derived import DERIVED
from vibroimpact.analysis.dataset.stores.grid import SHARD_POINTS, Block, StoreGrid

OVERVIEW = "overview"
"""Group of the overview in a store."""
MOST_BLOCKS = 512
"""Largest number of blocks along a dimension, up to a shard's end: a map of one column has 560 pixels on the page."""
PARTS = ("low", "high", "sample", "missing")
CLASSES = ("class_kind", "class_impacts", "class_periods")
"""Variables that are a class together."""
_FILLED = {"low": np.inf, "high": -np.inf, "sample": np.nan, "missing": 0.0}
Floats = NDArray[np.float64]


def quantities_of(columns: Mapping[Any, xr.Variable]) -> dict[str, Floats]:
    """Return the quantities of runs that a map shows, shape (run,) each, from their variables."""
    return {
        quantity.name: quantity.values({name: columns[name].values for name in quantity.sources})
        for quantity in DERIVED
        if quantity.is_from(columns)
    }


def names_of(names: Mapping[Any, Any]) -> list[str]:
    """Return the names of the arrays of an overview, from the variables of its runs."""
    found = [f"{quantity.name}_{part}" for quantity in DERIVED if quantity.is_from(names) for part in PARTS]
    return found + (list(CLASSES) if all(name in names for name in CLASSES) else [])


@dataclass(frozen=True, slots=True)
class BlockGrid:
    """The blocks of a map: they begin anew in each shard, so that a shard writes its own.

    Attributes
    ----------
    grid : StoreGrid
    length : tuple of int
        Cells of a block along each dimension.
    """

    grid: StoreGrid
    length: tuple[int, ...]

    @classmethod
    def of(cls, grid: StoreGrid) -> BlockGrid | None:
        """Return the blocks of a map over two dimensions; None where it needs no overview."""
        along = [
            dim for dim, size in zip(grid.dims, grid.shape, strict=True) if size > 1 and dim != "direction"
        ]
        if len(along) != 2 or grid.points <= SHARD_POINTS:
            return None
        length = tuple(
            -(-size // MOST_BLOCKS) if dim in along else 1
            for dim, size in zip(grid.dims, grid.shape, strict=True)
        )
        return cls(grid, length)

    @property
    def in_shard(self) -> tuple[int, ...]:
        """Number of blocks of a shard along each dimension: a chunk of the overview."""
        return tuple(-(-n // b) for n, b in zip(self.grid.shard, self.length, strict=True))

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of blocks along each dimension."""
        return tuple(n * count for n, count in zip(self.in_shard, self.grid.counts, strict=True))

    def place(self, block: Block) -> Block:
        """Return the blocks of a shard."""
        spans = zip(block, self.grid.shard, self.in_shard, strict=True)
        return tuple(slice(c.start // n * m, (c.start // n + 1) * m) for c, n, m in spans)

    def starts(self, axis: int) -> NDArray[np.int64]:
        """Return the first cell of each block along a dimension; blocks beyond the last cell are left out."""
        shard, length, size = self.grid.shard[axis], self.length[axis], self.grid.shape[axis]
        inside = np.arange(self.in_shard[axis]) * length
        found = (np.arange(self.grid.counts[axis])[:, None] * shard + inside).reshape(-1)
        return found[found < size]

    def reduced(self, values: Floats) -> dict[str, Floats]:
        """Return the parts of the overview of a shard, from values on its cells."""
        blocks = self._in_blocks(values, np.nan)
        there = np.isfinite(blocks).sum(axis=-1)
        middle = blocks[..., _middle(self.length)]
        first = np.take_along_axis(blocks, np.argmax(np.isfinite(blocks), axis=-1)[..., None], axis=-1)[
            ..., 0
        ]
        inside = self._in_blocks(np.ones(values.shape), 0.0)
        sample = np.where(inside[..., _middle(self.length)] > 0.0, middle, first)
        return {
            "low": np.fmin.reduce(blocks, axis=-1, initial=np.inf),
            "high": np.fmax.reduce(blocks, axis=-1, initial=-np.inf),
            "sample": sample,
            "missing": inside.sum(axis=-1) - there,
        }

    def rarest(self, columns: list[NDArray[Any]]) -> list[NDArray[Any]]:
        """Return the class of each block that is rarest in its shard, from the variables of classes on its cells."""
        stacked = np.stack([np.asarray(column, dtype=np.int64).reshape(-1) for column in columns])
        classes, code, count = np.unique(stacked, axis=1, return_inverse=True, return_counts=True)
        order = np.lexsort((-np.arange(count.size), count))  # rarest first
        rank = np.empty_like(order)
        rank[order] = np.arange(order.size)
        rank[classes[0] < 0] = order.size  # a cell without a run is no class
        ranks = rank[code.reshape(-1)].reshape(columns[0].shape).astype(np.float64)
        best = np.fmin.reduce(self._in_blocks(ranks, np.nan), axis=-1)
        known = np.append(classes[:, order], np.full((len(columns), 1), -1), axis=1)
        place = np.where(np.isfinite(best), best, order.size).astype(np.int64)
        return [row[place] for row in known]

    def _in_blocks(self, values: Floats, fill: float) -> Floats:
        """Return values on the cells of a shard with the cells of each block along the last dimension."""
        whole = np.full([m * b for m, b in zip(self.in_shard, self.length, strict=True)], fill)
        whole[tuple(slice(0, size) for size in values.shape)] = values
        split = whole.reshape([n for pair in zip(self.in_shard, self.length, strict=True) for n in pair])
        axes = len(self.length)
        return split.transpose([*range(0, 2 * axes, 2), *range(1, 2 * axes, 2)]).reshape(*self.in_shard, -1)


def _middle(length: tuple[int, ...]) -> int:
    """Return the place of the middle cell of a block among its cells."""
    return int(np.ravel_multi_index(tuple(size // 2 for size in length), length))
