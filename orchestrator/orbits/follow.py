"""The study `follow`: orbits over one number of a scene, and their bifurcations over two numbers."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Self

import numpy as np
import xarray as xr

from vibroimpact.analysis.orbits.branch import Branch, SpecialPoint
from vibroimpact.analysis.orbits.branches import mirror_images, multiplier_text
from vibroimpact.analysis.orbits.corners import AT_YIELD_VELOCITY
from vibroimpact.analysis.orbits.following import STABILITY_CHANGE, FollowSettings
from vibroimpact.analysis.orbits.loci.fold_extrema import EXTREMA
from vibroimpact.analysis.orbits.periodic import grazes
from vibroimpact.analysis.orbits.pitchforks import DEGENERATE
from vibroimpact.analysis.orbits.search import STARTS
from vibroimpact.analysis.study import Study
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import counted
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.operations.follow import Follow
from vibroimpact.orchestrator.orbits.beginning import files_of, orbit_start, refuse_contradictions
from vibroimpact.orchestrator.orbits.branches import (
    HISTORY,
    Followed,
    Meeting,
    follow_branches,
    refuse_nothing,
)
from vibroimpact.orchestrator.orbits.loci import (
    COARSE,
    FollowedLoci,
    at_other_values,
    find_isolas,
    follow_loci,
    refuse_second,
    sheets_of,
)
from vibroimpact.orchestrator.orbits.seeds import Seed
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene

EXACT_DIGITS, UNEXPLAINED_DIGITS = 11, 6
"""Digits of a special point's value: for a zero of a test function, and for a bracket without a test function."""
MARGINAL = 1e-9
"""Distance of a multiplier from the unit circle below which it is on it."""


@dataclass(eq=False)
class Following(Study[str]):
    """Orbits of a scene over one of its numbers: see `vibroimpact.follow`. A row names the branch or locus at work."""

    name = "follow"
    nothing = "an orbit"
    begins = "Looking for orbits"
    history = HISTORY
    mark = ""
    interruption = "Interrupted: the above is what was followed."

    scene: Scene
    parameter: str
    start: float
    stop: float
    impacts: int | None = None
    periods: int = 1
    seed: Seed | None = None
    doublings: int = 1
    grazes: int = 1
    step: float = 0.01
    starts: int = STARTS
    second: str | None = None
    second_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        self.followed = Followed(self.scene, self.parameter)
        self.loci = FollowedLoci(self.followed, self.second or "")

    @classmethod
    def reads(cls, options: Follow) -> Sequence[Path]:
        """Return scene and dataset."""
        return [options.scene, *files_of(options)]

    @classmethod
    def prepare(cls, options: Follow, stack: ExitStack) -> Self:
        """Open the scene, at the values of the run that is on the orbit."""
        refuse_contradictions(options)
        changes, second_range = options.changes or (), _second_range(options)
        opened = opened_scene(options.scene, changes, for_orbits=True)
        first = orbit_start(options, opened, changes, [options.parameter])
        return cls(
            *(first.scene, options.parameter, options.start, options.stop),
            impacts=first.impacts,
            periods=1 if first.periods is None else first.periods,
            seed=first.seed,
            doublings=options.doublings,
            grazes=options.grazes,
            step=options.step,
            starts=options.starts,
            second=options.second,
            second_range=second_range,
        )

    def rows(self) -> Generator[str, None, None]:
        """Follow branches, then their bifurcations, also those of branches at other values of the second number."""
        first, *others = self._settings()
        for each in others:
            refuse_second(self.loci, each)
        is_searched = self.seed is None and self.impacts in (None, 1)
        yield from self._branches(self.followed, self.step, required=not (others and is_searched))
        for each in others:
            yield from self._loci(first, each, self.followed)
            if is_searched:
                yield from self._over_second(first, each)
        if self.is_empty:
            refuse_nothing(self.followed, first, self.impacts, self.periods, self.starts)

    def _over_second(self, first: FollowSettings, second: FollowSettings) -> Generator[str, None, None]:
        """Follow the branches at further values of the second number, connect them, and follow their bifurcations."""
        for followed in at_other_values(self.loci, second):
            yield from self._branches(followed, max(self.step, COARSE), required=False)
            yield from self._loci(first, second, followed)
        coarse = replace(first, longest=max(self.step, COARSE))
        sheets = sheets_of(self.loci, coarse, second, self.doublings, self.grazes)
        yield from (branch.name for branch, _ in sheets.connect())
        for _, followed in sheets.levels:
            yield from self._loci(first, second, followed)
        known = len(self.loci.levels)
        yield from (branch.name for branch, _ in find_isolas(self.loci, sheets, first, second))
        for followed in self.loci.levels[known:]:
            yield from self._loci(first, second, followed)

    def _branches(
        self, followed: Followed, step: float, *, required: bool = True
    ) -> Generator[str, None, None]:
        orbits = follow_branches(
            *(followed, self.start, self.stop),
            impacts=self.impacts,
            periods=self.periods,
            seed=self.seed,
            doublings=self.doublings,
            grazes=self.grazes,
            longest=step,
            starts=self.starts,
            looking=lambda value: self.status(f"{self.begins}, {self.parameter} {value:.6g}"),
            required=required,
            checked=followed is self.followed,
        )
        for branch, orbit in orbits:
            if len(branch.orbits) % 20 == 1:
                many = counted(len(branch.orbits), "orbit")
                self.status(f"{branch.name}: {many}, {self.parameter} {orbit.value:.6g}")
            yield branch.name

    def _loci(
        self, first: FollowSettings, second: FollowSettings, followed: Followed
    ) -> Generator[str, None, None]:
        for locus in follow_loci(self.loci, first, second, followed, self.grazes):
            self.status(f"{locus.kind}: {counted(len(locus.points), 'orbit')}")
            yield locus.kind

    def _settings(self) -> list[FollowSettings]:
        ranges = [(self.start, self.stop), *([self.second_range] if self.second_range else [])]
        return [FollowSettings(min(ends), max(ends), self.step) for ends in ranges]

    @property
    def is_empty(self) -> bool:
        """Whether there is no branch, and no curve over two numbers."""
        return not self.followed.branches and not self.loci.loci

    def made(self) -> xr.Dataset:
        """Return the curves over two numbers if there are any, else the branches."""
        return self.loci.dataset if self.loci.loci else self.followed.dataset

    def print_results(self) -> None:
        """Print the special points of each branch, and each curve."""
        self._print_points()
        self._print_branches()
        for meeting in self.followed.meetings:
            say(self._meeting(meeting))
        self._print_unexplained()
        if self.followed.is_cut_short:
            many = len(self.followed.branches)
            say(
                f"After {many} branches no more are begun at special points. Ask for fewer doublings or grazes."
            )
        if self.followed.left:
            say(
                f"Branches of more than {self.followed.most_begun_impacts} impacts that begin at special points: "
                f"{self.followed.left}, not followed. Give a seed, or --impacts and --periods, to follow them."
            )
        for line in (
            self.followed.origins if self.incomplete else [*self.followed.origins, *self.followed.sums]
        ):
            say(line)
        if self.second is not None:
            self._print_loci()
            say(self.loci.left_out)

    def conclude(self, options: Follow) -> None:
        """Say whether the dataset holds curves or branches after a study over two numbers."""
        output = options.output
        if output is not None and self.loci.loci:
            say(f"{output} has the curves over both numbers; branches are written without --second.")
        elif output is not None and self.second is not None:
            say(f"No curves over {self.second} were found: {output} has the branches.")

    def _print_points(self) -> None:
        rows = table(
            f"Orbits over {self.parameter}: {self.scene.title or self.scene.source}",
            *("<orbit", "<what happens", f">{self.parameter}", "<impact velocities", "<largest multipliers"),
        )
        for number, branch in enumerate(self.followed.branches, start=1):
            name = f"{number}  {branch.full_name}"
            for point in branch.points:
                rows.add_row(name, *_cells(branch, point, self.followed.crossings.get(point, point.kind)))
            if not branch.points:
                rows.add_row(name, "nothing", "", "", "")
        wide_terminal().print(rows)

    def _print_branches(self) -> None:
        images = mirror_images(self.followed.branches)
        for number, branch in enumerate(self.followed.branches, start=1):
            low, high = float(branch.values.min()), float(branch.values.max())
            symmetry = "closed; " * branch.is_closed + "symmetric; " * branch.is_symmetric
            if number - 1 in images:
                place = len(self.followed.branches) + 1 + list(images).index(number - 1)
                symmetry = f"{symmetry}its mirror image is branch {place}, {images[number - 1].full_name}; "
            say(
                f"{number}  {branch.full_name}: {counted(len(branch.orbits), 'orbit')} from {low:.8g} to {high:.8g}, "
                f"{_stable_orbits(branch)}; {symmetry}"
                f"begun from {branch.origin}; ends: {', '.join(branch.ends) or 'interrupted'}."
            )

    def _meeting(self, meeting: Meeting) -> str:
        """Return a sentence on the orbits that meet at a graze."""
        number = next(k for k, each in enumerate(self.followed.branches, 1) if each is meeting.branch)
        orbit, value = meeting.point.at.orbit, f"{meeting.point.at.value:.{EXACT_DIGITS}g}"
        others: dict[str, list[str]] = {}
        for each in meeting.departures:
            words = f"{'stable' if each.is_stable else 'unstable'} at {each.side} values"
            others.setdefault(words, []).append(each.start.orbit.full_name)
        parts = [f"{', '.join(names)} ({words})" for words, names in others.items()]
        if grazes(orbit).all():
            parts.insert(0, "rest" if orbit.body.has_own_period else "motion without impacts")
        return (
            f"{number}  {orbit.full_name}: its {meeting.point.kind} at {value} meets "
            f"{'; '.join(parts) or 'no other orbit'}."
        )

    def _print_unexplained(self) -> None:
        for number, branch in enumerate(self.followed.branches, start=1):
            values = [
                f"{point.at.value:.{UNEXPLAINED_DIGITS}g}"
                for point in branch.points
                if point.kind == STABILITY_CHANGE
            ]
            if values:
                say(
                    f"{number}  {branch.full_name}: stability changes at {', '.join(values)}, and no cause was found."
                )

    def _print_loci(self) -> None:
        for name, locus in zip(self.loci.names, self.loci.loci, strict=True):
            rows = np.array([each.values for each in locus.points])
            low, high = rows.min(axis=0), rows.max(axis=0)
            say(
                f"{name}: {counted(len(rows), 'orbit')}, "
                f"{self.parameter} from {low[0]:.8g} to {high[0]:.8g}, "
                f"{self.second} from {low[1]:.8g} to {high[1]:.8g}; ends: {', '.join(locus.ends)}."
            )
            for kind, point in locus.special:
                words = kind if kind in EXTREMA else f"codimension 2, {_two_kinds(locus.kind, kind)}"
                say(f"   {words}: {point.values[0]:.11g}, {point.values[1]:.11g}")
        for line in self.loci.isolas:
            say(line)


def _two_kinds(kind: str, other: str) -> str:
    """Return the kinds of a point of codimension 2 in words."""
    return other if other == DEGENERATE else f"{kind} and {other}"


def _stable_orbits(branch: Branch) -> str:
    """Return the number of stable orbits, and in parentheses their ranges of the followed number if there are any.

    An orbit at a special point has a multiplier on the unit circle: alone it is no stable one.
    """
    groups = [
        list(orbits)
        for is_stable, orbits in groupby(branch.orbits, attrgetter("orbit.is_stable"))
        if is_stable
    ]
    groups = [each for each in groups if len(each) > 1 or abs(each[0].orbit.multipliers[0]) < 1.0 - MARGINAL]
    ends = {id(branch.orbits[0]), id(branch.orbits[-1])}
    if branch.is_closed and len(groups) > 1 and ends == {id(groups[0][0]), id(groups[-1][-1])}:
        groups[0] += groups.pop()
    ranges = [sorted(each.value for each in group) for group in groups]
    shown = ", ".join(f"{each[0]:.6g} to {each[-1]:.6g}" for each in ranges)
    return f"{sum(map(len, groups))} stable{f' ({shown})' if shown else ''}"


def _cells(branch: Branch, point: SpecialPoint, kind: str) -> tuple[str, str, str, str]:
    """Return the kind in words and the value of a special point, velocities and multipliers of its orbit, as texts.

    At a corner the largest multiplier of either side is shown.
    """
    orbit = point.at.orbit
    largest = (
        "" if point.kind == "graze" else ", ".join(multiplier_text(each) for each in orbit.multipliers[:2])
    )
    if point.kind == AT_YIELD_VELOCITY:
        sides = (branch.orbits[point.place + k].orbit.multipliers[0] for k in (0, 1))
        largest = " to ".join(map(multiplier_text, sides))
    speeds = ", ".join(f"{speed:.8g}" if speed > 1e-12 else "0" for speed in orbit.velocities)
    digits = UNEXPLAINED_DIGITS if point.kind == STABILITY_CHANGE else EXACT_DIGITS
    return kind, f"{point.at.value:.{digits}g}", speeds, largest


def _second_range(options: Follow) -> tuple[float, float] | None:
    """Return the range of the second number; UsageError if it is incomplete or empty."""
    low, high = options.second_start, options.second_stop
    given = (options.second is not None, low is not None, high is not None)
    if any(given) and not all(given):
        raise UsageError(
            "--second: expected --second, --second-from and --second-to together, got some of them."
        )
    if low is None or high is None:
        return None
    if low == high:
        raise UsageError("--second-from, --second-to: expected two different numbers, got the same.")
    return min(low, high), max(low, high)
