"""Seeds of orbits: impacts near those of an orbit, given by hand or recorded in a run."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import NamedTuple

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.analysis.orbits.recorded import recorded_orbit
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.orbits.runs import Bodies, ImpactsOf, place_of, scene_of, why_without_orbit
from vibroimpact.orchestrator.run.dataset import coordinate_names

Seed = Sequence[tuple[float, int]]
"""Forcing phase, rad, and stop, from 1, of each impact of a first guess."""


class RunSeed(NamedTuple):
    """The seed from the last round of a run's impacts.

    Attributes
    ----------
    impacts : list of (phase, stop)
        Forcing phases, rad, ascending within `periods`, and stops, from 1.
    periods : int
        q of P(p,q).
    values : dict of str to float
        The run's value of each key that its scene sweeps.
    """

    impacts: list[tuple[float, int]]
    periods: int
    values: dict[str, float]


def seed_of_run(dataset: xr.Dataset | str | PathLike[str], run: int | None = None) -> RunSeed:
    """Return the seed of the orbit on which a run of a dataset ends.

    Parameters
    ----------
    dataset : xarray.Dataset or path
        As `open_dataset` or `run` gives it, or its file or folder; with impacts.
    run : int, optional
        `run_index`; optional for a single run.

    Raises
    ------
    DatasetError
        The dataset has no impacts or no scene, no such run, or the run has no periodic orbit.
    UsageError
        The scene's orbits cannot be followed.

    Examples
    --------
    >>> near = seed_of_run("sweep.nc", 12)                     # doctest: +SKIP
    >>> scene = scene.unswept(near.values).with_values(near.values)  # doctest: +SKIP
    >>> vi.follow(scene, "forcing.amplitude", 0.3, 0.6, seed=near.impacts, periods=near.periods)  # doctest: +SKIP
    """
    if not isinstance(dataset, xr.Dataset):
        with open_dataset(dataset) as opened:
            return seed_of_run(opened, run)
    if "orbit_periods" in dataset:
        raise DatasetError(
            "seed: expected runs of a scene, got orbits that were found. Give their impact_phase as a seed."
        )
    scene = scene_of(dataset, "seed")
    runs = dataset.vibroimpact.runs
    if run is None and runs.sizes["run"] != 1:
        known = runs["run_index"].values
        raise DatasetError(f"seed: run: expected one of run_index {known.min()} to {known.max()}, got none.")
    place = 0 if run is None else place_of(runs, run, "seed")
    if reason := why_without_orbit(runs, place):
        raise DatasetError(f"seed: expected a run with a periodic orbit, got none: {reason}.")
    impacts = ImpactsOf(dataset)[int(runs["run_id"].values[place])]
    try:
        orbit = recorded_orbit(Bodies(scene, runs, all_kinds=True)[place], impacts).orbit
    except OrbitError as problem:
        reason = str(problem).removeprefix("orbit: ")
        raise DatasetError(f"seed: expected a run with a periodic orbit, got none: {reason}.") from problem
    train = zip(orbit.phases.tolist(), (orbit.contacts + 1).tolist(), strict=True)
    values = {key: float(runs[name].values[place]) for key, name in coordinate_names(scene).items()}
    return RunSeed(list(train), orbit.periods, values)
