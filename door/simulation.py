"""Scenes that run in a notebook or a script: a dataset comes back. The commands stand on the same functions."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset, write_dataset
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.analysis.orbits import PeriodicOrbit
from vibroimpact.analysis.orbits.following import FollowSettings
from vibroimpact.analysis.sensitivity import LEVEL, RESAMPLES, sensitivity_report
from vibroimpact.fmus.errors import UsageError
from vibroimpact.given import PathLike, SceneLike, given_scene
from vibroimpact.orchestrator.campaign import SceneCost, run_campaign, run_scene
from vibroimpact.orchestrator.campaign import cost_of as scene_cost
from vibroimpact.orchestrator.campaign.cluster import Client, refuse_two_kinds_of_workers
from vibroimpact.orchestrator.campaign.progress import Progress, shown_progress
from vibroimpact.orchestrator.hard_cases import dataset_of as hard_cases_dataset
from vibroimpact.orchestrator.hard_cases import measured_cases
from vibroimpact.orchestrator.orbits.find import find_orbits as orbits_of_scene
from vibroimpact.orchestrator.orbits.follow import Followed, FollowedLoci, follow_branches, follow_loci
from vibroimpact.orchestrator.replay.replaying import replay_scene
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import (
    export_system,
    import_system,
    load_system,
    refuse_system_elsewhere,
)
from vibroimpact.orchestrator.study import BUDGET, refuse_unreached, study_accuracy
from vibroimpact.orchestrator.study import dataset_of as accuracy_dataset
from vibroimpact.orchestrator.study.effects import dataset_of_shares, effects_of, shares_of
from vibroimpact.orchestrator.study.preparation import prepared_scene, with_found_modes

_ONE_AT_A_TIME = threading.Lock()


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
    chosen, target = prepared_scene(given_scene(scene)), None if path is None else _path(path)
    # NetCDF's library is not for several threads at once
    with _ONE_AT_A_TIME, _shown(progress) as shown:
        if target is not None:
            run_scene(chosen, target, progress=shown)
            return open_dataset(target)
        with ScratchFolder("run") as folder:
            file = Path(folder.name, "run.nc")
            run_scene(chosen, file, progress=shown)
            return _in_memory(file)


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
            _path(folder),
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
        given_scene(scene), _paths(recordings), fit=keys or None, score=_paths(score), execution=execution
    )
    if path is not None:
        write_results(whole.dataset, _path(path), kind="replay")
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
        There is nothing to vary, no such quantity, or no way reaches the tolerance.

    Examples
    --------
    >>> accuracy("examples/single_run.toml", tolerance=1e-6).attrs["chosen"]    # doctest: +SKIP
    'fused'
    """
    study = study_accuracy(
        with_found_modes(given_scene(scene)), tolerance=tolerance, quantity=of, budget=budget
    )
    dataset = accuracy_dataset(study)
    if path is not None:
        write_results(dataset, _path(path), kind="accuracy")
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

    Examples
    --------
    >>> effects("examples/chatter.toml").attrs["not_simulated"].split(", ")[0]    # doctest: +SKIP
    'recorded drive'
    """
    chosen = with_found_modes(given_scene(scene))
    alone = chosen.with_sweep({}) if chosen.sweep else chosen
    dataset = dataset_of_shares(alone, shares_of(alone, effects_of(alone)), chosen.found)
    if path is not None:
        write_results(dataset, _path(path), kind="effects")
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
    opened = dataset if isinstance(dataset, xr.Dataset) else open_dataset(_path(dataset))
    names = [of] if isinstance(of, str) else list(of)
    found = sensitivity_report(opened, names, level=level, resamples=resamples, seed=seed)
    if path is not None:
        write_results(found, _path(path), kind="sensitivity")
    return found.assign_attrs(results_kind="sensitivity")


def find_orbits(
    scene: SceneLike,
    impacts: int | None = None,
    periods: int | None = None,
    *,
    seed: Sequence[tuple[float, int]] | None = None,
    penetrating: bool = False,
) -> list[PeriodicOrbit]:
    """Find periodic orbits of a scene, stable and unstable ones.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator, a chain or a beam on restitution stops under a harmonic force; its sweep is left out.
    impacts, periods : int, optional
        p and q of P(p,q). Without them, all orbits P(1,1), and the orbit that a long run ends on.
    seed : sequence of (phase, stop), optional
        Forcing phases, rad, of impacts near to those of one orbit, and their stops, from 1: that orbit alone.
    penetrating : bool
        Whether orbits that pass through a stop between impacts are returned as well.

    Returns
    -------
    list of PeriodicOrbit
        With `phases` (rad), `velocities` (m/s), `multipliers`, `is_stable`, `highest` maximum between impacts.

    Raises
    ------
    UsageError
        Orbits of the scene are not followed.
    OrbitError
        There is no orbit near to the seed.

    Examples
    --------
    >>> body = {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05}
    >>> stop, force = {"position": 1.0, "restitution": 0.7}, {"amplitude": 0.5, "angular_frequency": 1.4}
    >>> record = {"transient_periods": 0, "recorded_periods": 1}
    >>> for orbit in find_orbits({"body": body, "forcing": force, "stop": [stop], "record": record}, 1):
    ...     print(orbit.name, orbit.velocities.round(6), orbit.is_stable)
    P(1,1) [1.884299] True
    P(1,1) [0.787422] False
    """
    return orbits_of_scene(given_scene(scene), impacts, periods, seed=seed, penetrating=penetrating)


def follow(
    scene: SceneLike,
    parameter: str,
    start: float,
    stop: float,
    path: PathLike | None = None,
    *,
    impacts: int | None = None,
    periods: int = 1,
    seed: Sequence[tuple[float, int]] | None = None,
    doublings: int = 1,
    step: float = 0.01,
    second: str | None = None,
    second_range: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Follow periodic orbits of a scene over one of its numbers, through folds and period doublings.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator, a chain or a beam on restitution stops under a harmonic force; its sweep is left out.
    parameter : str
        Key of a number, such as `forcing.angular_frequency`.
    start, stop : float
        Its range.
    path : path, optional
        The dataset to write as well (.nc).
    impacts, periods : int, optional
        p and q of the orbits to begin with, which are looked for along the range; P(1,1).
    seed : sequence of (phase, stop), optional
        Forcing phases, rad, of impacts near to those of one orbit of the scene as it is, and their stops, from 1: that
        orbit is followed both ways.
    doublings : int
        How often branches of twice the period are followed on.
    step : float
        Largest step along a branch; the range of the parameter counts 1, a radian of all phases 1.
    second : str, optional
        Another number: folds, period doublings and grazes are followed over both.
    second_range : tuple of float, optional
        Its range.

    Returns
    -------
    xarray.Dataset
        Each orbit is a run, with `orbit_branch`, `orbit_stable`, `orbit_special` and its largest multiplier; with
        `second`, each is an orbit at a bifurcation, where there are any.

    Raises
    ------
    UsageError
        Orbits of the scene are not followed, or a parameter is no number of it.
    OrbitError
        There is no orbit to begin with.

    Examples
    --------
    >>> follow("scene.toml", "forcing.angular_frequency", 0.6, 1.6)    # doctest: +SKIP
    """
    chosen = given_scene(scene)
    alone = chosen.with_sweep({}) if chosen.sweep else chosen
    if (second is None) != (second_range is None):
        raise UsageError("follow: second: expected a key and its range together, got one of them.")
    followed = follow_branches(
        alone,
        parameter,
        start,
        stop,
        impacts=impacts,
        periods=periods,
        seed=seed,
        doublings=doublings,
        longest=step,
    )
    result: Followed | FollowedLoci = followed
    if second is not None and second_range is not None:
        ranges = [FollowSettings(min(ends), max(ends), step) for ends in ((start, stop), second_range)]
        loci = follow_loci(FollowedLoci(followed, second), *ranges)
        result = loci if loci.loci else followed
    with _ONE_AT_A_TIME, ScratchFolder("orbits") as folder:
        target = Path(folder.name, "branches.nc") if path is None else _path(path)
        write_dataset(result.dataset, target)
        return open_dataset(target) if path is not None else _in_memory(target)


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
        There is no such case.

    Examples
    --------
    >>> found = hard_cases("grazing-from-below")
    >>> float(found.figure[0]), bool(found.is_met[0])
    (0.0, True)
    """
    found = hard_cases_dataset(measured_cases([only] if isinstance(only, str) else only))
    if path is not None:
        write_results(found, _path(path), kind="hard_cases")
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


def export_fmu(
    scene: SceneLike,
    path: PathLike,
    *,
    fmi: str = "3.0",
    full: bool = False,
    external: bool = False,
    enumerations: bool = False,
    platform: str | None = None,
) -> Path:
    """Write an FMU of a scene's body, stops and forcing, for another tool; components alone: `vi.fmus.export`.

    Parameters
    ----------
    scene : Scene, path or mapping
        Of one body. What it sweeps has the value that it has in its own table.
    path : path
        The file to write.
    fmi, full, external, enumerations, platform
        As `vibroimpact.fmus.export` has them.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    SceneError
        With all problems of the scene, each on one line.
    UsageError
        The scene has another kind of body, or the file cannot be written.
    ComponentError
        There is no library for a platform, and nothing to compile it with.

    Examples
    --------
    >>> export_fmu("rig.toml", "rig.fmu", platform="all")    # doctest: +SKIP
    """
    return export_scene(
        with_found_modes(given_scene(scene)),
        _path(path),
        fmi=fmi,
        full=full,
        external=external,
        enumerations=enumerations,
        platform=platform,
    )


def export_ssp(
    scene: SceneLike,
    path: PathLike,
    *,
    ssp: str = "1.0",
    fmi: str | None = None,
    gains: str = "component",
    platform: str | None = None,
) -> Path:
    """Write a scene of components as a system (SSP) that other tools run; `import_ssp` gives it back.

    Parameters
    ----------
    scene : Scene, path or mapping
        With components.
    path : path
        The file to write.
    ssp : str
        `1.0` or `2.0`.
    fmi : str, optional
        Version of FMI of this package's components in the archive; by default 2.0, in SSP 2.0 that of the scene.
    gains : str
        How a connection has its gain: as a `component` with units of its own, or as a `transformation`.
    platform : str, optional
        As `vibroimpact.fmus.export` has it.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    SceneError
        With all problems of the scene, each on one line.
    UsageError
        The scene has no components, or the file cannot be written.
    ComponentError
        There is no library for a platform, and nothing to compile it with.

    Examples
    --------
    >>> export_ssp("two_oscillators.toml", "two.ssp")    # doctest: +SKIP
    """
    return export_system(given_scene(scene), _path(path), ssp=ssp, fmi=fmi, gains=gains, platform=platform)


def import_ssp(
    path: PathLike, output: PathLike | None = None, *, parameters: PathLike | Sequence[PathLike] = ()
) -> Scene:
    """Read a system (SSP 1.0 or 2.0) as a scene; `run`, `campaign` and `cost_of` take its path as it is.

    Parameters
    ----------
    path : path
        The archive.
    output : path, optional
        The scene file to write as well (.toml), with the FMUs in a folder beside it; files that are there and hold
        something else are refused. Without one the FMUs lie unpacked until this process ends.
    parameters : path or sequence of path
        Parameter sets (.ssv), files or ones in the archive: one is applied, several become a sweep.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        What is wrong with the system, or with the scene that it makes.
    ComponentFileError
        The archive, or an FMU in it, is unsafe or damaged.
    UsageError
        The parameter sets make no sweep, or a file cannot be written.

    Examples
    --------
    >>> import_ssp("two.ssp").with_sweep({"a.mass": [1.0, 2.0]})    # doctest: +SKIP
    """
    sets = _paths(parameters)
    if output is None:
        return load_system(_path(path), (), sets).scene
    import_system(_path(path), _path(output), (), sets)
    return Scene.from_file(output)


def _paths(given: PathLike | Sequence[PathLike]) -> list[Path]:
    if isinstance(given, str | os.PathLike) or not isinstance(given, Iterable):
        return [_path(given)]
    return [_path(one) for one in given]


def _path(given: object) -> Path:
    if not isinstance(given, str | os.PathLike) or "\0" in os.fspath(given):
        raise UsageError(f"path: expected the name of a file or folder, got {given!r}.")
    return Path(given)


def _shown(progress: bool) -> AbstractContextManager[Progress]:
    return shown_progress() if progress else nullcontext(Progress())


def _in_memory(file: Path) -> xr.Dataset:
    with open_dataset(file) as opened:
        found = opened.load()
    found.encoding.clear()
    return found
