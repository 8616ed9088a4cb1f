"""The intervals of a swept parameter in which the motion jumps, found in a dataset."""

from __future__ import annotations

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.clock import refuse_quasi_periodic
from vibroimpact.analysis.dataset.columns import OF_ALL_PERIODS
from vibroimpact.analysis.dataset.schema import swept_names
from vibroimpact.analysis.jumps.classes import classes_of
from vibroimpact.fmus.errors import DatasetError

JUMP = 0.05
"""Change of the recorded range between neighbours, over the largest range, above which the motion jumps."""


def jumps_of(dataset: xr.Dataset, jump: float = JUMP) -> xr.Dataset:
    """Return the intervals between neighbouring runs of a one-parameter sweep in which the motion jumps.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `open_dataset` gives it, adaptive or not.
    jump : float
        Change of the displacement range, over the largest one, that counts as a jump.

    Returns
    -------
    xarray.Dataset
        Along `jump`: `below` and `above`, the values at both ends of the interval; `direction`. Along `side` as well:
        `period` and `impacts` of the motion P(p,q) at each end (period 0: aperiodic).

    Raises
    ------
    DatasetError
        The dataset sweeps more than one parameter, or none; or it has one value for all periods.

    Examples
    --------
    >>> jumps_of(open_dataset("campaign")).above.values  # doctest: +SKIP
    """
    names = [name for name in swept_names(dataset) if dataset[name].size > 1]
    if len(names) != 1:
        raise DatasetError(
            f"jumps: expected one swept parameter, got {', '.join(names) or 'none'}. Select values of the others."
        )
    if any(
        dataset[name].attrs.get("long_name") == words
        for name, words in OF_ALL_PERIODS.items()
        if name in dataset
    ):
        raise DatasetError(
            "jumps: expected values of each recorded period, got one for all. "
            "Run it without each_period = false."
        )
    refuse_quasi_periodic(dataset.attrs, "jumps")
    runs = dataset.vibroimpact.runs
    values = runs[names[0]].values
    directions = np.broadcast_to(runs["direction"].values, values.shape)
    classes = classes_of(runs)
    order = np.lexsort((values, directions))
    low, high = order[:-1], order[1:]
    step = jump * float(np.nanmax(classes.extent, initial=0.0))
    there = classes.jump(low, high, step) & (directions[low] == directions[high])
    low, high = low[there], high[there]
    unit = dataset[names[0]].attrs.get("units", "1")
    labels = np.stack([classes.label[low], classes.label[high]], axis=1)
    return xr.Dataset(
        {
            "below": ("jump", values[low], {"units": unit, "long_name": f"{names[0]} below the jump"}),
            "above": ("jump", values[high], {"units": unit, "long_name": f"{names[0]} above the jump"}),
            "direction": ("jump", directions[low]),
            "period": (("jump", "side"), labels[:, :, 1]),
            "impacts": (("jump", "side"), labels[:, :, 2]),
        },
        coords={"side": ["below", "above"]},
    )
