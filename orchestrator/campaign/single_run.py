"""`vibroimpact run`: the points of a scene one after the other, in this process, without Dask."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path

from vibroimpact.analysis.dataset import RunRecord, write_dataset
from vibroimpact.analysis.dataset.columns import RunColumns, columns_of, joined
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.wording import typed_or_called
from vibroimpact.orchestrator.campaign.chunks import (
    DEFAULT_RUNNER,
    Chunk,
    PointColumns,
    columns_of_points,
    dataset_of,
    empty_part,
    run_columns,
    run_points,
    tally,
)
from vibroimpact.orchestrator.campaign.progress import Progress
from vibroimpact.orchestrator.campaign.provenance import provenance
from vibroimpact.orchestrator.run import Runner, identity_of, named_runner
from vibroimpact.orchestrator.run.dataset import with_constants_of
from vibroimpact.orchestrator.run.many_points.loop import PointLoop, loop_of
from vibroimpact.orchestrator.run.result_size import refuse_large_results
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import expand, most_points, run_count

PROGRESS_SECONDS = 0.5
"""Time after which progress is told of the points that are done, s."""


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
        points = columns_of_points(expand(scene), Chunk(0, 0, run_count(scene.sweep)))
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


def _run_all(
    scene: Scene, runner: Runner, points: PointColumns, progress: Progress
) -> list[RunRecord] | RunColumns:
    if len(points) > 1:
        progress.begin(len(points), 0)
    if scene.sweep and (loop := loop_of(scene, runner)) is not None:
        return _run_in_loop(scene, runner, loop, points, progress)
    records: list[RunRecord] = []
    carried = None
    for place in points.places():
        done, carried = run_points(scene, runner, [place], carried)
        records += done
        if len(points) > 1:
            progress.advance(1)
    return records


def _run_in_loop(
    scene: Scene, runner: Runner, loop: PointLoop, points: PointColumns, progress: Progress
) -> list[RunRecord] | RunColumns:
    """Run points as a campaign does; now and then progress is told."""
    pieces: list[RunColumns] = []
    done, carried = 0, None
    while done < len(points):
        until = time.perf_counter() + PROGRESS_SECONDS
        left = points.chosen(slice(done, None))
        columns, carried = run_columns(scene, runner, loop, left, carried, until)
        pieces.append(columns if isinstance(columns, RunColumns) else columns_of(columns))
        done += len(columns)
        progress.advance(len(columns))
    return joined(pieces)


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
