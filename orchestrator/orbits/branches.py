"""Branches of a scene's periodic orbits over one of its numbers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.orbits import OrbitError, PeriodicOrbit
from vibroimpact.analysis.orbits.branch import Branch, BranchOrbit, SpecialPoint, joined
from vibroimpact.analysis.orbits.branch_points import BRANCH_POINT
from vibroimpact.analysis.orbits.branches import MISSING_ORBITS, dataset_of_branches, mirror_images
from vibroimpact.analysis.orbits.corners import AT_YIELD_VELOCITY
from vibroimpact.analysis.orbits.departures import Departure, departures, passes
from vibroimpact.analysis.orbits.following import Follower, FollowSettings
from vibroimpact.analysis.orbits.search import STARTS
from vibroimpact.analysis.orbits.symmetry import mirror_image
from vibroimpact.fmus.core.orbits import MOST_IMPACTS
from vibroimpact.fmus.errors import SceneError, UsageError, VibroimpactError
from vibroimpact.fmus.messages import counted, message
from vibroimpact.orchestrator.orbits.bodies import (
    BodiesAlong,
    impacting_body,
    refuse_outside,
    refuse_without_energy,
)
from vibroimpact.orchestrator.orbits.ends_of_runs import RunEnd, ends_in_words, ends_of_runs, where_runs_end
from vibroimpact.orchestrator.orbits.first_orbits import MOST_BEGUN_IMPACTS, SEEDS, first_orbits, seed_values
from vibroimpact.orchestrator.orbits.seeds import Seed
from vibroimpact.orchestrator.orbits.self_check.index_check import IndexCheck
from vibroimpact.orchestrator.run.dataset import cf_unit
from vibroimpact.orchestrator.run.provenance import scene_attributes
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.forcing_clock import is_frequency, sines_of, sines_of_stops
from vibroimpact.orchestrator.scene.keys import coordinate_name

HISTORY = "periodic orbits followed by vibroimpact"
SAME_ORBIT = 0.02
"""Distance, in ranges of the parameter and radians, below which an orbit lies on a known branch."""
MOST_BRANCHES = 256
"""Number of branches from which on no more are begun at special points."""
FOLLOWED_TURNS = 2
"""Number of turns of a grazing orbit up to which the orbits that meet it are followed."""
MOST_ROUNDS = 4
"""Rounds of the self-check in which missing orbits are searched."""

Followings = Iterator[tuple[Branch, BranchOrbit]]
"""Each new orbit, and the branch that it extends."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """A graze of a branch, and the branches of other orbits that begin there."""

    branch: Branch
    point: SpecialPoint
    departures: list[Departure]


@dataclass(slots=True)
class Followed:
    """Branches of orbits over one parameter."""

    scene: Scene
    parameter: str
    """Key of the scene that is varied."""
    branches: list[Branch] = field(default_factory=list)
    """The branches so far."""
    ends: list[RunEnd] = field(default_factory=list)
    """The motions on which runs over the range end, where these runs were made."""
    search: str = ""
    """A sentence on the starts of the search for first orbits, and its finds."""
    check: IndexCheck | None = None
    """The self-check by index sums, where orbits of all kinds were looked for."""
    leaving: set[int] = field(default_factory=set)
    """Indices of the branches that begin at special points of others."""
    meetings: list[Meeting] = field(default_factory=list)
    """The grazes of these branches, with the orbits that meet there."""
    crossings: dict[SpecialPoint, str] = field(default_factory=dict)
    """The cause of the other branch at each branch point: `pitchfork` or `transcritical branch point`."""
    most_begun_impacts: int = MOST_IMPACTS
    """Impacts of an orbit up to which branches begin at special points."""
    left: int = 0
    """Number of branches of more impacts that are not followed."""
    is_cut_short: bool = False
    """Whether branches begin at special points that were not followed, since there are too many."""

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the file of its orbits."""
        missing = [] if self.check is None else self.check.incomplete
        texts = {
            "first_orbits": self.origins,
            "index_sums": self.sums,
            MISSING_ORBITS: [f"{each.between[0]:.17g} {each.between[1]:.17g}" for each in missing],
        }
        told = {name: "\n".join(lines) for name, lines in texts.items() if lines}
        return scene_attributes(self.scene, HISTORY) | {"parameter": self.parameter} | told

    @property
    def sums(self) -> list[str]:
        """Lines on the self-check by index sums."""
        return [] if self.check is None else self.check.lines

    @property
    def origins(self) -> list[str]:
        """Lines on the search for first orbits: its starts, or the motions on which runs over the range end."""
        values = [each.value for each in self.ends]
        if not values:
            return [self.search] if self.search else []
        settings = FollowSettings(min(values), max(values))

        def is_followed(end: RunEnd) -> bool:
            return end.orbit is not None and _is_known(self.branches, end.orbit, end.value, settings)

        return ends_in_words(self.ends, is_followed)

    @property
    def dataset(self) -> xr.Dataset:
        """The orbits as runs; the branches of mirror images come last."""
        branches = [branch for branch in self.branches if branch.orbits]
        return dataset_of_branches(
            [*branches, *mirror_images(branches).values()],
            coordinate=coordinate_name(self.parameter, [self.parameter]),
            unit=cf_unit(self.scene, self.parameter) or "1",
            units=self.scene.units,
            attrs=self.attributes,
        )


def follow_branches(
    followed: Followed,
    start: float,
    stop: float,
    *,
    impacts: int | None = None,
    periods: int = 1,
    seed: Seed | None = None,
    doublings: int = 1,
    grazes: int = 1,
    longest: float = 0.01,
    starts: int = STARTS,
    looking: Callable[[float], None] = lambda value: None,
    required: bool = True,
    checked: bool = True,
) -> Followings:
    """Follow orbits P(p,q), and branches that begin at their special points; yield each orbit with its branch.

    Branches go into `followed`, also unfinished branches. `longest` is the largest step: the range of the parameter
    counts as 1, a radian of all phases as 1. For the other arguments see `vibroimpact.follow`. `looking` is called
    with each value at which orbits of several impacts are searched. `checked`: index sums are evaluated.

    UsageError: the scene has no such orbits, or the parameter is no number of it. OrbitError: there is no orbit to
    begin with, and one is `required`.
    """
    scene, parameter = followed.scene, followed.parameter
    _refuse(start, stop, impacts, periods, doublings, grazes, longest, starts)
    refuse_outside(scene, parameter, (start, stop), "--from, --to")
    body_at = _bodies(scene, parameter, 0.5 * (start + stop))
    _refuse_without_energy(scene, body_at, (start, 0.5 * (start + stop), stop))
    settings = FollowSettings(min(start, stop), max(start, stop), longest)
    follower = Follower(body_at, settings)
    found = 0
    for value, orbit in first_orbits(
        body_at, scene, parameter, settings, impacts, periods, seed, followed.ends, starts, looking
    ):
        found += 1
        if not _is_known(followed.branches, orbit, value, settings):
            yield from follow_orbit(follower, orbit, value, followed)
    if seed is None and (impacts or 1) > 1:
        followed.search = (
            f"The search at {SEEDS} values or more took {starts} trains of impacts at each and found "
            f"{counted(found, 'orbit')}; branches: {len(followed.branches)}."
        )
    if seed is None and impacts is None:
        followed.most_begun_impacts = MOST_BEGUN_IMPACTS
    yield from follow_departures(follower, followed, doublings, grazes)
    if seed is None and impacts is None and periods == 1 and scene.period is not None and checked:
        followed.check = IndexCheck(scene, parameter, settings, starts, followed.ends)
        yield from _completed(follower, followed, doublings, grazes, followed.check)
    if required:
        refuse_nothing(followed, settings, impacts, periods, starts)


def refuse_nothing(
    followed: Followed, settings: FollowSettings, impacts: int | None, periods: int, starts: int
) -> None:
    """Raise OrbitError if there is no branch: what was tried, values without a scene, and where runs end."""
    if followed.branches:
        return
    scene, parameter, values = followed.scene, followed.parameter, seed_values(settings)
    refused = _refusals(scene, parameter, values)
    if len(refused) == len(values):
        raise refused[0]
    ends = followed.ends or list(ends_of_runs(scene, parameter, values))
    kind = "an orbit with impacts" if followed.ends else f"a physical orbit P({impacts or 1},{periods})"
    tried = f" near {starts} trains of impacts at each" if (impacts or 1) > 1 else ""
    without = (
        f"The scene refuses {counted(len(refused), 'value')} of these: {refused[0].message} "
        if refused
        else ""
    )
    raise OrbitError(
        message(
            f"follow: expected {kind} at one of {SEEDS} values of "
            f"{parameter} from {settings.lowest:g} to {settings.highest:g}, got none{tried}. {without}",
            where_runs_end(ends, (impacts or 1, periods)),
        )
    )


def _refusals(scene: Scene, parameter: str, values: Sequence[float]) -> list[VibroimpactError]:
    """Return the first problem of the scene at each value that its rules refuse."""
    found: list[VibroimpactError] = []
    for value in values:
        try:
            impacting_body(scene.with_values({parameter: value}), all_kinds=True)
        except SceneError as problem:
            found.append(SceneError(problem.problems[:1]))
        except UsageError as problem:
            found.append(problem)
    return found


def follow_orbit(
    follower: Follower, orbit: PeriodicOrbit, value: float, result: Followed, origin: str = ""
) -> Followings:
    """Follow an orbit both ways; an interruption keeps the orbits so far. The origin may be given."""
    origin = origin or f"{orbit.full_name} at {value:g}"
    ways = Branch(origin), Branch(origin)
    try:
        yield from follower.both_ways(*ways, orbit, value)
    finally:
        backward, forward = ways
        if backward.orbits:
            result.branches.append(joined(backward, forward) if forward.orbits else backward)


def _completed(
    follower: Follower, result: Followed, doublings: int, grazes: int, check: IndexCheck
) -> Followings:
    """Follow orbits that index sums show to be missing, until a round finds none."""
    for _ in range(MOST_ROUNDS):
        begin = len(result.branches)
        for value, orbit in check.missing(result.branches):
            try:
                yield from follow_orbit(follower, orbit, value, result)
            except OrbitError:
                continue  # no branch leads on from an orbit at rounding from its end
        if len(result.branches) == begin:
            return
        yield from follow_departures(follower, result, doublings, grazes, begin)


def follow_departures(
    follower: Follower, result: Followed, doublings: int, grazes: int, begin: int = 0
) -> Followings:
    """Follow the branches that begin at the special points of others, from branch number `begin` on.

    Doublings and grazes are followed one after the other up to their numbers, branch points always.
    """
    waiting = deque((branch, doublings, grazes) for branch in result.branches[begin:])
    while waiting and not result.is_cut_short:
        result.is_cut_short = len(result.branches) >= MOST_BRANCHES
        parent, doublings, grazes = waiting.popleft()
        for point in parent.points:
            is_graze = point.kind.startswith("graze")
            is_doubling = point.kind in ("period doubling", AT_YIELD_VELOCITY)
            if is_doubling and not doublings:
                continue
            found = departures(follower, point)
            if point.kind == BRANCH_POINT:
                result.crossings[point] = found[0].cause
            if is_graze:
                result.meetings.append(Meeting(parent, point, found))
                longest = FOLLOWED_TURNS * point.at.orbit.periods if grazes else 0
                found = [each for each in found if each.start.orbit.periods <= longest]
            for departure in found:
                others = [each for each in result.branches if each is not parent or is_graze or is_doubling]
                if any(passes(each, departure.start, follower.settings.span) for each in others):
                    continue
                if departure.start.orbit.phases.size > result.most_begun_impacts:
                    result.left += 1
                    continue
                count = len(result.branches)
                yield from _leaving(follower, departure, parent, result)
                waiting.extend(
                    (each, doublings - is_doubling, grazes - is_graze) for each in result.branches[count:]
                )


def _leaving(follower: Follower, departure: Departure, parent: Branch, result: Followed) -> Followings:
    """Follow a branch from a special point of another one; an interruption keeps the orbits so far."""
    start = departure.start
    origin = f"{parent.full_name} at its {departure.cause} {start.value:.11g}"
    ways = [Branch(origin) for _ in range(1 + departure.goes_both_ways)]
    if not departure.goes_both_ways:
        ways[0].ends.append(f"{departure.cause} of {parent.name}")
    result.branches.append(ways[0])
    try:
        for branch, first in zip(ways, (start, start.turned), strict=False):
            for each in follower.leave(branch, first):
                yield branch, each
    finally:
        if len(ways) > 1 and ways[1].orbits:
            whole = result.branches[-1] = joined(*ways)
            place = len(ways[0].orbits) - 1
            whole.points.append(SpecialPoint(BRANCH_POINT, whole.orbits[place], place))
            whole.points.sort(key=lambda point: point.place)
        if result.branches[-1].orbits:
            result.leaving.add(len(result.branches) - 1)
        else:
            result.branches.pop()


def _bodies(scene: Scene, parameter: str, value: float) -> BodiesAlong:
    """Return the bodies over a number; UsageError for one that no orbit can be followed over."""
    found = BodiesAlong(scene, {parameter: value})
    if len([*sines_of(scene.forces), *sines_of_stops(scene.stops)]) > 1 and is_frequency(parameter):
        raise UsageError(
            f"follow: {parameter}: expected a number that the common period of the sines does not depend on, "
            "got the frequency of one of them."
        )
    return found


def _refuse_without_energy(scene: Scene, body_at: BodiesAlong, values: Sequence[float]) -> None:
    """Raise UsageError if nothing gives energy to the body at any of some values of the range."""
    problems = []
    for value in values:
        try:
            refuse_without_energy(scene, body_at(value))
        except UsageError as problem:
            problems.append(problem)
        except OrbitError:
            continue  # the scene has no body there, such as with a force of frequency 0
    if len(problems) == len(values):
        raise problems[0]


def branch_with(
    branches: list[Branch], orbit: PeriodicOrbit, value: float, settings: FollowSettings
) -> int | None:
    """Return the index of the branch that an orbit or its mirror image is on; None without one."""
    places = (place for place, each in enumerate(branches) if _is_known([each], orbit, value, settings))
    return next(places, None)


def _is_known(branches: list[Branch], orbit: PeriodicOrbit, value: float, settings: FollowSettings) -> bool:
    """Return whether an orbit or its mirror image is on a branch."""
    images = [each for each in (orbit, mirror_image(orbit)) if each is not None]
    return any(_is_on_branch(branches, each, value, settings) for each in images)


def _is_on_branch(
    branches: list[Branch], orbit: PeriodicOrbit, value: float, settings: FollowSettings
) -> bool:
    """Return whether an orbit is on a branch, counted from any of its impacts and periods."""
    for branch in branches:
        alike = branch.orbits[0].orbit
        if alike.periods != orbit.periods or alike.phases.size != orbit.phases.size:
            continue
        off = ((branch.values - value) / settings.span)[:, None]
        rows = np.array([each.orbit.unknowns for each in branch.orbits])
        steps = np.diff(np.hstack([rows, off]), axis=0)
        for first in range(orbit.phases.size):
            if (np.roll(orbit.contacts, -first) != alike.contacts).any():
                continue
            apart = rows - orbit.counted_from(first).unknowns
            if not orbit.body.has_own_period:
                apart = apart - 2.0 * np.pi * np.round(apart[:, :1] / (2.0 * np.pi))
            if _off_path(np.hstack([apart, off]), steps) < SAME_ORBIT:
                return True
    return False


def _off_path(apart: NDArray[np.float64], steps: NDArray[np.float64]) -> float:
    """Return the distance of a point from a path.

    `apart`, shape (n, d), is the point's offset from each point of the path. `steps`, shape (n - 1, d), lead from each
    point to the next.
    """
    squares = np.maximum((steps**2).sum(axis=1), np.finfo(np.float64).tiny)
    shares = np.clip(-(apart[:-1] * steps).sum(axis=1) / squares, 0.0, 1.0)
    nearest = np.vstack([apart[-1:], apart[:-1] + shares[:, None] * steps])
    return float(np.sqrt((nearest**2).sum(axis=1)).min())


def _refuse(
    start: float,
    stop: float,
    impacts: int | None,
    periods: int,
    doublings: int,
    grazes: int,
    longest: float,
    starts: int,
) -> None:
    if not (np.isfinite(start) and np.isfinite(stop) and start != stop):
        raise UsageError(f"--from, --to: expected two different numbers, got {start:g} and {stop:g}.")
    if not (impacts is None or 1 <= impacts <= MOST_IMPACTS):
        raise UsageError(f"--impacts: expected 1 to {MOST_IMPACTS}, got {impacts}.")
    if not periods >= 1:
        raise UsageError(f"--periods: expected 1 or more, got {periods}.")
    if not starts >= 1:
        raise UsageError(f"--starts: expected 1 or more, got {starts}.")
    if not doublings >= 0:
        raise UsageError(f"--doublings: expected 0 or more, got {doublings}.")
    if not grazes >= 0:
        raise UsageError(f"--grazes: expected 0 or more, got {grazes}.")
    if not 1e-4 <= longest <= 0.2:
        raise UsageError(f"--step: expected 1e-4 to 0.2, got {longest:g}.")
