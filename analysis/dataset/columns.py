"""The records of many runs as arrays: the columns that a dataset is built of."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import (
    IMPACT_COLUMNS,
    PERIOD_COLUMNS,
    POINT_COLUMNS,
    RAGGED,
    STICK_COLUMNS,
    RunRecord,
    known_rule,
    names_list,
    period_columns,
)
from vibroimpact.fmus.errors import DatasetError

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Ragged:
    """Rows of runs, those of the first run first: `count`, shape (run,), and `rows`, shape (row, column)."""

    count: NDArray[np.int64]
    rows: Floats

    @property
    def nbytes(self) -> int:
        """Size of the arrays, bytes."""
        return self.count.nbytes + self.rows.nbytes

    def taken(self, first: int, stop: int) -> Ragged:
        """Return the rows of the runs `first` to `stop - 1`."""
        begin, end = int(self.count[:first].sum()), int(self.count[:stop].sum())
        return Ragged(self.count[first:stop], self.rows[begin:end])

    def chosen(self, runs: NDArray[np.int64]) -> Ragged:
        """Return the rows of some runs, in their order."""
        count = self.count[runs]
        begin = (np.cumsum(self.count) - self.count)[runs]
        rows = np.arange(count.sum()) + np.repeat(begin - (np.cumsum(count) - count), count)
        return Ragged(count, self.rows[rows])


@dataclass(frozen=True, slots=True)
class RunColumns:
    """Records of runs, one element or row for each; a group that their scene does not record is None.

    Attributes are named as in `RunRecord`, but hold all runs at once. `periods` has the shape (run, period, 5): a run
    that recorded fewer periods than the others ends in NaN.
    """

    outcome: NDArray[np.int8]
    message: NDArray[np.object_]
    seconds: Floats
    final_displacement: Floats
    final_velocity: Floats
    final_phase: Floats
    final_state: Floats | None = None
    periods: Floats | None = None
    impacts: Ragged | None = None
    sticks: Ragged | None = None
    samples: Ragged | None = None

    def __len__(self) -> int:
        return len(self.outcome)

    @property
    def nbytes(self) -> int:
        """Size of the arrays, bytes."""
        values = (getattr(self, name) for name in self.__slots__)
        return sum(value.nbytes for value in values if value is not None)

    def taken(self, first: int, stop: int) -> RunColumns:
        """Return the runs `first` to `stop - 1`."""

        def some(values: Any) -> Any:
            if isinstance(values, Ragged):
                return values.taken(first, stop)
            return None if values is None else values[first:stop]

        return RunColumns(*(some(getattr(self, name)) for name in self.__slots__))

    def chosen(self, runs: NDArray[np.int64]) -> RunColumns:
        """Return some runs, in their order."""

        def some(values: Any) -> Any:
            if isinstance(values, Ragged):
                return values.chosen(runs)
            return None if values is None else values[runs]

        return RunColumns(*(some(getattr(self, name)) for name in self.__slots__))


def arrays_of(
    columns: RunColumns, omit: Collection[str] = (), *, each_period: bool = True, further: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the records of runs as arrays, by their names in a dataset and in its types.

    Parameters
    ----------
    columns : RunColumns
    omit : collection of str
        Per-period variables that are left out.
    each_period : bool
        False: one element stands for all recorded periods of a run, as `of_all_periods` computes it.
    further : sequence of str
        Names in files of the further observed points.
    """
    found: dict[str, Any] = {
        "outcome": columns.outcome,
        "message": columns.message,
        "point_seconds": columns.seconds,
        "final_displacement": columns.final_displacement,
        "final_velocity": columns.final_velocity,
        "final_phase": columns.final_phase,
    }
    if columns.final_state is not None:
        found["final_state"] = columns.final_state
    if columns.periods is not None:
        periods = columns.periods if each_period else of_all_periods(columns.periods)
        of_periods = zip(period_columns(further), np.moveaxis(periods, -1, 0), strict=True)
        left_out = tuple(omit)
        found |= {name: values for name, values in of_periods if not name.startswith(left_out)}
    for dimension, rows, names in (
        ("impact", columns.impacts, IMPACT_COLUMNS),
        ("stick", columns.sticks, STICK_COLUMNS),
    ):
        if rows is not None:
            found |= {RAGGED[dimension]: rows.count, **dict(zip(names, rows.rows.T, strict=True))}
    return {
        name: np.ascontiguousarray(values, dtype=known_rule(name).dtype) for name, values in found.items()
    }


def columns_of(records: Sequence[RunRecord]) -> RunColumns:
    """Return the columns of single runs.

    Raises
    ------
    DatasetError
        Their whole states are of different sizes.
    """
    numbers = np.array(
        [(r.seconds, r.final_displacement, r.final_velocity, r.final_phase) for r in records],
        dtype=np.float64,
    ).reshape(-1, 4)
    message = np.empty(len(records), dtype=object)
    message[:] = [record.message for record in records]
    seconds, displacement, velocity, phase = np.ascontiguousarray(numbers.T)
    return RunColumns(
        outcome=np.array([record.outcome for record in records], dtype=np.int8),
        message=message,
        seconds=seconds,
        final_displacement=displacement,
        final_velocity=velocity,
        final_phase=phase,
        final_state=_states([record.final_state for record in records]),
        periods=_periods([record.periods for record in records]),
        impacts=ragged([record.impacts for record in records], len(IMPACT_COLUMNS)),
        sticks=ragged([record.sticks for record in records], len(STICK_COLUMNS)),
        samples=_samples([record.samples for record in records]),
    )


def _samples(tables: Sequence[Floats | None]) -> Ragged | None:
    widths = {table.shape[1] for table in tables if table is not None}
    if len(widths) > 1:
        raise DatasetError(
            f"dataset: samples: expected tables of one width, got {names_list(list(map(str, sorted(widths))))}."
        )
    return ragged(tables, widths.pop()) if widths else None


def _states(states: Sequence[Floats | None]) -> Floats | None:
    sizes = {state.size for state in states if state is not None}
    if not sizes:
        return None
    if len(sizes) > 1:
        raise DatasetError(
            f"dataset: final_state: expected states of one size, got {names_list(list(map(str, sorted(sizes))))}."
        )
    missing = np.full(sizes.pop(), np.nan)
    return np.array([missing if state is None else state for state in states])


def _periods(tables: Sequence[Floats | None]) -> Floats | None:
    if all(table is None for table in tables):
        return None
    length, width = np.max([table.shape for table in tables if table is not None], axis=0)
    values = np.full((len(tables), length, width), np.nan)
    for row, table in enumerate(tables):
        if table is not None:
            values[row, : len(table)] = table
    return values


OF_ALL_PERIODS = {
    "displacement_max": "largest displacement in all recorded periods",
    "displacement_min": "smallest displacement in all recorded periods",
    "strobe_displacement": "displacement at forcing phase zero of the last recorded period",
    "strobe_velocity": "velocity at forcing phase zero of the last recorded period",
    "impacts_per_period": "mean number of impacts in a recorded period",
}
"""Meanings of the variables of each period where one value stands for all, see `of_all_periods`."""


def of_all_periods(periods: Floats) -> Floats:
    """Return the values of each run over all its periods together.

    The columns are those of `schema.period_columns`, shape (run, period, column), then (run, 1, column): largest,
    smallest, both strobe values of the last period, mean. A run with fewer periods than the others ends in NaN; a run
    without any has NaN alone. Values of one period stand for all as they are.
    """
    if periods.shape[1] == 1:
        return periods
    result = np.full((len(periods), 1, periods.shape[2]), np.nan)
    # each recorded period has its number of impacts, also where nothing else is recorded
    count = np.count_nonzero(~np.isnan(periods[:, :, 4]), axis=1)
    some = count > 0
    if some.any():
        known, last = periods[some], count[some] - 1
        for first in (0, *range(len(PERIOD_COLUMNS), periods.shape[2], len(POINT_COLUMNS))):
            result[some, 0, first] = np.fmax.reduce(known[:, :, first], axis=1)
            result[some, 0, first + 1] = np.fmin.reduce(known[:, :, first + 1], axis=1)
            strobe = slice(first + 2, first + 4)
            result[some, 0, strobe] = known[np.arange(len(known)), last, strobe]
        result[some, 0, 4] = np.nansum(known[:, :, 4], axis=1) / count[some]
    return result


def ragged(tables: Sequence[Floats | None], columns: int) -> Ragged | None:
    """Return the tables of runs as one, with this number of columns; None where no run has a table."""
    known = [_with_columns(table, columns) for table in tables if table is not None]
    if not known:
        return None
    count = np.array([0 if table is None else len(table) for table in tables], dtype=np.int64)
    return Ragged(count, np.concatenate(known))


def _with_columns(table: Floats, number: int) -> Floats:
    """Return a table with this number of columns; columns that its run does not know are NaN."""
    known = table[:, :number]
    return np.hstack([known, np.full((len(known), number - known.shape[1]), np.nan)])


def joined(pieces: list[RunColumns]) -> RunColumns:
    """Return the runs of several columns of one scene, one after the other.

    The list is emptied. A column of the pieces is let go as soon as it is joined, so that memory holds few of them
    twice.
    """
    if len(pieces) == 1:
        return pieces.pop()
    columns = {name: [getattr(piece, name) for piece in pieces] for name in RunColumns.__slots__}
    pieces.clear()
    return RunColumns(*(_joined(columns.pop(name)) for name in RunColumns.__slots__))


def _joined(values: Sequence[Any]) -> Any:
    first = values[0]
    if isinstance(first, Ragged):
        return Ragged(np.concatenate([v.count for v in values]), np.concatenate([v.rows for v in values]))
    if first is None:
        return None
    if first.ndim == 3:
        return _joined_periods(values)
    return np.concatenate(values)


def _joined_periods(tables: Sequence[Floats]) -> Floats:
    """Return tables of periods as one, shape (run, period, column), whose columns are contiguous."""
    runs, periods, columns = (list(sizes) for sizes in zip(*(table.shape for table in tables), strict=True))
    whole = np.full((columns[0], sum(runs), max(periods)), np.nan)
    for table, end in zip(tables, np.cumsum(runs), strict=True):
        whole[:, end - len(table) : end, : table.shape[1]] = np.moveaxis(table, -1, 0)
    return np.moveaxis(whole, 0, -1)
