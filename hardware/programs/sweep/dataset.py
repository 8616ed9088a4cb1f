"""The dataset of a sweep in its folder: written as a whole after each step, and read when the sweep continues."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import (
    MeasurementFlag,
    Outcome,
    RunRecord,
    build_dataset,
    read_flat,
    write_dataset,
)
from vibroimpact.analysis.dataset.schema import MEASURED_COLUMNS, PERIOD_COLUMNS
from vibroimpact.analysis.files.opening import file_attributes
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.messages import WITH_OUTPUT, message
from vibroimpact.hardware.programs.sweep.analysis import MeasuredStep
from vibroimpact.hardware.programs.sweep.drive import Drive, SeenLags, clock_error_of
from vibroimpact.hardware.programs.sweep.plan import planned
from vibroimpact.hardware.programs.sweep.settings import SweepSettings

Floats = NDArray[np.float64]

DATASET = "dataset.nc"
_MADE_BY = "measured by vibroimpact"
_MOST_DIFFERENCES = 3
_STROBED = ("displacement", "velocity")


@dataclass(slots=True)
class SweepRows:
    """The finished part of a sweep."""

    settings: SweepSettings
    calibration: str
    """TOML."""
    steps: list[MeasuredStep] = field(default_factory=list)
    """The first steps of the path, in its order."""
    made_by: dict[str, str] = field(default_factory=dict)
    """`rig`, `device` and `measured_at`, with a line for each start or continuation."""
    session_starts: list[int] = field(default_factory=list)
    """Number of steps at each of these starts."""

    @property
    def complete(self) -> bool:
        """Whether all steps are measured."""
        return len(self.steps) == len(self.settings.steps)


def dataset_of(rows: SweepRows) -> xr.Dataset:
    """Return the one-dimensional dataset of the finished steps, a run for each step."""
    settings, steps = rows.settings, rows.steps
    done = settings.steps[: len(steps)]
    measured: dict[str, Any] = {"measurement_flags": [int(step.flags) for step in steps]}
    if settings.place_of("drive") is not None:
        drives = [step.drive for step in steps]
        measured["drive_amplitude"] = [drive.amplitude for drive in drives]
        measured["drive_lag"] = [drive.lag for drive in drives]
        measured["drive_clock_error"] = [drive.clock_error for drive in drives]
    omitted = ["impacts_per_period"] if settings.place_of("load_cell") is None else []
    return build_dataset(
        [_record(step, settings) for step in steps],
        coordinates={"frequency": np.array([frequency for _, frequency in done], dtype=np.float64)},
        direction=[direction for direction, _ in done],
        run_index=range(len(steps)),
        unit_of={"frequency": "Hz"},
        omit=omitted,
        measured={name: np.asarray(values) for name, values in measured.items()},
        attrs=_attributes(rows),
    )


def _record(step: MeasuredStep, settings: SweepSettings) -> RunRecord:
    periods = np.full((len(step.highest), len(PERIOD_COLUMNS)), np.nan)
    columns = {
        "displacement_max": step.highest,
        "displacement_min": step.lowest,
        "strobe_displacement": step.strobe[:, 0],
        "strobe_velocity": step.strobe[:, 1],
        "impacts_per_period": step.impacts,
    }
    for name, values in columns.items():
        if values is not None:
            periods[:, PERIOD_COLUMNS.index(name)] = values
    words = [member.name for member in MeasurementFlag if member in step.flags]
    return RunRecord(
        Outcome.ok,
        f"{', '.join(map(str, words))}: {step.message}" if words else "",
        periods,
        final_displacement=step.final_displacement,
        final_velocity=np.nan,
        final_phase=0.0,
        seconds=settings.step_periods / settings.steps[step.place][1],
    )


def _attributes(rows: SweepRows) -> dict[str, Any]:
    settings = rows.settings
    attributes = {
        "history": _MADE_BY,
        "title": Path(settings.source).stem,
        "source": Path(settings.source).name,
        "sweep": settings.text,
        "sweep_content": json.dumps(settings.content),
        "calibration": rows.calibration,
        "steps_planned": len(settings.steps),
        "begun_with_steps": json.dumps(rows.session_starts),
        **rows.made_by,
    }
    error, standard_error = clock_error_of(_seen_lags(rows))
    if np.isfinite(error):
        attributes |= {"clock_error_ppm": error, "clock_error_standard_error_ppm": standard_error}
    return attributes


def _seen_lags(rows: SweepRows) -> list[SeenLags]:
    """Return the lags that each acquisition has measured; its plan gives their times."""
    found = []
    ends = [*rows.session_starts[1:], len(rows.steps)]
    for begin, end in zip(rows.session_starts, ends, strict=True):
        plan = planned(rows.settings, begin)
        middles = {s.place: (s.first + 0.5 * s.count) / plan.rate for s in plan.segments if s.kind == "step"}
        some = rows.steps[begin:end]
        columns = (
            [middles[step.place] for step in some],
            [step.drive.lag for step in some],
            [step.drive.clock_error for step in some],
            [1.0 / rows.settings.steps[step.place][1] for step in some],
        )
        found.append(SeenLags(*(np.array(column, dtype=np.float64) for column in columns)))
    return found


def store(rows: SweepRows, folder: Path) -> None:
    """Write the finished steps; the old file stays until the new one is complete."""
    write_dataset(dataset_of(rows), folder / DATASET)


def stored(settings: SweepSettings, calibration: str, folder: Path) -> SweepRows:
    """Return the finished part of a sweep in a folder; empty in a new folder.

    UsageError: the folder has another sweep, a campaign, or a damaged dataset.
    """
    path = folder / DATASET
    rows = SweepRows(settings, calibration)
    if (folder / "campaign.json").exists():
        raise _refused(folder, "that of a campaign")
    if not path.exists():
        return rows
    try:
        attributes = file_attributes(path)
        if not attributes:
            read_flat(path)  # raises the error of the damage
        if attributes.get("history") != _MADE_BY:
            raise _refused(folder, "one with another dataset")
        different = _differences(json.loads(str(attributes.get("sweep_content"))), settings.content)
        if str(attributes.get("calibration")) != calibration:
            different.append("the calibration")
        if different:
            more = len(different) - _MOST_DIFFERENCES
            shown = "; ".join(different[:_MOST_DIFFERENCES]) + (f"; and {more} more" if more > 0 else "")
            raise _refused(folder, f"that of another one: {shown}")
        flat = read_flat(path)
    except (DatasetError, ValueError, KeyError, TypeError) as error:
        raise UsageError(
            message(
                f"{path}: expected the dataset of this sweep, got a damaged one ({error}). Move it away, or choose "
                "another folder",
                *(WITH_OUTPUT, "."),
            )
        ) from error
    rows.steps = _steps_of(flat)
    rows.made_by = {name: str(flat.attrs[name]) for name in ("rig", "device", "measured_at")}
    rows.session_starts = [int(steps) for steps in json.loads(str(flat.attrs["begun_with_steps"]))]
    return rows


def _refused(folder: Path, got: str) -> UsageError:
    return UsageError(
        message(
            f"{folder}: expected a new folder, or that of this sweep, got {got}. Choose another folder",
            *(WITH_OUTPUT, "."),
        )
    )


def _differences(was: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return, in words, the differences of a stored sweep from this one."""
    found = []
    now = json.loads(json.dumps(now))
    for key in sorted(was.keys() | now.keys()):
        if was.get(key) != now.get(key):
            old, new = (_shown(one.get(key)) for one in (was, now))
            found.append(f"{key} was {old}, is {new}")
    return found


def _shown(value: Any) -> str:
    if isinstance(value, list) and value:
        return f"{len(value)} values from {value[0]:g} to {value[-1]:g}"
    return "absent" if value is None else json.dumps(value)[:60]


def _steps_of(flat: xr.Dataset) -> list[MeasuredStep]:
    """Return the steps of a stored dataset."""

    def column(name: str) -> Floats | None:
        return flat.variables[name].values if name in flat.variables else None

    drives = [column(name) for name in MEASURED_COLUMNS[1:]]
    impacts = column("impacts_per_period")
    found = []
    for place in range(flat.sizes["run"]):
        drive = Drive()
        if all(values is not None for values in drives):
            amplitude, lag, error = (float(values[place]) for values in drives if values is not None)
            drive = Drive(amplitude, lag, error)
        words = str(flat.variables["message"].values[place]).partition(": ")[2]
        found.append(
            MeasuredStep(
                place,
                flat.variables["displacement_max"].values[place],
                flat.variables["displacement_min"].values[place],
                np.stack([flat.variables[f"strobe_{what}"].values[place] for what in _STROBED], axis=1),
                None if impacts is None else impacts[place],
                MeasurementFlag(int(flat.variables["measurement_flags"].values[place])),
                words,
                drive,
                float(flat.variables["final_displacement"].values[place]),
            )
        )
    return found
