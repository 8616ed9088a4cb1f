"""A campaign: every point of a sweep, computed by workers, kept as parts, compacted into one dataset.

A campaign may end by Ctrl-C, kill -9, a full disk or a lost machine. The complete parts stay, and the same command
goes on from them. The rows are then bit-identical to the rows of an uninterrupted campaign.

The home holds `campaign.json` (scene and components at the start), `parts/` while the campaign runs, and `dataset.nc`
at the end. In the other format it holds a store that grows, `dataset.zarr`, and `seals/` of its shards. Home is a
folder, or for such a store an address: an object store has no rename, so a seal is an object written last.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibroimpact.analysis.files.object_paths import AnyPath, ObjectPath, located
from vibroimpact.fmus.errors import CampaignError, DatasetError
from vibroimpact.fmus.messages import CALL, Message, message
from vibroimpact.orchestrator.campaign.destination import ShardParts, UnfitShardsError
from vibroimpact.orchestrator.campaign.earlier_sweep import EarlierSweep
from vibroimpact.orchestrator.campaign.extension import (
    kept_path,
    other_differences,
    read_only_kept,
    scene_of_manifest,
    without_held,
)
from vibroimpact.orchestrator.campaign.formats import (
    DatasetFormat,
    chosen_shard_points,
    destination_of,
    earlier_store,
)
from vibroimpact.orchestrator.campaign.home import held_home, make_folder_in_home, refuse_blind_workers
from vibroimpact.orchestrator.campaign.manifest import (
    NAME,
    add_build,
    carried_manifest,
    differences,
    flat_scene,
    read_content,
    read_manifest,
    refuse_other_runner,
    refuse_other_scene,
    runner_differences,
    scene_hash,
    write_manifest,
)
from vibroimpact.orchestrator.campaign.manifest_copies import manifest_of_folder
from vibroimpact.orchestrator.campaign.other_build import compare_with_stored
from vibroimpact.orchestrator.campaign.parts import (
    NO_RUNS,
    StoredPart,
    list_parts,
    remove_parts,
    remove_parts_within,
    remove_temporary_files,
    still_there,
    unfit_parts,
)
from vibroimpact.orchestrator.campaign.report import CampaignInterrupted, CampaignReport
from vibroimpact.orchestrator.campaign.rounds import Rounds, Stage, adaptive_axes, stages_of
from vibroimpact.orchestrator.campaign.schedule import ChunkSchedule
from vibroimpact.orchestrator.campaign.workers.chunks import ChunkResult, Work, common_identity, get_ready
from vibroimpact.orchestrator.campaign.workers.here import (
    FEW_SECONDS,
    computed_here,
    may_begin_here,
    opened_here,
)
from vibroimpact.orchestrator.campaign.workers.pieces import MOST_BYTES
from vibroimpact.orchestrator.campaign.workers.threads import (
    BYTES_OF_A_THREAD,
    compute_in_threads,
    thread_count,
)
from vibroimpact.orchestrator.run import RunnerIdentity
from vibroimpact.orchestrator.run.dataset import DatasetForm
from vibroimpact.orchestrator.run.limits import may_go_by_lanes
from vibroimpact.orchestrator.run.progress import Progress
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import run_count

if TYPE_CHECKING:
    from vibroimpact.orchestrator.campaign.workers.cluster import Client
    from vibroimpact.orchestrator.campaign.workers.pool import WorkerPool

MOST_ROUNDS = 3
"""Largest number of times that one command computes unfit parts, before it gives up."""
MOST_NAMED = 5

OpenedWorkers = Callable[[], AbstractContextManager["WorkerPool"]]


def open_workers(**options: Any) -> AbstractContextManager[WorkerPool]:
    """Open workers, see `cluster.open_workers`; imported only when needed, since Dask takes half a second."""
    from vibroimpact.orchestrator.campaign.workers.cluster import open_workers as opened

    return opened(**options)


def run_campaign(
    scene: Scene,
    folder: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | Client | None = None,
    runner: str = DEFAULT_RUNNER,
    progress: Progress | None = None,
    format: DatasetFormat | None = None,
) -> CampaignReport:
    """Compute all points of a scene's sweep into one dataset in a folder, or go on where an earlier try ended.

    Parameters
    ----------
    scene : Scene
    folder : path or address
        Folder of this campaign alone; made when absent. It may be an address of fsspec, such as `s3://bucket/map`;
        the dataset is then a store.
    workers : int, optional
        Worker processes on this machine. By default the campaign begins in this process. If more than 2 s of work are
        left, one worker for each processor goes on. Points in lanes stay here, in threads, on up to four processors.
    scheduler : str or dask.distributed.Client, optional
        Address of a Dask scheduler, or a client of a scheduler, to use instead.
    runner : str
        The class that runs a point, as `module:name`.
    progress : Progress, optional
        Receives the progress of the campaign.
    format : {"netcdf", "zarr"}, optional
        Format of the dataset: the file `dataset.nc`, or the store `dataset.zarr`. By default as the campaign began.

    Raises
    ------
    UsageError
        The folder cannot be written, is in use or belongs to another scene, or nothing listens at `scheduler`.
    CampaignError
        The campaign could not finish; the same call resumes it.
    CampaignInterrupted
        Ctrl-C interrupted the campaign.
    """
    progress = progress or Progress()
    with held_home(folder, progress.note) as (home, refuse_lost):
        opened = partial(open_workers, workers=workers, scheduler=scheduler, progress=progress)
        try:
            here = workers is None and scheduler is None
            campaign = _Campaign(scene, home, runner, progress, format, refuse_lost, here=here)
            return campaign.finished_before() or campaign.run(opened)
        except OSError as error:
            # This process or a worker raised it: the folder for temporary files may be full, too.
            raise CampaignError(
                message(
                    f"{error.filename or home}: expected a file that can be read and written, got "
                    f"{error.strerror or error}. Make room or restore access, there and in the folder for temporary "
                    "files; then the same ",
                    CALL,
                    " resumes.",
                )
            ) from error


class _Campaign:
    """One campaign in its home, which this process holds."""

    def __init__(
        self,
        scene: Scene,
        home: AnyPath,
        runner: str,
        progress: Progress,
        format: DatasetFormat | None,
        refuse_lost: Callable[[], None],
        *,
        here: bool = False,
    ) -> None:
        self._scene = scene
        self._refuse_lost = refuse_lost
        self._home = home
        self._progress = progress
        self._parts_folder = home / "parts"
        self._manifest_path = home / NAME
        self._manifest = manifest_of_folder(home, scene, progress.note)
        # A worker may run in another folder; files named by the scene lie next to the scene.
        source = str(Path(scene.source).absolute())
        self._shard_points = chosen_shard_points(home, scene, self._manifest, format)
        self._report = CampaignReport(home / "dataset.nc", run_count(scene.sweep))
        self._go_on_with_this_sweep()
        hashed = self._manifest.scene_hash if self._manifest is not None else scene_hash(scene)
        self._destination = destination_of(home, scene, self._shard_points, hashed, progress.note)
        self._report.dataset = self._destination.path
        self._kept_path = kept_path(self._parts_folder, hashed)
        self._rounds: Rounds | None = None
        self._computed_files: list[AnyPath] = []
        self._form: DatasetForm | None = None
        self._begins_here = here and may_begin_here(scene, runner, self._report.runs)
        self._work = Work(
            scene.model_copy(update={"source": source}),
            str(self._parts_folder),
            runner,
            hashed,
            execution=self._execution(),
            kept=str(self._kept_path),
            store=self._destination.store,
        )

    def _execution(self) -> str:
        """Return the execution of the points, `lanes` or `fused`, of an earlier sweep; empty: the scene's own."""
        earlier_way = "" if self._manifest is None else self._manifest.identity.execution
        either = self._scene.execution.how == "auto" and may_go_by_lanes(self._scene)
        return earlier_way if either and earlier_way in ("fused", "lanes") else ""

    def _go_on_with_this_sweep(self) -> None:
        """Keep the points of this sweep that an earlier sweep of the same scene has computed."""
        if self._manifest is None:
            return
        old = scene_of_manifest(self._manifest, self._scene)
        different = differences(
            self._manifest.scene if old is None else flat_scene(old), flat_scene(self._scene)
        )
        if not different:
            return
        others = different if old is None else other_differences(old, self._scene)
        if old is None or others or isinstance(self._home, ObjectPath):
            refuse_other_scene(self._manifest_path, others or different)
        make_folder_in_home(self._parts_folder)
        hashed, note = self._manifest.scene_hash, self._progress.note
        store = earlier_store(self._home, old, self._shard_points, hashed, note)
        earlier = EarlierSweep(old, self._manifest, self._home, note, store)
        if not earlier.hand_over(self._scene, self._report.runs):
            refuse_other_scene(self._manifest_path, different)
        self._manifest = read_manifest(self._manifest_path)

    def finished_before(self) -> CampaignReport | None:
        """Return the report of a finished campaign; None when points are left."""
        done = None if self._manifest is None else self._destination.finished(self._manifest)
        if done is None:
            return None
        rows, attrs = done
        remove_parts(self._parts_folder)
        remove_temporary_files(self._home)
        if self._scene.title and attrs.get("title") != self._scene.title:
            self._destination.retitle({name: self._attributes()[name] for name in ("title", "scene")})
            self._progress.note(f"{self._destination.path} has the title {self._scene.title!r} now.")
        return replace(self._report, runs=rows, resumed=rows)

    def run(self, workers: OpenedWorkers) -> CampaignReport:
        """Compute the points that are left and compact all parts; unfit parts are computed again."""
        make_folder_in_home(self._parts_folder)
        remove_temporary_files(self._home)
        unfit: list[tuple[AnyPath, str]] = []
        try:
            for _ in range(MOST_ROUNDS):
                paths = self._complete(workers)
                unfit = self._compact(paths)
                if not unfit:
                    return self._report
        except KeyboardInterrupt:
            raise CampaignInterrupted(self._interrupted()) from None
        names = "; ".join(f"{path.name}: {reason}" for path, reason in unfit[:MOST_NAMED])
        raise CampaignError(
            f"{self._parts_folder}: expected parts of this scene, got {len(unfit)} that are not, computed "
            f"{MOST_ROUNDS} times: {names}"
        )

    def _complete(self, workers: OpenedWorkers) -> list[AnyPath]:
        """Compute all runs that no part holds, and return the files with all runs."""
        remove_temporary_files(self._parts_folder)
        self._report.chunks.clear()
        self._computed_files.clear()
        self._rounds = Rounds(self._scene) if adaptive_axes(self._scene) else None
        kept = read_only_kept(self._parts_folder, self._kept_path, self._scene, self._progress.note)
        runs = kept.runs if kept is not None else NO_RUNS
        self._destination.make()
        held = self._destination.held()
        remove_parts_within(self._parts_folder, held)
        parts = list_parts(self._parts_folder, self._work.scene_hash, self._progress.note, runs)
        self._destination.expect(parts, kept)
        parts = sorted([*held, *parts], key=lambda part: part.chunk.first)
        outside = without_held(kept, held) if kept is not None else None
        self._report.resumed = sum(part.rows for part in parts) + (outside.runs.size if outside else 0)
        stored = [part.path for part in parts] + ([kept.path] if kept is not None else [])
        stages = stages_of(
            self._scene,
            self._rounds,
            lambda: self._stored(parts),
            outside.stretches if outside is not None else (),
            self._destination,
        )
        # a sweep is complete by its number of runs; rounds are complete if no stage comes
        stage = next(stages, None) if self._rounds or self._report.resumed < self._report.runs else None
        if stage is not None:
            self._compute_on(chain([stage], stages), still_there(stored, self._home), workers)
        found = still_there(stored, self._home) + [part.path for part in self._computed()]
        if self._rounds is not None:
            self._report.runs = sum(part.rows for part in self._stored(parts))
        return found

    def _stored(self, parts: Sequence[StoredPart]) -> list[StoredPart]:
        """Return the sealed shards, and the parts of earlier commands and of this one that are in no shard."""
        held = self._destination.held()
        others = [
            part for part in (*parts, *self._computed()) if part.path.suffix == ".nc" and part.path.exists()
        ]
        return sorted([*held, *others], key=lambda part: part.chunk.first)

    def _computed(self) -> list[StoredPart]:
        """Return the parts that this command has computed so far."""
        return [
            StoredPart(path, chunk, None, chunk.count)
            for path, chunk in zip(self._computed_files, self._report.chunks, strict=True)
        ]

    def _interrupted(self) -> Message:
        done = self._report.resumed + self._report.outcomes.total()
        return message(
            f"Interrupted: {done} of {self._report.runs} points are complete in {self._home}. The same ",
            CALL,
            " resumes.",
        )

    def _compute_on(self, stages: Iterable[Stage], stored: Sequence[AnyPath], workers: OpenedWorkers) -> None:
        try:
            left = self._computed_here(iter(stages)) if self._begins_here else iter(stages)
            stage = next(left, None)
            if stage is None:
                return
            with workers() as pool:
                if not pool.is_local or isinstance(self._home, ObjectPath):
                    refuse_blind_workers(pool, self._home)
                work = replace(
                    self._work, identity=common_identity(pool.call_everywhere(get_ready, self._work))
                )
                self._agree_with_manifest(pool, work, stored)
                self._compute_with(pool, self._with_manifest(work), chain([stage], left))
        finally:
            # A worker that was stopped may have been writing.
            remove_temporary_files(self._parts_folder)

    def _write_manifest(self, identity: RunnerIdentity) -> None:
        write_manifest(
            self._manifest_path, self._scene, identity, self._report.runs, shard_points=self._shard_points
        )

    def _with_manifest(self, work: Work) -> Work:
        """Return the work with the manifest that each part carries."""
        return replace(work, manifest=carried_manifest(read_content(self._manifest_path), work.scene.source))

    def _computed_here(self, stages: Iterator[Stage]) -> Iterator[Stage]:
        """Compute quick stages in this process; return the stages that are left for workers."""
        with opened_here(self._work) as opened:
            if opened is None:
                return stages
            identity, self._form = opened.runner.identity, opened.form
            if self._manifest and runner_differences(self._manifest, identity):
                return stages  # workers compare the other build with stored points
            if self._manifest is None:
                self._write_manifest(identity)
                self._manifest = read_manifest(self._manifest_path)
            work = self._with_manifest(replace(self._work, identity=identity))
            with self._computing():
                threads = thread_count(identity.execution)
                for stage in stages:
                    own, schedule = self._of_stage(work, stage), self._schedule(work, stage, 1)
                    take = partial(self._take_and_seal, own)
                    left = computed_here(own, stage, schedule, take, FEW_SECONDS if threads else None)
                    if left is not None and not threads:
                        return chain([left], stages)
                    if left is not None:
                        schedule = self._schedule(work, left, threads, BYTES_OF_A_THREAD)
                        compute_in_threads(own, schedule, threads, take)
        return iter(())

    def _compute_with(self, pool: WorkerPool, work: Work, stages: Iterable[Stage]) -> None:
        # imported only when workers are needed
        from vibroimpact.orchestrator.campaign.workers.computation import Computation

        self._report.workers = len(pool.worker_addresses())
        try:
            with self._computing():
                for stage in stages:
                    schedule = self._schedule(work, stage, self._report.workers)
                    of_stage, sealed = self._of_stage(work, stage), self._destination.sealed
                    Computation(pool, of_stage, schedule, self._take, sealed).run()
        finally:
            self._report.lost_workers += pool.lost_workers
            pool.cancel_all()

    def _schedule(self, work: Work, stage: Stage, workers: int, size: int = MOST_BYTES) -> ChunkSchedule:
        """Return the schedule of a stage, and start its progress."""
        in_lanes = work.identity is not None and work.identity.execution == "lanes"
        schedule = ChunkSchedule(
            stage.branches,
            stage.held,
            workers,
            in_lanes=in_lanes,
            most_bytes=size,
            shards=self._destination.shards,
        )
        self._report.runs = stage.runs
        self._progress.begin(stage.runs, stage.runs - schedule.left, stage.said)
        return schedule

    def _of_stage(self, work: Work, stage: Stage) -> Work:
        return replace(work, branches=stage.branches) if self._rounds is not None else work

    @contextmanager
    def _computing(self) -> Iterator[None]:
        began = time.perf_counter()
        try:
            yield
        finally:
            self._report.compute_seconds += time.perf_counter() - began

    def _agree_with_manifest(self, pool: WorkerPool, work: Work, stored: Sequence[AnyPath]) -> None:
        """Write the manifest of a new campaign; raise UsageError if workers could give an old one other results."""
        assert work.identity is not None
        if self._manifest is None:
            self._write_manifest(work.identity)
        elif different := runner_differences(self._manifest, work.identity):
            began = replace(work.identity, fmu_hashes=self._manifest.identity.fmu_hashes)
            if runner_differences(self._manifest, began):
                refuse_other_runner(self._manifest_path, different)
            compared, reason = compare_with_stored(pool, work, self._scene, stored, self._destination.rows)
            if reason:
                refuse_other_runner(self._manifest_path, different, f"{reason}. ")
            add_build(self._manifest_path, work.identity, compared)
            self._progress.note(
                f"The components differ from those that began this campaign ({'; '.join(different)}); "
                f"{compared} of its points computed again are equal bit for bit."
            )
        self._manifest = read_manifest(self._manifest_path)

    def _take(self, result: ChunkResult) -> list[ShardParts]:
        self._refuse_lost()
        if result.outcomes:  # a chunk of kept runs has no outcomes and no part
            self._report.chunks.append(result.chunk)
            self._computed_files.append(located(result.path))
        self._report.outcomes.update(result.outcomes)
        self._progress.advance(sum(result.outcomes.values()))
        return self._destination.taken(result)

    def _take_and_seal(self, work: Work, result: ChunkResult) -> None:
        """Take the result of a chunk of this process, and write the shards that are complete by it."""
        for complete in self._take(result):
            self._destination.seal(work, complete)

    def _compact(self, parts: Sequence[AnyPath]) -> list[tuple[AnyPath, str]]:
        """Write the dataset; return the unfit parts that prevent it, which are removed, each with the reason."""
        self._refuse_lost()
        began = time.perf_counter()
        try:
            form = self._form or DatasetForm(self._scene)
            work, attrs = self._with_manifest(self._work), self._attributes()
            has_messages = self._destination.complete(work, parts, form, attrs)
        except DatasetError as error:
            # parts of sealed shards are removed
            is_file = self._destination.store is None
            files = [path for path in parts if path.suffix == ".nc" and (is_file or path.exists())]
            unfit = (
                error.found if isinstance(error, UnfitShardsError) else list(unfit_parts(files, self._scene))
            )
            if not unfit:
                raise CampaignError(f"{self._home}: the parts do not fit together: {error}") from error
            for path, reason in unfit:
                path.unlink(missing_ok=True)
                self._progress.note(
                    f"{path.name} was damaged and is removed; its points come again: {reason}"
                )
            return unfit
        except OSError as error:
            raise CampaignError(
                message(
                    f"{self._report.dataset}: could not be written: {error.strerror or error}. "
                    f"All points are complete in {self._parts_folder}. "
                    "Make room or restore access; then the same ",
                    CALL,
                    " finishes.",
                )
            ) from error
        remove_parts(self._parts_folder)
        self._report.is_silent = not has_messages
        self._report.compaction_seconds = time.perf_counter() - began
        return []

    def _attributes(self) -> dict[str, Any]:
        manifest = self._manifest or read_manifest(self._manifest_path)
        if manifest is None:
            raise CampaignError(
                f"{self._manifest_path}: expected the manifest of this campaign, got no file. Put it back."
            )
        found = manifest.attributes(self._scene) | {"scene_hash": scene_hash(self._scene)}
        return found | ({} if self._rounds is None else {"unresolved_jumps": self._rounds.left})
