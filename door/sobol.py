"""Sobol indices of a campaign with drawn keys."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.sensitivity import LEVEL, RESAMPLES
from vibroimpact.analysis.sensitivity.report import SensitivityOfCampaign
from vibroimpact.given import PathLike, given_path, given_result
from vibroimpact.returned import of_study


def sensitivity(
    dataset: xr.Dataset | PathLike,
    path: PathLike | None = None,
    *,
    of: str | Sequence[str] = (),
    level: float = LEVEL,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> xr.Dataset:
    """Estimate the share of each result's variance that each drawn key of a campaign explains (Sobol indices).

    Parameters
    ----------
    dataset : xarray.Dataset or path
        Dataset, file or folder of a campaign with `sample = { design = "saltelli", ... }`.
    path : path, optional
        Dataset file to write as well (.nc).
    of : str or sequence of str
        Quantities to analyse, for example `displacement_range`. By default all quantities are analysed.
    level : float
        Confidence level of the bootstrap intervals.
    resamples, seed : int
        Number of bootstrap resamples, and the seed of their random numbers.

    Returns
    -------
    xarray.Dataset
        `first_order`, `total_order`, `first_order_interval` and `total_order_interval` have the dims `quantity`,
        `parameter` and the other keys of the sweep. `attrs["remarks"]` lists what was left out.

    Raises
    ------
    DatasetError
        The dataset has no whole Saltelli design, or no result varies over the design.
    UsageError
        A quantity is unknown; or the level, the number of resamples or the seed makes no sense.

    Examples
    --------
    >>> sensitivity("campaign").total_order.sel(quantity="displacement_range")    # doctest: +SKIP
    """
    target = given_result(path, [dataset])
    opened = dataset if isinstance(dataset, xr.Dataset) else open_dataset(given_path(dataset))
    names = [of] if isinstance(of, str) else list(of)
    return of_study(SensitivityOfCampaign(opened, names, level, resamples, seed), target)
