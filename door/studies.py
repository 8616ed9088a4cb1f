"""Measured studies of a scene: the cost of accuracy, and the cost and influence of each effect."""

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
    """Simulate a scene with every method that fits it, and measure the error of each method and its cost in time.

    Parameters
    ----------
    scene : Scene, path or mapping
        Scene to simulate; the sweep is ignored.
    path : path, optional
        Dataset file to write as well (.nc).
    tolerance : float, optional
        Relative error that the recommended method must reach; the cheapest such method is chosen.
    of : str
        Quantity whose error counts: `impact_time`, `impact_velocity`, `displacement_range`, `final_state`, `samples`,
        or `all`.
    budget : float
        Processor time of all processes, s, at least 10. The study keeps it within a factor of 1.5.

    Returns
    -------
    xarray.Dataset
        Each `way` (method) has its `error`, its `cost` (s), and a `failure` in words where it failed.
        `attrs["verdict"]` recommends a method.

    Raises
    ------
    SceneError
        The scene is wrong; the message lists all problems, one a line.
    UsageError
        The scene leaves nothing to vary, the quantity is unknown, or the file cannot be written. The budget is below
        10 s or below the needs of the scene. No method reaches the tolerance: this error alone takes the time of a
        study, unless the reference itself is less accurate than the tolerance.

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
    """Run a scene with and without each of its effects, and measure the cost and the influence of each effect.

    Parameters
    ----------
    scene : Scene, path or mapping
        Scene to simulate; the sweep is ignored.
    path : path, optional
        Dataset file to write as well (.nc).

    Returns
    -------
    xarray.Dataset
        Effects along `effect`, the most expensive first. Each has its `share` of the run time, the relative `change` of
        the results without it, and the `changes` in words. `statistics` describes, in words, lost impacts and chaotic
        motion. `attrs["not_simulated"]` lists the effects that the scene does not ask for.

    Raises
    ------
    SceneError
        The scene is wrong; the message lists all problems, one a line.
    UsageError
        The dataset cannot be written.

    Examples
    --------
    >>> effects("examples/chatter.toml").attrs["not_simulated"].split(", ")[0]    # doctest: +SKIP
    'recorded drive'
    """
    chosen = given_scene(scene)
    target = given_result(path, [scene, chosen])
    return of_study(CostOfEffects(scene_with_modes(chosen)), target)
