"""Loci of the bifurcations of a scene's periodic orbits over two of its numbers."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import xarray as xr

from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.analysis.orbits.bifurcations import FOLLOWED_KINDS, Bifurcation, Locus, joined_loci
from vibroimpact.analysis.orbits.branch import Branch
from vibroimpact.analysis.orbits.branches import dataset_of_loci
from vibroimpact.analysis.orbits.following import FollowSettings
from vibroimpact.analysis.orbits.loci import LocusFollower
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.bodies import BodiesAlong, impacting_body, refuse_outside
from vibroimpact.orchestrator.orbits.branches import Followed
from vibroimpact.orchestrator.run.dataset import cf_unit
from vibroimpact.orchestrator.scene.keys import coordinate_name

SECOND_VALUES = 5
"""Number of further values of the second parameter, ends of its range included, at which branches are followed."""
COARSE = 0.05
"""Largest step along these branches, over the range of the parameter."""


@dataclass(slots=True)
class FollowedLoci:
    """Bifurcations that were followed over two parameters."""

    followed: Followed
    """The branches with the bifurcations."""
    second: str
    """Key of the second parameter."""
    loci: list[Locus] = field(default_factory=list)
    """The curves so far."""
    values: list[float] = field(default_factory=list)
    """Values of the second parameter at which branches were followed, the scene's own first."""
    not_begun: list[Bifurcation] = field(default_factory=list)
    """Bifurcations at which no curve could begin: the orbits next to them are not defined."""

    @property
    def dataset(self) -> xr.Dataset:
        """Their orbits as runs."""
        scene, keys = self.followed.scene, [self.followed.parameter, self.second]
        names = coordinate_name(keys[0], keys), coordinate_name(keys[1], keys)
        return dataset_of_loci(
            self.loci,
            coordinates=names,
            unit_of={name: cf_unit(scene, key) or "1" for name, key in zip(names, keys, strict=True)},
            units=scene.units,
            attrs=self.followed.attributes
            | {
                "second_parameter": self.second,
                "curves": "\n".join(self.names),
                "not_looked_for": self.left_out,
            },
        )

    @property
    def names(self) -> list[str]:
        """Kind and orbit of each curve, and the branch or curve on which it was found."""
        return [
            f"{number}  {locus.kind} of {locus.points[0].orbit.full_name}; begun from {locus.origin}"
            for number, locus in enumerate(self.loci, start=1)
        ]

    @property
    def left_out(self) -> str:
        """A sentence on the bifurcations that were not searched."""
        values = ", ".join(f"{each:.6g}" for each in self.values)
        kinds = f"{', '.join(FOLLOWED_KINDS[:-1])} or {FOLLOWED_KINDS[-1]}"
        text = (
            f"Curves were begun where a branch has a {kinds} at {self.second} = {values}, "
            "and at each point of codimension 2 of a curve: curves that meet none of these were not looked for."
        )
        points = [point for each in self.followed.branches for point in each.points]
        others = [point for point in points if point.kind not in FOLLOWED_KINDS]
        where = [f"{point.kind} at {point.at.value:.8g}" for point in others]
        where += [f"{each.kind} at {each.values[0]:.8g}, {each.values[1]:.8g}" for each in self.not_begun]
        if where:
            text += f" Not followed: {'; '.join(where)}."
        return text


class _Start(NamedTuple):
    """A bifurcation at which a curve can begin, and where it was found."""

    at: Bifurcation
    origin: str


def follow_loci(
    result: FollowedLoci, first: FollowSettings, second: FollowSettings, followed: Followed | None = None
) -> Iterator[Locus]:
    """Follow the bifurcations of branches over a second parameter; yield each locus as it grows.

    Loci begin at the special points of the branches, and at points of codimension 2 of the loci themselves. A locus
    that is found again is left out. The branches are those of `result`, or of a scene with another value of the second
    parameter. The settings have the ranges of both parameters. The loci go into `result`.

    UsageError: the second parameter is no number of the scene.
    """
    followed = followed or result.followed
    scene, keys = followed.scene, (followed.parameter, result.second)
    value = float(scene.value(result.second))
    body_at = BodiesAlong(scene, dict(zip(keys, (0.5 * (first.lowest + first.highest), value), strict=True)))
    result.values.append(value)
    yield from _from_starts(
        result, LocusFollower(body_at, first, second), _starts(followed.branches, value, result.second)
    )


def at_other_values(result: FollowedLoci, second: FollowSettings) -> Iterator[Followed]:
    """Yield the scene at further values of the second parameter at which it has a body, without branches."""
    scene, parameter = result.followed.scene, result.followed.parameter
    for value in np.linspace(second.lowest, second.highest, SECOND_VALUES):
        if value in result.values:
            continue
        other = scene.at({result.second: float(value)})
        try:
            impacting_body(other, all_kinds=True)
        except UsageError:
            continue  # such as a force of 0
        yield Followed(other, parameter)


def _starts(branches: list[Branch], value: float, second: str) -> list[_Start]:
    """Return the special points of branches from which loci can begin."""
    return [
        _Start(
            Bifurcation.of(point, (point.at.value, value)),
            f"branch {number} at {second} = {value:.6g}, {branch.full_name}, at {point.at.value:.8g}",
        )
        for number, branch in enumerate(branches, start=1)
        for point in branch.points
        if point.kind in FOLLOWED_KINDS
    ]


def _from_starts(result: FollowedLoci, follower: LocusFollower, starts: list[_Start]) -> Iterator[Locus]:
    """Follow loci from starts, and from the points of codimension 2 on them, each locus once."""
    waiting = deque(starts)
    while waiting:
        start = waiting.popleft()
        if any(follower.goes_through(locus, start.at) for locus in result.loci):
            continue
        ways = Locus(start.at.kind, origin=start.origin), Locus(start.at.kind, origin=start.origin)
        try:
            yield from follower.both_ways(*ways, start.at)
        except OrbitError:  # no derivatives at the very start, such as a mode in resonance
            result.not_begun.append(start.at)
        finally:
            if len(ways[0].points) + len(ways[1].points) > 2:
                found = joined_loci(*ways)
                result.loci.append(found)
                number = len(result.loci)
                waiting += [_Start(each, _met(number, found.kind, each)) for each in found.starts]


def _met(number: int, kind: str, at: Bifurcation) -> str:
    """Return where a locus meets a bifurcation, in words."""
    other = "another" if at.kind == kind else f"a {at.kind}"
    return f"curve {number}, where its {kind} is {other}, at {at.values[0]:.8g}, {at.values[1]:.8g}"


def refuse_second(result: FollowedLoci, second: FollowSettings) -> None:
    """Raise UsageError unless the second parameter differs from the first, and its range holds the scene's value."""
    if result.followed.parameter == result.second:
        raise UsageError(
            f"--second: expected another number of the scene than {result.second}, got the same."
        )
    scene, ends = result.followed.scene, (second.lowest, second.highest)
    refuse_outside(scene, result.second, ends, "--second-from, --second-to")
    value = float(scene.value(result.second))
    if not second.lowest <= value <= second.highest:
        raise UsageError(
            f"--second-from, --second-to: expected a range around {result.second} = {value:g} of the scene, "
            f"got {second.lowest:g} to {second.highest:g}."
        )
