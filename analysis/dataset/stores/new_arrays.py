"""The arrays of a store before they are made: of cells, of rows of shards, of numbers of shards."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.assembling import new_variable
from vibroimpact.analysis.dataset.stores.grid import CHUNK_POINTS, SHARD_POINTS, StoreGrid

MOST_ROWS = 1 << 40
"""Number of rows of a shard for which its arrays are announced until the store is finished."""


@dataclass(frozen=True, slots=True)
class NewArray:
    """One array before it is made: dimensions, sizes, cells of a chunk and of a shard, type, attributes."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    shard: tuple[int, ...]
    dtype: Any
    attrs: Mapping[str, Any]


def cells_array(
    grid: StoreGrid, further: Mapping[str, int], dtype: Any, attrs: Mapping[str, Any]
) -> NewArray:
    """Return the array of a variable of runs, with further dimensions."""
    chunk, shard = grid.chunks_of(tuple(further.values()))
    return NewArray((*grid.dims, *further), (*grid.shape, *further.values()), chunk, shard, dtype, attrs)


def rows_array(
    dim: str,
    grid: StoreGrid,
    dtype: Any,
    attrs: Mapping[str, Any],
    elements: Mapping[str, int] | None = None,
) -> NewArray:
    """Return the array of the rows of a ragged dimension; `elements` are the dimensions of each row."""
    names, sizes = tuple(elements or ()), tuple((elements or {}).values())
    # a shard has whole chunks
    chunk = max(1, CHUNK_POINTS // math.prod(sizes))
    shard = chunk * (SHARD_POINTS // CHUNK_POINTS)
    return NewArray(
        (f"{dim}_shard", f"{dim}_row", *names),
        (grid.shards, MOST_ROWS, *sizes),
        (1, chunk, *sizes),
        (1, shard, *sizes),
        dtype,
        attrs,
    )


def shards_array(dim: str, grid: StoreGrid, attrs: Mapping[str, Any]) -> NewArray:
    """Return the array of a whole number for each shard."""
    return whole_array(new_variable((dim,), np.zeros(grid.shards, dtype=np.int64), attrs))


def whole_array(variable: xr.Variable) -> NewArray:
    """Return the array of a variable whose values are known."""
    dims, one = tuple(map(str, variable.dims)), (SHARD_POINTS,) * variable.ndim
    size = tuple(min(most, max(n, 1)) for most, n in zip(one, variable.shape, strict=True))
    return NewArray(dims, variable.shape, size, size, variable.dtype, variable.attrs)
