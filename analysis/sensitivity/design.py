"""The blocks of a Saltelli design in a dataset, found by its values: selected or sorted runs are noticed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import DRAW, SWEPT_ALONG, names_list, scene_of, swept_names
from vibroimpact.fmus.errors import DatasetError

Floats = NDArray[np.float64]

_ADVICE = 'Sweep two keys or more with a distribution and sample = { design = "saltelli", points = 256 }.'


@dataclass(frozen=True, slots=True)
class Design:
    """A Saltelli design."""

    names: tuple[str, ...]
    """Coordinates of the drawn keys, in the order of the design."""
    blocks: int

    def parts(self, values: Floats) -> tuple[Floats, Floats, Floats]:
        """Return values along the draws, shape (draw, ...), split into A, B, and A with each coordinate of B."""
        blocks = values.reshape(self.blocks, len(self.names) + 2, *values.shape[1:])
        return blocks[:, 0], blocks[:, 1], blocks[:, 2:]


def design_of(dataset: xr.Dataset) -> Design:
    """Return the design of an opened dataset.

    DatasetError: the points are drawn in another way or not at all, or blocks of the design are incomplete.
    """
    names = [name for name in swept_names(dataset) if dataset[name].attrs.get(SWEPT_ALONG) == DRAW]
    if len(names) < 2:
        got = _other_design(dataset) or names_list([f"drawn: {name}" for name in names])
        raise DatasetError(f"sensitivity: expected points drawn in a Saltelli design, got {got}. {_ADVICE}")
    if any(dataset[name].dims != (DRAW,) for name in names):
        raise _broken("one of its points", len(names))
    points = np.stack([dataset[name].values for name in names], axis=1)
    if not len(points) or len(points) % (len(names) + 2):
        other = _other_design(dataset)
        raise _broken(f"{len(points)} runs" + (f" of {other}" if other else ""), len(names))
    blocks = points.reshape(-1, len(names) + 2, len(names))
    base, fresh, mixed = blocks[:, 0], blocks[:, 1], blocks[:, 2:]
    changed = mixed != base[:, None]
    order = changed[0].argmax(axis=1)
    only_one = np.eye(len(names), dtype=bool)[order]
    taken = np.where(only_one, fresh[:, None], base[:, None])
    if sorted(order) != list(range(len(names))) or not np.array_equal(mixed, taken):
        raise _broken(_other_design(dataset) or "runs in another order, or not all of them", len(names))
    return Design(tuple(names[place] for place in order), len(blocks))


def _other_design(dataset: xr.Dataset) -> str:
    """Return the scene's own words for the points of a dataset; empty for a Saltelli design."""
    sweep = scene_of(dataset.attrs).get("sweep", {})
    sample = sweep.get("sample") if isinstance(sweep, dict) else None
    if not isinstance(sample, dict):
        swept = names_list([name for name in swept_names(dataset) if dataset[name].size > 1])
        return f"a sweep of {swept}" if swept != names_list([]) else "no sweep"
    return "" if sample.get("design") == "saltelli" else f'a design "{sample.get("design")}"'


def _broken(got: str, keys: int) -> DatasetError:
    return DatasetError(
        f"sensitivity: expected whole blocks of {keys + 2} runs of a Saltelli design, as they were drawn, "
        f"got {got}. Take the whole dataset, or its first blocks: isel(draw=slice({keys + 2} * blocks))."
    )
