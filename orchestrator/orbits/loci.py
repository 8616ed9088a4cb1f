"""Loci of the bifurcations of a scene's periodic orbits over two of its numbers."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import xarray as xr

from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.analysis.orbits.bifurcations import FOLLOWED_KINDS, Bifurcation, Locus, joined_loci, kind_of
from vibroimpact.analysis.orbits.branch import Branch
from vibroimpact.analysis.orbits.branch_points import BRANCH_POINT
from vibroimpact.analysis.orbits.branches import dataset_of_loci
from vibroimpact.analysis.orbits.following import Follower, FollowSettings
from vibroimpact.analysis.orbits.loci.follower import LocusFollower
from vibroimpact.analysis.orbits.pitchforks import PITCHFORK
from vibroimpact.analysis.orbits.symmetry import is_symmetric
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.messages import counted
from vibroimpact.orchestrator.orbits.bodies import BodiesAlong, impacting_body, refuse_outside
from vibroimpact.orchestrator.orbits.branches import Followed, Followings, follow_orbit
from vibroimpact.orchestrator.orbits.sheets import (
    Apart,
    Sheets,
    apart_from,
    apart_of,
    fold_near,
    isola_centres,
)
from vibroimpact.orchestrator.run.dataset import cf_unit
from vibroimpact.orchestrator.scene.keys import coordinate_name
from vibroimpact.orchestrator.study.preparing import with_modes

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
    levels: list[Followed] = field(default_factory=list)
    """Branches at further values of the second number."""
    apart: list[Apart] = field(default_factory=list)
    """Isolas, and branches apart from those at the scene's own value."""
    left_at_corners: int = 0
    """Number of curves of other numbers of impacts that leave corners and are not followed."""

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
                "isolas": "\n".join(self.isolas),
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
    def isolas(self) -> list[str]:
        """A sentence on each isola, and on each branch apart from those at the scene's own value."""
        return [self._in_words(each) for each in self.apart]

    def _in_words(self, apart: Apart) -> str:
        name = next(branch.full_name for _, branch in apart.branches)
        values = ", ".join(dict.fromkeys(f"{value:.6g}" for value, _ in apart.branches))
        ends = [each for _, branch in apart.branches for each in (branch.values.min(), branch.values.max())]
        where = f"{name} at {self.second} = {values}, {self.followed.parameter} from {min(ends):.6g} to {max(ends):.6g}"
        if not apart.is_isola:
            own = f"{self.second} = {self.values[0]:.6g}"
            return f"Branch that no branch at {own} is connected with: {where}."
        at = [f"shrinks to a point at {_pair(each)}" for each in apart.births]
        at += [f"meets another branch at {_pair(each)}" for each in apart.crossings]
        more = "; ".join(at) or "no curve of folds has its birth or end in the range"
        return f"Isola, a closed branch: {where}; {more}."

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
        others = [point for point in points if kind_of(point) not in FOLLOWED_KINDS]
        where = [f"{point.kind} at {point.at.value:.8g}" for point in others]
        where += [f"{each.kind} at {each.values[0]:.8g}, {each.values[1]:.8g}" for each in self.not_begun]
        if self.left_at_corners:
            where.append(f"{counted(self.left_at_corners, 'curve')} of other orbits at corners")
        if where:
            text += f" Not followed: {'; '.join(where)}."
        if any(each.kind == PITCHFORK for each in self.not_begun):
            text += " Pitchforks are followed over numbers that keep the mirror symmetry."
        if any(point.kind == BRANCH_POINT for point in others):
            text += " Branch points without mirror symmetry exist in general at single values of the second number."
        return text


class _Start(NamedTuple):
    """A bifurcation at which a curve can begin, where it was found, and the number of corners on the way to it."""

    at: Bifurcation
    origin: str
    corners: int = 0


def follow_loci(
    result: FollowedLoci,
    first: FollowSettings,
    second: FollowSettings,
    followed: Followed | None = None,
    corners: int = 0,
) -> Iterator[Locus]:
    """Follow the bifurcations of branches over a second parameter; yield each locus as it grows.

    Loci begin at the special points of the branches, and at points of codimension 2 of the loci themselves. A locus
    that is found again is left out. The branches are those of `result`, or of a scene with another value of the second
    parameter. The settings have the ranges of both parameters. The loci go into `result`. Orbits with another number of
    impacts are taken at up to `corners` corners in a row.

    UsageError: the second parameter is no number of the scene.
    """
    followed = followed or result.followed
    value = float(followed.scene.value(result.second))
    if value not in result.values:
        result.values.append(value)
    yield from _from_starts(
        result,
        LocusFollower(_bodies(followed, first, result.second), first, second),
        _starts(followed.branches, value, result.second),
        corners,
    )


def _bodies(followed: Followed, first: FollowSettings, second: str) -> BodiesAlong:
    """Return the bodies over both parameters."""
    scene, middle = followed.scene, 0.5 * (first.lowest + first.highest)
    return BodiesAlong(scene, {followed.parameter: middle, second: float(scene.value(second))})


def sheets_of(
    result: FollowedLoci, first: FollowSettings, second: FollowSettings, doublings: int, grazes: int
) -> Sheets:
    """Return the branches at all values of the second parameter, connected along the loci of `result`."""
    levels = [(float(each.scene.value(result.second)), each) for each in (result.followed, *result.levels)]
    levels.sort(key=lambda level: level[0])
    bodies = _bodies(result.followed, first, result.second)
    sheets = Sheets(bodies, first, result.second, levels, doublings, grazes)
    sheets.connect_along(result.loci, LocusFollower(sheets.body_at, first, second))
    return sheets


def find_isolas(
    result: FollowedLoci, sheets: Sheets, first: FollowSettings, second: FollowSettings
) -> Followings:
    """Put the branches that are apart from those at the scene's own value, and all isolas, into `result`.

    An isola centre may belong to none of the isolas. The branch next to it is then followed from a fold of its curve,
    and its orbits are yielded. Its value of the second parameter becomes another one of `result`.
    """
    follower = LocusFollower(sheets.body_at, first, second)
    sheets.connect_along(result.loci, follower)
    result.apart = apart_from(sheets, result.values[0], result.loci, follower)
    for locus in list(result.loci):
        for centre in isola_centres(locus):
            if any(np.allclose(centre.values, each) for apart in result.apart for each in apart.births):
                continue
            at = fold_near(locus, centre)
            level = Followed(
                result.followed.scene.at({result.second: at.values[1]}), result.followed.parameter
            )
            along = Follower(lambda value, fixed=at.values[1]: sheets.body_at(value, fixed), first)  # type: ignore[misc]  # of a lambda with a default
            passed = along.branch(at.orbit, at.values[0]).orbits
            start = passed[len(passed) // 3]  # a branch that began at a fold would not report this fold
            origin = f"an isola centre at {_pair(centre.values)}"
            yield from follow_orbit(along, start.orbit, start.value, level, origin)
            result.levels.append(level)
            result.apart += [
                apart_of([(at.values[1], branch)], result.loci, follower) for branch in level.branches
            ]


def at_other_values(result: FollowedLoci, second: FollowSettings) -> Iterator[Followed]:
    """Yield the scene at further values of the second parameter at which it has a body, without branches."""
    scene, parameter = result.followed.scene, result.followed.parameter
    for value in np.linspace(second.lowest, second.highest, SECOND_VALUES):
        if value in result.values:
            continue
        try:
            other = with_modes(
                scene.unswept([parameter, result.second]).with_values({result.second: float(value)})
            )
            impacting_body(other, all_kinds=True)
        except (UsageError, SceneError):
            continue  # such as a force of 0
        result.levels.append(Followed(other, parameter))
        yield result.levels[-1]


def _starts(branches: list[Branch], value: float, second: str) -> list[_Start]:
    """Return the special points of branches from which loci can begin."""
    return [
        _Start(
            Bifurcation.of(point, (point.at.value, value)),
            f"branch {number} at {second} = {value:.6g}, {branch.full_name}, at {point.at.value:.8g}",
        )
        for number, branch in enumerate(branches, start=1)
        for point in branch.points
        if kind_of(point) in FOLLOWED_KINDS
    ]


def _from_starts(
    result: FollowedLoci, follower: LocusFollower, starts: list[_Start], corners: int
) -> Iterator[Locus]:
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
                waiting += [_Start(each, _met(number, found, each), start.corners) for each in found.starts]
                if start.corners < corners:
                    waiting += [
                        _Start(each, _at_corner(number, each), start.corners + 1) for each in found.beyond
                    ]
                else:
                    result.left_at_corners += len(found.beyond)


def _met(number: int, locus: Locus, at: Bifurcation) -> str:
    """Return where a locus meets a bifurcation, in words."""
    where = f"at {at.values[0]:.8g}, {at.values[1]:.8g}"
    middle = locus.points[len(locus.points) // 2].orbit
    if {locus.kind, at.kind} == {"fold", PITCHFORK} and not (is_symmetric(at.orbit) and is_symmetric(middle)):
        return f"curve {number}, next to its degenerate pitchfork, {where}"
    other = "another" if at.kind == locus.kind else f"a {at.kind}"
    return f"curve {number}, where its {locus.kind} is {other}, {where}"


def _at_corner(number: int, at: Bifurcation) -> str:
    """Return the corner of a locus at which the graze of another orbit begins, in words."""
    return f"the corner of curve {number} at {at.values[0]:.8g}, {at.values[1]:.8g}"


def _pair(values: tuple[float, float]) -> str:
    return f"{values[0]:.8g}, {values[1]:.8g}"


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
