"""Runs of a scene in this process, point by point, returned as a dataset."""

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
        A scene, the file of a scene or of a system (SSP), or the tables of a scene.
    path : path, optional
        Dataset file to write as well (.nc). It is written whole or not at all; an existing file is replaced.
    progress : bool
        Whether to show the progress, where the scene has more than one point.

    Returns
    -------
    xarray.Dataset
        The dataset as `open_dataset` returns it. Without a path it is in memory.

    Raises
    ------
    SceneError
        The scene is wrong; the message lists all problems, one a line.
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

    A call runs one point from the scene's own start, and agrees with `run(scene.with_values(...))` bit for bit. A call
    with many points runs them as a campaign does. A body with its own stops costs its motion and some tens of
    microseconds a point. Coupled, measured and sampled scenes take longer.

    Parameters
    ----------
    scene : Scene, path or mapping
        Scene in which each key has a value; the sweep is ignored.
    keys : str or sequence of str
        Keys that each call gives values, in SI or the units of the scene; a sweep must be able to vary them.

    Returns
    -------
    SceneRunner
        A callable, which takes values of shape (key,), or a number for a single key. It returns a dict of arrays, named
        as in a [dataset](dataset.md):

        - `final_displacement` (m) and `outcome` have the shape ();
        - `displacement_max` (m) and other results of each period have the shape (period,);
        - `impact_time` (s) and other results of each impact have the shape (impact,).

        Values of shape (point, key) run many points, and the arrays get a first dimension of points. Impacts, sticks
        and samples of all points are concatenated instead; `impact_count` is the number of impacts of each point.
        `outcome` and `message` report runs that could not finish. A runner is a context manager, can be pickled, and
        serves one thread at a time.

    Raises
    ------
    SceneError
        A key cannot be varied. A call raises SceneError for values that a sweep refuses, with the same words.
    UsageError
        A key has no value in the scene. A call raises UsageError for values of another shape.

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
    """Run one point of a scene and estimate the cost of all points, as `vibroimpact check` does.

    Parameters
    ----------
    scene : Scene, path or mapping
        A scene, the file of a scene or of a system (SSP), or the tables of a scene.

    Raises
    ------
    SceneError
        The scene is wrong; the message lists all problems, one a line.

    Examples
    --------
    >>> cost_of({"body": {"mass": 1.0, "stiffness": 4.0}, "record": {"recorded_time": 5.0}}).points
    1
    """
    return scene_cost(scene_with_modes(scene))
