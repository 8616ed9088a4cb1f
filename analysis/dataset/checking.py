"""The check of a dataset against the schema; every writer calls it before it writes.

There are two kinds of problems. A file that would be no dataset (a variable is missing, counts do not sum) is
refused. A run with impossible values (a speed of approach below 0) is marked; all other runs are kept.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from typing import Any, get_args

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import (
    CONVENTIONS,
    COUPLED_COLUMNS,
    EVENT_COLUMNS,
    NEEDED_IMPACT_COLUMNS,
    RAGGED,
    RULES,
    RUN_COLUMNS,
    SCORE_COLUMNS,
    STICK_COLUMNS,
    TRACE_COLUMNS,
    Direction,
    Outcome,
    UnitSystem,
    constant_names,
    is_of_samples,
    swept_names,
    variable_rule,
)
from vibroimpact.analysis.files.stores import Place
from vibroimpact.fmus.errors import DatasetError


def refuse_foreign(place: Place, attributes: Collection[object], variables: Collection[object]) -> None:
    """Raise DatasetError unless a file or store has the marks of a dataset of this package."""
    if "dataset_schema" not in attributes or not all(name in variables for name in ("run_index", "outcome")):
        raise DatasetError(
            f"{os.fspath(place)}: expected a dataset written by vibroimpact, got other contents. "
            "Use the dataset of a campaign or the file of a run."
        )


def check(dataset: xr.Dataset) -> None:
    """Check a one-dimensional dataset against the schema.

    The values of a run with the outcome error are not checked: such a run promises nothing.

    Parameters
    ----------
    dataset : xarray.Dataset
        A dataset along `run`, as `build_dataset` makes it.

    Raises
    ------
    DatasetError
        With all problems, one on each line.
    """
    problems = _problems(dataset)
    if not problems:
        index = dataset.variables["run_index"].values
        problems = [f"run {index[run]}: {problem}" for run, problem in _run_problems(dataset)]
    if problems:
        raise _refusal(problems)


def marked(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset in which each run whose values fail the check has the outcome error, and the reason.

    Computed values are never removed: the values of a marked run stay as they are.

    Parameters
    ----------
    dataset : xarray.Dataset
        A dataset along `run`; it is not changed.

    Raises
    ------
    DatasetError
        Names, dimensions, types or counts are wrong, so that runs cannot be distinguished.
    """
    problems = _problems(dataset)
    if problems:
        raise _refusal(problems)
    bad = list(_run_problems(dataset))
    if not bad:
        return dataset
    # a needless copy would cost more than all other work here
    outcome, message = dataset.variables["outcome"].copy(), dataset.variables["message"].copy()
    for run, problem in bad:
        outcome.values[run] = Outcome.error
        message.values[run] = "; ".join(text for text in (message.values[run], f"check: {problem}") if text)
    return dataset.assign(outcome=outcome, message=message)


def _refusal(problems: list[str]) -> DatasetError:
    return DatasetError("\n".join(f"dataset: {problem}" for problem in problems))


def _problems(dataset: xr.Dataset) -> list[str]:
    """Return the reasons why this is no dataset at all."""
    # The contents mean nothing while a variable is missing or has another shape.
    return structure_problems(dataset) or _content_problems(dataset)


def structure_problems(dataset: xr.Dataset) -> list[str]:
    """Return the problems of names, dimensions, types and attributes."""
    problems = [f"{name}: expected this variable, got none." for name in _missing_names(dataset)]
    if dataset.attrs.get("Conventions") != CONVENTIONS:
        problems.append(f"Conventions: expected {CONVENTIONS!r}, got {dataset.attrs.get('Conventions')!r}.")
    if dataset.attrs.get("units_system") not in get_args(UnitSystem):
        problems.append(
            f"units_system: expected {' or '.join(get_args(UnitSystem))}, "
            f"got {dataset.attrs.get('units_system')!r}."
        )
    for name, variable in dataset.variables.items():
        problems += _variable_problems(str(name), variable)
    return problems


# Variables that one key of a scene records are stored together.
_GROUPS = (
    ("displacement_max", "displacement_min"),
    ("strobe_displacement", "strobe_velocity"),
    ("impact_count", *NEEDED_IMPACT_COLUMNS),
    ("stick_count", *STICK_COLUMNS),
    ("event_count", *EVENT_COLUMNS),
    ("chosen_step_count", *TRACE_COLUMNS),
    ("connection", "energy_residual"),
    ("compared", *SCORE_COLUMNS),
)


def _missing_names(dataset: xr.Dataset) -> list[str]:
    """Return the required names that are missing: names of every run, and recorded groups that are incomplete."""
    present = set(map(str, dataset.variables))
    required = set(RUN_COLUMNS)
    for group in _GROUPS:
        if present.intersection(group):
            required.update(group)
    if "sample" in dataset.dims or "sample_count" in present:
        required.update(("sample_count", "time"))
    return sorted(required - present)


def _variable_problems(name: str, variable: xr.Variable) -> list[str]:
    """Return the problems of one variable."""
    rule = RULES.get(name)
    if rule is None and variable.dims == RULES["displacement_max"].dims:
        rule = variable_rule(name)
    problems = []
    if rule is None:
        if variable.dims not in ((), ("run",)) and variable.dims[0] != "sample":
            problems.append(f"{name}: expected dimensions of a parameter or a sample, got {variable.dims}.")
        if variable.dtype != np.float64 and not is_of_samples(variable.dims, variable.dtype):
            problems.append(f"{name}: expected float64, got {variable.dtype}.")
    else:
        if variable.dims != rule.dims:
            problems.append(f"{name}: expected dimensions {rule.dims}, got {variable.dims}.")
        # text is object where it was built, and has a fixed length where it was read
        is_text = np.dtype(rule.dtype).kind == "O" and variable.dtype.kind in "OUT"
        if variable.dtype != rule.dtype and not is_text:
            problems.append(f"{name}: expected {np.dtype(rule.dtype)}, got {variable.dtype}.")
    wanted = ["long_name", "units"]
    if name == "event_component":
        # The schema has the meanings of the other flags; the flags of events are the scene's components.
        wanted += ["flag_meanings"]
    return problems + [
        f"{name}: expected the attribute {key}, got none." for key in wanted if not variable.attrs.get(key)
    ]


def count_problems(dataset: xr.Dataset) -> list[str]:
    """Return the counts of rows that do not sum to the number of rows; rows are assigned to runs only after this."""
    problems = []
    for dimension, count_name in RAGGED.items():
        if count_name in dataset.variables:
            count = dataset.variables[count_name].values
            rows, counted = dataset.sizes[dimension], count.sum(dtype=np.int64)
            if (count < 0).any() or counted != rows:
                problems.append(
                    f"{count_name}: expected counts that sum to the {rows} rows of {dimension}, got {counted}."
                )
    return problems


def _content_problems(dataset: xr.Dataset) -> list[str]:
    """Return the problems of the values that identify runs, rows and components."""
    problems = []
    for name, kind in (("outcome", Outcome), ("direction", Direction)):
        values = dataset.variables[name].values
        if values.size and (values.min() < 0 or values.max() >= len(kind)):
            problems.append(f"{name}: expected 0 to {len(kind) - 1}, got {values.min()} to {values.max()}.")
    index = dataset.variables["run_index"].values
    if _repeats(index) or (index.size and index.min() < 0):
        problems.append(
            "run_index: expected each index once and none below 0, got a repeated or negative index."
        )
    for name in (*swept_names(dataset), *constant_names(dataset)):
        if not np.isfinite(dataset.variables[name].values).all():
            problems.append(f"{name}: expected finite values of a parameter, got NaN or infinity.")
    return problems + count_problems(dataset) + _label_problems(dataset)


def _repeats(index: NDArray[Any]) -> bool:
    """Return whether an index repeats a number; runs in their order, the usual case, need no sorting."""
    return bool((np.diff(index) <= 0).any()) and np.unique(index).size != index.size


def _label_problems(dataset: xr.Dataset) -> list[str]:
    """Return the problems of the names of components and connections."""
    problems = []
    if "event" in dataset.dims:
        component = dataset.variables["event_component"]
        count = len(component.attrs["flag_meanings"].split())
        # NetCDF gives an attribute of one element back as a number.
        values = np.atleast_1d(component.attrs.get("flag_values", []))
        if not np.array_equal(values, np.arange(1, count + 1)):
            problems.append(
                f"event_component: expected flag_values 1 to {count}, one for each of flag_meanings."
            )
    if "connection" in dataset.variables:
        names = dataset.variables["connection"].values
        if len(set(names)) != names.size:
            problems.append("connection: expected each connection once, got one twice.")
    return problems


_Flags = NDArray[np.bool_]
_CLOCKS = {
    "impact": "impact_time",
    "stick": "stick_start",
    "sample": "time",
    "event": "event_time",
    "chosen_step": "chosen_step_end",
}


def _run_problems(dataset: xr.Dataset) -> Iterator[tuple[int, str]]:
    """Yield each run with impossible values: its place, and its first problem."""
    failed = dataset.variables["outcome"].values == Outcome.error
    for dimension, count_name in RAGGED.items():
        if count_name in dataset.variables:
            count = dataset.variables[count_name].values.astype(np.int64)
            owner = np.repeat(np.arange(count.size), count)
            first = np.cumsum(count) - count
            for name, expected, bad in _row_checks(dataset, dimension, owner):
                rows = np.flatnonzero(bad & ~failed[owner])
                _, places = np.unique(owner[rows], return_index=True)
                values = dataset.variables[name].values
                for row in rows[places]:
                    run = int(owner[row])
                    where = f"of {dimension} {row - first[run] + 1}"
                    yield run, f"{name}: expected {expected}, got {values[row]} {where}."
    for name in COUPLED_COLUMNS:
        if name in dataset.variables:
            found = dataset.variables[name].values
            what = "a residual" if name == "loop_residual" else "a number"
            for run in np.flatnonzero((found < 0) & ~failed).tolist():
                yield run, f"{name}: expected {what} >= 0 or NaN, got {found[run]}."


def _row_checks(
    dataset: xr.Dataset, dimension: str, owner: NDArray[np.int64]
) -> Iterator[tuple[str, str, _Flags]]:
    """Yield the variables of a ragged dimension: name, rule of its values, and mask of the rows that break it."""
    clock = _CLOCKS[dimension]
    time = dataset.variables[clock].values
    yield clock, "finite times", ~np.isfinite(time)
    backwards = np.zeros(time.size, dtype=np.bool_)
    # The first row of a run may be earlier than the last row of the run before it.
    backwards[1:] = (np.diff(time) < 0) & (np.diff(owner) == 0)
    yield clock, "times that do not decrease in a run", backwards

    def value(name: str) -> NDArray[Any]:
        values: NDArray[Any] = dataset.variables[name].values
        return values

    if dimension == "impact":
        phase = value("impact_phase")
        yield "impact_phase", "0 <= phase < 2 pi rad or NaN", (phase < 0) | (phase >= 2 * np.pi)
        yield "impact_velocity", "a speed of approach >= 0", ~(value("impact_velocity") >= 0)
        for name in ("impact_restitution", "impact_duration", "impact_peak_force"):
            if name in dataset.variables:
                yield name, "a number >= 0 or NaN", value(name) < 0
    if dimension in ("impact", "stick"):
        name = f"{dimension}_contact"
        yield name, "stops numbered from 1", value(name) < 1
    if dimension == "stick":
        yield "stick_end", "an end that is not before its start", value("stick_end") < time
    if dimension == "chosen_step":
        for name in TRACE_COLUMNS[1:]:
            yield name, "a number >= 0", ~(value(name) >= 0)
    if dimension == "event":
        yield "event_index", "events at the same time numbered from 0", value("event_index") < 0
        component = dataset.variables["event_component"]
        count = len(component.attrs["flag_meanings"].split())
        outside = (component.values < 1) | (component.values > count)
        yield "event_component", f"components numbered 1 to {count}", outside
