"""Measured studies of a scene: what accuracy costs, and what each effect costs and changes."""

from __future__ import annotations

import xarray as xr

from vibroimpact.given import PathLike, SceneLike, given_result, given_scene, scene_with_modes
from vibroimpact.orchestrator.study.accuracy import BUDGET, AccuracyOfScene, refuse_unreached
from vibroimpact.orchestrator.study.accuracy.refusals import refuse_misuse
from vibroimpact.orchestrator.study.cost_of_effects import CostOfEffects
from vibroimpact.returned import of_study


def accuracy(
    scene: SceneLike,
    path: PathLike | None = None,
    *,
    tolerance: float | None = None,
    of: str = "all",
    budget: float = BUDGET,
) -> xr.Dataset:
    """Simulate a scene in all ways that it can be, and measure what the accuracy of each costs in time.

    Parameters
    ----------
    scene : Scene, path or mapping
        Its sweep is left out.
    path : path, optional
        The dataset to write as well (.nc).
    tolerance : float, optional
        Relative error for which the cheapest way is looked for.
    of : str
        What errors are of: `impact_time`, `impact_velocity`, `displacement_range`, `final_state`, `samples`, or `all`.
    budget : float
        Processor time to spend, of all processes, s: kept within a factor of 1.5, 10 at least.

    Returns
    -------
    xarray.Dataset
        `error` and `cost` (s) of each `way`, what is wrong with it (`failure`); `attrs["verdict"]` says what to choose.

    Raises
    ------
    SceneError
        With all problems of the scene, each on one line.
    UsageError
        There is nothing to vary, no such quantity, a budget below 10 s or below what the scene needs, no place for the
        file, or no way reaches the tolerance. Only the last takes the time of a study, unless the reference is known to
        less.

    Examples
    --------
    >>> accuracy("examples/single_run.toml", tolerance=1e-6).attrs["chosen"]    # doctest: +SKIP
    'fused'
    """
    refuse_misuse(tolerance, of, budget)
    chosen = given_scene(scene)
    target = given_result(path, [scene, chosen])
    study = AccuracyOfScene(scene_with_modes(chosen), tolerance, of, budget)
    found = of_study(study, target)
    refuse_unreached(study.comparison)
    return found


def effects(scene: SceneLike, path: PathLike | None = None) -> xr.Dataset:
    """Run a scene with and without each effect that it asks for, and measure what each costs and changes.

    Parameters
    ----------
    scene : Scene, path or mapping
        Its sweep is left out.
    path : path, optional
        The dataset to write as well (.nc).

    Returns
    -------
    xarray.Dataset
        `share` of the time of a run, `change` without it (relative) and `changes` (in words) of each `effect`, the
        dearest first; `statistics` in words where impacts are lost or the motion is chaotic;
        `attrs["not_simulated"]` lists what the scene does not call for.

    Raises
    ------
    SceneError
        With all problems of the scene, each on one line.
    UsageError
        The dataset cannot be written there.

    Examples
    --------
    >>> effects("examples/chatter.toml").attrs["not_simulated"].split(", ")[0]    # doctest: +SKIP
    'recorded drive'
    """
    chosen = given_scene(scene)
    target = given_result(path, [scene, chosen])
    return of_study(CostOfEffects(scene_with_modes(chosen)), target)
