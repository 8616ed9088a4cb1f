"""`vibroimpact run`: the points of a scene one after the other, in this process, without Dask."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from vibroimpact.analysis.dataset import RunRecord, write_dataset
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.wording import typed_or_called
from vibroimpact.orchestrator.campaign.chunks import (
    DEFAULT_RUNNER,
    BranchPoint,
    Chunk,
    dataset_of,
    empty_part,
    points_of,
    run_points,
    tally,
)
from vibroimpact.orchestrator.campaign.progress import Progress
from vibroimpact.orchestrator.campaign.provenance import provenance
from vibroimpact.orchestrator.run import Runner, identity_of, named_runner
from vibroimpact.orchestrator.run.dataset import with_constants_of
from vibroimpact.orchestrator.run.result_size import refuse_large_results
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import expand, most_points, run_count


def run_scene(
    scene: Scene,
    path: str | os.PathLike[str],
    *,
    runner: str = DEFAULT_RUNNER,
    progress: Progress | None = None,
) -> Mapping[str, int]:
    """Run every point of a scene and write one dataset; nothing is kept when it is interrupted.

    Parameters
    ----------
    scene : Scene
    path : path
        The dataset to write, whole or not at all.
    runner : str
        The class that runs a point, as `module:name`.
    progress : Progress, optional
        Told how far it is, when there is more than one point.

    Returns
    -------
    mapping of str to int
        How many runs ended in each way.

    Raises
    ------
    UsageError
        When the dataset cannot be written, or would be larger than memory, or the sweep is adaptive.
    """
    target = Path(path)
    refuse_adaptive(scene)
    refuse_large_results(scene)
    _refuse_unwritable(target)
    opened = named_runner(scene, runner)
    try:
        # A dataset that cannot be made is found out before an hour of work, not after it.
        with_constants_of(empty_part(scene), scene)
        points = points_of(expand(scene), Chunk(0, 0, run_count(scene.sweep)))
        records = _run_all(scene, opened, points, progress or Progress())
        dataset = dataset_of(scene, points, records, provenance(scene, identity_of(opened)))
        dataset = with_constants_of(dataset, scene)
    finally:
        opened.close()
    try:
        write_dataset(dataset, target)
    except OSError as error:
        raise _unwritable(target, error) from error
    return tally(dataset)


def refuse_adaptive(scene: Scene) -> None:
    """Refuse a scene whose points are found round by round.

    Raises
    ------
    UsageError
        With what to do.
    """
    if most_points(scene.sweep) is not None:
        raise UsageError(
            f"{scene.source}: sweep: expected points that are known before the first is computed, got adaptive axes. "
            "Use `vibroimpact campaign`, which computes them round by round."
        )


def _run_all(scene: Scene, runner: Runner, points: list[BranchPoint], progress: Progress) -> list[RunRecord]:
    if len(points) > 1:
        progress.begin(len(points), 0)
    records: list[RunRecord] = []
    carried = None
    for place in points:
        done, carried = run_points(scene, runner, [place], carried)
        records += done
        if len(points) > 1:
            progress.advance(1)
    return records


def _refuse_unwritable(target: Path) -> None:
    """Find out before an hour of work whether its results have a place to go."""
    trial = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        if target.is_dir():
            raise IsADirectoryError(0, "a folder of that name")
        trial.touch()
        trial.unlink()
    except OSError as error:
        raise _unwritable(target, error) from error


def _unwritable(target: Path, error: OSError) -> UsageError:
    return UsageError(
        f"{target}: expected a place where a dataset can be written, got {error.strerror or error}. "
        f"Choose another{typed_or_called(' with -o')}."
    )
