"""What a worker does with a chunk: run its points, write them as one part, say how that went.

A chunk is a range of neighbouring runs. Everything here runs on a worker; the components
of the scene are loaded once in each process and used for every chunk after that. What a point returns
never depends on how the runs were cut into chunks.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Direction, Outcome, RunRecord, marked, read_part, write_dataset
from vibroimpact.analysis.dataset.columns import RunColumns
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.fmus.errors import CampaignError, VibroimpactError
from vibroimpact.orchestrator.run import AnnouncedRunner, Runner, RunnerIdentity, identity_of, named_runner
from vibroimpact.orchestrator.run.dataset import dataset_of_runs
from vibroimpact.orchestrator.run.empty_record import empty_record
from vibroimpact.orchestrator.run.many_points.loop import PointLoop, PointValues, loop_of
from vibroimpact.orchestrator.run.many_points.loop_rows import run_loop
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import Branch, Point, expand

DEFAULT_RUNNER = "vibroimpact.orchestrator.guard.guarded:make_runner"
"""The class that runs one point, as `module:name`, so that a worker can find it by itself."""

CARRIED = ("carried_displacement", "carried_velocity")
CARRIED_STATE = "carried_state"
"""Attributes of a part: the state that the next run of its branch starts from; two numbers, or an array."""
MANIFEST = "campaign_manifest"
"""Attribute of a part: what its campaign was started with, as `manifest.carried_manifest` returns it."""

CARRYING = (Outcome.ok, Outcome.stuck)
"""Outcomes whose final state is handed on along a branch: the run came to its end, at forcing phase 0."""

State = tuple[float, ...]
"""Displacement (m) and velocity (m/s) of an oscillator; of a structure N displacements, then N velocities."""


@dataclass(frozen=True, slots=True)
class Work:
    """What all chunks of a campaign have in common; small, sent along with each.

    Attributes
    ----------
    scene : Scene
        With an absolute path for its source: a worker may live in another folder.
    parts_folder : str
        Absolute path of the folder that the parts go to.
    runner : str
        The runner class as `module:name`.
    scene_hash : str
        Written into each part, so that a stray part of another campaign is noticed.
    identity : RunnerIdentity or None
        What the runner must be; None while the campaign still asks.
    execution : str
        How points run where the campaign has begun so; empty: as the scene says.
    kept : str
        File with the runs of an earlier sweep that are left out of all chunks; it may be absent.
    branches : tuple of Branch
        The points of a round of an adaptive sweep; empty: those of the scene's sweep.
    manifest : str
        Written into each part, from which `campaign.json` is made again; empty: nothing is written.
    """

    scene: Scene
    parts_folder: str
    runner: str = DEFAULT_RUNNER
    scene_hash: str = ""
    identity: RunnerIdentity | None = None
    execution: str = ""
    kept: str = ""
    branches: tuple[Branch, ...] = ()
    manifest: str = ""


@dataclass(frozen=True, slots=True)
class Chunk:
    """Runs `first` to `stop - 1`; the first is in branch `branch` and starts from `start`.

    Either a stretch of one branch, or several whole branches. `start` is the state (m, m/s) carried from the
    run before; None is the scene's own start state. A chunk that takes longer than
    `most_seconds` ends early, after a point; the rest is left to other chunks.
    """

    branch: int
    first: int
    stop: int
    start: State | None = None
    most_seconds: float = math.inf

    @property
    def count(self) -> int:
        """Number of runs."""
        return self.stop - self.first

    @property
    def part_name(self) -> str:
        """Name of the file that its results go to."""
        return f"branch-{self.branch:06d}_runs-{self.first:010d}-{self.stop:010d}.nc"


@dataclass(frozen=True, slots=True)
class ChunkResult:
    """What a worker says of a chunk whose part is on the disk.

    Attributes
    ----------
    chunk : Chunk
        The runs that the part holds: those asked for, or the first of them.
    carried : tuple of float or None
        The state (m, m/s) that the next run of the branch starts from.
    outcomes : mapping of str to int
        How many runs ended in each way.
    compute_seconds : float
        Wall time of the runs, s.
    """

    chunk: Chunk
    carried: State | None
    outcomes: Mapping[str, int]
    compute_seconds: float


@lru_cache(maxsize=1)
def _opened(scene: Scene, runner: str, execution: str) -> tuple[tuple[Branch, ...], Runner, PointLoop | None]:
    """Return the branches of a scene, what runs their points in this process, and the loop in C over them."""
    opened = named_runner(scene, runner, execution or None)
    return expand(scene), opened, loop_of(scene, opened)


def get_ready(work: Work) -> RunnerIdentity:
    """Load all that a worker needs before its first chunk, and return which runner it has."""
    _, runner, _ = _opened(work.scene, work.runner, work.execution)
    # The first dataset of a process takes long, because libraries load what they need when they need it.
    with ScratchFolder("rehearsal") as folder:
        write_dataset(empty_part(work.scene), Path(folder.name, "rehearsal.nc"))
    return identity_of(runner)


def run_chunk(work: Work, chunk: Chunk) -> ChunkResult:
    """Run the points of a chunk and write them as one part.

    Raises
    ------
    CampaignError
        When this worker's runner is not the one the campaign began with, or the part cannot be written.
    """
    branches, runner, loop = _opened(work.scene, work.runner, work.execution)
    _refuse_other_runner(work, runner)
    began = time.perf_counter()
    points = _points_left(work, work.branches or branches, chunk)
    if not len(points):
        return ChunkResult(chunk, chunk.start, {}, 0.0)
    deadline = began + chunk.most_seconds
    records, carried = run_columns(work.scene, runner, loop, points, chunk.start, deadline)
    seconds = time.perf_counter() - began
    stop = int(points.index[len(records)]) if len(records) < len(points) else chunk.stop
    done = replace(chunk, stop=stop)
    outcomes = write_part(work, done, points.taken(len(records)), records, carried)
    return ChunkResult(done, carried, outcomes, seconds)


def run_columns(
    scene: Scene,
    runner: Runner,
    loop: PointLoop | None,
    points: PointColumns,
    start: State | None,
    deadline: float,
) -> tuple[Sequence[RunRecord] | RunColumns, State | None]:
    """Run points in the quickest way that they allow, see `run_points`."""
    ran = None if loop is None else run_in_loop(scene, runner, loop, points, start, deadline)
    return run_points(scene, runner, points.places(), start, deadline) if ran is None else ran


def run_in_loop(
    scene: Scene,
    runner: Runner,
    loop: PointLoop,
    points: PointColumns,
    start: State | None,
    deadline: float = math.inf,
) -> tuple[RunColumns, State | None] | None:
    """Run points by the loop in C or in lanes; None where they need Python in between.

    The loop has the results of `run_points`, lanes have them to rounding.
    """
    if loop.by_lanes:
        return _run_in_lanes(scene, runner, loop, points, start, deadline)
    prepared = None if points.starts else loop.prepared(PointValues(points.values, points.first))
    if prepared is None:
        return None

    def alone(place: int, given: State | None) -> tuple[RunRecord, State | None]:
        record = run_point(scene, runner, points.place(place).point, given)
        return record, _next_start(record, given)

    return run_loop(loop, prepared, start, deadline, alone)


def _run_in_lanes(
    scene: Scene, runner: Runner, loop: PointLoop, points: PointColumns, start: State | None, deadline: float
) -> tuple[RunColumns, State | None]:
    # what finds points their lanes takes time to load, and only these scenes need it
    from vibroimpact.orchestrator.run.many_points.lanes_rows import LaneValues, run_in_lanes

    begins = np.isin(points.index, list(points.starts)) & points.first
    starts = {int(place): points.starts[int(points.index[place])] for place in np.flatnonzero(begins)}
    whole = LaneValues(points.values, points.first, starts).piece(0, len(points), start)

    def alone(place: int, given: State | None) -> RunRecord:
        return run_point(scene, runner, points.place(place).point, given)

    return run_in_lanes(loop, whole, deadline, alone)


def compute_again(work: Work, chunk: Chunk) -> xr.Dataset:
    """Run the points of a chunk, kept ones too, and return their rows; nothing is written."""
    branches, runner, loop = _opened(work.scene, work.runner, work.execution)
    _refuse_other_runner(work, runner)
    points = columns_of_points(branches, chunk)
    records, _ = run_columns(work.scene, runner, loop, points, chunk.start, math.inf)
    return dataset_of(work.scene, points, records, {})


def write_crashed(work: Work, chunk: Chunk, message: str) -> ChunkResult:
    """Write the part of points that kill the process that runs them; nothing of the points is run."""
    points = _points_left(work, work.branches or expand(work.scene), chunk)
    records = [empty_record(work.scene, Outcome.crash, message, 0.0) for _ in range(len(points))]
    return ChunkResult(chunk, chunk.start, write_part(work, chunk, points, records, chunk.start), 0.0)


def _refuse_other_runner(work: Work, runner: Runner) -> None:
    if work.identity is not None and identity_of(runner) != work.identity:
        raise CampaignError(
            f"worker: expected the runner that the campaign began with ({work.identity}), "
            f"got {identity_of(runner)}. Use workers of one kind of machine with one version of vibroimpact."
        )


@dataclass(frozen=True, slots=True)
class BranchPoint:
    """A point, the direction it is travelled in, whether its branch begins with it, and from which state then."""

    point: Point
    direction: Direction
    first: bool
    start: State | None = None


def points_of(branches: Sequence[Branch], chunk: Chunk) -> list[BranchPoint]:
    """Return the points of a chunk, which may reach over several branches."""
    points: list[BranchPoint] = []
    for branch in branches[chunk.branch :]:
        first = branch.points.first_index
        if first >= chunk.stop:
            break
        direction = Direction[branch.direction]
        inside = branch.points[max(chunk.first - first, 0) : chunk.stop - first]
        points += [BranchPoint(point, direction, point.index == first, branch.start) for point in inside]
    return points


@dataclass(frozen=True, slots=True)
class PointColumns:
    """Points as arrays, shape (point,): swept values, direction, place in the campaign, where a branch begins.

    `starts` has the states of those branches that do not begin where the scene does, by the index of their first point.
    """

    values: Mapping[str, NDArray[np.float64]]
    direction: NDArray[np.int8]
    index: NDArray[np.int64]
    first: NDArray[np.bool_]
    starts: Mapping[int, State]

    def __len__(self) -> int:
        return len(self.index)

    def chosen(self, which: slice | NDArray[np.bool_]) -> PointColumns:
        """Return some of the points."""
        values = {key: column[which] for key, column in self.values.items()}
        return PointColumns(values, self.direction[which], self.index[which], self.first[which], self.starts)

    def taken(self, count: int) -> PointColumns:
        """Return the first points."""
        return self.chosen(slice(count))

    def place(self, number: int) -> BranchPoint:
        """Return one point."""
        values = {key: float(column[number]) for key, column in self.values.items()}
        index, direction = int(self.index[number]), Direction(int(self.direction[number]))
        first = bool(self.first[number])
        return BranchPoint(Point(index, values), direction, first, self.starts.get(index) if first else None)

    def places(self) -> list[BranchPoint]:
        """Return the points one by one."""
        return [self.place(number) for number in range(len(self))]


def columns_of_points(branches: Sequence[Branch], chunk: Chunk) -> PointColumns:
    """Return the points of a chunk, as `points_of` does, as arrays."""
    pieces: list[PointColumns] = []
    for branch in branches[chunk.branch :]:
        begin = branch.points.first_index
        if begin >= chunk.stop:
            break
        first, stop = max(chunk.first - begin, 0), min(chunk.stop - begin, len(branch.points))
        if first >= stop:
            continue
        index = np.arange(begin + first, begin + stop)
        direction = np.full(len(index), Direction[branch.direction], dtype=np.int8)
        starts = {} if branch.start is None else {begin: branch.start}
        columns = branch.points.columns(first, stop)
        pieces.append(PointColumns(columns, direction, index, index == begin, starts))
    return PointColumns(
        {key: np.concatenate([piece.values[key] for piece in pieces]) for key in pieces[0].values},
        np.concatenate([piece.direction for piece in pieces]),
        np.concatenate([piece.index for piece in pieces]),
        np.concatenate([piece.first for piece in pieces]),
        {begin: start for piece in pieces for begin, start in piece.starts.items()},
    )


def _of_places(points: Sequence[BranchPoint]) -> PointColumns:
    keys = points[0].point.values if points else {}
    return PointColumns(
        {key: np.array([place.point.values[key] for place in points], dtype=np.float64) for key in keys},
        np.array([place.direction for place in points], dtype=np.int8),
        np.array([place.point.index for place in points], dtype=np.int64),
        np.array([place.first for place in points], dtype=np.bool_),
        {place.point.index: place.start for place in points if place.start is not None},
    )


def _points_left(work: Work, branches: Sequence[Branch], chunk: Chunk) -> PointColumns:
    """Return the points of a chunk that are not kept from an earlier sweep."""
    points, kept = columns_of_points(branches, chunk), _kept_runs(work.kept)
    return points.chosen(~np.isin(points.index, kept)) if kept.size else points


@lru_cache(maxsize=1)
def _kept_runs(path: str) -> NDArray[np.int32]:
    return read_part(path).run_index if path and Path(path).exists() else np.empty(0, dtype=np.int32)


def run_points(
    scene: Scene,
    runner: Runner,
    points: Sequence[BranchPoint],
    start: State | None,
    deadline: float = math.inf,
) -> tuple[list[RunRecord], State | None]:
    """Run points in their order; along a branch with a direction each starts where the one before ended.

    No point begins after `deadline` (s of `time.perf_counter`), except the first.

    Returns
    -------
    records : list of RunRecord
    carried : tuple of float or None
        Where the next point of the branch starts; a run that did not come to its end hands on what it was
        given.
    """
    carried = start
    records = []
    if isinstance(runner, AnnouncedRunner) and start is None and _are_independent(points):
        runner.announce([(place.point.values, place.start if place.first else None) for place in points])
    for place in points:
        given = place.start if place.first else carried
        record = run_point(scene, runner, place.point, given)
        records.append(record)
        carried = None if place.direction is Direction.independent else _next_start(record, given)
        if time.perf_counter() > deadline:
            break
    return records, carried


def _are_independent(points: Sequence[BranchPoint]) -> bool:
    return all(place.direction is Direction.independent for place in points)


def _next_start(record: RunRecord, start: State | None) -> State | None:
    end: State = (record.final_displacement, record.final_velocity)
    if record.final_state is not None:
        end = tuple(record.final_state.tolist())
    usable = record.outcome in CARRYING and all(map(math.isfinite, end))
    return end if usable else start


def run_point(scene: Scene, runner: Runner, point: Point, start: State | None) -> RunRecord:
    """Run one point; whatever goes wrong with it becomes a record with the outcome `error`."""
    began = time.perf_counter()
    try:
        return runner.run(point.values, start)
    except (VibroimpactError, ArithmeticError, ValueError) as error:
        # A point that fails is a row that says so: the sweep is worth more than the point.
        return empty_record(scene, Outcome.error, str(error), time.perf_counter() - began)


def tally(dataset: xr.Dataset) -> dict[str, int]:
    """Count the runs of each outcome."""
    values, counts = np.unique(dataset.outcome.values, return_counts=True)
    return {Outcome(value).name: int(count) for value, count in zip(values, counts, strict=True)}


def dataset_of(
    scene: Scene,
    points: Sequence[BranchPoint] | PointColumns,
    records: Sequence[RunRecord] | RunColumns,
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """Return the dataset of points and what became of them; points with impossible values are marked."""
    columns = points if isinstance(points, PointColumns) else _of_places(points)
    dataset = dataset_of_runs(scene, columns.values, columns.direction, columns.index, records, attrs)
    return marked(dataset)


def empty_part(scene: Scene) -> xr.Dataset:
    """Return the dataset of one run of a scene that has no results: its names, dimensions and attributes."""
    point = points_of(expand(scene), Chunk(0, 0, 1))
    return dataset_of(scene, point, [empty_record(scene, Outcome.error, "", 0.0)], {})


def carried_attributes(state: State) -> dict[str, Any]:
    """Return the attributes of a part that keep the state its branch goes on from."""
    if len(state) == len(CARRIED):
        return dict(zip(CARRIED, state, strict=True))
    return {CARRIED_STATE: np.array(state)}


def carried_state(attrs: Mapping[str, Any]) -> State | None:
    """Return the state that the attributes of a part keep; None where there is none."""
    if CARRIED_STATE in attrs:
        # NetCDF gives an array of one element back as a number.
        return tuple(np.atleast_1d(np.asarray(attrs[CARRIED_STATE], dtype=np.float64)).tolist())
    displacement, velocity = (attrs.get(name) for name in CARRIED)
    return None if displacement is None or velocity is None else (float(displacement), float(velocity))


def write_part(
    work: Work,
    chunk: Chunk,
    points: PointColumns,
    records: Sequence[RunRecord] | RunColumns,
    carried: State | None,
) -> dict[str, int]:
    """Write the part of a chunk, as a whole or not at all; returns how many runs ended in each way."""
    attrs: dict[str, Any] = {"scene_hash": work.scene_hash}
    if work.manifest:
        attrs[MANIFEST] = work.manifest
    if carried is not None:
        attrs |= carried_attributes(carried)
    path = Path(work.parts_folder, chunk.part_name)
    try:
        dataset = dataset_of(work.scene, points, records, attrs)
        write_dataset(dataset, path)
    except OSError as error:
        raise CampaignError(
            f"{path.parent}: the results of {chunk.count} points could not be written: "
            f"{error.strerror or error}. "
            "Make room or restore access; then the same command or call resumes."
        ) from error
    return tally(dataset)
