"""Sobol indices of the quantities of a campaign, as a dataset."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.dataset.schema import DRAW
from vibroimpact.analysis.sensitivity.design import design_of
from vibroimpact.analysis.sensitivity.indices import FEWEST_BLOCKS, sobol_indices
from vibroimpact.analysis.sensitivity.quantities import quantities_of
from vibroimpact.fmus.errors import DatasetError, UsageError

LEVEL = 0.95
RESAMPLES = 1000
TABLE = ResultTable(
    "sensitivity",
    ("first_order", "quantity ... parameter", "1", "first-order Sobol index"),
    ("total_order", "quantity ... parameter", "1", "total Sobol index"),
    (
        "first_order_interval",
        "quantity ... parameter bound",
        "1",
        "{level} bootstrap interval of the first-order Sobol index",
    ),
    (
        "total_order_interval",
        "quantity ... parameter bound",
        "1",
        "{level} bootstrap interval of the total Sobol index",
    ),
    ("blocks", "quantity ...", "1", "blocks of the design that were used"),
    ("quantity", "quantity", "1", "quantity whose variance is shared out", "text"),
    ("parameter", "parameter", "1", "parameter that was drawn", "text"),
    ("bound", "bound", "1", "end of an interval", "text"),
    ("quantity_name", "quantity", "1", "quantity in words", "text"),
)


def sensitivity_report(
    dataset: xr.Dataset,
    of: Sequence[str] = (),
    *,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> xr.Dataset:
    """Estimate how much of the variance of each quantity each drawn key of a campaign accounts for.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `open_dataset` gives it, of a sweep with `sample = { design = "saltelli", ... }`. Keys that span the drawn
        ones stay dimensions: indices along a frequency, say.
    of : sequence of str
        Quantities, see `quantities_of`; none: all that there are.
    level, resamples, seed
        Of the bootstrap intervals, see `sobol_indices`.

    Returns
    -------
    xarray.Dataset
        `first_order`, `total_order` and their intervals on `quantity`, `parameter` and the other keys of the sweep;
        `blocks`: how many they are estimated from. NaN where a quantity is constant; the attribute `remarks` says so.

    Raises
    ------
    DatasetError
        The dataset has no Saltelli design, or nothing that varies over it.
    UsageError
        There is no such quantity; or the level, the number of resamples or the seed makes no sense.

    Examples
    --------
    >>> sensitivity_report(open_dataset("campaign")).total_order      # doctest: +SKIP
    """
    design = design_of(dataset)
    if taken := sorted({"quantity", "parameter", "bound"} & set(map(str, dataset["outcome"].dims))):
        raise DatasetError(
            f"sensitivity: {taken[0]}: expected a dimension of another name. Rename it in Python."
        )
    found = quantities_of(dataset)
    names = _chosen([str(name) for name in found.data_vars], of)
    others = [str(dim) for dim in dataset["outcome"].dims if dim != DRAW]
    columns = [found[name].transpose(DRAW, *others).values for name in names]
    shape = (len(names), *columns[0].shape[1:])
    runs = np.stack(columns, axis=1).reshape(columns[0].shape[0], -1)
    indices = sobol_indices(*design.parts(runs), level=level, resamples=resamples, seed=seed)
    keys = len(design.names)
    values = {
        "first_order": indices.first_order.reshape(*shape, keys),
        "total_order": indices.total_order.reshape(*shape, keys),
        "first_order_interval": indices.first_interval.reshape(*shape, keys, 2),
        "total_order_interval": indices.total_interval.reshape(*shape, keys, 2),
        "blocks": indices.blocks.reshape(shape),
        "quantity": names,
        "parameter": list(design.names),
        "bound": ["lower", "upper"],
        "quantity_name": [found[name].attrs["long_name"] for name in names],
    }
    coordinates = {
        str(name): c.variable.copy(deep=False)
        for name, c in dataset.coords.items()
        if c.dims and set(c.dims) <= set(others)
    }
    for coordinate in coordinates.values():
        coordinate.attrs.setdefault("units", "1")  # the words of a direction have none
    report = TABLE.dataset(values, over=tuple(others), coords=coordinates, level=f"{100.0 * level:g} %")
    remarks = list(_remarks(report, design.blocks))
    if not np.isfinite(report.total_order.values).any():
        raise DatasetError(f"sensitivity: expected a quantity that varies, got none: {' '.join(remarks)}")
    attributes = {"blocks_drawn": design.blocks, "level": level, "resamples": resamples, "seed": seed}
    kept = {name: dataset.attrs[name] for name in ("title", "scene") if name in dataset.attrs}
    return report.assign_attrs(kept | attributes | {"remarks": "\n".join(remarks)})


def _chosen(there: Sequence[str], of: Sequence[str]) -> list[str]:
    """Return the quantities asked for."""
    if not there:
        raise DatasetError(
            "sensitivity: expected something recorded of each run, got nothing. Set extrema, impacts or a time "
            "series in [record]."
        )
    for name in of:
        if name not in there:
            raise UsageError(f"sensitivity: quantity: expected one of {', '.join(there)}, got {name!r}.")
    return list(dict.fromkeys(of)) or list(there)


def _remarks(report: xr.Dataset, drawn: int) -> list[str]:
    """Return what is to be said of quantities that are constant, or lost blocks to runs that failed."""
    remarks = []
    for name in report["quantity"].values.tolist():
        own = report.sel(quantity=name)
        blocks = own["blocks"].values
        unknown = np.isnan(own["total_order"].values).all(axis=-1)
        few = blocks < FEWEST_BLOCKS
        where = (
            ""
            if unknown.all() or not unknown.ndim
            else f" at {int((unknown & ~few).sum())} of {unknown.size} points"
        )
        if (unknown & ~few).any():
            remarks.append(f"{name} is the same for all draws{where}: it has no indices.")
        if few.any():
            remarks.append(f"{name} has fewer than {FEWEST_BLOCKS} whole blocks of runs: it has no indices.")
        elif blocks.min() < drawn:
            lost = drawn - int(blocks.min())
            remarks.append(
                f"{name}: {lost} of {drawn} blocks are left out, for runs that failed or have no such number; "
                "indices are those of what is left."
            )
    return remarks
