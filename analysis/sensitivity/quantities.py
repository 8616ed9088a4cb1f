"""The numbers of a run whose variance is divided among keys: one number per run for each quantity."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.derived import largest_impact_velocity
from vibroimpact.analysis.dataset.schema import RULES, Outcome, swept_names

Floats = NDArray[np.float64]

_RAN = (Outcome.ok, Outcome.stuck)


def quantities_of(dataset: xr.Dataset) -> xr.Dataset:
    """Return the quantities of an opened dataset that can be analysed, on the dimensions of its sweep.

    A run that did not come to its end is NaN. Recorded groups give `displacement_range`; the mean of
    `impacts_per_period`; `impact_count` or `event_count` without periods; and the largest `impact_velocity`, 0 without
    impacts. Each sampled variable gives `NAME_rms`, and each pair of signals of a replay a numbered
    `variance_accounted_for`.
    """
    ran = dataset["outcome"].isin(_RAN)
    found = {name: values.where(ran) for name, values in _recorded(dataset)}
    return xr.Dataset({name: values.astype(np.float64) for name, values in found.items()})


def _recorded(dataset: xr.Dataset) -> Iterator[tuple[str, xr.DataArray]]:
    there = dataset.variables
    if "displacement_range" in there:
        yield "displacement_range", dataset["displacement_range"]
    if "impacts_per_period" in there:
        each = dataset["impacts_per_period"]
        yield "impacts_per_period", _named(each.mean("period"), "1", "mean number of impacts in a period")
    elif "impact_count" in there:
        yield "impact_count", dataset["impact_count"]
    if "impact_velocity" in there:
        largest = largest_impact_velocity(dataset).fillna(0.0)
        yield "impact_velocity", _named(largest, _unit(dataset, "impact_velocity"), "largest impact velocity")
    if "event_count" in there:
        yield "event_count", dataset["event_count"]
    for name in _sampled(dataset):
        squares = _sums(dataset, dataset[name].values.astype(np.float64) ** 2)
        root = (squares / dataset["sample_count"].where(dataset["sample_count"] > 0)) ** 0.5
        yield f"{name}_rms", _named(root, _unit(dataset, name), f"root mean square of {name}")
    if "variance_accounted_for" in there:
        for number, pair in enumerate(dataset["compared"].values.tolist(), start=1):
            share = dataset["variance_accounted_for"].isel(compared=number - 1, drop=True)
            yield f"variance_accounted_for_{number}", _named(share, "%", f"variance accounted for of {pair}")


def _sampled(dataset: xr.Dataset) -> list[str]:
    """Return the sampled variables of a dataset."""
    coordinates = {*RULES, *swept_names(dataset), "sample_run"}
    return [
        str(name)
        for name, one in dataset.variables.items()
        if one.dims == ("sample",) and one.dtype.kind in "fiu" and name not in coordinates
    ]


def _sums(dataset: xr.Dataset, values: Floats) -> xr.DataArray:
    """Return the sum of the samples of each run; 0 for a run without samples."""
    owner, run_id = dataset["sample_run"].values, dataset["run_id"]
    sums = np.bincount(owner, values, minlength=int(run_id.max()) + 1)
    return run_id.copy(data=sums[run_id.values])


def _unit(dataset: xr.Dataset, name: str) -> str:
    return str(dataset[name].attrs.get("units", "1"))


def _named(values: xr.DataArray, unit: str, words: str) -> xr.DataArray:
    return values.drop_attrs().assign_attrs(units=unit, long_name=words)
