"""Small datasets for tests of the schema, its writers and its readers."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import (
    Direction,
    Outcome,
    RunRecord,
    build_dataset,
    open_dataset,
    with_constants,
    write_dataset,
)
from vibroimpact.analysis.dataset.schema import CLASS_COLUMNS, MEASURED_COLUMNS, ORBIT_COLUMNS, RULES

PERIODS = 3


def written(dataset: xr.Dataset, folder: Path, name: str = "runs.nc") -> Path:
    """Write a dataset and return the path of its file."""
    write_dataset(dataset, folder / name)
    return folder / name


def opened(dataset: xr.Dataset, folder: Path) -> xr.Dataset:
    """Write a dataset and return it as it opens."""
    return open_dataset(written(dataset, folder))


def impact_rows(number: int, start: float) -> NDArray[np.float64]:
    """Return successive impacts from a start time; each has its own velocity."""
    rows = np.ones((number, 7))
    rows[:, 0] = start + np.arange(number)
    rows[:, 1] = np.linspace(0.0, 6.0, number)
    rows[:, 2] = start + 0.01 * np.arange(number)
    rows[:, 3] = 1.7 * rows[:, 2]
    rows[:, 5] = 0.7
    rows[:, 6] = 0.0
    return rows


def record(value: float, impacts: int = 0, sticks: int = 0, samples: int = 0) -> RunRecord:
    """Return a run whose numbers all derive from `value`."""
    periods = np.column_stack(
        [np.full(PERIODS, value + k) for k in (1.0, -1.0, 0.5, 0.25)] + [np.zeros(PERIODS)]
    )
    stick_rows = np.column_stack(
        [value + np.arange(sticks), value + np.arange(sticks) + 0.5, np.ones(sticks)]
    )
    sample_rows = np.column_stack(
        [value + np.arange(samples), np.full(samples, value), np.full(samples, -value)]
    )
    return RunRecord(
        outcome=Outcome.ok,
        message="",
        periods=periods,
        impacts=impact_rows(impacts, value),
        sticks=stick_rows,
        samples=sample_rows,
        final_displacement=value,
        final_velocity=-value,
        final_phase=0.5,
        seconds=1e-3,
    )


def failed(message: str) -> RunRecord:
    """Return a run that ended in an error: no rows, no final state."""
    return RunRecord(
        Outcome.error,
        message,
        np.empty((0, 5)),
        np.empty((0, 5)),
        np.empty((0, 3)),
        np.empty((0, 3)),
        np.nan,
        np.nan,
        np.nan,
        0.0,
    )


#: Units of swept parameters of these examples; a real scene takes them from its fields.
UNITS = {
    "angular_frequency": "rad s-1",
    "body_mass": "kg",
    "damping_ratio_2": "1",
    "frequency": "Hz",
    "mass": "kg",
    "position": "m",
    "restitution": "1",
    "stop_position": "m",
}


def dataset_of(runs: list[RunRecord], **changes: Any) -> xr.Dataset:
    """Return a dataset of runs, by default an independent sweep of the angular frequency 0, 1, 2, ..."""
    arguments: dict[str, Any] = {
        "coordinates": {"angular_frequency": np.arange(len(runs), dtype=np.float64)},
        "direction": [Direction.independent] * len(runs),
        "run_index": np.arange(len(runs)),
        "sample_variables": ["displacement", "velocity"],
        "units": "SI",
        "attrs": {"title": "example"},
    }
    arguments["unit_of"] = UNITS | changes.pop("unit_of", {})
    return build_dataset(runs, **(arguments | changes))


def up_down(points: int = 3) -> xr.Dataset:
    """Return an up-down sweep of angular frequencies 0, 1, ...; the run at position k has k + 1 impacts."""
    up = np.arange(points, dtype=np.float64)
    return dataset_of(
        [record(float(k), impacts=k + 1, sticks=k % 2, samples=2) for k in range(2 * points)],
        coordinates={"angular_frequency": np.concatenate([up, up[::-1]])},
        direction=[Direction.up] * points + [Direction.down] * points,
    )


COMPONENTS = ["body", "stop"]
CONNECTIONS = ["body.displacement -> stop.force", "stop.displacement -> body.contact[1].force"]
COMPARED = ["beam.sensor.acceleration ~ board", "displacement ~ gap"]
COUPLED_UNITS = {"body.displacement": "m", "body.velocity": "m/s"}


def coupled_record(value: float, events: int = 0, samples: int = 0) -> RunRecord:
    """Return a run of a coupled scene whose numbers all derive from `value`.

    Events come in pairs at a time: of component 1 with index 0, then of component 2 with index 1.
    """
    place = np.arange(events)
    return RunRecord(
        outcome=Outcome.ok,
        message="",
        periods=None,
        impacts=None,
        sticks=None,
        samples=np.column_stack(
            [value + np.arange(samples), *(np.full(samples, value + k) for k in range(3))]
        ),
        final_displacement=np.nan,
        final_velocity=np.nan,
        final_phase=np.nan,
        seconds=1e-3,
        events=np.column_stack([value + place // 2, place % 2, 1 + place % 2]),
        energy_residual=np.array([1e-9 * value, -1e-9 * value]),
        loop_residual=1e-12 * value,
    )


def coupled_dataset(runs: list[RunRecord], **changes: Any) -> xr.Dataset:
    """Return a dataset of runs of a coupled scene that sweeps a mass."""
    arguments: dict[str, Any] = {
        "coordinates": {"mass": np.arange(len(runs), dtype=np.float64)},
        "sample_variables": ["body.displacement", "body.velocity", "stop.contact[1].law"],
        "unit_of": COUPLED_UNITS,
        "event_components": COMPONENTS,
        "connections": CONNECTIONS,
    }
    return dataset_of(runs, **(arguments | changes))


def everything(**changes: Any) -> xr.Dataset:
    """Return a dataset with every variable of the schema, and a failed run that has no rows."""
    runs = [record(1.0, impacts=2, sticks=1, samples=3), record(2.0), failed("no convergence")]
    coupled = coupled_record(1.0, events=3)
    runs[0].events, runs[0].energy_residual = coupled.events, coupled.energy_residual
    runs[0].loop_residual = coupled.loop_residual
    runs[0].chosen_steps = np.array([12.0, 2.0, 1e-3, 0.25, 3e-7])
    runs[0].step_trace = np.array([[0.001, 0.001, 0.5], [0.251, 0.25, 0.9]])
    runs[0].scores = np.array([[98.5, 1.01, 8.3e-3, 3e-6, -1.0, 0.4], [97.0, 0.99, 0.0, 0.0, 1.0, 0.1]])
    runs[0].final_state, runs[1].final_state = np.array([1.0, -1.0, 0.5, 0.25]), np.zeros(4)
    dataset = dataset_of(
        runs,
        sample_variables=["body.displacement", "stop.contact[1].force"],
        unit_of={"stop.contact[1].force": "N"},
        event_components=COMPONENTS,
        connections=CONNECTIONS,
        compared=COMPARED,
        measured={
            "measurement_flags": np.array([0, 5, 8]),
            **{name: np.ones(3) for name in MEASURED_COLUMNS[1:]},
            **{name: np.ones(3).astype(RULES[name].dtype) for name in (*ORBIT_COLUMNS, *CLASS_COLUMNS[:-1])},
            CLASS_COLUMNS[-1]: np.array(["", "chance", ""], dtype=object),
        },
        **changes,
    )
    return with_constants(dataset, {"restitution": 0.7, "stop_position": 1e-3}, unit_of=UNITS)


def grid_of_runs() -> xr.Dataset:
    """Return 15 runs over two parameters in no order, with rows; the fifth failed."""
    axes = itertools.product([2.0, 1.0, 4.0], [0.3, 0.1, 0.2, 0.4, 0.5])
    points = np.array(list(axes))
    runs = [record(float(k), impacts=k % 3, sticks=k % 2, samples=1) for k in range(len(points))]
    runs[4] = failed("it broke: \u03c9 too large")
    return dataset_of(runs, coordinates={"mass": points[:, 0], "restitution": points[:, 1]})
