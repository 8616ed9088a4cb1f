"""Scenes that run in a notebook or a script: a dataset comes back. The commands stand on the same functions."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.analysis.sensitivity import LEVEL, RESAMPLES, sensitivity_report
from vibroimpact.fmus.errors import UsageError
from vibroimpact.given import PathLike, SceneLike, given_path, given_paths, given_result, given_scene
from vibroimpact.orchestrator.campaign import SceneCost, run_campaign, run_scene
from vibroimpact.orchestrator.campaign import cost_of as scene_cost
from vibroimpact.orchestrator.campaign.cluster import Client, refuse_two_kinds_of_workers
from vibroimpact.orchestrator.campaign.progress import Progress, shown_progress
from vibroimpact.orchestrator.hard_cases import dataset_of as hard_cases_dataset
from vibroimpact.orchestrator.hard_cases import measured_cases
from vibroimpact.orchestrator.replay.replaying import replay_scene
from vibroimpact.orchestrator.ssp import refuse_system_elsewhere
from vibroimpact.orchestrator.study import BUDGET, refuse_unreached, study_accuracy
from vibroimpact.orchestrator.study import dataset_of as accuracy_dataset
from vibroimpact.orchestrator.study.effects import dataset_of_shares, effects_of, shares_of
from vibroimpact.orchestrator.study.preparation import prepared_scene, with_found_modes
from vibroimpact.orchestrator.study.refusals import refuse_misuse
from vibroimpact.returned import ONE_AT_A_TIME, in_memory


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
    chosen, target = prepared_scene(given_scene(scene)), None if path is None else given_path(path)
    with ONE_AT_A_TIME, _shown(progress) as shown:
        if target is not None:
            run_scene(chosen, target, progress=shown)
            return open_dataset(target)
        with ScratchFolder("run") as folder:
            file = Path(folder.name, "run.nc")
            run_scene(chosen, file, progress=shown)
            return in_memory(file)


def campaign(
    scene: SceneLike,
    folder: PathLike,
    *,
    workers: int | None = None,
    scheduler: str | Client | None = None,
    progress: bool = True,
) -> xr.Dataset:
    """Compute all points of a scene's sweep with many workers; the same call resumes after anything.

    Parameters
    ----------
    scene : Scene, path or mapping
    folder : path
        One campaign, one folder; made when absent. The dataset is `dataset.nc` in it.
    workers : int, optional
        Worker processes on this machine; one for each processor by default.
    scheduler : str or dask.distributed.Client, optional
        Workers to use instead: the address of a Dask scheduler, or a client of it.
    progress : bool
        Show how far it is.

    Returns
    -------
    xarray.Dataset
        As `open_dataset(folder)` gives it.

    Raises
    ------
    SceneError
        With all problems of the scene, each on one line.
    UsageError
        The folder cannot be written or belongs to another scene, or nothing listens at `scheduler`.
    CampaignError
        The campaign could not finish; the same call resumes it.
    CampaignInterrupted
        On Ctrl-C, a KeyboardInterrupt; the same call resumes.

    Examples
    --------
    >>> found = campaign("examples/bifurcation.toml", "bifurcation", workers=2)        # doctest: +SKIP
    >>> found.displacement_range.sel(direction="up")                                   # doctest: +SKIP
    """
    if workers is not None and (not isinstance(workers, int) or workers < 1):
        raise UsageError(f"workers: expected a whole number of 1 or more, got {workers!r}.")
    refuse_two_kinds_of_workers(workers, scheduler)
    if isinstance(scene, str | os.PathLike):
        refuse_system_elsewhere(scene, scheduler)
    with _shown(progress) as shown:
        report = run_campaign(
            prepared_scene(given_scene(scene)),
            given_path(folder),
            workers=workers,
            scheduler=scheduler,
            progress=shown,
        )
    return open_dataset(report.dataset)


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
    keys = fit if isinstance(fit, str) else ",".join(fit)
    whole = replay_scene(
        given_scene(scene),
        given_paths(recordings),
        fit=keys or None,
        score=given_paths(score),
        execution=execution,
    )
    if path is not None:
        write_results(whole.dataset, given_path(path), kind="replay")
    return whole.dataset


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
        Wall time to spend, about, s.

    Returns
    -------
    xarray.Dataset
        `error` and `cost` (s) of each `way`, what is wrong with it (`failure`); `attrs["verdict"]` says what to choose.

    Raises
    ------
    SceneError
        With all problems of the scene, each on one line.
    UsageError
        There is nothing to vary, no such quantity, no such budget, no place for the file, or no way reaches the
        tolerance. Only the last takes the time of a study, unless the reference is known to less.

    Examples
    --------
    >>> accuracy("examples/single_run.toml", tolerance=1e-6).attrs["chosen"]    # doctest: +SKIP
    'fused'
    """
    refuse_misuse(tolerance, of, budget)
    target = given_result(path)
    study = study_accuracy(
        with_found_modes(given_scene(scene)), tolerance=tolerance, quantity=of, budget=budget
    )
    dataset = accuracy_dataset(study)
    if target is not None:
        write_results(dataset, target, kind="accuracy")
    refuse_unreached(study)
    return dataset.assign_attrs(results_kind="accuracy")


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
        dearest first; `attrs["not_simulated"]` lists what the scene does not call for.

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
    target = given_result(path)
    chosen = with_found_modes(given_scene(scene))
    alone = chosen.with_sweep({}) if chosen.sweep else chosen
    dataset = dataset_of_shares(alone, shares_of(alone, effects_of(alone)), chosen.found)
    if target is not None:
        write_results(dataset, target, kind="effects")
    return dataset.assign_attrs(results_kind="effects")


def sensitivity(
    dataset: xr.Dataset | PathLike,
    path: PathLike | None = None,
    *,
    of: str | Sequence[str] = (),
    level: float = LEVEL,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> xr.Dataset:
    """Estimate how much of the variance of each result each drawn key of a campaign accounts for (Sobol indices).

    Parameters
    ----------
    dataset : xarray.Dataset or path
        A campaign with `sample = { design = "saltelli", ... }`, opened, or its file or folder.
    path : path, optional
        The dataset to write as well (.nc).
    of : str or sequence of str
        Quantities to look at: `displacement_range`, ...; none: all that there are.
    level : float
        Of the bootstrap intervals.
    resamples, seed : int
        Of the bootstrap.

    Returns
    -------
    xarray.Dataset
        `first_order`, `total_order`, `first_order_interval` and `total_order_interval` on `quantity`, `parameter` and
        the other keys of the sweep; `attrs["remarks"]` says what was left out.

    Raises
    ------
    DatasetError
        The dataset has no whole Saltelli design, or nothing that varies over it.
    UsageError
        There is no such quantity; or the level, the number of resamples or the seed makes no sense.

    Examples
    --------
    >>> sensitivity("campaign").total_order.sel(quantity="displacement_range")    # doctest: +SKIP
    """
    opened = dataset if isinstance(dataset, xr.Dataset) else open_dataset(given_path(dataset))
    names = [of] if isinstance(of, str) else list(of)
    found = sensitivity_report(opened, names, level=level, resamples=resamples, seed=seed)
    if path is not None:
        write_results(found, given_path(path), kind="sensitivity")
    return found.assign_attrs(results_kind="sensitivity")


def hard_cases(only: str | Sequence[str] = (), path: PathLike | None = None) -> xr.Dataset:
    """Run what breaks solvers of impacts, and measure how well each claim about it holds on this machine.

    Parameters
    ----------
    only : str or sequence of str
        Names of the cases to run; none: all of docs/hard_cases.md that have one.
    path : path, optional
        The dataset to write as well (.nc).

    Returns
    -------
    xarray.Dataset
        `figure`, `bound` and `is_met` of each `case`, what is drawn of it (`x`, `y`), and its `name`, `claim` and
        `reference` in words; `attrs["missed"]` names those whose bound is missed.

    Raises
    ------
    UsageError
        There is no such case, or one is named twice, or the dataset cannot be written there.

    Examples
    --------
    >>> found = hard_cases("grazing-from-below")
    >>> float(found.figure[0]), bool(found.is_met[0])
    (0.0, True)
    """
    target = given_result(path)
    found = hard_cases_dataset(measured_cases([only] if isinstance(only, str) else only))
    if target is not None:
        write_results(found, target, kind="hard_cases")
    return found.assign_attrs(results_kind="hard_cases")


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
    return scene_cost(with_found_modes(given_scene(scene)))


def _shown(progress: bool) -> AbstractContextManager[Progress]:
    return shown_progress() if progress else nullcontext(Progress())
