"""Write and open recordings: NetCDF files of channels, event trains and single values."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import CONVENTIONS, RAGGED
from vibroimpact.analysis.dataset.stores.runs import read_runs
from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.analysis.files.fingerprints import sealed
from vibroimpact.analysis.files.open_files import netcdf_lock
from vibroimpact.analysis.files.opening import one_error, opened_netcdf
from vibroimpact.analysis.recording.chain import chain_of
from vibroimpact.analysis.recording.channels import (
    QUALITY_FLAGS,
    RECORDING_SCHEMA,
    Channel,
    EventTrain,
    Quality,
    Recording,
    SingleValue,
    TimeAxis,
)
from vibroimpact.analysis.recording.rules import EVENT_ENDING, QUALITY_ENDING, problems_of
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import Argument, message

MOST_VALUES = 10**8
"""Number of values (8 bytes each) above which a recording is refused: damaged bytes can announce any number."""
# Attributes that the file needs and no channel has.
_STORED = frozenset(
    {"units", "long_name", "ancillary_variables", "_FillValue", "coordinates", "event_train", "resolution"}
    | {"window_start", "window_end", "flag_masks", "flag_meanings"}
)


def write_recording(recording: Recording, path: str | os.PathLike[str]) -> None:
    """Check a recording and write it as one NetCDF-4 file that is whole or absent.

    Parameters
    ----------
    recording : Recording
    path : path
        An older file of this name is replaced only when the new one is complete.

    Raises
    ------
    DatasetError
        The recording contradicts itself; all problems, one on each line.
    OSError
        The file cannot be written, with the reason of the operating system.
    """
    problems = list(problems_of(recording))
    if problems:
        raise DatasetError("\n".join(f"{recording.title}: {problem}" for problem in problems))
    with netcdf_lock():
        file = netCDF4.Dataset("recording.nc", "w", format="NETCDF4", memory=1)
        file.setncatts(
            {
                "Conventions": CONVENTIONS,
                "recording_schema": RECORDING_SCHEMA,
                "history": "recorded or imported by vibroimpact",
                "title": f"recording {recording.attrs.get('source_file', '')}".strip(),
                **{key: value for key, value in recording.attrs.items() if key != "opened_from"},
                # the library lists variables by name; people expect the original order of the columns
                "variable_order": " ".join((*recording.channels, *recording.events, *recording.scalars)),
            }
        )
        _store_channels(file, recording)
        for train in recording.events.values():
            _store_events(file, train)
        for name, scalar in recording.scalars.items():
            variable = file.createVariable(name, "f8", ())
            variable.setncatts({"units": scalar.unit, "long_name": scalar.label or name})
            if scalar.overrange:
                variable.setncattr("overrange", 1)
            variable[...] = scalar.value
        image = file.close()
    write_atomically(path, *sealed(image))


def _store_channels(file: netCDF4.Dataset, recording: Recording) -> None:
    """Store each time axis once, then its channels."""
    stored: dict[int, str] = {}
    for channel in recording.channels.values():
        axis = channel.axis
        if id(axis) not in stored:
            stored[id(axis)] = "time" if not stored else f"time_{len(stored) + 1}"
            _store_axis(file, stored[id(axis)], axis)
        _store_channel(file, stored[id(axis)], channel)


def _store_axis(file: netCDF4.Dataset, name: str, axis: TimeAxis) -> None:
    file.createDimension(name, len(axis.time))
    variable = file.createVariable(name, "f8", (name,))
    attributes = {
        "units": "s",
        "long_name": "time from the start of the recording",
        "interval_uncertainty": axis.interval_uncertainty,
        "source": axis.source,
        "trigger": axis.trigger,
    }
    # there is no date to count from, so the axis has seconds and no calendar
    variable.setncatts({key: value for key, value in attributes.items() if value != ""})
    if axis.interval is not None:
        variable.setncattr("sampling_interval", axis.interval)
    variable[...] = axis.time


def _store_channel(file: netCDF4.Dataset, dimension: str, channel: Channel) -> None:
    variable = file.createVariable(
        channel.name, "f8", (dimension,), fill_value=np.nan, compression="zlib", complevel=1, shuffle=True
    )
    variable.setncatts({"units": channel.unit, "long_name": channel.label or channel.name})
    variable.setncatts({key: value for key, value in channel.attrs.items() if key not in _STORED})
    variable[...] = channel.values
    if not np.any(channel.quality):
        return
    name = channel.name + QUALITY_ENDING
    variable.setncattr("ancillary_variables", name)
    flags = file.createVariable(name, "u1", (dimension,), compression="zlib", complevel=1)
    flags.setncatts({"units": "1", "long_name": f"quality of {channel.name}", **QUALITY_FLAGS})
    flags[...] = channel.quality


def _store_events(file: netCDF4.Dataset, train: EventTrain) -> None:
    dimension = train.name + EVENT_ENDING
    file.createDimension(dimension, len(train.times))
    variable = file.createVariable(train.name, "f8", (dimension,))
    variable.setncatts({"units": "s", "long_name": train.label or train.name, "event_train": 1})
    variable.setncattr("resolution", train.resolution)
    variable.setncatts({key: value for key, value in train.attrs.items() if key not in _STORED})
    if train.window is not None:
        variable.setncatts({"window_start": train.window[0], "window_end": train.window[1]})
    variable[...] = train.times


def open_recording(path: str | os.PathLike[str]) -> Recording:
    """Open a recording, and load it whole into memory.

    Raises
    ------
    DatasetError
        The file is missing, damaged, or no recording.
    """
    with opened_netcdf(path) as file:
        if "recording_schema" not in file.ncattrs():
            raise DatasetError(
                f"{os.fspath(path)}: expected a recording, got other NetCDF contents. "
                "Make one with `vibroimpact import`."
            )
        return _read(file, path)


def is_recording(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file is a recording; an unreadable file is none."""
    try:
        with opened_netcdf(path) as file:
            return "recording_schema" in file.ncattrs()
    except DatasetError:
        return False


def _read(file: netCDF4.Dataset, path: str | os.PathLike[str]) -> Recording:
    if str(file.recording_schema) != RECORDING_SCHEMA:
        raise DatasetError(
            f"{os.fspath(path)}: recording_schema: expected {RECORDING_SCHEMA}, "
            f"got {str(file.recording_schema)[:60]!r}. Import the measurement again with this version."
        )
    if sum(int(each.size) * each.dtype.itemsize / 8 for each in file.variables.values()) > MOST_VALUES:
        raise DatasetError(f"{os.fspath(path)}: expected at most {MOST_VALUES} values, got more.")
    axes = {}
    for name, variable in file.variables.items():
        if variable.dimensions == (name,) and name.startswith("time"):
            with _about(path, name):
                axes[name] = _read_axis(variable)
    channels: dict[str, Channel] = {}
    events: dict[str, EventTrain] = {}
    scalars: dict[str, SingleValue] = {}
    order = str(getattr(file, "variable_order", "")).split()
    for name in sorted(file.variables, key=lambda name: order.index(name) if name in order else len(order)):
        variable = file.variables[name]
        if name in axes or (
            name.endswith(QUALITY_ENDING) and name.removesuffix(QUALITY_ENDING) in file.variables
        ):
            continue
        with _about(path, name):
            _check_attributes(variable)
            if variable.dimensions == ():
                scalars[name] = SingleValue(
                    float(np.ma.filled(variable[...], np.nan)),
                    str(variable.units),
                    str(variable.long_name),
                    "overrange" in variable.ncattrs(),
                )
            elif "event_train" in variable.ncattrs():
                events[name] = _read_events(name, variable)
            elif variable.dimensions[0] in axes:
                channels[name] = _read_channel(file, name, axes[variable.dimensions[0]])
            else:
                raise DatasetError(
                    "expected a channel on a time axis, an event train or a single value, "
                    f"got dimensions {variable.dimensions}."
                )
    attrs = {key: file.getncattr(key) for key in file.ncattrs() if key != "variable_order"}
    recording = Recording(channels, events, scalars, attrs | {"opened_from": os.fspath(path)})
    problems = list(problems_of(recording))
    if problems:
        raise DatasetError("\n".join(f"{os.fspath(path)}: {problem}" for problem in problems))
    return recording


@contextmanager
def _about(path: str | os.PathLike[str], name: str) -> Iterator[None]:
    """Add the file and the variable to errors of reading."""
    try:
        yield
    except DatasetError as problem:
        raise DatasetError(f"{os.fspath(path)}: {name}: {problem}") from problem
    except (ValueError, TypeError) as problem:
        raise DatasetError(
            f"{os.fspath(path)}: {name}: expected numbers and attributes as recordings have them, got: {problem}."
        ) from problem


def _check_attributes(variable: Any) -> None:
    for key in ("units", "long_name"):
        if key not in variable.ncattrs():
            raise DatasetError(f"expected the attribute {key}, got none.")


def _read_axis(variable: Any) -> TimeAxis:
    interval = getattr(variable, "sampling_interval", None)
    return TimeAxis(
        np.asarray(variable[...], dtype=np.float64),
        None if interval is None else float(interval),
        float(getattr(variable, "interval_uncertainty", 0.0)),
        str(getattr(variable, "source", "")),
        str(getattr(variable, "trigger", "")),
    )


def _others(variable: Any) -> dict[str, Any]:
    return {key: variable.getncattr(key) for key in variable.ncattrs() if key not in _STORED}


def _read_channel(file: netCDF4.Dataset, name: str, axis: TimeAxis) -> Channel:
    variable: Any = file.variables[name]
    values = np.asarray(variable[...], dtype=np.float64)
    stored: Any = file.variables.get(name + QUALITY_ENDING)
    quality = np.zeros(len(values), np.uint8) if stored is None else _quality(np.asarray(stored[...]))
    unit = str(variable.units)
    # a unit without a meaning is refused here, not in the middle of an analysis
    measured_unit(unit)
    return Channel(name, values, unit, axis, quality, str(variable.long_name), _others(variable))


def _quality(flags: NDArray[Any]) -> NDArray[np.uint8]:
    known = sum(int(flag) for flag in Quality)
    if flags.dtype.kind not in "iu" or np.any((flags < 0) | (flags > known)):
        raise DatasetError(f"quality: expected whole numbers from 0 to {known}, got others.")
    return flags.astype(np.uint8)


def _read_events(name: str, variable: Any) -> EventTrain:
    window = None
    if {"window_start", "window_end"} <= set(variable.ncattrs()):
        window = float(variable.window_start), float(variable.window_end)
    times = np.asarray(variable[...], dtype=np.float64)
    resolution = float(getattr(variable, "resolution", 0.0))
    return EventTrain(name, times, window, resolution, str(variable.long_name), _others(variable))


def open_signals(path: str | os.PathLike[str], run: int | None = None) -> Recording:
    """Open the signals for an analysis: a recording, or one run of a simulated dataset in the same form.

    The sampled variables of the run become channels, its impacts the event train `impacts`.

    Parameters
    ----------
    path : path
    run : int or None
        run_index of the run; None for the only run.

    Raises
    ------
    DatasetError
        No such file, no such run, or a run without time series and impacts.
    """
    if is_recording(path):
        if run is not None:
            raise DatasetError(
                message(
                    *(f"{os.fspath(path)}: ", Argument("run")),
                    f": expected none of a recording, got {run}. Leave it out.",
                )
            )
        return open_recording(path)
    try:
        flat = read_runs(path)
    except DatasetError as problem:
        hint = " `vibroimpact import` makes a recording of the file of an instrument."
        raise DatasetError(f"{problem}{hint if os.path.isfile(path) else ''}") from problem
    with one_error(path):
        indices = flat.run_index.values.tolist()
        if run is None and len(indices) > 1:
            raise DatasetError(
                message(
                    f"{os.fspath(path)}: expected one run to be named, got {len(indices)} (run_index {indices[0]} to "
                    f"{indices[-1]}). Choose one with ",
                    *(Argument("run"), "."),
                )
            )
        if run is not None and run not in indices:
            raise DatasetError(
                f"{os.fspath(path)}: run: expected a run_index from {min(indices)} to {max(indices)}, got {run}."
            )
        return _run_signals(flat, 0 if run is None else indices.index(run), os.fspath(path))


def _run_signals(flat: Any, row: int, title: str) -> Recording:
    def rows(dimension: str) -> slice:
        counts = flat[RAGGED[dimension]].values
        first = int(counts[:row].sum())
        return slice(first, first + int(counts[row]))

    channels: dict[str, Channel] = {}
    events: dict[str, EventTrain] = {}
    nondimensional = flat.attrs.get("units_system") == "nondimensional"
    if "sample_count" in flat:
        part = flat.isel(sample=rows("sample"))
        axes = {0.0: TimeAxis.through(part.time.values, "simulated")}
        for name, variable in part.data_vars.items():
            # a channel is a number for each sample: arrays and texts are none
            if variable.dims == ("sample",) and variable.dtype.kind in "fiu" and name != "time":
                unit = "1" if nondimensional else str(variable.attrs["units"])
                chain = chain_of(variable.attrs, flat, row)
                if chain.skew not in axes:
                    axes[chain.skew] = TimeAxis.through(part.time.values + chain.skew, "simulated")
                values, label = (
                    variable.values.astype(np.float64, copy=False),
                    str(variable.attrs["long_name"]),
                )
                attrs = {"role": "simulated", **chain.attrs}
                channels[str(name)] = Channel(
                    str(name), values, unit, axes[chain.skew], chain.quality(values), label, attrs
                )
    if "impact_count" in flat:
        part = flat.isel(impact=rows("impact"))
        known = {str(name): part[name].values for name in part.data_vars if part[name].dims == ("impact",)}
        events["impacts"] = EventTrain("impacts", known["impact_time"], label="impacts", attrs=known)
    if not channels and not events:
        raise DatasetError(
            f"{title}: expected a run with time series of single numbers or impacts, got neither. "
            "Ask for them under [record] in the scene."
        )
    attrs = {**flat.attrs, "opened_from": title, "simulated": 1}
    return Recording(channels, events, {}, attrs)
