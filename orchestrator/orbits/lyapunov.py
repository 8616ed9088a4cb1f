"""Lyapunov exponents of the runs of a dataset."""

from __future__ import annotations

from os import PathLike

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.dataset.schema import Outcome
from vibroimpact.analysis.orbits.exponents import ExponentError, Exponents, exponents_of
from vibroimpact.orchestrator.orbits.runs import Bodies, ImpactsOf, OnSweep, scene_of, units_of
from vibroimpact.orchestrator.run.provenance import runs_attributes

TABLE = ResultTable(
    "lyapunov",
    ("lyapunov_exponent", "... exponent", "1", "Lyapunov exponent per impact"),
    ("standard_error", "... exponent", "1", "standard error of the exponent"),
    ("impact_interval", "...", "s", "mean time from impact to impact"),
    ("dimension", "...", "1", "Kaplan-Yorke dimension of the attractor of the impact map"),
    ("impacts", "...", "1", "impacts that counted"),
    ("sum_error", "...", "1", "sum of the exponents less its exact value, over their size"),
    ("reason", "...", "1", "why a run has no exponents, else empty", "text"),
    ("exponent", "exponent", "1", "exponent, the largest first"),
)


def lyapunov(dataset: xr.Dataset | str | PathLike[str]) -> xr.Dataset:
    """Return the Lyapunov exponents of each run of a dataset: equations.md 4.11.

    Parameters
    ----------
    dataset : xarray.Dataset or path
        As `open_dataset` or `run` gives it, or its file or folder: of an oscillator, a chain or a beam on restitution
        stops, with impacts: 200 that count, or two rounds of a periodic orbit.

    Returns
    -------
    xarray.Dataset
        `lyapunov_exponent` per impact and `standard_error` along `exponent`, the largest first, on the dimensions of
        the sweep; `impact_interval` (s): exponents over it are those per second; `dimension` (Kaplan-Yorke),
        `impacts` that counted, `sum_error`; `reason`: why a run has none, else empty.

    Raises
    ------
    DatasetError
        It has no impacts, or no scene.
    UsageError
        The scene is none whose orbits are followed.

    Examples
    --------
    >>> lyapunov("run.nc").lyapunov_exponent      # doctest: +SKIP
    """
    if not isinstance(dataset, xr.Dataset):
        with open_dataset(dataset) as opened:
            return lyapunov(opened)
    scene, runs = scene_of(dataset, "lyapunov"), dataset.vibroimpact.runs
    bodies, impacts = Bodies(scene, runs), ImpactsOf(dataset)
    found = [_of_run(bodies, impacts, runs, place) for place in range(runs.sizes["run"])]
    return _on_sweep(dataset, found, 2 * bodies.most_modes)


def _of_run(bodies: Bodies, impacts: ImpactsOf, runs: xr.Dataset, place: int) -> Exponents | str:
    outcome = Outcome(int(runs["outcome"].values[place]))
    body = bodies[place]
    if outcome is not Outcome.ok:
        return f"outcome {outcome.name}"
    if "stick_count" in runs and runs["stick_count"].values[place] > 0:
        return "sticking: what is held on a stop forgets all, and the sum rule ends"
    if "impacts_per_period" in runs and np.isinf(runs["impacts_per_period"].values[place]).any():
        return "chatter: impacts without number"
    try:
        return exponents_of(body, impacts[int(runs["run_id"].values[place])])
    except ExponentError as problem:
        return str(problem).removeprefix("lyapunov: ")


def _on_sweep(dataset: xr.Dataset, found: list[Exponents | str], most: int) -> xr.Dataset:
    runs = OnSweep(dataset)
    exponents, errors = np.full((len(found), most), np.nan), np.full((len(found), most), np.nan)
    single = np.full((len(found), 4), np.nan)
    for row, each in enumerate(found):
        if not isinstance(each, str):
            count = each.per_impact.size
            exponents[row, :count], errors[row, :count] = each.per_impact, each.standard_error
            single[row] = each.interval, each.dimension, each.impacts, each.sum_error
    interval, dimension, impacts, sum_error = np.moveaxis(runs.placed(single), -1, 0)
    values = {
        "lyapunov_exponent": runs.placed(exponents),
        "standard_error": runs.placed(errors),
        "impact_interval": interval,
        "dimension": dimension,
        "impacts": impacts,
        "sum_error": sum_error,
        "reason": runs.texts([each if isinstance(each, str) else "" for each in found]),
        "exponent": np.arange(1, most + 1),
    }
    attrs = runs_attributes(dataset.attrs)
    return TABLE.dataset(values, attrs, over=runs.dims, coords=runs.coords, units=units_of(dataset))
