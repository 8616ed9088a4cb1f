"""Data of a campaign for the page to draw: some thousands of values of one variable, for campaigns of any size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.service.landed import Landed
from vibroimpact.service.run_classes import named_classes

LEVELS = 2000
"""Number of levels in the range of all values; values of a run in the same level are drawn as one point."""


class Selection:
    """Selection of a part of a campaign, by swept parameters.

    Parameters are held `at` the nearest existing value, or limited `within` a lowest and a highest value.
    """

    def __init__(self, at: dict[str, float], within: dict[str, tuple[float, float]]) -> None:
        self.at, self.within = at, within

    @classmethod
    def from_words(cls, at: Sequence[str], within: Sequence[str]) -> Selection:
        """Return the selection of `NAME:VALUE` and `NAME:LOW:HIGH`; raise ValueError for another form.

        >>> Selection.from_words(["restitution:0.7"], ["angular_frequency:0.8:0.9"]).within
        {'angular_frequency': (0.8, 0.9)}
        """
        held = {name: numbers[0] for name, numbers in (_read("at", word, 1) for word in at)}
        ranges = {name: (low, high) for name, (low, high) in (_read("within", word, 2) for word in within)}
        return cls(held, ranges)

    def runs(self, landed: Landed) -> NDArray[np.bool_]:
        """Return which runs are selected; raise ValueError for a name that is no swept parameter."""
        names = [axis.name for axis in landed.axes]
        for name in (*self.at, *self.within):
            if name not in names:
                raise ValueError(f"{name}: expected a swept parameter ({', '.join(names) or 'none'}).")
        kept = np.ones(landed.runs.size, dtype=bool)
        for name, (low, high) in self.within.items():
            values = landed.coordinates[names.index(name)]
            kept &= (values >= low) & (values <= high)
        for name, value in self.at.items():
            values = landed.coordinates[names.index(name)]
            kept &= values == values[np.argmin(np.abs(values - value))]
        return kept


def _read(option: str, word: str, count: int) -> tuple[str, list[float]]:
    name, *texts = word.split(":")
    try:
        numbers = [float(text) for text in texts]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        form = ":".join(("NAME", *(("VALUE",) if count == 1 else ("LOW", "HIGH"))))
        raise ValueError(f"{option}: expected {form} with finite numbers, got {word!r}.")
    return name, numbers


def slice_of(landed: Landed, selection: Selection, most: int) -> dict[str, Any]:
    """Return columns of at most `most` rows: run, direction, outcome, coordinates, value.

    `rows` is the full number of rows; a map keeps one of `every` values of each axis.
    """
    kept, every = selection.runs(landed), 1
    per_run = landed.owners.size == landed.runs.size
    spanned = _spanned(landed, selection)
    total = int(kept.sum()) if per_run else 0
    if per_run and len(spanned) > 1:
        chosen = landed.coordinates[spanned][:, kept]
        every = max(1, math.ceil(math.sqrt(chosen.shape[1] / most)))
        # ends of axes count too: a map that is thinned further by its rows would have gaps
        while (coarser := _coarser_grid(chosen, every)).sum() > most and every < chosen.shape[1]:
            every += 1
        kept[np.flatnonzero(kept)[~coarser]] = False
    rows = np.flatnonzero(kept[landed.owners])
    if not per_run:
        rows = rows[_distinct(landed.owners[rows], landed.values[rows])]
        total = rows.size
    if rows.size > most:
        rows = rows[np.linspace(0, rows.size - 1, most).astype(np.int64)]
    owners = landed.owners[rows]
    classes, values = named_classes(landed.values[rows]) if landed.is_class else ([], landed.values[rows])
    return {
        "rows": int(total),
        "shown": int(rows.size),
        "every": every,
        "classes": classes,
        "run": landed.runs[owners].tolist(),
        "direction": landed.directions[owners].tolist(),
        "outcome": landed.outcomes[owners].tolist(),
        "coordinates": [finite(column[owners]) for column in landed.coordinates],
        "value": finite(values),
    }


def _spanned(landed: Landed, selection: Selection) -> list[int]:
    """Return the places of the axes that are not held, one for each group of axes that vary together."""
    first: dict[str, int] = {}
    for place, axis in enumerate(landed.axes):
        if axis.name not in selection.at:
            first.setdefault(axis.along or axis.name, place)
    return list(first.values())


def _coarser_grid(coordinates: NDArray[np.float64], every: int) -> NDArray[np.bool_]:
    """Return the runs on every n-th value of each axis (n = `every`): a map keeps no gaps, but larger cells."""
    chosen = np.ones(coordinates.shape[1], dtype=bool)
    if every > 1:
        for column in coordinates:
            _, places = np.unique(column, return_inverse=True)
            chosen &= places % every == 0
    return chosen


def _distinct(owners: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return one row for all values of a run that a diagram shows as one point."""
    usable = np.isfinite(values)
    if not usable.any():
        return np.flatnonzero(usable)
    low, high = values[usable].min(), values[usable].max()
    scale = LEVELS / (high - low) if 0.0 < high - low < math.inf else 0.0
    levels = np.where(usable, (values - low) * scale, -1.0).astype(np.int64)
    _, first = np.unique(owners * (LEVELS + 2) + levels, return_index=True)
    return np.sort(first)


def finite(values: NDArray[Any]) -> list[float | None]:
    """Return numbers for JSON, with null in place of numbers that are not finite.

    >>> finite(np.array([1.0, np.nan]))
    [1.0, None]
    """
    found: list[float | None] = np.asarray(values, dtype=np.float64).tolist()
    return [one if one is not None and math.isfinite(one) else None for one in found]
