"""The protocol of runners: a runner opens a scene and runs its points, and each point becomes a row.

A runner has `run` and `close`. A runner that can take many points at once has its own `rows`, too; callers of `rows`
need not know the difference.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from vibroimpact.analysis.dataset import Direction, Outcome, RunRecord
from vibroimpact.analysis.dataset.columns import RunColumns
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.orchestrator.run.empty_record import empty_record
from vibroimpact.orchestrator.run.points import BranchPoint, PointColumns, State
from vibroimpact.orchestrator.scene import Scene

OTHER_ENGINE = 1
"""Version of the engine for other components, and for bodies of releases without a version number."""

CARRYING = (Outcome.ok, Outcome.stuck)
"""Outcomes whose final state is handed on along a branch: the run came to its end, at forcing phase 0."""

Rows = tuple[Sequence[RunRecord] | RunColumns, State | None]
"""The records of points, and the start state of the next point of the branch."""


@dataclass(frozen=True, slots=True)
class RunnerIdentity:
    """The properties of a runner that all points of a campaign share, so that their rows can be compared."""

    execution: str
    instruction_set: str
    fmu_hashes: Mapping[str, str]
    engine: int = OTHER_ENGINE


class Runner(ABC):
    """Runs the points of one scene.

    Attributes
    ----------
    scene : Scene
    execution : str
        Way of running the scene.
    instruction_set : str
        Instruction set of the machine code.
    fmu_hashes : mapping of str to str
        Content hash of each loaded FMU.
    engine : int
        Version of the engine that follows the bodies.
    """

    scene: Scene
    execution: str
    instruction_set: str
    fmu_hashes: Mapping[str, str]
    engine: int = OTHER_ENGINE

    @property
    def identity(self) -> RunnerIdentity:
        """The properties that all points of a campaign share."""
        return RunnerIdentity(self.execution, self.instruction_set, dict(self.fmu_hashes), self.engine)

    @abstractmethod
    def run(self, values: Mapping[str, float], start: State | None = None) -> RunRecord:
        """Run one point from a carried state, or from the scene's own start state."""

    @abstractmethod
    def close(self) -> None:
        """Free the components."""

    def record_of(self, values: Mapping[str, float], start: State | None = None) -> RunRecord:
        """Return the record of one point; a failure becomes a record with the outcome `error`."""
        began = time.perf_counter()
        try:
            return self.run(values, start)
        except (VibroimpactError, ArithmeticError, ValueError) as error:
            # a failed point becomes a row with its message, so that the sweep goes on
            return empty_record(self.scene, Outcome.error, str(error), time.perf_counter() - began)

    def rows(self, points: PointColumns, start: State | None = None, deadline: float = math.inf) -> Rows:
        """Run points in their order; along a branch with a direction each starts where the point before ended.

        Parameters
        ----------
        points : PointColumns
        start : tuple of float or None
            Start state of the first point, where it does not begin a branch.
        deadline : float
            Time after which no point begins, except the first; s of `time.perf_counter`.

        Returns
        -------
        records : sequence of RunRecord, or RunColumns
            Records of the points that ran, from the first point on.
        carried : tuple of float or None
            Start state of the next point of the branch; a run that ended early hands on its own start state.
        """
        return self.rows_one_by_one(points.places(), start, deadline)

    def rows_one_by_one(
        self, points: Iterable[BranchPoint], start: State | None, deadline: float
    ) -> tuple[list[RunRecord], State | None]:
        """Run points one by one, see `rows`."""
        carried = start
        records = []
        for place in points:
            given = place.start if place.first else carried
            record = self.record_of(place.point.values, given)
            records.append(record)
            carried = None if place.direction is Direction.independent else next_start(record, given)
            if time.perf_counter() > deadline:
                break
        return records, carried

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def next_start(record: RunRecord, start: State | None) -> State | None:
    """Return the state that a run, started from `start`, hands on along its branch."""
    end: State = (record.final_displacement, record.final_velocity)
    if record.final_state is not None:
        end = tuple(record.final_state.tolist())
    usable = record.outcome in CARRYING and all(map(math.isfinite, end))
    return end if usable else start
