"""The self-check of followed branches: index sums between all special points, and the search where a sum is not 1."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.analysis.orbits import ImpactingBody, OrbitError, PeriodicOrbit, find_orbit
from vibroimpact.analysis.orbits.branch import Branch
from vibroimpact.analysis.orbits.following import FollowSettings
from vibroimpact.analysis.orbits.index_sum import IndexSum, clears_stops, index_sum, why_without_sum
from vibroimpact.analysis.orbits.search import each_orbit, same_orbit
from vibroimpact.analysis.orbits.symmetry import mirror_image
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.messages import counted
from vibroimpact.orchestrator.orbits.strobe_map import GRID_STARTS, StrobeMap
from vibroimpact.orchestrator.scene import Scene

PERIODS = (1, 2)
"""Forcing periods of the strobe maps that are checked."""
NARROWEST = 1e-9
"""Distance of two special points, over the range, below which nothing is checked between them."""
STEADY_VALUES = 65
"""Values of the range between which the motion without impacts is watched for meeting a stop."""
LOST = "cannot be followed"
"""Beginning of the reason of a branch's end that is no special point."""
MOST_SEARCHES = {True: 64, False: 8}
"""Number of searches for missing orbits of a body of one mode, and of several modes, whose searches take longer."""
MOST_IMPACTS_A_PERIOD = 3
"""Impacts in a forcing period up to which a body of several modes is searched."""


@dataclass(frozen=True, slots=True)
class CheckedValue:
    """Index sums at a value between two neighbouring special points.

    Attributes
    ----------
    value : float
    between : tuple of float
        The special points, or ends of branches or of the range.
    sums : tuple of IndexSum
        For each of `PERIODS`.
    """

    value: float
    between: tuple[float, float]
    sums: tuple[IndexSum, ...]

    @property
    def is_complete(self) -> bool:
        """Whether all sums are 1."""
        return all(each.is_complete for each in self.sums)


@dataclass(slots=True)
class IndexCheck:
    """Index sums of the branches of a scene over one number.

    Attributes
    ----------
    scene : Scene
    parameter : str
    settings : FollowSettings
        The range.
    starts : int
        Trains of impacts from which a search of a body of several modes starts, for each number of impacts.
    reason : str
        Reason that the sum of this body need not be 1; empty if it must be.
    values : list of CheckedValue
        The last sums, ascending.
    steady_grazes : list of float
        Values at which the motion without impacts begins or ends to meet a stop.
    searched : int
        Number of searches for missing orbits.
    started : int
        Number of starts of these searches.
    found : int
        Number of orbits that they found.
    is_cut_short : bool
        Whether sums that are not 1 were left without a search, since there were too many searches.
    """

    scene: Scene
    parameter: str
    settings: FollowSettings
    starts: int
    reason: str = ""
    values: list[CheckedValue] = field(default_factory=list)
    steady_grazes: list[float] = field(default_factory=list)
    searched: int = 0
    started: int = 0
    found: int = 0
    is_cut_short: bool = False
    _places: set[tuple[float, int]] = field(default_factory=set)

    def missing(self, branches: Sequence[Branch]) -> Iterator[tuple[float, PeriodicOrbit]]:
        """Yield values and orbits that no branch holds there, found where a sum is not 1; keep the sums.

        The branches may grow meanwhile; sums at later values count what has been added.
        """
        self.values = []
        with StrobeMap(self.scene, self.parameter) as strobe:
            self.steady_grazes = list(self._steady_grazes(strobe))
            for low, high in between_special_points(branches, self.settings, self.steady_grazes):
                value = 0.5 * (low + high)
                try:
                    body = strobe.body(value)
                except (SceneError, UsageError):
                    continue  # the scene has no body there, such as with a restitution above 1
                self.reason = why_without_sum(body)
                if self.reason:
                    self.values = []
                    return
                resting = {periods: strobe.resting(value, periods) for periods in PERIODS}
                for periods in PERIODS:
                    if self._is_complete(body, value, branches, periods, resting[periods]):
                        continue
                    for orbit in self._search(strobe, body, value, periods, branches):
                        yield value, orbit
                    if not self._is_complete(body, value, branches, periods, resting[periods]):
                        break  # the same orbits are missing in the sums of more periods
                known = orbits_at(branches, body, value)
                sums = (index_sum(body, known, each, resting[each]) for each in PERIODS)
                self.values.append(CheckedValue(value, (low, high), tuple(sums)))

    def _is_complete(
        self,
        body: ImpactingBody,
        value: float,
        branches: Sequence[Branch],
        periods: int,
        resting: Sequence[int],
    ) -> bool:
        return index_sum(body, orbits_at(branches, body, value), periods, resting).is_complete

    def _steady_grazes(self, strobe: StrobeMap) -> Iterator[float]:
        """Yield the values at which the motion without impacts begins or ends to meet a stop."""

        def is_clear(value: float) -> bool | None:
            try:
                body = strobe.body(value)
            except (SceneError, UsageError):
                return None  # the scene has no body there
            return None if why_without_sum(body) else clears_stops(body)

        values = np.linspace(self.settings.lowest, self.settings.highest, STEADY_VALUES)
        clear = [is_clear(float(each)) for each in values]
        for place in range(STEADY_VALUES - 1):
            if None in (clear[place : place + 2]) or clear[place] == clear[place + 1]:
                continue
            same, changed = float(values[place]), float(values[place + 1])
            while abs(changed - same) > 0.1 * NARROWEST * self.settings.span:
                middle = 0.5 * (same + changed)
                same, changed = (middle, changed) if is_clear(middle) == clear[place] else (same, middle)
            yield changed

    def _search(
        self, strobe: StrobeMap, body: ImpactingBody, value: float, periods: int, branches: Sequence[Branch]
    ) -> Iterator[PeriodicOrbit]:
        """Yield orbits that are not known, found from many starts; nothing where a search was before.

        After `MOST_SEARCHES` there are no more.
        """
        if (value, periods) in self._places:
            return
        if self.searched == MOST_SEARCHES[body.frequencies.size == 1]:
            self.is_cut_short = True
            return
        self._places.add((value, periods))
        self.searched += 1
        if body.frequencies.size == 1:
            candidates = strobe.orbits(value, periods)
            self.started += GRID_STARTS
        else:
            counts = range(1, MOST_IMPACTS_A_PERIOD * periods + 1)
            candidates = (orbit for p in counts for orbit in each_orbit(body, p, periods, starts=self.starts))
            self.started += self.starts * (len(counts) - 1)
        for orbit in candidates:
            # an orbit found before may have brought a branch that holds this one, too
            known = orbits_at(branches, body, value)
            if orbit.is_physical and not any(same_orbit(orbit, other) for other in known):
                self.found += 1
                yield orbit

    @property
    def incomplete(self) -> list[CheckedValue]:
        """The values at which a sum is not 1."""
        return [each for each in self.values if not each.is_complete]

    @property
    def lines(self) -> list[str]:
        """Lines on the check: its reason where there is none, else its sums, its searches, and what is missing."""
        if self.reason:
            return [f"No self-check by index sums: the body has {self.reason}."]
        if not self.values:
            return []
        whole = len(self.values) - len(self.incomplete)
        rows = []
        if self.steady_grazes:
            values = ", ".join(f"{each:.8g}" for each in self.steady_grazes)
            rows.append(f"The motion without impacts begins or ends to meet a stop at {values}.")
        rows.append(
            f"Index sums over {_all(PERIODS)} are 1 in {whole} of {counted(len(self.values), 'range')} "
            "between special points."
        )
        if self.searched:
            rows.append(
                f"{self.searched} times a search began where a sum was not 1: {counted(self.started, 'start')}, "
                f"{counted(self.found, 'further orbit')} found."
            )
        if self.is_cut_short:
            rows.append("There were no more searches: a smaller range has more for each part of it.")
        return [*rows, *self._sums()]

    def _sums(self) -> Iterator[str]:
        """Yield the terms of the sums; neighbouring ranges with the same terms are one."""
        for _, group in itertools.groupby(self.values, lambda each: tuple(map(str, each.sums))):
            first, *others = group
            low, high = first.between[0], (others or [first])[-1].between[1]
            texts = {
                str(each): [other.periods for other in first.sums if str(other) == str(each)]
                for each in first.sums
            }
            parts = (f"{text} over {_all(periods)}" for text, periods in texts.items())
            words = "Indices" if first.is_complete else "Orbits are missing"
            yield f"{words} from {low:.8g} to {high:.8g}: {'; '.join(parts)}."


def _all(periods: Sequence[int]) -> str:
    """Return numbers of periods in words: `1 period`, `1 and 2 periods`."""
    return f"{' and '.join(map(str, periods))} period{'s' * (list(periods) != [1])}"


def between_special_points(
    branches: Sequence[Branch], settings: FollowSettings, others: Sequence[float] = ()
) -> list[tuple[float, float]]:
    """Return the ranges between neighbouring special points, other values, and ends of the range.

    Ends of unfinished branches count, too.
    """
    values = [*others, *(point.at.value for branch in branches for point in branch.points)]
    for branch in branches:
        reasons = zip(branch.ends, (0, -1) if len(branch.ends) == 2 else (-1,), strict=False)
        values += [branch.orbits[place].value for reason, place in reasons if reason.startswith(LOST)]
    inside = [each for each in values if settings.lowest < each < settings.highest]
    ends = sorted({settings.lowest, settings.highest, *inside})
    narrowest = NARROWEST * settings.span
    return [(low, high) for low, high in itertools.pairwise(ends) if high - low > narrowest]


def orbits_at(branches: Sequence[Branch], body: ImpactingBody, value: float) -> list[PeriodicOrbit]:
    """Return the orbits of the branches at a value of the number, and their mirror images.

    An orbit that is its own mirror image comes twice.
    """
    found = []
    for branch in branches:
        values = branch.values - value
        # an orbit at the value itself counts as one beyond it
        beyond = values >= 0.0
        for place in np.flatnonzero(beyond[:-1] != beyond[1:]):
            one, other = branch.orbits[place].orbit, branch.orbits[place + 1].orbit
            share = values[place] / (values[place] - values[place + 1])
            phases = one.phases + share * (other.phases - one.phases)
            orbit = _near(body, phases, one)
            images = [] if orbit is None else [orbit, mirror_image(orbit)]
            found += [each for each in images if each is not None]
    return found


def _near(body: ImpactingBody, phases: Floats, like: PeriodicOrbit) -> PeriodicOrbit | None:
    """Return the orbit near phases, with the contacts of another orbit; None if there is none."""
    try:
        return find_orbit(body, phases, like.contacts.tolist(), like.periods)
    except (OrbitError, UsageError):
        return None
