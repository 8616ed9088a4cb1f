"""The loop over points with one point, again and again: a million calls cost little more than the motion.

Arrays, plan and calls of C come from `loop_rows` and are made once. A key that is the value of a single parameter of
the FMU sets that parameter directly. Other keys need all parameters of the scene anew for each point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import IMPACT_COLUMNS, PERIOD_COLUMNS, RULES, STICK_COLUMNS, Outcome
from vibroimpact.fmus.core import runs as core
from vibroimpact.orchestrator.run.dataset import DatasetForm
from vibroimpact.orchestrator.run.many_points.loop import (
    NOT_IN_THE_LOOP,
    PointLoop,
    PointValues,
    PreparedPoints,
)
from vibroimpact.orchestrator.run.many_points.loop_rows import LoopArrays
from vibroimpact.orchestrator.run.parameters import float_parameters, own_parameters, state_variables
from vibroimpact.orchestrator.run.record import OBSERVED, ROW_IMPACT, ROW_PERIOD
from vibroimpact.orchestrator.run.window import forced_window
from vibroimpact.orchestrator.scene.laws import LAWS

NOT_OF_THE_MOTION = ("run_index", "direction", "point_seconds")
"""Variables of a dataset that do not describe the motion of a point."""

Floats = NDArray[np.float64]
_OK = np.int8(Outcome.ok)
_PHASES = {True: np.float64(0.0), False: np.float64(np.nan)}
_IMPACTS = [(column % len(IMPACT_COLUMNS), name) for column, name in enumerate(IMPACT_COLUMNS, start=1)]
_CONTACT = IMPACT_COLUMNS.index("impact_contact") + 1
_NO_STICKS = {
    "stick_count": np.int32(0),
    **{name: np.empty(0, dtype=RULES[name].dtype) for name in STICK_COLUMNS},
}


class OnePoint:
    """Runs one point of a scene after the other, each from the scene's own start: see `one_point_of`.

    Parameters
    ----------
    loop : PointLoop
        Loop of a scene without a sweep.
    points : PreparedPoints
        The scene itself, as one point.
    keys : sequence of str
        Keys whose values differ from point to point.
    form : DatasetForm
        Form of the scene's dataset.
    """

    def __init__(
        self, loop: PointLoop, points: PreparedPoints, keys: Sequence[str], form: DatasetForm
    ) -> None:
        self._form = form
        self._scene, self._keys, self._points = loop.scene, tuple(keys), points
        self._names = names = loop.driver.float_names
        self._columns = [points.columns[name] for name in names]
        own = own_parameters(loop.scene, keys)
        self._own = None if own is None else [names.index(each) for each in own]
        self._arrays = LoopArrays(loop, points, None)
        self._row = points.table[0]
        record, stops = loop.scene.record, loop.scene.stops
        self._elements = len(state_variables(loop.scene))
        self._has_impacts = record.impacts
        of_periods = enumerate(PERIOD_COLUMNS, start=2) if points.periods else ()
        self._periods = [(column, name) for column, name in of_periods if name not in form.omitted]
        self._is_plain = record.each_period and all(LAWS[stop.law].is_rigid for stop in stops)
        forcing = "forcing.angular_frequency", "forcing.phase"
        self._frequency, self._phase = map(names.index, forcing) if points.forced else (-1, -1)

    def run(self, values: Sequence[float]) -> dict[str, Any] | None:
        """Return the results of a point; None where it must run alone: its body refuses it, or its force has no period.

        Parameters
        ----------
        values : sequence of float
            Values in the order of the keys.

        Returns
        -------
        dict of str to ndarray
            Arrays with the names of `columns.arrays_of`, without the dimension of runs.
        """
        self._set(values)
        if self._frequency >= 0 and not self._set_window():
            return None
        arrays = self._arrays
        arrays.begin_again()
        while (end := arrays.call()) is not core.RunsEnd.done:
            if end is core.RunsEnd.refused:
                return None
        rows = arrays.only_rows() if self._is_plain else None
        plain = None if rows is None else self._plain(rows)
        return of_the_only_run(self._form.arrays(arrays.columns())) if plain is None else plain

    def _plain(self, rows: Floats) -> dict[str, Any] | None:
        """Return the results from rows of periods and of impacts on rigid stops; None if there are other rows."""
        kinds, final = rows[:, 0], self._arrays.finals[0]
        impacts = rows.compress(kinds == ROW_IMPACT, axis=0).T.copy()
        periods = rows.compress(kinds == ROW_PERIOD, axis=0).T.copy()
        if impacts.shape[1] + periods.shape[1] < len(rows):
            return None
        found: dict[str, Any] = {
            "outcome": _OK,
            "message": "",
            "final_displacement": final[0],
            "final_velocity": final[1],
            "final_phase": _PHASES[self._points.forced],
        }
        if self._elements:
            found["final_state"] = final[len(OBSERVED) : len(OBSERVED) + self._elements].copy()
        for column, name in self._periods:
            found[name] = periods[column]
        if self._has_impacts:
            impacts[0] = (
                np.nan
            )  # the column of the row's kind becomes the largest force, which rigid stops do not have
            for column, name in _IMPACTS:
                found[name] = impacts[column]
            found["impact_contact"] = impacts[_CONTACT].astype(np.int8)
            found["impact_count"] = np.int32(impacts.shape[1])
            found |= _NO_STICKS
        return found

    def _set(self, values: Sequence[float]) -> None:
        """Set the parameters of the point."""
        row, columns = self._row, self._columns
        if self._own is not None:
            for place, value in zip(self._own, values, strict=True):
                row[place] = columns[place][0] = value
            return
        found = float_parameters(self._scene.at(dict(zip(self._keys, values, strict=True))), None)
        for place, name in enumerate(self._names):
            row[place] = columns[place][0] = found[name]

    def _set_window(self) -> bool:
        """Set start and end of the recording; return False where the force has no period."""
        frequency = float(self._row[self._frequency])
        if frequency == 0.0:
            return False
        begin, end = forced_window(self._scene.record, float(self._row[self._phase]), frequency)
        self._points.begin[0], self._points.end[0] = begin, end
        return True


def one_point_of(loop: PointLoop, keys: Sequence[str], form: DatasetForm) -> OnePoint | None:
    """Return the loop over one point that varies some keys; None where points must run alone.

    Parameters
    ----------
    loop : PointLoop
        Loop of a scene without a sweep.
    keys : sequence of str
        Keys that have a value in the scene.
    form : DatasetForm
    """
    points = loop.prepared(PointValues({}, np.ones(1, dtype=np.bool_)))
    if points is None or loop.scene.execution.deadline is not None or set(keys) & set(NOT_IN_THE_LOOP):
        return None
    return OnePoint(loop, points, keys, form)


def of_the_only_run(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arrays of one run without the dimension of runs, and without `NOT_OF_THE_MOTION`."""
    return {
        name: array[0] if RULES[name].dims[0] == "run" else array
        for name, array in found.items()
        if name not in NOT_OF_THE_MOTION
    }
