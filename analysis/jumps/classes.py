"""The class of each run: its outcome, the period of its orbit, and the impacts in one turn of the orbit.

A motion P(p,q) repeats after q forcing periods with p impacts. A motion has such a class if it repeats within half of
the recorded time. All other motions are aperiodic: chaos, long periods or transients.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import Outcome

SAME = 1e-3
"""Difference between two periods, over the run's largest value of the quantity, below which they count as equal."""
APERIODIC = 0
_TINY = np.finfo(np.float64).tiny
_UNCOUNTED = -1
_COMPLETE_CHATTER = -2
_ORBIT = ("strobe_displacement", "strobe_velocity", "displacement_max", "displacement_min")
_RAN = (Outcome.ok, Outcome.stuck)


@dataclass(frozen=True, slots=True)
class RunClasses:
    """The distinguishing numbers of runs.

    Attributes
    ----------
    label : ndarray of int, shape (run, 3)
        Outcome; forcing periods until the orbit repeats (0: aperiodic); impacts in that time. Impacts are events in a
        scene of components; -1 means not compared, -2 infinitely many.
    extent : ndarray of float, shape (run,)
        Displacement range (m); NaN where it is not compared.
    """

    label: NDArray[np.int64]
    extent: NDArray[np.float64]

    def jump(self, one: NDArray[np.intp], other: NDArray[np.intp], step: float) -> NDArray[np.bool_]:
        """Return a mask of the pairs of runs between which the motion jumps: by class, or by a range beyond `step`."""
        differ = (self.label[one] != self.label[other]).any(axis=1)
        # NaN means not compared, and makes no jump
        return np.asarray(differ | (np.abs(self.extent[one] - self.extent[other]) > step))

    def joined(self, more: RunClasses) -> RunClasses:
        """Return the classes of these runs followed by the classes of others."""
        label = np.concatenate([self.label, more.label])
        return RunClasses(label, np.concatenate([self.extent, more.extent]))


def classes_of(runs: xr.Dataset) -> RunClasses:
    """Return the class of each run of a one-dimensional dataset.

    Parameters
    ----------
    runs : xarray.Dataset
        As it is stored, or `ds.vibroimpact.runs`. Quantities that were not recorded are not compared.
    """
    outcome = runs["outcome"].values.astype(np.int64)
    repeats = np.where(np.isin(outcome, _RAN), _periods_of(runs), APERIODIC)
    periodic = repeats != APERIODIC
    count = np.where(periodic, _counted(runs, repeats), _UNCOUNTED)
    extent = np.full(outcome.size, np.nan)
    if "displacement_max" in runs.variables:
        high, low = runs["displacement_max"].values, runs["displacement_min"].values
        spread = np.fmax.reduce(high, axis=1, initial=-np.inf) - np.fmin.reduce(low, axis=1, initial=np.inf)
        extent = np.where(periodic & np.isfinite(spread), spread, np.nan)
    return RunClasses(np.stack([outcome, repeats, count], axis=1), extent)


def _periods_of(runs: xr.Dataset) -> NDArray[np.int64]:
    """Return the period of each run in forcing periods; 1 in a scene without forcing, 0 for an aperiodic run."""
    columns = [runs[name].values for name in _ORBIT if name in runs.variables and runs[name].shape[1] > 1]
    found = np.zeros(runs.sizes["run"], dtype=np.int64)
    if not columns:
        return found + 1
    scaled = [c / np.fmax.reduce(np.abs(c), axis=1, initial=_TINY)[:, None] for c in columns]
    for period in range(1, columns[0].shape[1] // 2 + 1):
        distance = np.max([np.abs(c[:, period:] - c[:, :-period]).max(axis=1) for c in scaled], axis=0)
        found[(found == 0) & (distance <= SAME)] = period
    return found


def _counted(runs: xr.Dataset, repeats: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the impacts, or events, of each run during one turn of its orbit."""
    if "impacts_per_period" in runs.variables:
        each = runs["impacts_per_period"].values
        inside = np.arange(each.shape[1]) < np.maximum(repeats, 1)[:, None]
        sums = np.where(inside, each, 0.0).sum(axis=1)
    else:
        names = [name for name in ("impact_count", "event_count") if name in runs.variables]
        sums = np.sum([runs[name].values for name in names], axis=0, dtype=np.float64, initial=0.0)
        sums = np.broadcast_to(sums, repeats.shape)
    finite = np.isfinite(sums)
    return np.where(finite, np.rint(np.where(finite, sums, 0.0)), _COMPLETE_CHATTER).astype(np.int64)
