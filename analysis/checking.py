"""The check of a dataset against the schema; every writer calls it before it writes."""

from __future__ import annotations

from typing import get_args

import numpy as np
import xarray as xr

from vibroimpact.analysis.schema import (
    CONVENTIONS,
    EVENT_COLUMNS,
    NEEDED_IMPACT_COLUMNS,
    RAGGED,
    RULES,
    RUN_COLUMNS,
    SCORE_COLUMNS,
    STICK_COLUMNS,
    Direction,
    Outcome,
    UnitSystem,
    swept_names,
)
from vibroimpact.fmus.errors import DatasetError


def check(dataset: xr.Dataset) -> None:
    """Check a one-dimensional dataset against the schema; every writer calls this before it writes.

    Parameters
    ----------
    dataset : xarray.Dataset
        A dataset along `run`, as `build_dataset` makes it.

    Raises
    ------
    DatasetError
        With all problems, one on each line.
    """
    problems = _structure_problems(dataset)
    # The contents mean nothing while a variable is missing or has another shape.
    if not problems:
        problems = _content_problems(dataset)
    if problems:
        raise DatasetError("\n".join(f"dataset: {problem}" for problem in problems))


def _structure_problems(dataset: xr.Dataset) -> list[str]:
    """Return what is wrong with names, dimensions, types and attributes."""
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


# What a scene asks for together is stored together.
_GROUPS = (
    ("displacement_max", "displacement_min"),
    ("strobe_displacement", "strobe_velocity"),
    ("impact_count", *NEEDED_IMPACT_COLUMNS),
    ("stick_count", *STICK_COLUMNS),
    ("event_count", *EVENT_COLUMNS),
    ("connection", "energy_residual"),
    ("compared", *SCORE_COLUMNS),
)


def _missing_names(dataset: xr.Dataset) -> list[str]:
    """Return the names that must be there: those of every run, and each recorded group as a whole."""
    present = set(map(str, dataset.variables))
    required = set(RUN_COLUMNS)
    for group in _GROUPS:
        if present.intersection(group):
            required.update(group)
    if "sample" in dataset.dims or "sample_count" in present:
        required.update(("sample_count", "time"))
    return sorted(required - present)


def _variable_problems(name: str, variable: xr.Variable) -> list[str]:
    """Return what is wrong with one variable."""
    rule = RULES.get(name)
    problems = []
    if rule is None:
        if variable.dims not in (("run",), ("sample",)):
            problems.append(
                f"{name}: expected dimensions of a swept parameter or a sample, got {variable.dims}."
            )
        if variable.dtype != np.float64:
            problems.append(f"{name}: expected float64, got {variable.dtype}.")
    else:
        if variable.dims != rule.dims:
            problems.append(f"{name}: expected dimensions {rule.dims}, got {variable.dims}.")
        if variable.dtype != rule.dtype:
            problems.append(f"{name}: expected {np.dtype(rule.dtype)}, got {variable.dtype}.")
    wanted = ["long_name", "units"]
    if name == "event_component":
        # The meanings of the other flags are in the schema; these are the scene's components.
        wanted += ["flag_meanings"]
    return problems + [
        f"{name}: expected the attribute {key}, got none." for key in wanted if not variable.attrs.get(key)
    ]


def _content_problems(dataset: xr.Dataset) -> list[str]:
    """Return what is wrong with the values of a dataset whose structure is right."""
    problems = []
    for name, kind in (("outcome", Outcome), ("direction", Direction)):
        values = dataset.variables[name].values
        if values.size and (values.min() < 0 or values.max() >= len(kind)):
            problems.append(f"{name}: expected 0 to {len(kind) - 1}, got {values.min()} to {values.max()}.")
    index = dataset.variables["run_index"].values
    if np.unique(index).size != index.size or (index.size and index.min() < 0):
        problems.append(
            "run_index: expected each index once and none below 0, got a repeated or negative index."
        )
    for name in swept_names(dataset):
        if not np.isfinite(dataset.variables[name].values).all():
            problems.append(f"{name}: expected finite values of a swept parameter, got NaN or infinity.")
    for dimension, count_name in RAGGED.items():
        if count_name in dataset.variables:
            problems += _ragged_problems(dataset, dimension, count_name)
    return (
        problems
        + _impact_problems(dataset)
        + _stick_problems(dataset)
        + _event_problems(dataset)
        + _coupling_problems(dataset)
    )


_CLOCKS = {"impact": "impact_time", "stick": "stick_start", "sample": "time", "event": "event_time"}


def _ragged_problems(dataset: xr.Dataset, dimension: str, count_name: str) -> list[str]:
    """Return what is wrong with the rows of a ragged array: their number and their order in time."""
    count = dataset.variables[count_name].values
    rows = dataset.sizes[dimension]
    if (count < 0).any() or int(count.sum(dtype=np.int64)) != rows:
        return [
            f"{count_name}: expected counts that sum to the {rows} rows of {dimension}, got {count.sum()}."
        ]
    clock = _CLOCKS[dimension]
    time = dataset.variables[clock].values
    if not np.isfinite(time).all():
        return [f"{clock}: expected finite times, got NaN or infinity."]
    backwards = np.diff(time) < 0
    first_rows = np.cumsum(count, dtype=np.int64)[:-1]
    # The first row of a run may be earlier than the last row of the run before it.
    backwards[first_rows[(first_rows > 0) & (first_rows < rows)] - 1] = False
    if backwards.any():
        row = int(np.argmax(backwards)) + 1
        return [
            f"{clock}: expected times that do not decrease in a run, got {time[row - 1]} then {time[row]}."
        ]
    return []


def _impact_problems(dataset: xr.Dataset) -> list[str]:
    """Return what is wrong with recorded impacts."""
    if "impact" not in dataset.dims:
        return []
    problems = []
    phase = dataset.variables["impact_phase"].values
    if ((phase < 0) | (phase >= 2 * np.pi)).any():
        problems.append("impact_phase: expected 0 <= phase < 2 pi rad or NaN, got a phase outside.")
    if not (dataset.variables["impact_velocity"].values >= 0).all():
        problems.append("impact_velocity: expected a speed of approach >= 0, got a negative or missing one.")
    for name in ("impact_restitution", "impact_duration"):
        if name in dataset.variables and (dataset.variables[name].values < 0).any():
            problems.append(f"{name}: expected a number >= 0 or NaN, got a negative one.")
    if (dataset.variables["impact_contact"].values < 1).any():
        problems.append("impact_contact: expected stops numbered from 1, got a smaller number.")
    return problems


def _stick_problems(dataset: xr.Dataset) -> list[str]:
    """Return what is wrong with recorded sticking phases."""
    if "stick" not in dataset.dims:
        return []
    problems = []
    if (dataset.variables["stick_end"].values < dataset.variables["stick_start"].values).any():
        problems.append("stick_end: expected an end that is not before its start, got an earlier one.")
    if (dataset.variables["stick_contact"].values < 1).any():
        problems.append("stick_contact: expected stops numbered from 1, got a smaller number.")
    return problems


def _event_problems(dataset: xr.Dataset) -> list[str]:
    """Return what is wrong with recorded events."""
    if "event" not in dataset.dims:
        return []
    problems = []
    if (dataset.variables["event_index"].values < 0).any():
        problems.append("event_index: expected events at the same time numbered from 0, got a lower number.")
    component = dataset.variables["event_component"]
    count = len(component.attrs["flag_meanings"].split())
    # NetCDF gives an attribute of one element back as a number.
    values = np.atleast_1d(component.attrs.get("flag_values", []))
    if not np.array_equal(values, np.arange(1, count + 1)):
        problems.append(f"event_component: expected flag_values 1 to {count}, one for each of flag_meanings.")
    if ((component.values < 1) | (component.values > count)).any():
        problems.append(f"event_component: expected components numbered 1 to {count}, got one outside.")
    return problems


def _coupling_problems(dataset: xr.Dataset) -> list[str]:
    """Return what is wrong with the residuals of a coupled scene."""
    problems = []
    if "connection" in dataset.variables:
        names = dataset.variables["connection"].values
        if len(set(names)) != names.size:
            problems.append("connection: expected each connection once, got one twice.")
    if "loop_residual" in dataset.variables and (dataset.variables["loop_residual"].values < 0).any():
        problems.append("loop_residual: expected a residual >= 0 or NaN, got a negative one.")
    return problems
