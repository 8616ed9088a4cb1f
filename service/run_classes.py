"""The class of each run of an open file, as a number that is cached like other variables, and its name."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.columns import OF_ALL_PERIODS
from vibroimpact.analysis.dataset.schema import OrbitClass, Outcome

STATES = ("strobe_displacement", "strobe_velocity", "displacement_max", "displacement_min")
_KINDS, _MOST_IMPACTS = 16, 2**24
"""Number of kinds of classes, and of impacts of an orbit, that fit into a code."""
_MOST_WORK, _EACH = 3e7, 200
"""Runs times (periods^2 + 200) above which classes are not computed: measured 10 s if all runs are aperiodic."""


def can_be_classified(file: netCDF4.Dataset) -> bool:
    """Whether a file has values of each period that determine the class of a run, and is small enough."""
    columns = _columns(file)
    if columns and file.dimensions["run"].size * (file[columns[0]].shape[1] ** 2 + _EACH) > _MOST_WORK:
        return False
    return bool(columns) and all(file[name].long_name != OF_ALL_PERIODS.get(name, "") for name in columns)


@dataclass(frozen=True, slots=True)
class ClassColumns:
    """The values of a file that determine the classes of its runs; the classification does not need the open file."""

    states: NDArray[np.float64]
    """States at each period, shape (run, period, state)."""
    impacts: NDArray[np.int64] | None
    """Impacts of each period, shape (run, period), where the file has them."""
    outcomes: NDArray[np.int8]
    """Outcomes, shape (run,); sticks have the same shape."""
    sticks: NDArray[np.int64]

    @classmethod
    def of(cls, file: netCDF4.Dataset) -> ClassColumns:
        """Return the values from an open file."""
        states = np.stack([np.asarray(file[name][:], dtype=np.float64) for name in _columns(file)], axis=-1)
        impacts = file["impacts_per_period"][:] if "impacts_per_period" in file.variables else None
        sticks = file["stick_count"][:] if "stick_count" in file.variables else np.zeros(len(states), int)
        return cls(states, impacts, file["outcome"][:], sticks)

    def codes(self) -> NDArray[np.float64]:
        """Return the class of each run as a number, shape (run,)."""
        from vibroimpact.analysis.orbits.classify import class_of  # xarray takes half a second to load

        found = np.empty(len(self.states))
        for run, own in enumerate(self.states):
            impacts = None if self.impacts is None else self.impacts[run]
            one = class_of(own, impacts, Outcome(int(self.outcomes[run])), bool(self.sticks[run] > 0))
            found[run] = int(one.kind) + _KINDS * ((one.impacts + 1) + _MOST_IMPACTS * one.periods)
        return found


def named_classes(codes: NDArray[np.float64]) -> tuple[list[str], NDArray[np.float64]]:
    """Return the names of the occurring classes, the most frequent first, and the place of each code among them."""
    distinct, owner = np.unique(codes, return_inverse=True)
    names = [_name(int(code)) for code in distinct]
    counts: Counter[str] = Counter()
    for name, count in zip(names, np.bincount(owner, minlength=len(names)), strict=True):
        counts[name] += int(count)
    classes = [name for name, _ in counts.most_common()]
    places = np.array([classes.index(name) for name in names], dtype=np.float64)
    return classes, places[owner]


def _name(code: int) -> str:
    from vibroimpact.analysis.orbits.classify import RunClass

    rest, kind = divmod(code, _KINDS)
    periods, impacts = divmod(rest, _MOST_IMPACTS)
    return RunClass(OrbitClass(kind), impacts - 1, periods).name


def _columns(file: netCDF4.Dataset) -> list[Any]:
    return [name for name in STATES if name in file.variables]
