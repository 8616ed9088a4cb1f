"""Branches at several values of a second number, connected by following their orbits over that number.

A branch that no run and no special point reaches at one value of the second number is found from its part at another.
Branches that stay apart are isolas if they are closed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.analysis.orbits import OrbitError, PeriodicOrbit
from vibroimpact.analysis.orbits.bifurcations import Bifurcation, Locus, LocusPoint
from vibroimpact.analysis.orbits.branch import Branch
from vibroimpact.analysis.orbits.following import Follower, FollowSettings
from vibroimpact.analysis.orbits.loci.fold_extrema import CROSSING, ISOLA_CENTRE
from vibroimpact.analysis.orbits.loci.follower import LocusFollower
from vibroimpact.analysis.orbits.loci.steps import BodyAt2
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.orchestrator.orbits.branches import (
    Followed,
    Followings,
    branch_with,
    follow_departures,
    follow_orbit,
)
from vibroimpact.orchestrator.orbits.first_orbits import MOST_BEGUN_IMPACTS

LONGEST = 0.1
"""Largest step from one value of the second number to the next, over their difference."""
SHARES = (0.5, 0.25, 0.75)
"""Places of the orbits of a branch from which it is followed over the second number, over its number of orbits."""

Place = tuple[int, int]
"""Index of a value of the second number, and of a branch there."""


@dataclass(slots=True)
class Sheets:
    """Connections of branches over two numbers.

    Attributes
    ----------
    body_at : callable
        Body for values of both numbers.
    first : FollowSettings
        Range of the first number.
    second : str
        Key of the second number.
    levels : list of (float, Followed)
        Values of the second number, ascending, with the branches there.
    doublings, grazes : int
        Numbers of these special points in a row at which branches of a new branch begin.
    """

    body_at: BodyAt2
    first: FollowSettings
    second: str
    levels: list[tuple[float, Followed]]
    doublings: int
    grazes: int
    _edges: list[tuple[Place, Place]] = field(default_factory=list)

    def connect(self) -> Followings:
        """Follow each branch to the neighbouring values of the second number; yield the orbits of new branches there.

        A new branch goes into the branches of its value. Branches that begin at special points of others are left out:
        they are found at each value from these points.
        """
        waiting = [place for k, (_, each) in enumerate(self.levels) for place in self._places(k, each)]
        while waiting:
            place = waiting.pop(0)
            if place[1] in self.levels[place[0]][1].leaving:
                continue
            for neighbour in (place[0] - 1, place[0] + 1):
                if not 0 <= neighbour < len(self.levels) or self._is_joined(place, neighbour):
                    continue
                for level, value, orbit in self._ends(place, neighbour):
                    followed = self.levels[level][1]
                    found = branch_with(followed.branches, orbit, value, self.first)
                    if found is None:
                        found = len(followed.branches)
                        follower = Follower(lambda first, k=level: self._body(first, k), self.first)  # type: ignore[misc]  # of a lambda with a default
                        yield from follow_orbit(follower, orbit, value, followed, self._origin(place))
                        if found == len(followed.branches):
                            continue
                        yield from follow_departures(follower, followed, self.doublings, self.grazes, found)
                        waiting += self._places(level, followed)[found:]
                    self._edges.append((place, (level, found)))
                    if self._is_joined(place, neighbour):
                        break

    def connect_along(self, loci: list[Locus], follower: LocusFollower) -> None:
        """Connect the branches that have special points on one curve over both numbers."""
        first: dict[int, Place] = {}
        for k, (value, each) in enumerate(self.levels):
            for place in self._places(k, each):
                for point in self.branch(place).points:
                    start = Bifurcation.of(point, (point.at.value, value))
                    for number, locus in enumerate(loci):
                        if follower.goes_through(locus, start):
                            self._edges.append((first.setdefault(number, place), place))

    def groups(self, *, closed_only: bool = False) -> list[list[Place]]:
        """Return the branches that are connected with each other, group by group; of closed branches alone, if so."""
        left = [
            place
            for level, (_, each) in enumerate(self.levels)
            for place in self._places(level, each)
            if not closed_only or self.branch(place).is_closed
        ]
        found = []
        while left:
            group = self._connected(left[0], left)
            left = [each for each in left if each not in group]
            found.append(sorted(group))
        return found

    def is_apart(self, group: list[Place], own: float) -> bool:
        """Tell whether a group has open branches, none of them at a value or begun at a special point of another."""
        return (
            all(self.levels[level][0] != own for level, _ in group)
            and not all(self.branch(place).is_closed for place in group)
            and not any(number in self.levels[level][1].leaving for level, number in group)
        )

    def branch(self, place: Place) -> Branch:
        """Return the branch at a place."""
        return self.levels[place[0]][1].branches[place[1]]

    def _places(self, level: int, followed: Followed) -> list[Place]:
        return [(level, number) for number in range(len(followed.branches))]

    def _body(self, first: float, level: int) -> ImpactingBody:
        return self.body_at(first, self.levels[level][0])

    def _origin(self, place: Place) -> str:
        return f"{self.branch(place).full_name} at {self.second} = {self.levels[place[0]][0]:.6g}"

    def _connected(self, place: Place, among: Collection[Place]) -> set[Place]:
        """Return the places that are connected with one through places among some."""
        group, new = {place}, [place]
        while new:
            here = new.pop()
            beside = {other for pair in self._edges if here in pair for other in pair}
            new += [each for each in beside if each in among and each not in group]
            group |= set(new)
        return group

    def _is_joined(self, place: Place, level: int) -> bool:
        """Return whether a branch is connected with one of another value."""
        everywhere = {each for pair in self._edges for each in pair}
        return any(each[0] == level for each in self._connected(place, everywhere))

    def _ends(self, place: Place, neighbour: int) -> Iterator[tuple[int, float, PeriodicOrbit]]:
        """Yield the orbits at which a branch arrives: level, value of the first number, and orbit."""
        branch, orbits = self.branch(place), self.branch(place).orbits
        if orbits[0].orbit.phases.size > MOST_BEGUN_IMPACTS:
            return
        here, there = self.levels[place[0]][0], self.levels[neighbour][0]
        span = FollowSettings(min(here, there), max(here, there), LONGEST)
        for share in SHARES:
            start = orbits[int(share * (len(orbits) - 1))]
            follower = Follower(lambda second, at=start.value: self.body_at(at, second), span)  # type: ignore[misc]  # of a lambda with a default
            way = Branch(branch.origin)
            try:
                for _ in follower.walk(way, start.orbit, here, float(np.sign(there - here))):
                    pass
            except OrbitError:
                continue  # no derivatives there, such as a mode in resonance
            last = way.orbits[-1]
            if last.value in (here, there) and len(way.orbits) > 1:
                yield (place[0] if last.value == here else neighbour), start.value, last.orbit


@dataclass(frozen=True, slots=True)
class Apart:
    """Closed branches that are connected over the second number, or branches that are apart from the known ones.

    Attributes
    ----------
    branches : list of (float, Branch)
        Values of the second number, and branches.
    is_isola : bool
        Whether all are closed.
    births, crossings : list of tuple of float
        Both numbers at isola centres and at crossings with other branches, where curves of folds give them.
    """

    branches: list[tuple[float, Branch]]
    is_isola: bool
    births: list[tuple[float, float]]
    crossings: list[tuple[float, float]]


def apart_from(sheets: Sheets, own: float, loci: list[Locus], follower: LocusFollower) -> list[Apart]:
    """Return the closed branches, and open branches that no branch at the value `own` is connected with."""

    def at(group: list[Place]) -> list[tuple[float, Branch]]:
        return [(sheets.levels[place[0]][0], sheets.branch(place)) for place in group]

    isolas = [at(group) for group in sheets.groups(closed_only=True)]
    others = [at(group) for group in sheets.groups() if sheets.is_apart(group, own)]
    return [apart_of(group, loci, follower) for group in isolas + others]


def apart_of(branches: list[tuple[float, Branch]], loci: list[Locus], follower: LocusFollower) -> Apart:
    """Return branches that are connected, with the ends that loci of folds give them."""
    is_isola = all(branch.is_closed for _, branch in branches)
    return Apart(branches, is_isola, *_ends_of_isola(branches, loci, follower))


def isola_centres(locus: Locus) -> list[LocusPoint]:
    """Return the points of a locus at which closed branches shrink to a point."""
    return [point for kind, point in locus.special if kind == ISOLA_CENTRE]


def fold_near(locus: Locus, centre: LocusPoint) -> LocusPoint:
    """Return a fold of the closed branch that an isola centre is the end of, midway to the nearest other end."""
    place = locus.points.index(centre)
    sides = [locus.points[place::-1], locus.points[place:]]
    ways = [_onwards(np.array([each.values[1] for each in side])) for side in sides if len(side) > 1]
    seconds = min(ways, key=lambda way: abs(float(way[-1] - way[0])))
    side = sides[-1 if len(sides[0]) < 2 or seconds is not ways[0] else 0]
    return side[max(1, int(np.abs(seconds - 0.5 * (seconds[0] + seconds[-1])).argmin()))]


def _onwards(values: Floats) -> Floats:
    """Return the values up to the first one at which they turn back."""
    steps = np.diff(values)
    back = np.flatnonzero(steps * steps[0] <= 0.0)
    return values[: back[0] + 1] if back.size else values


def _ends_of_isola(
    branches: list[tuple[float, Branch]], loci: list[Locus], follower: LocusFollower
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Return the isola centres between folds of closed branches along loci of folds, and the crossings beside."""
    births: list[tuple[float, float]] = []
    crossings: list[tuple[float, float]] = []
    for value, branch in branches:
        folds = [
            Bifurcation.of(point, (point.at.value, value)) for point in branch.points if point.kind == "fold"
        ]
        for locus in loci:
            passed = [place for each in folds for place in follower.places_on(locus, each)]
            if not passed:
                continue
            low, high = min(passed), max(passed)
            at = [(locus.points.index(point), kind, point.values) for kind, point in locus.special]
            births += [
                values for place, kind, values in at if kind == ISOLA_CENTRE and low <= place <= high + 1
            ]
            before = [values for place, kind, values in at if kind == CROSSING and place <= low]
            beyond = [values for place, kind, values in at if kind == CROSSING and place > high]
            crossings += before[-1:] + beyond[:1]
    return sorted(set(births)), sorted(set(crossings))
