"""From the axes of a sweep to the branches and points of a campaign.

Run order (the `run` dimension of the dataset) is fixed by the scene alone:

- axes have the order of the scene file, the last one fastest;
- axes that move together count once, at the place of the first of them;
- a continuation axis (`up`, `down`, `up-down`) is always the fastest, whatever its place in the file;
- each combination of the other axes is one branch (two for `up-down`: first up, then down);
- a branch is a contiguous range of runs in the order of travel: a down branch starts at the top;
- without a continuation axis all points form one flat branch of independent points.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import prod
from typing import Any, Literal, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import SCATTERED, Direction

SweepPath = Literal["independent", "up", "down", "up-down"]
SweepDirection = Literal["independent", "up", "down"]

DIRECTIONS: dict[SweepPath, tuple[SweepDirection, ...]] = {
    "independent": ("independent",),
    "up": ("up",),
    "down": ("down",),
    "up-down": ("up", "down"),
}


MOST_LISTED = 10**6
"""Number of values of a range, above which they are computed on access (`SpacedValues`) and not kept as a tuple."""


@dataclass(frozen=True, slots=True)
class SpacedValues(Sequence[float]):
    """Evenly spaced values, both ends included, computed on access; the bits are those of `numpy.linspace`.

    Attributes
    ----------
    start, stop : float
        Ends in the order of the range.
    points : int
        Number of values, 2 or more.
    backwards : bool
        Whether the values go from `stop` to `start`.
    """

    start: float
    stop: float
    points: int
    backwards: bool = False

    def __len__(self) -> int:
        return self.points

    @overload
    def __getitem__(self, place: int) -> float: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[float]: ...
    def __getitem__(self, place: int | slice) -> float | Sequence[float]:
        if place == slice(None, None, -1):
            return replace(self, backwards=not self.backwards)
        if isinstance(place, slice):
            return tuple(self.at(np.arange(self.points)[place]).tolist())
        return float(self.at(np.array([range(self.points)[place]]))[0])

    def __iter__(self) -> Iterator[float]:
        for block in self.blocks():
            yield from block.tolist()

    def blocks(self) -> Iterator[NDArray[np.float64]]:
        """Yield all values in blocks of at most `MOST_LISTED`."""
        for first in range(0, self.points, MOST_LISTED):
            yield self.at(np.arange(first, min(first + MOST_LISTED, self.points)))

    @property
    def differ(self) -> bool:
        """Whether all values differ; they never turn back, so equal values are neighbours."""
        step = abs(self.stop / 2.0 - self.start / 2.0) / (self.points - 1)
        if step > 2.0 * math.ulp(max(abs(self.start), abs(self.stop)) / 2.0):
            return True
        return all((np.diff(block) != 0.0).all() for block in self.blocks())

    def at(self, places: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the values at some places, from 0 on."""
        places = self.points - 1 - places if self.backwards else places
        # Halved ends keep the span of the range finite for any two finite numbers; scaling by 2 is exact.
        start, stop = self.start / 2.0, self.stop / 2.0
        step = (stop - start) / (self.points - 1)
        # as numpy does where the quotient underflows
        shift = places * step if step else places / (self.points - 1) * (stop - start)
        return 2.0 * np.where(places == self.points - 1, stop, shift + start)


def values_at(values: Sequence[float], places: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the values of an axis at some places."""
    if isinstance(values, SpacedValues):
        return values.at(places)
    # an axis may have 10^6 values: only the values in use become an array
    low, high = (int(places.min()), int(places.max())) if places.size else (0, 0)
    return np.array(values[low : high + 1], dtype=np.float64)[places - low]


@dataclass(frozen=True, slots=True)
class Adaptive:
    """The refinement of an axis where the motion jumps.

    Attributes
    ----------
    tolerance : float
        Width of an interval with a jump, in the unit of the key, down to which it is halved.
    at_most : int
        Largest number of points of the whole sweep.
    jump : float
        Change of the recorded range between neighbours, over the largest range, above which the motion jumps.
    """

    tolerance: float
    at_most: int
    jump: float


@dataclass(frozen=True, slots=True)
class SweepAxis:
    """One swept key of a scene.

    Attributes
    ----------
    key : str
        The swept key with 1-based indices, for example `stop[1].position`.
    values : tuple of float, or SpacedValues
        Values in the unit of the key; ascending on a continuation axis, else in the order of the scene.
    path : {"independent", "up", "down", "up-down"}
        Whether each point starts from the scene's start state, or from its predecessor's final state.
    span : tuple or None
        Start, stop and number of values of a range, which are sent to workers in place of the values.
    together : str
        Name of the dimension that the axis shares with others; empty for an axis that moves alone.
    adaptive : Adaptive or None
        Refinement between these values; None without refinement.
    """

    key: str
    values: Sequence[float]
    path: SweepPath = "independent"
    span: tuple[float, float, int] | None = field(default=None, compare=False, repr=False)
    together: str = ""
    adaptive: Adaptive | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        if self.span is not None and not self.together and self.adaptive is None:
            return axis_of_range, (self.key, *self.span, self.path)
        return SweepAxis, (self.key, self.values, self.path, None, self.together, self.adaptive)

    @property
    def continuation(self) -> bool:
        """Whether the state is carried from point to point along this axis."""
        return self.path != "independent"

    @property
    def lowest(self) -> float:
        """Lowest value."""
        return min(self.bounding)

    @property
    def highest(self) -> float:
        """Highest value."""
        return max(self.bounding)

    @property
    def bounding(self) -> Sequence[float]:
        """Values among which are the lowest and the highest."""
        return (self.values[0], self.values[-1]) if isinstance(self.values, SpacedValues) else self.values


@lru_cache(maxsize=8)
def axis_of_range(key: str, start: float, stop: float, points: int, path: SweepPath) -> SweepAxis:
    """Return an axis of evenly spaced values, both ends included."""
    if points > MOST_LISTED:
        backwards = path != "independent" and start > stop
        return SweepAxis(key, SpacedValues(start, stop, points, backwards), path, (start, stop, points))
    # Halved ends: see `SpacedValues`.
    values = (2.0 * np.linspace(start / 2.0, stop / 2.0, points)).tolist()
    ordered = values if path == "independent" else sorted(values)
    return SweepAxis(key, tuple(ordered), path, (start, stop, points))


def log_axis(key: str, start: float, stop: float, points: int, path: SweepPath) -> SweepAxis:
    """Return an axis of values with a constant ratio between neighbours, both ends included.

    Workers get the values themselves, not a span, since another machine's logarithm may differ in its last bit.

    Examples
    --------
    >>> log_axis("body.stiffness", 1e2, 1e8, 4, "independent").values
    (100.0, 10000.0, 1000000.0, 100000000.0)
    """
    # 15 digits, without the rounding of the ratio
    inner = (float(f"{value:.15g}") for value in np.geomspace(start, stop, points)[1:-1])
    values = (start, *inner, stop) if points > 1 else (start,)
    return SweepAxis(key, values if path == "independent" else tuple(sorted(values)), path)


Dimension = tuple[SweepAxis, ...]
"""The axes that move together: a single axis, or several axes with the same number of values."""


def dimensions(axes: Sequence[SweepAxis]) -> tuple[Dimension, ...]:
    """Return the axes of a sweep by the dimensions that they span, in the order of the scene.

    Examples
    --------
    >>> gap = [SweepAxis(f"stop[{k}].position", (0.1, 0.2), together="gap") for k in (1, 2)]
    >>> [len(dimension) for dimension in dimensions([gap[0], SweepAxis("body.mass", (1.0,)), gap[1]])]
    [2, 1]
    """
    found: dict[str, list[SweepAxis]] = {}
    for axis in axes:
        # every key has a dot, and no name of a dimension has one
        found.setdefault(axis.together or f".{axis.key}", []).append(axis)
    return tuple(tuple(members) for members in found.values())


def most_points(axes: Sequence[SweepAxis]) -> int | None:
    """Return the largest number of points of adaptive axes; None if all points are known in advance."""
    return max((axis.adaptive.at_most for axis in axes if axis.adaptive is not None), default=None)


def shared_dimensions(axes: Sequence[SweepAxis]) -> dict[str, str]:
    """Return the dimension of a dataset that each key shares with other keys, by key; other keys are left out.

    Examples
    --------
    >>> shared_dimensions([SweepAxis(f"stop[{k}].position", (0.1, 0.2), together="gap") for k in (1, 2)])
    {'stop[1].position': 'gap', 'stop[2].position': 'gap'}
    """
    adaptive = [axis.key for axis in axes if axis.adaptive is not None]
    scattered = dict.fromkeys(adaptive, SCATTERED) if len(adaptive) > 1 else {}
    return {axis.key: axis.together for axis in axes if axis.together} | scattered


@dataclass(frozen=True, slots=True)
class Point:
    """One point of a sweep: its place in the `run` dimension, and the value of every swept key."""

    index: int
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Points(Sequence[Point]):
    """The points of a branch, computed on access: a sweep may have 10^9 points."""

    first_index: int
    fixed: Mapping[str, float]
    dimensions: tuple[Dimension, ...]

    def __len__(self) -> int:
        return prod(len(members[0].values) for members in self.dimensions)

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

    def columns(self, first: int, stop: int) -> dict[str, NDArray[np.float64]]:
        """Return the values of every swept key at the positions `first` to `stop - 1`, shape (point,) each."""
        return self.columns_at(np.arange(first, stop))

    def columns_at(self, positions: NDArray[np.int64]) -> dict[str, NDArray[np.float64]]:
        """Return the values of every swept key at some positions, shape (point,) each."""
        rest = positions
        swept: dict[str, NDArray[np.float64]] = {}
        for members in reversed(self.dimensions):
            rest, place = np.divmod(rest, len(members[0].values))
            swept |= {axis.key: values_at(axis.values, place) for axis in members}
        fixed = {key: np.full(len(positions), value) for key, value in self.fixed.items()}
        return fixed | swept

    def _point(self, position: int) -> Point:
        rest = position
        swept: dict[str, float] = {}
        for members in reversed(self.dimensions):
            rest, place = divmod(rest, len(members[0].values))
            for axis in members:
                swept[axis.key] = axis.values[place]
        return Point(self.first_index + position, {**self.fixed, **swept})


@dataclass(frozen=True, slots=True)
class Branch:
    """Points that belong together: a chain along a continuation axis, or all points of an independent sweep.

    Attributes
    ----------
    direction : {"independent", "up", "down"}
        Up and down branches carry the state from point to point; their first point starts from `start`. All
        independent points start from the scene's own start state.
    fixed : mapping of str to float
        Values of the spanning axes, the same for all points; empty for the independent branch.
    points : Points
        The points in the order of travel; `point.index` is their place in the `run` dimension.
    start : tuple of float or None
        Start state of the first point; None: the scene's own start state.
    """

    direction: SweepDirection
    fixed: Mapping[str, float]
    points: Points
    start: tuple[float, ...] | None = None


class Swept(Protocol):
    """Anything with sweep axes; a `Scene` is one."""

    @property
    def sweep(self) -> tuple[SweepAxis, ...]:
        """The axes in the order of the scene file."""


@dataclass(frozen=True, slots=True)
class Paths(Sequence[Branch]):
    """The branches of a sweep along a path, computed on access: a sweep may have 10^8 branches.

    Attributes
    ----------
    carried : SweepAxis
        The axis along which the state is carried.
    spanning : tuple of Dimension
        The other axes; each combination of their values has one branch in each direction.
    """

    carried: SweepAxis
    spanning: tuple[Dimension, ...]

    def __len__(self) -> int:
        return len(Points(0, {}, self.spanning)) * len(DIRECTIONS[self.carried.path])

    @overload
    def __getitem__(self, number: int) -> Branch: ...
    @overload
    def __getitem__(self, number: slice) -> tuple[Branch, ...]: ...
    def __getitem__(self, number: int | slice) -> Branch | tuple[Branch, ...]:
        if isinstance(number, slice):
            return tuple(self._branch(place) for place in range(len(self))[number])
        return self._branch(range(len(self))[number])

    @property
    def first_runs(self) -> range:
        """First run of each branch."""
        length = len(self.carried.values)
        return range(0, len(self) * length, length)

    def columns(self, runs: NDArray[np.int64]) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64]]:
        """Return the values of every swept key at some runs, and the place of each run on its branch."""
        directions = DIRECTIONS[self.carried.path]
        branch, place = np.divmod(runs, len(self.carried.values))
        combination, direction = np.divmod(branch, len(directions))
        is_down = np.array([each == "down" for each in directions])[direction]
        along = np.where(is_down, len(self.carried.values) - 1 - place, place)
        values = Points(0, {}, self.spanning).columns_at(combination)
        return values | {self.carried.key: values_at(self.carried.values, along)}, place

    def directions(self, runs: NDArray[np.int64]) -> NDArray[np.int8]:
        """Return the direction of the branch of some runs, as `schema.Direction`."""
        codes = np.array([Direction[each] for each in DIRECTIONS[self.carried.path]], dtype=np.int8)
        found: NDArray[np.int8] = codes[runs // len(self.carried.values) % len(codes)]
        return found

    def _branch(self, number: int) -> Branch:
        directions = DIRECTIONS[self.carried.path]
        combination = Points(0, {}, self.spanning)[number // len(directions)].values
        direction = directions[number % len(directions)]
        values = self.carried.values[::-1] if direction == "down" else self.carried.values
        travelled = SweepAxis(self.carried.key, values, self.carried.path)
        points = Points(number * len(values), combination, ((travelled,),))
        return Branch(direction, combination, points)


def expand(scene: Swept) -> Sequence[Branch]:
    """Return the branches of a scene's sweep, in run order.

    Parameters
    ----------
    scene : Swept
        A scene; a scene without a sweep has one branch with one point.

    Returns
    -------
    sequence of Branch
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
        return (Branch("independent", {}, Points(0, {}, dimensions(scene.sweep))),)
    return Paths(carried, dimensions([axis for axis in scene.sweep if axis is not carried]))


def first_runs(branches: Sequence[Branch]) -> Sequence[int]:
    """Return the first run of each branch."""
    if isinstance(branches, Paths):
        return branches.first_runs
    return [branch.points.first_index for branch in branches]


def run_count(axes: Sequence[SweepAxis]) -> int:
    """Return the length of the `run` dimension of these axes; 1 without axes."""
    return prod(len(members[0].values) * len(DIRECTIONS[members[0].path]) for members in dimensions(axes))
