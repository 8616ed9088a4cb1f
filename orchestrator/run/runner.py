"""The protocol of runners: a scene is opened, what is opened runs points, and a point becomes a row.

A runner gives `run` and `close`. One that can take many points at once gives `rows` too; whoever asks for rows does
not know how they are made.
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
"""Version of the engine of components that are not ours, and of bodies before there was a number."""

CARRYING = (Outcome.ok, Outcome.stuck)
"""Outcomes whose final state is handed on along a branch: the run came to its end, at forcing phase 0."""

Rows = tuple[Sequence[RunRecord] | RunColumns, State | None]
"""What points recorded, and the state that the next point of the branch starts from."""


@dataclass(frozen=True, slots=True)
class RunnerIdentity:
    """What must be the same for all points of a campaign, or its rows could not be compared."""

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
        Which way of running the scene it uses.
    instruction_set : str
        The instruction set of the machine code it runs.
    fmu_hashes : mapping of str to str
        Content hash of each FMU it loaded.
    engine : int
        Version of what follows the bodies.
    """

    scene: Scene
    execution: str
    instruction_set: str
    fmu_hashes: Mapping[str, str]
    engine: int = OTHER_ENGINE

    @property
    def identity(self) -> RunnerIdentity:
        """What a campaign wants to be the same for all of its points."""
        return RunnerIdentity(self.execution, self.instruction_set, dict(self.fmu_hashes), self.engine)

    @abstractmethod
    def run(self, values: Mapping[str, float], start: State | None = None) -> RunRecord:
        """Run one point from a carried state, or from the scene's own start state."""

    @abstractmethod
    def close(self) -> None:
        """Free the components."""

    def record_of(self, values: Mapping[str, float], start: State | None = None) -> RunRecord:
        """Run one point; whatever goes wrong with it becomes a record with the outcome `error`."""
        began = time.perf_counter()
        try:
            return self.run(values, start)
        except (VibroimpactError, ArithmeticError, ValueError) as error:
            # A point that fails is a row that says so: the sweep is worth more than the point.
            return empty_record(self.scene, Outcome.error, str(error), time.perf_counter() - began)

    def rows(self, points: PointColumns, start: State | None = None, deadline: float = math.inf) -> Rows:
        """Run points in their order; along a branch with a direction each starts where the one before ended.

        Parameters
        ----------
        points : PointColumns
        start : tuple of float or None
            State that the first one goes on from, where it does not begin a branch.
        deadline : float
            No point begins after it, except the first; s of `time.perf_counter`.

        Returns
        -------
        records : sequence of RunRecord, or RunColumns
            Of the points that were run: the first of them.
        carried : tuple of float or None
            Where the next point of the branch starts; a run that did not come to its end hands on what it was given.
        """
        return self.rows_one_by_one(points.places(), start, deadline)

    def rows_one_by_one(
        self, points: Iterable[BranchPoint], start: State | None, deadline: float
    ) -> tuple[list[RunRecord], State | None]:
        """Run points each by itself, see `rows`."""
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
    """Return the state that a run from a state hands on along its branch."""
    end: State = (record.final_displacement, record.final_velocity)
    if record.final_state is not None:
        end = tuple(record.final_state.tolist())
    usable = record.outcome in CARRYING and all(map(math.isfinite, end))
    return end if usable else start
