"""Recordings that drive a scene, and numbers of the scene that are fitted to them."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.given import PathLike, SceneLike, given_paths, given_result, given_scene
from vibroimpact.orchestrator.replay.replaying import replay_scene


def replay(
    scene: SceneLike,
    recordings: PathLike | Sequence[PathLike] = (),
    path: PathLike | None = None,
    *,
    fit: str | Sequence[str] = (),
    score: PathLike | Sequence[PathLike] = (),
    execution: str | None = None,
) -> xr.Dataset:
    """Drive a scene by recordings, compare its motion with what was measured, fit numbers of it.

    Parameters
    ----------
    scene : Scene, path or mapping
        With `[replay]`.
    recordings : path or sequence of path
        Those to replay, and to fit to; none: those that the scene names.
    path : path, optional
        The dataset to write as well (.nc).
    fit : str or sequence of str
        Numbers of the scene to find, by key: `body.damping_ratio`.
    score : path or sequence of path
        Recordings to score that were not fitted on.
    execution : str, optional
        `auto`, `fused` or `coupled`; None: as the scene says.

    Returns
    -------
    xarray.Dataset
        Signals, scores, fitted numbers; `attrs["verdict"]` says in words how far the model is to be trusted. A
        campaign over recordings and a grid of numbers: `campaign(scene, folder)`.

    Raises
    ------
    SceneError, UsageError, DatasetError, EstimationError
        What is wrong with the scene, the request, a recording or the fit.

    Examples
    --------
    >>> found = replay("board.toml", "a0.nc", fit=["body.damping_ratio"], score="a1.nc")    # doctest: +SKIP
    >>> found.attrs["verdict"]                                                             # doctest: +SKIP
    """
    fitted_on, scored = given_paths(recordings), given_paths(score)
    chosen = given_scene(scene)
    target = given_result(path, [scene, chosen, *fitted_on, *scored])
    keys = fit if isinstance(fit, str) else ",".join(fit)
    whole = replay_scene(chosen, fitted_on, fit=keys or None, score=scored, execution=execution)
    if target is not None:
        write_results(whole.dataset, target)
    return whole.dataset
