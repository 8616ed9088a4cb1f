"""Quantities of runs that come from other variables: displacement range, largest impact, mean number of impacts."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RANGE, RANGE_ENDS = "displacement_range", ("displacement_max", "displacement_min")
"""The displacement range of a run, and the variables that it comes from."""
LARGEST_IMPACT = "largest_impact_velocity"
"""The largest impact velocity of a run, NaN without an impact."""
MEAN_IMPACTS = "mean_impacts_per_period"
"""The mean number of impacts in a forcing period of a run, NaN without an impact."""


def range_over_periods(largest: Floats, smallest: Floats) -> Floats:
    """Return the range of each run, shape (run,), from the extremes of its periods, shape (run, period)."""
    top = np.fmax.reduce(largest, axis=1, initial=-np.inf)
    bottom = np.fmin.reduce(smallest, axis=1, initial=np.inf)
    return np.where(top >= bottom, top - bottom, np.nan)


def largest_of_runs(owner: NDArray[Any], velocities: NDArray[Any], runs: int) -> Floats:
    """Return the largest impact velocity of each run, shape (run,), from the run of each impact; NaN without one."""
    largest = np.full(runs, np.nan)
    np.fmax.at(largest, owner, velocities)
    return largest


def largest_impact_velocity(dataset: xr.Dataset) -> xr.DataArray:
    """Return the largest impact velocity of each run (m/s), on the dimensions of `run_id`; NaN without an impact.

    Parameters
    ----------
    dataset : xarray.Dataset
        An opened dataset, or some runs of it, with `run_id`, `impact_run` and `impact_velocity`.
    """
    run_id, owner = dataset["run_id"].values, dataset["impact_run"].values
    runs = 1 + max(int(run_id.max(initial=-1)), int(owner.max(initial=-1)))
    largest = largest_of_runs(owner, dataset["impact_velocity"].values, runs)
    # a point of the grid without a run has the run_id -1
    return dataset["run_id"].copy(data=np.append(largest, np.nan)[run_id])


def mean_of_periods(impacts: NDArray[Any], axis: int = -1) -> Floats:
    """Return the mean of the impacts of runs over the axis of their periods; NaN without an impact."""
    there = ~np.isnan(impacts)
    mean = np.sum(impacts, axis=axis, where=there) / np.maximum(there.sum(axis=axis), 1)
    return np.where(mean > 0.0, mean, np.nan)


def _range(columns: Mapping[str, NDArray[Any]]) -> Floats:
    return range_over_periods(*(columns[name] for name in RANGE_ENDS))


def _largest_impact(columns: Mapping[str, NDArray[Any]]) -> Floats:
    counts = columns["impact_count"]
    return largest_of_runs(np.repeat(np.arange(len(counts)), counts), columns["impact_velocity"], len(counts))


def _mean_impacts(columns: Mapping[str, NDArray[Any]]) -> Floats:
    return mean_of_periods(columns["impacts_per_period"])


@dataclass(frozen=True, slots=True)
class DerivedQuantity:
    """A quantity of runs that comes from their other variables.

    Attributes
    ----------
    name, label : str
    sources : tuple of str
        The variables of runs that it comes from; the first has its units.
    values : callable
        Function of these variables by name; returns the quantity, shape (run,).
    """

    name: str
    label: str
    sources: tuple[str, ...]
    values: Callable[[Mapping[str, NDArray[Any]]], Floats]

    def is_from(self, names: Container[str]) -> bool:
        """Return whether runs with these variables have the quantity."""
        return all(name in names for name in self.sources)


DERIVED = (
    DerivedQuantity(RANGE, "range of the displacement in a run", RANGE_ENDS, _range),
    DerivedQuantity(
        LARGEST_IMPACT,
        "largest impact velocity in a run",
        ("impact_velocity", "impact_count"),
        _largest_impact,
    ),
    DerivedQuantity(
        MEAN_IMPACTS,
        "impacts per forcing period, mean of a run",
        ("impacts_per_period",),
        _mean_impacts,
    ),
)
"""All derived quantities."""
