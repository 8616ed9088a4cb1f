"""The cut of the cells of a sweep into the shards and chunks of a store."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

CHUNK_POINTS = 1 << 16
"""Points of a chunk, which is read and expanded as a whole."""
SHARD_POINTS = 1 << 20
"""Points of a shard, about: one object for each variable, with one writer."""
CHUNK_VALUES = 1 << 19
"""Largest number of values of a chunk of a variable with a further dimension: 4 MiB."""
SHARD_VALUES = 1 << 23
"""Largest number of values of a shard of a variable with a further dimension: 64 MiB."""

LINE = ("run",)
"""Dimensions of runs one after the other."""
Block = tuple[slice, ...]
"""The cells of a shard along each dimension."""


@dataclass(frozen=True, slots=True)
class StoreGrid:
    """The cells of a dataset, and the cells of one shard and of one chunk along each dimension.

    A shard is made of whole chunks; the last one along a dimension may reach beyond the cells.

    Examples
    --------
    >>> grid = StoreGrid.cut(("amplitude", "angular_frequency"), (3000, 3000))
    >>> grid.chunk, grid.shard, grid.shards
    ((21, 3000), (336, 3000), 9)
    """

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    shard: tuple[int, ...]

    @classmethod
    def cut(cls, dims: tuple[str, ...], shape: tuple[int, ...]) -> StoreGrid:
        """Return cells in shards of about 2^20 points, each a stretch of the cells in their order."""
        chunk = _stretch(shape, CHUNK_POINTS)
        shard = [
            _whole_chunks(size, wanted, part)
            for size, wanted, part in zip(shape, _stretch(shape, SHARD_POINTS), chunk, strict=True)
        ]
        return cls(dims, shape, chunk, tuple(shard))

    @property
    def is_line(self) -> bool:
        """Whether runs lie one after the other, each with its own coordinates."""
        return self.dims == LINE

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of shards along each dimension."""
        return tuple(-(-size // part) for size, part in zip(self.shape, self.shard, strict=True))

    @property
    def shards(self) -> int:
        """Number of shards."""
        return math.prod(self.counts)

    @property
    def points(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    def blocks(self) -> Iterator[Block]:
        """Yield the cells of each shard, in the order of their numbers."""
        for place in product(*map(range, self.counts)):
            yield tuple(
                slice(k * part, min((k + 1) * part, size))
                for k, part, size in zip(place, self.shard, self.shape, strict=True)
            )

    def number(self, block: Block) -> int:
        """Return the number of the shard with these cells."""
        found = 0
        for cells, count, part in zip(block, self.counts, self.shard, strict=True):
            found = found * count + cells.start // part
        return found

    def chunks_of(self, further: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the chunk and the shard of a variable that has these further dimensions."""
        points, in_shard = math.prod(self.chunk), math.prod(self.shard)
        chunk, shard = [], []
        for size in reversed(further):
            part = _balanced(size, max(1, CHUNK_VALUES // points))
            times = max(1, SHARD_VALUES // (in_shard * part))
            chunk.append(part)
            shard.append(part * min(times, -(-size // part)))
            points, in_shard = points * chunk[-1], in_shard * shard[-1]
        return (*self.chunk, *reversed(chunk)), (*self.shard, *reversed(shard))


def _stretch(shape: tuple[int, ...], points: int) -> tuple[int, ...]:
    """Return the largest stretch of cells in their order, along each dimension, of about these points."""
    found, inner = [], 1
    for size in reversed(shape):
        found.append(_balanced(size, max(1, points // inner)))
        # beyond a dimension that is cut, the stretch has one cell
        inner = inner * size if found[-1] == size else points
    return tuple(reversed(found))


def _balanced(size: int, most: int) -> int:
    """Return the length of equal parts of a dimension, none above `most`."""
    return -(-size // -(-size // most)) if size else 1


def _whole_chunks(size: int, wanted: int, chunk: int) -> int:
    """Return the length of a shard: whole chunks, at least as long as wanted."""
    return chunk * max(1, min(-(-wanted // chunk), -(-size // chunk)))
