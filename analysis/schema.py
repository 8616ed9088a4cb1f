"""The dataset schema: every name, dimension, type, unit and meaning that a vibroimpact file may hold.

This table is the only place where these facts are written. `writing` builds and writes datasets from it,
`reading` opens them, and `docs/dataset.md` says the same in words.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Literal, get_args

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.fmus.errors import DatasetError

CONVENTIONS = "CF-1.11"
SCHEMA_VERSION = "1"

UnitSystem = Literal["SI", "nondimensional"]


class Outcome(IntEnum):
    """How a run ended; the first three are physics, the last three are failures of the run."""

    ok = 0
    stuck = 1
    impact_limit = 2
    error = 3
    crash = 4
    timeout = 5


class Direction(IntEnum):
    """How a run was started: from the scene's own start state, or from its neighbour in a sweep."""

    independent = 0
    up = 1
    down = 2


@dataclass(slots=True)
class RunRecord:
    """What one run of a scene recorded; a group that the scene does not ask for is None.

    Attributes
    ----------
    outcome : Outcome
        How the run ended.
    message : str
        Why, in words; empty for `Outcome.ok`.
    periods : ndarray of float, shape (period, 5), or None
        Columns `PERIOD_COLUMNS`: displacement_max, displacement_min, strobe_displacement (m),
        strobe_velocity (m/s), impacts_per_period.
    impacts : ndarray of float, shape (impact, 5), or None
        Columns `IMPACT_COLUMNS`: impact_time (s), impact_phase (rad), impact_velocity (m/s),
        impact_impulse (N s), impact_contact (1-based).
    sticks : ndarray of float, shape (stick, 3), or None
        Columns `STICK_COLUMNS`: stick_start, stick_end (s; NaN: still stuck at the end), stick_contact.
    samples : ndarray of float, shape (sample, 1 + variables), or None
        Time (s), then the sampled variables.
    final_displacement, final_velocity, final_phase : float
        State (m, m/s) and forcing phase (rad) at the end, where a sweep goes on.
    seconds : float
        Wall time this run took, s.
    """

    outcome: Outcome
    message: str
    periods: NDArray[np.float64] | None
    impacts: NDArray[np.float64] | None
    sticks: NDArray[np.float64] | None
    samples: NDArray[np.float64] | None
    final_displacement: float
    final_velocity: float
    final_phase: float
    seconds: float


@dataclass(frozen=True, slots=True)
class VariableRule:
    """What the schema says of one variable; `unit` is its SI unit."""

    name: str
    dims: tuple[str, ...]
    dtype: Any
    unit: str
    long_name: str
    extra: Mapping[str, Any] = field(default_factory=dict)


def _flags(kind: type[IntEnum]) -> dict[str, Any]:
    """Return the CF attributes that name the values of an enumeration."""
    return {
        "flag_values": np.array([int(member) for member in kind], dtype=np.int8),
        "flag_meanings": " ".join(member.name for member in kind),
    }


_RULES = (
    VariableRule("run_index", ("run",), np.int32, "1", "index of the run in its campaign"),
    VariableRule("direction", ("run",), np.int8, "1", "direction of the sweep", _flags(Direction)),
    VariableRule("outcome", ("run",), np.int8, "1", "outcome of the run", _flags(Outcome)),
    VariableRule("message", ("run",), object, "1", "why the run ended as it did"),
    VariableRule("point_seconds", ("run",), np.float64, "s", "wall time of the run"),
    VariableRule("final_displacement", ("run",), np.float64, "m", "displacement at the end of the run"),
    VariableRule("final_velocity", ("run",), np.float64, "m s-1", "velocity at the end of the run"),
    VariableRule("final_phase", ("run",), np.float64, "rad", "forcing phase at the end of the run"),
    VariableRule("displacement_max", ("run", "period"), np.float64, "m", "largest displacement in a period"),
    VariableRule("displacement_min", ("run", "period"), np.float64, "m", "smallest displacement in a period"),
    VariableRule(
        "strobe_displacement", ("run", "period"), np.float64, "m", "displacement at forcing phase zero"
    ),
    VariableRule("strobe_velocity", ("run", "period"), np.float64, "m s-1", "velocity at forcing phase zero"),
    VariableRule("impacts_per_period", ("run", "period"), np.float64, "1", "number of impacts in a period"),
    VariableRule(
        "impact_count",
        ("run",),
        np.int32,
        "1",
        "number of impacts of the run",
        {"sample_dimension": "impact"},
    ),
    VariableRule("impact_time", ("impact",), np.float64, "s", "time of impact from the start of the scene"),
    VariableRule("impact_phase", ("impact",), np.float64, "rad", "forcing phase at impact"),
    VariableRule(
        "impact_velocity", ("impact",), np.float64, "m s-1", "velocity of approach just before impact"
    ),
    VariableRule("impact_impulse", ("impact",), np.float64, "N s", "impulse of the stop on the body"),
    VariableRule("impact_contact", ("impact",), np.int8, "1", "number of the stop that was hit, from 1"),
    VariableRule(
        "stick_count",
        ("run",),
        np.int32,
        "1",
        "number of sticking phases of the run",
        {"sample_dimension": "stick"},
    ),
    VariableRule("stick_start", ("stick",), np.float64, "s", "time at which sticking starts"),
    VariableRule(
        "stick_end", ("stick",), np.float64, "s", "time at which sticking ends, missing if it does not"
    ),
    VariableRule("stick_contact", ("stick",), np.int8, "1", "number of the stop the body sticks to, from 1"),
    VariableRule(
        "sample_count",
        ("run",),
        np.int32,
        "1",
        "number of samples of the run",
        {"sample_dimension": "sample"},
    ),
    VariableRule("time", ("sample",), np.float64, "s", "time of the sample from the start of the scene"),
)
RULES: Mapping[str, VariableRule] = {rule.name: rule for rule in _RULES}


def _columns(dims: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the variables with these dimensions, in order."""
    return tuple(rule.name for rule in _RULES if rule.dims == dims)


PERIOD_COLUMNS = _columns(("run", "period"))
IMPACT_COLUMNS = _columns(("impact",))
STICK_COLUMNS = _columns(("stick",))
RAGGED = {"impact": "impact_count", "stick": "stick_count", "sample": "sample_count"}
RUN_COLUMNS = tuple(name for name in _columns(("run",)) if name not in RAGGED.values())

# Units of swept parameters and sampled variables, found by the end of their name.
_QUANTITY_UNITS = {
    "mass": "kg",
    "stiffness": "N m-1",
    "damping": "N s m-1",
    "damping_ratio": "1",
    "angular_frequency": "rad s-1",
    "frequency": "Hz",
    "amplitude": "N",
    "phase": "rad",
    "position": "m",
    "restitution": "1",
    "exponent": "1",
    "displacement": "m",
    "velocity": "m s-1",
    "acceleration": "m s-2",
    "displacement_start": "m",
    "velocity_start": "m s-1",
    "force": "N",
    "forcing": "N",
    "force_rate": "N s-1",
    "base_acceleration_rate": "m s-3",
    "energy": "J",
    "time": "s",
    "impulse": "N s",
    "kinetic": "J",
    "potential": "J",
    "length": "m",
    "width": "m",
    "thickness": "m",
    "density": "kg m-3",
    "youngs_modulus": "Pa",
    "location": "1",
    "stuck": "1",
    "count": "1",
}


def file_name_of(quantity: str) -> str:
    """Return the name a quantity has in a file: CF allows letters, digits and underscores only.

    >>> file_name_of("contact[1].force")
    'contact_1_force'
    """
    return re.sub(r"[^A-Za-z0-9]+", "_", quantity).strip("_")


def unit_in(system: UnitSystem, unit: str) -> str:
    """Return the unit that an SI unit becomes in a system of units; angles stay radians.

    >>> unit_in("nondimensional", "m s-1"), unit_in("nondimensional", "rad"), unit_in("SI", "m s-1")
    ('1', 'rad', 'm s-1')
    """
    return unit if system == "SI" or unit == "rad" else "1"


def quantity_unit(name: str, system: UnitSystem) -> str:
    """Return the unit of a swept parameter or sampled variable, known by the end of its name.

    Raises
    ------
    DatasetError
        If no known quantity ends the name; the writer must then be told the unit.

    >>> quantity_unit("stop_1_position", "SI"), quantity_unit("angular_frequency", "SI")
    ('m', 'rad s-1')
    """
    # The number of one of several alike (damping_ratio_2) does not change what it is.
    words = name.rstrip("0123456789_").split("_")
    for start in range(len(words)):
        unit = _QUANTITY_UNITS.get("_".join(words[start:]))
        if unit is not None:
            return unit_in(system, unit)
    raise DatasetError(
        f"dataset: {name}: expected a quantity whose unit is known, got an unknown name. "
        "Give its unit to build_dataset."
    )


def attributes_of(name: str, system: UnitSystem) -> dict[str, Any]:
    """Return the attributes of a schema variable in a system of units."""
    rule = RULES[name]
    # Wall time is measured in seconds in every system of units.
    unit = rule.unit if name == "point_seconds" else unit_in(system, rule.unit)
    return {"long_name": rule.long_name, "units": unit, **rule.extra}


def swept_names(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the names of the swept parameters: the coordinates that the schema itself does not name."""
    return tuple(
        str(name)
        for name, coordinate in dataset.coords.items()
        if name not in RULES and coordinate.dtype.kind == "f" and name not in ("run", "period")
    )


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
    ("impact_count", *IMPACT_COLUMNS),
    ("stick_count", *STICK_COLUMNS),
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
    return problems + [
        f"{name}: expected the attribute {key}, got none."
        for key in ("long_name", "units")
        if not variable.attrs.get(key)
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
    return problems + _impact_problems(dataset) + _stick_problems(dataset)


_CLOCKS = {"impact": "impact_time", "stick": "stick_start", "sample": "time"}


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


def flat_order(first_rows: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the row numbers of ragged blocks in the order given.

    Parameters
    ----------
    first_rows, counts : ndarray of int, shape (run,)
        First row and number of rows of each block.

    Returns
    -------
    ndarray of int, shape (sum of counts,)

    >>> flat_order(np.array([3, 0]), np.array([2, 3])).tolist()
    [3, 4, 0, 1, 2]
    """
    ends = np.cumsum(counts)
    return np.repeat(first_rows - (ends - counts), counts) + np.arange(ends[-1] if ends.size else 0)


def names_list(names: Sequence[str]) -> str:
    """Return names for a message, or the word none."""
    return ", ".join(names) if names else "none"
