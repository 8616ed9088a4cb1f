"""`vibroimpact run`: the points of a scene one after the other, in this process, without Dask."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import cast

import xarray as xr

from vibroimpact.analysis.dataset import Outcome, RunRecord, write_dataset
from vibroimpact.analysis.dataset.columns import RunColumns, columns_of, joined
from vibroimpact.analysis.dataset.reading import opened_in_memory
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import WITH_OUTPUT, message
from vibroimpact.orchestrator.run import Runner
from vibroimpact.orchestrator.run.points import PointColumns, columns_of_points
from vibroimpact.orchestrator.run.progress import Progress
from vibroimpact.orchestrator.run.result_size import refuse_large_results
from vibroimpact.orchestrator.running.kept import OpenedScene, opened_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import expand, most_points, run_count

PROGRESS_SECONDS = 0.5
"""Time between two reports of the points done to `progress`, s."""

Recorded = Sequence[RunRecord] | RunColumns


def run_scene(scene: Scene, path: str | os.PathLike[str], *, progress: Progress | None = None) -> xr.Dataset:
    """Run every point of a scene and write one dataset; an interrupted run leaves nothing behind.

    Parameters
    ----------
    scene : Scene
    path : path
        The dataset to write, whole or not at all.
    progress : Progress, optional
        Receives the progress, if there is more than one point.

    Returns
    -------
    xarray.Dataset
        The one-dimensional dataset in the file.

    Raises
    ------
    UsageError
        The dataset cannot be written, or would be larger than memory, or the sweep is adaptive.
    """
    target = Path(path)
    refuse_adaptive(scene)
    refuse_large_results(scene)
    _refuse_unwritable(target)
    with opened_scene(scene) as opened:
        dataset = run_whole(opened, progress)
    try:
        write_dataset(dataset, target)
    except OSError as error:
        raise _unwritable(target, error) from error
    return dataset


def run_in_memory(scene: Scene, *, progress: Progress | None = None) -> xr.Dataset:
    """Run every point of a scene and return the dataset that `open_dataset` would return, without a file.

    Parameters
    ----------
    scene : Scene
    progress : Progress, optional
        Receives the progress, if there is more than one point.

    Raises
    ------
    UsageError
        The dataset would be larger than memory, or the sweep is adaptive.
    """
    refuse_adaptive(scene)
    refuse_large_results(scene)
    with opened_scene(scene) as opened:
        return opened_in_memory(run_whole(opened, progress))


def run_whole(opened: OpenedScene, progress: Progress | None = None) -> xr.Dataset:
    """Run every point of an opened scene; return the one-dimensional dataset in the form for a file."""
    scene, form = opened.scene, opened.form
    points = columns_of_points(expand(scene), 0, run_count(scene.sweep))
    records = _run_all(opened.runner, points, progress or Progress())
    dataset = form.dataset(points, records, opened.attributes, constants=True)
    opened.failed = bool((dataset.variables["outcome"].values == Outcome.error).any())
    return dataset


def refuse_adaptive(scene: Scene) -> None:
    """Raise UsageError if the points of a scene are found round by round; the message has a remedy."""
    if most_points(scene.sweep) is not None:
        raise UsageError(
            f"{scene.source}: sweep: expected points that are known before the first is computed, got adaptive axes. "
            "Use `vibroimpact campaign`, which computes them round by round."
        )


def _run_all(runner: Runner, points: PointColumns, progress: Progress) -> Recorded:
    """Run all points and return their records; report to `progress` now and then."""
    if len(points) == 1:
        return runner.rows(points)[0]
    progress.begin(len(points), 0)
    pieces: list[Recorded] = []
    done, carried = 0, None
    while done < len(points):
        left = points.chosen(slice(done, None))
        found, carried = runner.rows(left, carried, time.perf_counter() + PROGRESS_SECONDS)
        pieces.append(found)
        done += len(found)
        progress.advance(len(found))
    return _together(pieces)


def _together(pieces: Sequence[Recorded]) -> Recorded:
    """Return the records of all pieces as one."""
    if any(isinstance(piece, RunColumns) for piece in pieces):
        return joined([piece if isinstance(piece, RunColumns) else columns_of(piece) for piece in pieces])
    return [record for piece in cast("Sequence[Sequence[RunRecord]]", pieces) for record in piece]


def _refuse_unwritable(target: Path) -> None:
    """Raise UsageError unless the dataset can be written, before the work begins."""
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
        message(
            f"{target}: expected a place where a dataset can be written, got {error.strerror or error}. "
            "Choose another",
            WITH_OUTPUT,
            ".",
        )
    )
