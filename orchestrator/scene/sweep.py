"""From the axes of a sweep to the branches and points of a campaign.

Run order (the `run` dimension of the dataset) is fixed by the scene alone:

- axes count in the order in which the scene file lists them, the last one fastest;
- a continuation axis (`up`, `down`, `up-down`) is always the fastest, whatever its place in the file;
- each combination of the other axes is one branch (two for `up-down`: first up, then down), and a branch
  occupies a contiguous range of runs in the order in which it is travelled: a down branch starts at the top;
- without a continuation axis all points form one flat branch of independent points.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product
from math import prod
from typing import Any, Literal, Protocol, overload

import numpy as np

SweepPath = Literal["independent", "up", "down", "up-down"]
SweepDirection = Literal["independent", "up", "down"]

DIRECTIONS: dict[SweepPath, tuple[SweepDirection, ...]] = {
    "independent": ("independent",),
    "up": ("up",),
    "down": ("down",),
    "up-down": ("up", "down"),
}


@dataclass(frozen=True, slots=True)
class SweepAxis:
    """One swept key of a scene.

    Attributes
    ----------
    key : str
        The swept key with 1-based indices, for example `stop[1].position`.
    values : tuple of float
        Its values in the unit of the key; ascending on a continuation axis, else in the order of the scene.
    path : {"independent", "up", "down", "up-down"}
        Whether each point starts from the scene's start state, or from its predecessor's final state.
    span : tuple or None
        Start, stop and number of the values of a range: all of it that is sent to workers.
    """

    key: str
    values: tuple[float, ...]
    path: SweepPath = "independent"
    span: tuple[float, float, int] | None = field(default=None, compare=False, repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        if self.span is not None:
            return axis_of_range, (self.key, *self.span, self.path)
        return SweepAxis, (self.key, self.values, self.path)

    @property
    def continuation(self) -> bool:
        """Whether the state is carried from point to point along this axis."""
        return self.path != "independent"


@lru_cache(maxsize=8)
def axis_of_range(key: str, start: float, stop: float, points: int, path: SweepPath) -> SweepAxis:
    """Return an axis of evenly spaced values, both ends included."""
    # Halved ends keep the span of the range finite for any two finite numbers; scaling by 2 is exact.
    values = (2.0 * np.linspace(start / 2.0, stop / 2.0, points)).tolist()
    ordered = values if path == "independent" else sorted(values)
    return SweepAxis(key, tuple(ordered), path, (start, stop, points))


def log_axis(key: str, start: float, stop: float, points: int, path: SweepPath) -> SweepAxis:
    """Return an axis of values of which each over the one before is the same, both ends included.

    Its values go to workers one by one, and not as a span: another machine's logarithm may end in another bit.

    Examples
    --------
    >>> log_axis("body.stiffness", 1e2, 1e8, 4, "independent").values
    (100.0, 10000.0, 1000000.0, 100000000.0)
    """
    # 15 digits: what rounding has left of a ratio is no part of a value
    inner = (float(f"{value:.15g}") for value in np.geomspace(start, stop, points)[1:-1])
    values = (start, *inner, stop) if points > 1 else (start,)
    return SweepAxis(key, values if path == "independent" else tuple(sorted(values)), path)


@dataclass(frozen=True, slots=True)
class Point:
    """One point of a sweep: its place in the `run` dimension and the value of every swept key."""

    index: int
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Points(Sequence[Point]):
    """The points of a branch, computed when asked for: a sweep may have 10^8 of them."""

    first_index: int
    fixed: Mapping[str, float]
    axes: tuple[SweepAxis, ...]

    def __len__(self) -> int:
        return prod(len(axis.values) for axis in self.axes)

    @overload
    def __getitem__(self, position: int) -> Point: ...
    @overload
    def __getitem__(self, position: slice) -> tuple[Point, ...]: ...
    def __getitem__(self, position: int | slice) -> Point | tuple[Point, ...]:
        if isinstance(position, slice):
            return tuple(self._point(place) for place in range(len(self))[position])
        return self._point(range(len(self))[position])

    def __iter__(self) -> Iterator[Point]:
        return (self._point(place) for place in range(len(self)))

    def _point(self, position: int) -> Point:
        rest = position
        swept: dict[str, float] = {}
        for axis in reversed(self.axes):
            rest, place = divmod(rest, len(axis.values))
            swept[axis.key] = axis.values[place]
        return Point(self.first_index + position, {**self.fixed, **swept})


@dataclass(frozen=True, slots=True)
class Branch:
    """Points that belong together: a chain along a continuation axis, or all points of an independent sweep.

    Attributes
    ----------
    direction : {"independent", "up", "down"}
        Up and down branches carry the state from point to point and start their first point from the
        scene's own start state; independent points all start there.
    fixed : mapping of str to float
        Values of the spanning axes, the same for all points; empty for the independent branch.
    points : Points
        The points in the order of travel; `point.index` is their place in the `run` dimension.
    """

    direction: SweepDirection
    fixed: Mapping[str, float]
    points: Points


class Swept(Protocol):
    """Anything with sweep axes; a `Scene` is one."""

    @property
    def sweep(self) -> tuple[SweepAxis, ...]:
        """The axes in the order of the scene file."""


def expand(scene: Swept) -> tuple[Branch, ...]:
    """Expand the sweep of a scene into its branches, in run order.

    Parameters
    ----------
    scene : Swept
        A scene; one without a sweep gives one branch with one point.

    Returns
    -------
    tuple of Branch
        Their points cover the `run` dimension once, without gaps.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> up_down = SimpleNamespace(sweep=(SweepAxis("body.mass", (1.0, 2.0), "up-down"),))
    >>> [(branch.direction, [p.values["body.mass"] for p in branch.points]) for branch in expand(up_down)]
    [('up', [1.0, 2.0]), ('down', [2.0, 1.0])]
    """
    carried = next((axis for axis in scene.sweep if axis.continuation), None)
    if carried is None:
        return (Branch("independent", {}, Points(0, {}, scene.sweep)),)
    return tuple(_continuation_branches(carried, [axis for axis in scene.sweep if axis is not carried]))


def _continuation_branches(carried: SweepAxis, spanning: Sequence[SweepAxis]) -> Iterator[Branch]:
    first_index = 0
    travelled = {"up": carried, "down": SweepAxis(carried.key, carried.values[::-1], carried.path)}
    keys = [axis.key for axis in spanning]
    for combination in product(*(axis.values for axis in spanning)):
        fixed = dict(zip(keys, combination, strict=True))
        for direction in DIRECTIONS[carried.path]:
            yield Branch(direction, fixed, Points(first_index, fixed, (travelled[direction],)))
            first_index += len(carried.values)


def run_count(axes: Sequence[SweepAxis]) -> int:
    """Return the length of the `run` dimension that these axes span (1 without axes)."""
    return prod(len(axis.values) * len(DIRECTIONS[axis.path]) for axis in axes)
