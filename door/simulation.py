"""Scenes that run in this process, point by point: a dataset comes back."""

from __future__ import annotations

from contextlib import nullcontext

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.given import PathLike, SceneLike, given_result, given_scene, prepared_scene, scene_with_modes
from vibroimpact.orchestrator.campaign import SceneCost
from vibroimpact.orchestrator.campaign import cost_of as scene_cost
from vibroimpact.orchestrator.run.progress import Progress, shown_progress
from vibroimpact.orchestrator.running import run_in_memory, run_scene
from vibroimpact.returned import ONE_AT_A_TIME


def run(scene: SceneLike, path: PathLike | None = None, *, progress: bool = True) -> xr.Dataset:
    """Run every point of a scene in this process, one after the other.

    Parameters
    ----------
    scene : Scene, path or mapping
        A scene, the file of one or of a system (SSP), or its tables.
    path : path, optional
        The dataset to write as well, whole or not at all; one that is there is replaced.
    progress : bool
        Show how far it is, where there is more than one point.

    Returns
    -------
    xarray.Dataset
        As `open_dataset` gives it; in memory, without a path.

    Raises
    ------
    SceneError
        With all problems of the scene, each on one line.
    UsageError
        The dataset cannot be written, or would be larger than memory.

    Examples
    --------
    >>> tables = {"body": {"mass": 1.0, "stiffness": 4.0}, "record": {"recorded_time": 5.0}}
    >>> str(run(tables).outcome.item())
    '0'
    """
    chosen = given_scene(scene)
    target = given_result(path, [scene, chosen])
    chosen = prepared_scene(chosen)
    with ONE_AT_A_TIME, shown_progress() if progress else nullcontext(Progress()) as shown:
        if target is not None:
            run_scene(chosen, target, progress=shown)
            return open_dataset(target)
        return run_in_memory(chosen, progress=shown)


def cost_of(scene: SceneLike) -> SceneCost:
    """Run one point of a scene and say what all of them would cost, as `vibroimpact check` does.

    Parameters
    ----------
    scene : Scene, path or mapping

    Raises
    ------
    SceneError
        With all problems of the scene, each on one line.

    Examples
    --------
    >>> cost_of({"body": {"mass": 1.0, "stiffness": 4.0}, "record": {"recorded_time": 5.0}}).points
    1
    """
    return scene_cost(scene_with_modes(scene))
