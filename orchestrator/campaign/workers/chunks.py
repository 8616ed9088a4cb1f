"""The work on a chunk: a worker runs its points, writes them as one part or shard, and returns the outcomes.

A chunk is a range of neighbouring runs. All of this module runs on a worker; each process loads the components of the
scene once and uses them for all its chunks. The results of a point never depend on the cut of the runs into chunks.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, RunRecord, read_part, write_dataset
from vibroimpact.analysis.dataset.columns import RunColumns
from vibroimpact.analysis.dataset.reading import SILENT
from vibroimpact.analysis.files.object_paths import AnyPath, located
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.fmus.errors import CampaignError, UsageError
from vibroimpact.orchestrator.campaign.stores.seals import seal_path
from vibroimpact.orchestrator.campaign.workers.pieces import MOST_BYTES, run_in_pieces
from vibroimpact.orchestrator.run import Runner, RunnerIdentity, named_runner
from vibroimpact.orchestrator.run.dataset import DatasetForm, dataset_of, empty_dataset, has_messages, tally
from vibroimpact.orchestrator.run.empty_record import empty_record
from vibroimpact.orchestrator.run.points import PointColumns, State, columns_of_points
from vibroimpact.orchestrator.running.kept import OpenedScene
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import Branch, Paths, expand

if TYPE_CHECKING:
    from vibroimpact.orchestrator.campaign.stores.sealing import GrowingStore

CARRIED = ("carried_displacement", "carried_velocity")
CARRIED_STATE = "carried_state"
"""Attributes of a part: start state of the next run of its branch, as two numbers or an array."""
MANIFEST = "campaign_manifest"
"""Attribute of a part: the manifest of its campaign, from `manifest.carried_manifest`."""


@dataclass(frozen=True, slots=True)
class Work:
    """The data that all chunks of a campaign share; it is small and sent with each chunk."""

    scene: Scene
    """Scene with an absolute path as its source, since a worker may run in another folder."""
    parts_folder: str
    """Absolute path of the folder of parts, or its address."""
    runner: str = DEFAULT_RUNNER
    """The runner class as `module:name`."""
    scene_hash: str = ""
    """Hash in each part, by which a part of another campaign is noticed."""
    identity: RunnerIdentity | None = None
    """Required identity of the runner; None while the campaign asks the workers for it."""
    execution: str = ""
    """Execution with which the campaign began; empty: the scene's own."""
    kept: str = ""
    """File with the runs of an earlier sweep, which all chunks leave out; it may be absent."""
    branches: Sequence[Branch] = ()
    """The points of a round of an adaptive sweep; empty: the points of the scene's sweep."""
    manifest: str = ""
    """Manifest in each part, from which `campaign.json` can be made again; empty: none is written."""
    store: GrowingStore | None = None
    """Store that grows by shards; None where all parts are joined at the end."""


@dataclass(frozen=True, slots=True)
class Chunk:
    """Runs `first` to `stop - 1`; the first is in branch `branch` and starts from `start`.

    A chunk is a stretch of one branch, or several whole branches. `start` is the state (m, m/s) carried from the run
    before; None is the scene's own start state. A chunk that takes longer than `most_seconds` ends early, after a
    point; so does one whose results take more than `most_bytes`. Other chunks compute the rest.
    """

    branch: int
    first: int
    stop: int
    start: State | None = None
    most_seconds: float = math.inf
    most_bytes: int = MOST_BYTES

    @property
    def count(self) -> int:
        """Number of runs."""
        return self.stop - self.first

    @property
    def part_name(self) -> str:
        """Name of the file of the part."""
        return f"branch-{self.branch:06d}_runs-{self.first:010d}-{self.stop:010d}.nc"


@dataclass(frozen=True, slots=True)
class ChunkResult:
    """The answer of a worker on a chunk whose part or shard is on the disk."""

    chunk: Chunk
    """The runs of the part: all requested runs, or the first of them."""
    carried: State | None
    """The start state (m, m/s) of the next run of the branch."""
    outcomes: Mapping[str, int]
    """Number of runs by outcome."""
    compute_seconds: float
    """Wall time of the runs, s."""
    size: int = 0
    """Size of the results, bytes, where they are columns; else 0."""
    path: str = ""
    """File of the part, or the seal of the shard."""


class _AtWork(threading.local):
    """The scene that this thread has opened for chunks, with its branches."""

    key: Work | None = None
    branches: Sequence[Branch] = ()
    opened: OpenedScene | None = None


_at_work = _AtWork()


def _opened(work: Work) -> tuple[Sequence[Branch], OpenedScene]:
    """Return the branches of a scene, and the opened scene that runs their points in this thread."""
    if _at_work.opened is None or _at_work.key != _key(work):
        take_up(work, OpenedScene(work.scene, named_runner(work.scene, work.runner, work.execution or None)))
    assert _at_work.opened is not None
    return _at_work.branches, _at_work.opened


def _key(work: Work) -> Work:
    return Work(work.scene, "", work.runner, execution=work.execution)


def take_up(work: Work, opened: OpenedScene) -> None:
    """Use an opened scene for the following chunks of this thread."""
    lay_down()
    _at_work.key, _at_work.branches, _at_work.opened = _key(work), expand(work.scene), opened


def lay_down() -> None:
    """Forget the opened scene of the chunks of this thread, without closing it."""
    _at_work.key, _at_work.branches, _at_work.opened = None, (), None
    _kept_runs.cache_clear()


def runner_identity(work: Work) -> RunnerIdentity:
    """Open the scene in this process, where it stays open, and return the identity of its runner."""
    return _opened(work)[1].runner.identity


def get_ready(work: Work) -> RunnerIdentity:
    """Prepare a worker for its first chunk, and return the identity of its runner."""
    identity = runner_identity(work)
    # The first dataset of a process takes long, because libraries import modules on first use.
    with ScratchFolder("rehearsal") as folder:
        write_dataset(empty_dataset(work.scene), Path(folder.name, "rehearsal.nc"))
    return identity


def common_identity(answers: Mapping[str, RunnerIdentity]) -> RunnerIdentity:
    """Return the identity of the runner that all workers share, from the answer of each."""
    first, *others = answers.values()
    for other in others:
        if other != first:
            raise UsageError(
                f"workers: expected one kind of runner on all of them, got {first} and {other}. "
                "Use workers of one kind of machine with one version of vibroimpact."
            )
    return first


def run_chunk(work: Work, chunk: Chunk) -> ChunkResult:
    """Run the points of a chunk, write them as one part, and return the outcomes.

    CampaignError: the campaign began with another runner, or the part cannot be written.
    """
    branches, opened = _opened(work)
    _refuse_other_runner(work, opened.runner)
    began = time.perf_counter()
    points = _points_left(work, work.branches or branches, chunk)
    if not len(points):
        return ChunkResult(chunk, chunk.start, {}, 0.0)
    deadline = began + chunk.most_seconds
    opened.failed = True  # until the chunk has ended
    records, carried = run_in_pieces(opened.runner, points, chunk.start, deadline, chunk.most_bytes)
    seconds = time.perf_counter() - began
    stop = int(points.index[len(records)]) if len(records) < len(points) else chunk.stop
    done = replace(chunk, stop=stop)
    path, outcomes = write_part(work, done, opened.form, points.taken(len(records)), records, carried)
    opened.failed = Outcome.error.name in outcomes
    size = records.nbytes if isinstance(records, RunColumns) else 0
    return ChunkResult(done, carried, outcomes, seconds, size, str(path))


def compute_again(work: Work, chunk: Chunk) -> xr.Dataset:
    """Return the rows of all points of a chunk, including kept points, by a run; nothing is written."""
    branches, opened = _opened(work)
    _refuse_other_runner(work, opened.runner)
    points = points_of(branches, chunk)
    records, _ = opened.runner.rows(points, chunk.start)
    return dataset_of(work.scene, points, records, {})


def write_crashed(work: Work, chunk: Chunk, message: str) -> ChunkResult:
    """Write the part of points that kill their process, without running them, and return the outcomes."""
    points = _points_left(work, work.branches or expand(work.scene), chunk)
    records = [empty_record(work.scene, Outcome.crash, message, 0.0) for _ in range(len(points))]
    path, written = write_part(work, chunk, DatasetForm(work.scene), points, records, chunk.start)
    return ChunkResult(chunk, chunk.start, written, 0.0, path=str(path))


def _refuse_other_runner(work: Work, runner: Runner) -> None:
    if work.identity is not None and runner.identity != work.identity:
        raise CampaignError(
            f"worker: expected the runner that the campaign began with ({work.identity}), "
            f"got {runner.identity}. Use workers of one kind of machine with one version of vibroimpact."
        )


def points_of(branches: Sequence[Branch], chunk: Chunk) -> PointColumns:
    """Return the points of a chunk, which may span several branches."""
    left = branches if isinstance(branches, Paths) else branches[chunk.branch :]
    return columns_of_points(left, chunk.first, chunk.stop)


def _points_left(work: Work, branches: Sequence[Branch], chunk: Chunk) -> PointColumns:
    """Return the points of a chunk that are not kept from an earlier sweep."""
    points, kept = points_of(branches, chunk), _kept_runs(work.kept)
    return points.chosen(~np.isin(points.index, kept)) if kept.size else points


@lru_cache(maxsize=1)
def _kept_runs(path: str) -> NDArray[np.int32]:
    return (
        read_part(located(path)).run_index if path and located(path).exists() else np.empty(0, dtype=np.int32)
    )


def carried_attributes(state: State) -> dict[str, Any]:
    """Return the attributes of a part that store the start state of the next run of its branch."""
    if len(state) == len(CARRIED):
        return dict(zip(CARRIED, state, strict=True))
    return {CARRIED_STATE: np.array(state)}


def carried_state(attrs: Mapping[str, Any]) -> State | None:
    """Return the state stored in the attributes of a part; None where there is none."""
    if CARRIED_STATE in attrs:
        # NetCDF returns an array of one element as a number.
        return tuple(np.atleast_1d(np.asarray(attrs[CARRIED_STATE], dtype=np.float64)).tolist())
    displacement, velocity = (attrs.get(name) for name in CARRIED)
    return None if displacement is None or velocity is None else (float(displacement), float(velocity))


def write_part(
    work: Work,
    chunk: Chunk,
    form: DatasetForm,
    points: PointColumns,
    records: Sequence[RunRecord] | RunColumns,
    carried: State | None,
) -> tuple[AnyPath, dict[str, int]]:
    """Write the rows of a chunk, as a whole or not at all; return the file and the number of runs by outcome.

    The rows are a part. Those of a whole shard of a store are written there, and the file is the seal.
    """
    attrs = attributes_of_part(work, carried)
    path = located(work.parts_folder) / chunk.part_name
    try:
        dataset = form.dataset(points, records, attrs)
        shard = None if work.store is None else work.store.shard_of(work.scene, chunk.first, chunk.stop)
        if work.store is not None and shard is not None and len(points) == shard.count:
            # imported only for a store
            from vibroimpact.orchestrator.campaign.stores.sealing import write_shard

            seal = write_shard(work.store, work.scene, shard, dataset, chunk.branch, attrs)
            return seal_path(work.store.seals, shard.number), dict(seal.outcomes)
        if not has_messages(dataset):
            dataset.attrs[SILENT] = 1
        write_dataset(dataset, path)
    except OSError as error:
        raise CampaignError(
            f"{path.parent}: the results of {chunk.count} points could not be written: "
            f"{error.strerror or error}. "
            "Make room or restore access; then the same command or call resumes."
        ) from error
    return path, tally(dataset)


def attributes_of_part(work: Work, carried: State | None) -> dict[str, Any]:
    """Return the attributes of a part of a campaign."""
    attrs: dict[str, Any] = {"scene_hash": work.scene_hash}
    if work.manifest:
        attrs[MANIFEST] = work.manifest
    return attrs if carried is None else attrs | carried_attributes(carried)
