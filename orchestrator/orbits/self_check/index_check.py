"""The self-check of followed branches: index sums between all special points, and the search where a sum is not 1."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.analysis.orbits import ImpactingBody, OrbitError, PeriodicOrbit, find_orbit
from vibroimpact.analysis.orbits.branch import Branch
from vibroimpact.analysis.orbits.following import FollowSettings
from vibroimpact.analysis.orbits.index_sum import (
    IndexSum,
    IndexTerm,
    clears_stops,
    index_sum,
    why_without_sum,
)
from vibroimpact.analysis.orbits.recurrences import MOST_RECURRENCES
from vibroimpact.analysis.orbits.search import each_orbit, same_orbit
from vibroimpact.analysis.orbits.symmetry import mirror_image
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.messages import counted
from vibroimpact.orchestrator.orbits.ends_of_runs import RunEnd
from vibroimpact.orchestrator.orbits.self_check.strobe_map import GRID_STARTS, IMPACT_LIMIT, StrobeMap
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.scene import Scene

PERIODS = (1, 2)
"""Forcing periods of the strobe maps that are checked."""
NARROWEST = 1e-8
"""Distance of two special points, over the range, below which nothing is checked between them."""
SAME_POINT = 1e-9
"""Distance of two special points, over the range, below which they are one: their errors."""
STEADY_GRAZE = 1e-10
"""Error of a value at which the motion without impacts meets a stop, over the range."""
STEADY_VALUES = 65
"""Values of the range between which the motion without impacts is watched for meeting a stop."""
LOST = "cannot be followed"
"""Beginning of the reason of a branch's end that is no special point."""
MOST_SEARCHES = {True: 64, False: 8}
"""Number of searches for missing orbits of a body of one mode, and of several modes, whose searches take longer."""
NEAREST_ENDS = 4
"""Number of nearest runs over the range whose ends start runs at a value."""
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
class Finds:
    """The finds of the searches at a value.

    Attributes
    ----------
    searched : set of int
        Forcing periods of the strobe maps that were searched.
    orbits : list of PeriodicOrbit
        Further orbits; no branch need hold them.
    located : dict of int to list of IndexTerm
        Further fixed points of the strobe map, which are no orbits of equations.md 4.7, by its periods.
    undecided : int
        Number of cells in which a fixed point must be and was not found.
    rests : dict of int to list of array
        Strobe states of the orbits that rest on a stop, by the periods of the strobe map.
    of_branches : tuple of int and list of PeriodicOrbit
        Number of branches, and their orbits at the value.
    """

    searched: set[int] = field(default_factory=set)
    orbits: list[PeriodicOrbit] = field(default_factory=list)
    located: dict[int, list[IndexTerm]] = field(default_factory=dict)
    undecided: int = 0
    rests: dict[int, list[Floats]] = field(default_factory=dict)
    of_branches: tuple[int, list[PeriodicOrbit]] = (0, [])


@dataclass(frozen=True, slots=True)
class Place:
    """A value of the number, with all that is known there."""

    value: float
    body: ImpactingBody
    branches: Sequence[Branch]
    finds: Finds
    strobe: StrobeMap
    starts: Sequence[State]

    @property
    def orbits(self) -> list[PeriodicOrbit]:
        """The known orbits: those of branches, and finds."""
        count, known = self.finds.of_branches
        if count != len(self.branches):
            known = orbits_at(self.branches, self.body, self.value)
            self.finds.of_branches = len(self.branches), known
        return [*known, *self.finds.orbits]

    def rests(self, periods: int) -> list[Floats]:
        """Return the strobe states of the orbits that rest on a stop."""
        if periods not in self.finds.rests:
            self.finds.rests[periods] = self.strobe.rests(self.value, periods, self.starts)
        return self.finds.rests[periods]

    def sum(self, periods: int) -> IndexSum:
        """Return the index sum over some periods."""
        resting = [len(each) for each in self.rests(periods)]
        return index_sum(self.body, self.orbits, periods, resting, self.finds.located.get(periods, ()))


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
    has_several_modes : bool
        Whether the body has several modes, whose searches are not complete.
    narrow : int
        Number of ranges between special points that are too narrow to be checked.
    """

    scene: Scene
    parameter: str
    settings: FollowSettings
    starts: int
    ends: Sequence[RunEnd] = ()
    reason: str = ""
    values: list[CheckedValue] = field(default_factory=list)
    steady_grazes: list[float] = field(default_factory=list)
    searched: int = 0
    started: int = 0
    found: int = 0
    is_cut_short: bool = False
    has_several_modes: bool = False
    narrow: int = 0
    _places: dict[float, Finds] = field(default_factory=dict)

    def missing(self, branches: Sequence[Branch]) -> Iterator[tuple[float, PeriodicOrbit]]:
        """Yield values and orbits that no branch holds there, found where a sum is not 1; keep the sums.

        The branches may grow meanwhile; sums at later values count what has been added.
        """
        self.values = []
        with StrobeMap(self.scene, self.parameter) as strobe:
            self.steady_grazes = list(self._steady_grazes(strobe))
            ranges = between_special_points(branches, self.settings, self.steady_grazes)
            widths = np.array([high - low for low, high in ranges]) / self.settings.span
            self.narrow = int(np.count_nonzero((widths > SAME_POINT) & (widths <= NARROWEST)))
            for low, high in itertools.compress(ranges, widths > NARROWEST):
                value = 0.5 * (low + high)
                try:
                    body = strobe.body(value)
                except (SceneError, UsageError):
                    continue  # the scene has no body there, such as with a restitution above 1
                self.reason = why_without_sum(body)
                if self.reason:
                    self.values = []
                    return
                self.has_several_modes = body.frequencies.size > 1
                finds = self._places.setdefault(value, Finds())
                place = Place(value, body, branches, finds, strobe, self._starts_near(value))
                for periods in PERIODS:
                    if place.sum(periods).is_complete:
                        continue
                    for orbit in self._search(place, periods):
                        yield value, orbit
                    if not place.sum(periods).is_complete:
                        break  # the same orbits are missing in the sums of more periods
                self.values.append(CheckedValue(value, (low, high), tuple(map(place.sum, PERIODS))))

    def _starts_near(self, value: float) -> list[State]:
        """Return the last states of the nearest runs over the range that end on no orbit of equations.md 4.7."""
        nearest = sorted(self.ends, key=lambda each: abs(each.value - value))[:NEAREST_ENDS]
        return [each.state for each in nearest if each.orbit is None and each.state is not None]

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
            while abs(changed - same) > STEADY_GRAZE * self.settings.span:
                middle = 0.5 * (same + changed)
                same, changed = (middle, changed) if is_clear(middle) == clear[place] else (same, middle)
            yield changed

    def _search(self, place: Place, periods: int) -> Iterator[PeriodicOrbit]:
        """Yield orbits that are not known, found from many starts; nothing where a search was before.

        After `MOST_SEARCHES` there are no more.
        """
        if periods in place.finds.searched:
            return
        has_one_mode = place.body.frequencies.size == 1
        if self.searched == MOST_SEARCHES[has_one_mode]:
            self.is_cut_short = True
            return
        place.finds.searched.add(periods)
        self.searched += 1
        if has_one_mode:
            candidates = place.strobe.orbits(place.value, periods)
            self.started += GRID_STARTS
        else:
            counts = range(1, MOST_IMPACTS_A_PERIOD * periods + 1)
            trains = (
                orbit for p in counts for orbit in each_orbit(place.body, p, periods, starts=self.starts)
            )
            candidates = itertools.chain(trains, place.strobe.passed(place.value, periods, place.starts))
            self.started += self.starts * (len(counts) - 1) + MOST_RECURRENCES * (1 + len(place.starts))
        yield from self._new(place, candidates)
        if has_one_mode and not place.sum(periods).is_complete:
            located = place.strobe.located(place.value, periods, place.orbits, place.rests(periods))
            place.finds.located[periods] = located.terms
            place.finds.undecided += located.undecided
            yield from self._new(place, located.orbits)

    def _new(self, place: Place, orbits: Iterable[PeriodicOrbit]) -> Iterator[PeriodicOrbit]:
        """Yield and keep the physical orbits that are not known."""
        for orbit in orbits:
            # an orbit found before may have brought a branch that holds this one, too
            if orbit.is_physical and not any(same_orbit(orbit, other) for other in place.orbits):
                self.found += 1
                place.finds.orbits.append(orbit)
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
        return [*rows, *self._limits(), *self._sums()]

    def _limits(self) -> Iterator[str]:
        """Yield lines on orbits that are counted and not followed, and on orbits that no search finds."""
        if self.narrow:
            yield f"Narrower than {NARROWEST:g} of the whole, and not checked: {counted(self.narrow, 'range')}."
        finds = [self._places[each.value] for each in self.values]
        located = {term.name for each in finds for terms in each.located.values() for term in terms}
        if located:
            yield f"Counted, not followed: {', '.join(sorted(located))}, which the strobe map itself locates."
        if undecided := sum(each.undecided for each in finds):
            yield (
                f"The strobe map has {counted(undecided, 'further fixed point')} that no run with at most "
                f"{IMPACT_LIMIT} impacts a period shows."
            )
        if self.incomplete and self.has_several_modes:
            yield (
                f"Several modes: orbits with more than {MOST_IMPACTS_A_PERIOD} impacts a period are found only near "
                "runs; those with a complete chatter are counted where runs end on them, not where they are unstable."
            )

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
    same = SAME_POINT * settings.span
    return [(low, high) for low, high in itertools.pairwise(ends) if high - low > same]


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
