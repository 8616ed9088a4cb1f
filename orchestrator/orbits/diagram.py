"""The study `diagram`: sweep, branches, shares of basins and exponents over a number; classes and loci over two."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from typing import Any, Self

import xarray as xr

from vibroimpact.analysis.dataset.composed import composed
from vibroimpact.analysis.dataset.reading import opened_in_memory
from vibroimpact.analysis.dataset.schema import names_list
from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.analysis.study import Study
from vibroimpact.fmus.errors import DatasetError, SceneError, UsageError, VibroimpactError
from vibroimpact.fmus.messages import typed
from vibroimpact.fmus.terminal import say
from vibroimpact.orchestrator.operations.diagram import MakeDiagram
from vibroimpact.orchestrator.orbits.basin_shares import BasinShares
from vibroimpact.orchestrator.orbits.follow import Following
from vibroimpact.orchestrator.orbits.lyapunov import ExponentsOfRuns
from vibroimpact.orchestrator.orbits.planes import Plane
from vibroimpact.orchestrator.orbits.swept_runs import (
    CLASSIFIED_PERIODS,
    EXPONENT_PERIODS,
    Axis,
    SweptRuns,
    axes_of,
)
from vibroimpact.orchestrator.run.provenance import scene_attributes
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene
from vibroimpact.orchestrator.study.preparing import with_modes

HISTORY = "diagram made by vibroimpact"
OF_ONE, OF_TWO = ("sweep", "branches", "shares", "exponents"), ("sweep", "loci")
"""Names of the parts over one parameter, and over two, in the order in which they are made."""
REFUSALS = (UsageError, SceneError, DatasetError, OrbitError)
"""Errors by which a study says that a scene cannot have its results."""


@dataclass(eq=False)
class Diagram(Study[str]):
    """Parts of a diagram, each by its own study: see `vibroimpact.diagram`. A row names the part at work."""

    name = "diagram"
    nothing = "a part"
    begins = "Sweeping"

    scene: Scene
    parameter: str | None = None
    start: float | None = None
    stop: float | None = None
    values: int | None = None
    parts: Sequence[str] | None = None
    points: int = 60
    share_values: int = 41
    impacts: int | None = None
    periods: int = 1
    doublings: int = 1
    grazes: int = 1
    second: str | None = None
    second_range: tuple[float, float] | None = None
    second_values: int | None = None

    def __post_init__(self) -> None:
        second = (self.second, *(self.second_range or (None, None)), self.second_values)
        self.axes = axes_of(self.scene, (self.parameter, self.start, self.stop, self.values), second)
        self.scene = _within(self.scene.unswept([axis.key for axis in self.axes]), self.axes[1:])
        self.names = _chosen(self.parts, OF_TWO if len(self.axes) > 1 else OF_ONE)
        self.studies = {name: self._study_of(name) for name in self.names if name != "exponents"}
        self.refused: dict[str, str] = {}

    @classmethod
    def prepare(cls, options: MakeDiagram, stack: ExitStack) -> Self:
        """Open the scene."""
        low, high = options.second_start, options.second_stop
        if (low is None) != (high is None):
            raise UsageError("--second: expected --second-from and --second-to together, got one of them.")
        return cls(
            with_modes(opened_scene(options.scene, options.changes or ())),
            *(options.parameter, options.start, options.stop, options.values),
            parts=None if options.parts is None else options.parts.split(","),
            points=options.points,
            share_values=options.share_values,
            impacts=options.impacts,
            periods=options.periods,
            doublings=options.doublings,
            grazes=options.grazes,
            second=options.second,
            second_range=None if low is None or high is None else (low, high),
            second_values=options.second_values,
        )

    def rows(self) -> Generator[str, None, None]:
        """Make the parts one after the other; a part that the scene cannot have leaves the others.

        UsageError, SceneError, DatasetError, OrbitError: the scene can have none of the parts.
        """
        problems: dict[str, VibroimpactError] = {}
        for part in self.names:
            self.interruption = f"Interrupted: the above is what was found, up to the part {part}."
            self.status(part)
            try:
                yield from self._rows_of(part)
            except REFUSALS as problem:
                problems[part], self.refused[part] = problem, problem.message
        if problems and self.is_empty:
            raise next(iter(problems.values()))

    def _rows_of(self, part: str) -> Generator[str, None, None]:
        if part == "exponents":
            self.studies[part] = self._study_of(part)
        study = self.studies[part]
        study.status = lambda text: self.status(f"{part}: {text}")
        with closing(study.rows()) as rows:
            for row in rows:
                study.take(row)
                yield part
        study.incomplete = ""
        if not _has_results(study):
            raise OrbitError(_why_nothing(study))

    def _study_of(self, part: str) -> Study[Any]:
        """Return the study of a part; UsageError for a number that it cannot take."""
        axis = self.axes[0]
        if part == "sweep":
            periods = EXPONENT_PERIODS if "exponents" in self.names else CLASSIFIED_PERIODS
            return SweptRuns(self.scene, self.axes, periods)
        if part == "exponents":
            return ExponentsOfRuns(opened_in_memory(self.studies["sweep"].dataset))
        if part == "shares":
            plane = Plane(points=(self.points, self.points))
            return BasinShares(self.scene, plane, axis.key, (axis.low, axis.high), self.share_values)
        for name, least in (("impacts", 1), ("periods", 1), ("doublings", 0), ("grazes", 0)):
            given = getattr(self, name)
            if given is not None and given < least:
                raise UsageError(f"--{name}: expected {least} or more, got {given}.")
        second = self.axes[1] if part == "loci" else None
        return Following(
            *(self.scene, axis.key, axis.low, axis.high, self.impacts, self.periods),
            doublings=self.doublings,
            grazes=self.grazes,
            second=None if second is None else second.key,
            second_range=None if second is None else (second.low, second.high),
        )

    @property
    def made_parts(self) -> dict[str, Study[Any]]:
        """The studies with results by the names of their parts, also unfinished ones."""
        return {name: study for name, study in self.studies.items() if _has_results(study)}

    @property
    def is_empty(self) -> bool:
        """Whether no part has results."""
        return not self.made_parts

    def made(self) -> xr.Dataset:
        """Return the parts that have results."""
        attributes = scene_attributes(self.scene, HISTORY) | {
            "units_system": self.scene.units,
            "parameters": " ".join(axis.key for axis in self.axes),
            "refused": "\n".join(f"{name}: {problem}" for name, problem in self.refused.items()),
        }
        parts = {name: study.dataset for name, study in self.made_parts.items()}
        return composed(self.name, parts, attributes)

    def print_results(self) -> None:
        """Print the results of each part, and the reasons for missing parts."""
        for study in self.made_parts.values():
            if isinstance(study, ExponentsOfRuns):
                study.print_summary()
            else:
                study.print_results()
        for name, problem in self.refused.items():
            say(f"No {name}: {typed(problem)}")


def _has_results(study: Study[Any]) -> bool:
    """Return whether a study has results; branches are none where loci are the part."""
    if isinstance(study, Following) and study.second is not None:
        return bool(study.loci.loci)
    return not study.is_empty


def _why_nothing(study: Study[Any]) -> str:
    """Return the reason for which a finished study has no results."""
    if isinstance(study, ExponentsOfRuns):
        return study.why_none
    return "diagram: expected bifurcations that can be followed over both numbers, got none."


def _chosen(given: Sequence[str] | None, known: Sequence[str]) -> list[str]:
    """Return the parts to make, in their order; UsageError for unknown names, and for exponents without a sweep."""
    if given is None:
        return list(known)
    names = [name.strip() for name in given]
    if not names or (unknown := [name for name in names if name not in known]):
        got = names_list([repr(name) for name in unknown]) if names else "none"
        raise UsageError(f"diagram: parts: expected some of {', '.join(known)}, got {got}.")
    if "exponents" in names and "sweep" not in names:
        raise UsageError(
            "diagram: parts: expected sweep beside exponents, which are those of its runs, got none."
        )
    return [name for name in known if name in names]


def _within(scene: Scene, second: Sequence[Axis]) -> Scene:
    """Return a scene whose second number, if there is one, lies in its range: in the middle if it lay outside."""
    for axis in second:
        with suppress(UsageError):  # a key that the scene does not have is refused by its sweep
            if not axis.low <= float(scene.value(axis.key)) <= axis.high:
                return scene.with_values({axis.key: axis.middle})
    return scene
