"""A campaign: every point of a sweep, computed by workers, kept as parts, compacted into one dataset.

Whatever ends a campaign (Ctrl-C, kill -9, a full disk, a lost machine), the parts that are complete stay, and
the same command goes on from them. The rows are then bit-identical to those of an uninterrupted campaign.

The folder holds `campaign.json` (what it was started with), `parts/` while it runs, and `dataset.nc` at the
end.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from vibroimpact.analysis.dataset import read_part
from vibroimpact.fmus.errors import CampaignError, DatasetError, UsageError
from vibroimpact.orchestrator.chunks import (
    DEFAULT_RUNNER,
    Chunk,
    ChunkResult,
    RunnerIdentity,
    Work,
    get_ready,
)
from vibroimpact.orchestrator.cluster import WorkerPool, open_workers
from vibroimpact.orchestrator.computation import Computation
from vibroimpact.orchestrator.folder_lock import locked_folder, make_folder
from vibroimpact.orchestrator.manifest import (
    Manifest,
    read_manifest,
    refuse_other_runner,
    refuse_other_scene,
    scene_hash,
    write_manifest,
)
from vibroimpact.orchestrator.parts import (
    StoredPart,
    compact,
    damaged_parts,
    list_parts,
    remove_temporary_files,
)
from vibroimpact.orchestrator.progress import Progress, Silence
from vibroimpact.orchestrator.provenance import provenance
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.schedule import ChunkSchedule
from vibroimpact.orchestrator.shared_folder import refuse_blind_workers
from vibroimpact.orchestrator.sweep import expand


class CampaignInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a campaign in good order; its text says what is there and how to go on."""


@dataclass(slots=True)
class CampaignReport:
    """What a campaign did.

    Attributes
    ----------
    dataset : Path
    runs : int
        Runs in the dataset.
    resumed : int
        Runs that were there already; equal to `runs` when there was nothing to do.
    outcomes : Counter
        How the runs computed now ended.
    chunks : list of Chunk
        In the order in which they ended.
    workers : int
    lost_workers : int
        How many died before the last point was done.
    compute_seconds : float
        From the first chunk handed out to the last one done; workers were ready before, s.
    compaction_seconds : float
        Making one dataset of the parts, s.
    """

    dataset: Path
    runs: int
    resumed: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    chunks: list[Chunk] = field(default_factory=list)
    workers: int = 0
    lost_workers: int = 0
    compute_seconds: float = 0.0
    compaction_seconds: float = 0.0


def run_campaign(
    scene: Scene,
    folder: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    runner: str = DEFAULT_RUNNER,
    progress: Progress | None = None,
) -> CampaignReport:
    """Compute all points of a scene's sweep into `folder/dataset.nc`, or go on where an earlier try ended.

    Parameters
    ----------
    scene : Scene
    folder : path
        One campaign, one folder; made when absent.
    workers : int, optional
        Worker processes on this machine; one for each processor by default.
    scheduler : str, optional
        Address of a Dask scheduler to use instead.
    runner : str
        The class that runs a point, as `module:name`.
    progress : Progress, optional
        Told how far the campaign is.

    Raises
    ------
    UsageError
        When the folder cannot be written or belongs to another scene, or nothing listens at `scheduler`.
    CampaignError
        When the campaign could not finish; the same call resumes it.
    CampaignInterrupted
        On Ctrl-C.
    """
    home = Path(folder).absolute()
    make_folder(home)
    with locked_folder(home):
        campaign = _Campaign(scene, home, runner, progress or Silence())
        return campaign.finished_before() or campaign.run(workers, scheduler)


class _Campaign:
    """One campaign in its folder, which this process holds."""

    def __init__(self, scene: Scene, home: Path, runner: str, progress: Progress) -> None:
        self._scene = scene
        self._home = home
        self._progress = progress
        self._parts_folder = home / "parts"
        self._manifest_path = home / "campaign.json"
        self._manifest = self._checked_manifest()
        # A worker may live in another folder, and files that a scene names lie beside it.
        source = str(Path(scene.source).absolute())
        self._work = Work(scene.text, source, str(self._parts_folder), runner, scene_hash(scene))
        self._branches = expand(scene)
        runs = sum(len(branch.points) for branch in self._branches)
        self._report = CampaignReport(home / "dataset.nc", runs)

    def _checked_manifest(self) -> Manifest | None:
        manifest = read_manifest(self._manifest_path)
        if manifest is not None:
            refuse_other_scene(self._manifest_path, manifest, self._scene)
        elif (self._home / "dataset.nc").exists() or any(self._parts_folder.glob("*.nc")):
            raise UsageError(
                f"{self._home}: expected an empty folder or one of a campaign, got data without "
                "campaign.json. Choose another folder with -o."
            )
        return manifest

    def finished_before(self) -> CampaignReport | None:
        """Return the report of a campaign with nothing left to do; None when there is."""
        target = self._report.dataset
        if not target.exists():
            return None
        try:
            rows = len(read_part(target).run_index)
        except DatasetError as error:
            raise DatasetError(f"{error} Delete {target} to compute the campaign again.") from error
        self._remove_parts()
        return replace(self._report, runs=rows, resumed=rows)

    def run(self, workers: int | None, scheduler: str | None) -> CampaignReport:
        """Compute what is left and compact it."""
        make_folder(self._parts_folder)
        remove_temporary_files(self._parts_folder)
        parts = list_parts(self._parts_folder, self._work.scene_hash, self._progress.note)
        self._report.resumed = sum(part.chunk.count for part in parts)
        try:
            if self._report.resumed < self._report.runs:
                self._compute_on(parts, workers, scheduler)
            computed = [self._parts_folder / chunk.part_name for chunk in self._report.chunks]
            self._compact([part.path for part in parts] + computed)
        except KeyboardInterrupt:
            raise CampaignInterrupted(self._interrupted()) from None
        return self._report

    def _interrupted(self) -> str:
        done = self._report.resumed + sum(chunk.count for chunk in self._report.chunks)
        return (
            f"Interrupted: {done} of {self._report.runs} points are complete in {self._home}. "
            "The same command resumes."
        )

    def _compute_on(self, parts: Sequence[StoredPart], workers: int | None, scheduler: str | None) -> None:
        try:
            with open_workers(workers=workers, scheduler=scheduler, progress=self._progress) as pool:
                self._compute_with(pool, parts, shared=scheduler is not None)
        finally:
            # A worker that was stopped may have been writing.
            remove_temporary_files(self._parts_folder)

    def _compute_with(self, pool: WorkerPool, parts: Sequence[StoredPart], *, shared: bool) -> None:
        if shared:
            refuse_blind_workers(pool, self._home)
        identity = _common_identity(pool, self._work)
        self._agree_with_manifest(identity)
        self._report.workers = len(pool.worker_addresses())
        schedule = ChunkSchedule(self._branches, parts, self._report.workers)
        began = time.perf_counter()
        self._progress.begin(self._report.runs, self._report.resumed)
        try:
            Computation(pool, replace(self._work, identity=identity), schedule, self._take).run()
        finally:
            self._report.compute_seconds = time.perf_counter() - began
            self._report.lost_workers = pool.lost_workers
            pool.cancel_all()

    def _agree_with_manifest(self, identity: RunnerIdentity) -> None:
        if self._manifest is not None:
            refuse_other_runner(self._manifest_path, self._manifest, identity)
        else:
            write_manifest(self._manifest_path, self._scene, identity, self._report.runs)

    def _take(self, result: ChunkResult) -> None:
        self._report.chunks.append(result.chunk)
        self._report.outcomes.update(result.outcomes)
        self._progress.advance(result.chunk.count)

    def _compact(self, parts: Sequence[Path]) -> None:
        began = time.perf_counter()
        identity = self._identity_of_manifest()
        try:
            compact(parts, self._report.dataset, provenance(self._scene, identity))
        except DatasetError as error:
            raise self._damaged(parts, error) from error
        except OSError as error:
            raise CampaignError(
                f"{self._report.dataset}: could not be written: {error.strerror or error}. "
                f"All points are complete in {self._parts_folder}. "
                "Make room or restore access; then the same command finishes."
            ) from error
        self._remove_parts()
        self._report.compaction_seconds = time.perf_counter() - began

    def _identity_of_manifest(self) -> RunnerIdentity:
        manifest = read_manifest(self._manifest_path)
        if manifest is None:
            raise CampaignError(
                f"{self._manifest_path}: expected the manifest of this campaign, got no file. Put it back."
            )
        content = manifest.content
        return RunnerIdentity(content["execution"], content["instruction_set"], content["fmu_hashes"])

    def _damaged(self, parts: Sequence[Path], error: DatasetError) -> CampaignError:
        damaged = damaged_parts(parts)
        if not damaged:
            return CampaignError(f"{self._home}: the parts do not fit together: {error}")
        for path in damaged:
            path.unlink(missing_ok=True)
        names = ", ".join(path.name for path in damaged[:5])
        return CampaignError(
            f"{self._parts_folder}: expected parts that can be read, got {len(damaged)} damaged and removed: "
            f"{names}. The same command computes their points again."
        )

    def _remove_parts(self) -> None:
        if self._parts_folder.is_dir():
            for path in self._parts_folder.iterdir():
                path.unlink(missing_ok=True)
            self._parts_folder.rmdir()


def _common_identity(pool: WorkerPool, work: Work) -> RunnerIdentity:
    """Let every worker load what it needs, and return the runner that all of them have."""
    answers: dict[str, RunnerIdentity] = pool.call_everywhere(get_ready, work)
    first, *others = answers.values()
    for other in others:
        if other != first:
            raise UsageError(
                f"workers: expected one kind of runner on all of them, got {first} and {other}. "
                "Use workers of one kind of machine with one version of vibroimpact."
            )
    return first
