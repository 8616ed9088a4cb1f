"""Scenes that run in this process, point by point: a dataset comes back."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.given import PathLike, SceneLike, given_result, given_scene, prepared_scene, scene_with_modes
from vibroimpact.orchestrator.campaign import SceneCost
from vibroimpact.orchestrator.campaign import cost_of as scene_cost
from vibroimpact.orchestrator.run.progress import Progress, shown_progress
from vibroimpact.orchestrator.running import run_in_memory, run_scene
from vibroimpact.orchestrator.running.calling import SceneRunner
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


def runner(scene: SceneLike, keys: str | Sequence[str]) -> SceneRunner:
    """Open a scene as a function of some of its numbers: values in, arrays out, for optimisers and sliders.

    A call runs one point from the scene's own start, as `run(scene.with_values(...))` does, bit for bit; or many points
    at once, as a campaign over them does. Of a body with its own stops a point costs its motion and some tens of
    microseconds; scenes that are coupled, measured or sampled take their time.

    Parameters
    ----------
    scene : Scene, path or mapping
        Its sweep is left out. Each key has a value in it.
    keys : str or sequence of str
        What calls give values to, in SI or the units of the scene: keys that a sweep may vary.

    Returns
    -------
    SceneRunner
        Called with values of shape (key,), or a number where there is one key, it returns a dict of arrays by the names
        of a [dataset](dataset.md): `final_displacement` (m) and `outcome` have the shape (), `displacement_max` (m) and
        others of each period (period,), `impact_time` (s) and others of each impact (impact,). With values of shape
        (point, key) all of them have a first dimension of points, but for impacts, sticks and samples, which are one
        after the other: `impact_count` says how many each point has. What a run cannot do is its `outcome`, and in
        `message`. It is a context manager, pickles, and serves one thread at a time.

    Raises
    ------
    SceneError
        A key cannot be varied. Calls raise it for values that a sweep refuses, with the same words.
    UsageError
        A key has no value in the scene. Calls raise it for values of another shape.

    Examples
    --------
    >>> body, stop = {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05}, {"position": 1.0, "restitution": 0.7}
    >>> force, record = {"amplitude": 1.0, "angular_frequency": 0.9}, {"transient_periods": 50, "recorded_periods": 5}
    >>> tables = {"body": body, "stop": [stop], "forcing": force, "record": record}
    >>> with runner(tables, ["forcing.angular_frequency", "stop[1].restitution"]) as motion:
    ...     one, two = motion([0.9, 0.7]), motion([[0.9, 0.7], [0.9, 0.5]])
    >>> one["displacement_max"].shape, two["displacement_max"].shape
    ((5,), (2, 5))
    >>> bool(one["impact_velocity"].max() < 2.0)
    True
    """
    return SceneRunner(scene_with_modes(scene), [keys] if isinstance(keys, str) else keys)


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
