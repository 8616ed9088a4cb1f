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
    target = given_result(path, [dataset])
    opened = dataset if isinstance(dataset, xr.Dataset) else open_dataset(given_path(dataset))
    names = [of] if isinstance(of, str) else list(of)
    return of_study(SensitivityOfCampaign(opened, names, level, resamples, seed), target)
