"""Large maps drawn from the overview of their store: a value for each block of points, which keeps what is rare."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.derived import LARGEST_IMPACT, MEAN_IMPACTS, RANGE
from vibroimpact.analysis.dataset.stores.overview import CLASSES, PARTS, BlockGrid
from vibroimpact.analysis.dataset.stores.reading import StoreContents
from vibroimpact.analysis.files.stores import is_store

_AROUND = 2
"""Blocks on each side that are the neighbourhood of a block."""
_FENCE = 1.5
"""Distance beyond the quartile of the neighbours, in their interquartile ranges, of an outlier (Tukey)."""
_STEP = 0.01
"""Smallest difference that shows, as a share of the range of all values: two of 256 colours."""
_FEW = 0.1
"""Share of points without a value (or with one) in a neighbourhood below which these points are rare."""
_FROM = {RANGE: RANGE, LARGEST_IMPACT: "impact_velocity", MEAN_IMPACTS: "impacts_per_period"}
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BlockValues:
    """A quantity of a map over blocks of its points.

    Attributes
    ----------
    values : xarray.DataArray
        One value for each block; coordinates are those of the first cells.
    starts : mapping of str to ndarray of int
        First cell of each block along each dimension.
    spread : ndarray
        Values of single points, and the smallest and the largest of all: the scale of the colours.
    """

    values: xr.DataArray
    starts: Mapping[str, NDArray[np.int64]]
    spread: Floats


def block_values(dataset: xr.Dataset, quantity: str) -> BlockValues | None:
    """Return a quantity of a whole large map over blocks; None for any other dataset, or a selection of one."""
    contents = _contents(dataset, ("run_id", _FROM[quantity]))
    parts = [] if contents is None else [contents.overview(f"{quantity}_{part}") for part in PARTS]
    if contents is None or any(part is None for part in parts):
        return None
    low, high, sample, missing = (np.asarray(part, dtype=np.float64) for part in parts)
    spread = np.concatenate([sample.ravel(), [low.min(), high.max()]])
    plane = tuple(axis for axis, dim in enumerate(contents.grid.dims) if dim != "direction")
    cells = _cells(contents)
    chosen = np.empty_like(sample)
    for place in np.ndindex(*(1 if axis in plane else size for axis, size in enumerate(sample.shape))):
        at = tuple(slice(None) if axis in plane else place[axis] for axis in range(sample.ndim))
        chosen[at] = _shown(low[at], high[at], sample[at], missing[at], cells[at], spread)
    return BlockValues(*_placed(dataset, contents, chosen), spread)


def block_classes(dataset: xr.Dataset) -> tuple[xr.Dataset, Mapping[str, NDArray[np.int64]]] | None:
    """Return the rarest class of each block of a whole large map, and the first cells of blocks; else None."""
    contents = _contents(dataset, ("run_id", *CLASSES))
    found = {} if contents is None else {name: contents.overview(name) for name in CLASSES}
    if contents is None or any(part is None for part in found.values()):
        return None
    starts: Mapping[str, NDArray[np.int64]] = {}
    classes = {}
    for name, values in found.items():
        classes[name], starts = _placed(dataset, contents, values)
    ids = classes[CLASSES[0]]
    return xr.Dataset({**classes, "run_id": ids.where(ids < 0, 0)}, attrs=dataset.attrs), starts


def _contents(dataset: xr.Dataset, names: tuple[str, ...]) -> StoreContents | None:
    """Return the store of a dataset, unless these variables are no longer those of the whole store."""
    source = dataset.encoding.get("source")
    chunked = [getattr(dataset.variables[name].data, "name", None) for name in names if name in dataset]
    if len(chunked) < len(names) or None in chunked or not isinstance(source, str) or not is_store(source):
        return None
    contents = StoreContents(source)
    if any(own != f"{name}-{contents.token}" for name, own in zip(names, chunked, strict=True)):
        return None
    dims = [dim for dim in contents.grid.dims if dim != "direction"]
    ascending = all(dim in dataset.indexes and dataset.indexes[dim].is_monotonic_increasing for dim in dims)
    return contents if ascending else None


def _placed(
    dataset: xr.Dataset, contents: StoreContents, values: Any
) -> tuple[xr.DataArray, dict[str, NDArray[np.int64]]]:
    blocks = BlockGrid.of(contents.grid)
    assert blocks is not None, "an overview has blocks"
    starts = {dim: blocks.starts(axis) for axis, dim in enumerate(contents.grid.dims)}
    coords = {dim: dataset[dim].isel({dim: first}) for dim, first in starts.items()}
    return xr.DataArray(values, coords, dims=contents.grid.dims), starts


def _cells(contents: StoreContents) -> Floats:
    """Return the number of points of each block."""
    blocks = BlockGrid.of(contents.grid)
    assert blocks is not None, "an overview has blocks"
    found = np.ones(())
    for axis, size in enumerate(contents.grid.shape):
        found = np.multiply.outer(found, np.diff(np.append(blocks.starts(axis), size)))
    return np.asarray(found, dtype=np.float64)


def _shown(
    low: Floats, high: Floats, sample: Floats, missing: Floats, cells: Floats, spread: Floats
) -> Floats:
    """Return the value that stands for each block: one point, or an extreme far from its neighbours."""
    finite = spread[np.isfinite(spread)]
    step = _STEP * (float(finite.max() - finite.min()) if finite.size else 0.0)
    above = np.where(np.isfinite(high), _beyond(high, step) * (high - sample > step), 0.0)
    below = np.where(np.isfinite(low), _beyond(-low, step) * (sample - low > step), 0.0)
    shown = np.where(above > below, high, np.where(below > 0.0, low, sample))
    share = _sum(missing) / _sum(cells)
    shown = np.where((missing > 0.0) & (missing < cells) & (share < _FEW), np.nan, shown)
    return np.where(np.isnan(sample) & (missing < cells) & (share > 1.0 - _FEW), high, shown)


def _beyond(values: Floats, step: float) -> Floats:
    """Return the distance of values beyond the outliers' fence of their neighbours; 0 for values within it."""
    known = np.where(np.isfinite(values), values, np.nan)
    around = np.sort(_windows(known).reshape(*values.shape, -1), axis=-1)  # without values: last
    count = np.isfinite(around).sum(axis=-1, keepdims=True)
    lower, upper = (
        np.take_along_axis(around, np.maximum((share * (count - 1)).astype(np.int64), 0), axis=-1)[..., 0]
        for share in (0.25, 0.75)
    )
    return np.nan_to_num(np.maximum(known - (upper + _FENCE * (upper - lower) + step), 0.0))


def _windows(values: Floats) -> Floats:
    size = 2 * _AROUND + 1
    return sliding_window_view(np.pad(values, _AROUND, constant_values=np.nan), (size, size))


def _sum(values: Floats) -> Floats:
    """Return the sum over the neighbourhood of each block."""
    found: Floats = np.nansum(_windows(values), axis=(-2, -1))
    return found


def edges_of_blocks(edges: Floats, starts: NDArray[np.int64] | None) -> Floats:
    """Return the edges of blocks from the edges of all points; without blocks these themselves."""
    return edges if starts is None else np.append(edges[starts], edges[-1])
