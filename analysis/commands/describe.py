"""The command `vibroimpact describe`: list the contents of a file by its own names and units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr
from rich.table import Table

from vibroimpact.analysis.commands.opened_file import opened_file
from vibroimpact.analysis.dataset import dataset_place
from vibroimpact.analysis.operations.describe import Describe
from vibroimpact.analysis.recording import Recording
from vibroimpact.analysis.recording.table import print_recording
from vibroimpact.fmus.printing import table, with_error
from vibroimpact.fmus.terminal import Terminal, wide_terminal
from vibroimpact.fmus.units import written_unit

#: Texts of a variable that are shown; further texts are counted only.
_MOST_TEXTS = 6
#: Remarks that are shown; further remarks are counted only.
_MOST_REMARKS = 8
#: Endings of the variable that holds the standard errors of another.
_ERRORS = ("_error", "_standard_error")
#: Variables on estimator and quantity, whose units differ by quantity.
_ESTIMATES = ("estimate", "standard_error", "interval_low", "interval_high", "estimator", "quantity", "unit")
#: Variables of the table of a fit.
_FITTED = ("parameter", "fitted_value", "start_value", "standard_error")
#: Attributes that are shown as they are.
_NOTES = ("title", "history", "engine", "channel", "verdict")


def describe_file(options: Describe) -> None:
    """Print the contents of a file of this package; a missing, damaged or foreign file raises DatasetError."""
    file = dataset_place(options.file)
    console = wide_terminal()
    with opened_file(file) as data:
        console.print(f"{file}: {_kind(data)}", soft_wrap=True)
        for line in _notes(data.attrs):
            console.print(f"  {line}", soft_wrap=True)
        if isinstance(data, Recording):
            print_recording(console, data)
        else:
            _print_dataset(console, data)


def _kind(data: xr.Dataset | Recording) -> str:
    """Return the kind of a file, in words."""
    if isinstance(data, Recording):
        return "recording"
    kind = data.attrs.get("results_kind")
    if kind == "estimates":
        return f"estimates of {data.attrs.get('estimates', 'a signal')}"
    if kind is not None:
        return str(kind)
    if "run_id" not in data:
        return "measurements of a benchmark"
    runs = int(np.sum(data["run_id"].values >= 0))
    if "scene_hash" in data.attrs:
        return f"campaign of {runs} runs"
    return "one run" if runs == 1 else f"{runs} runs"


def _notes(attrs: Mapping[str, Any]) -> Iterator[str]:
    """Yield the command that made a file, and the notes of its writer."""
    kind = str(attrs.get("results_kind", ""))
    source = attrs.get("source", attrs.get("source_file", "data without a name"))
    if kind == "estimates":
        yield f"made by: vibroimpact estimate {attrs.get('estimates', '')} of {source}"
    elif "rig" in attrs and "sweep" in attrs:
        yield f"made by: vibroimpact rig sweep of {source}, on {attrs['rig']} ({attrs.get('device', '')})"
    elif "rig" in attrs:
        yield f"made by: vibroimpact rig record of {source}"
    elif kind == "spikes" or "recording_schema" in attrs:
        yield f"made by: vibroimpact {kind or 'import'} of {source}"
    elif "source" in attrs:
        yield f"made by: {source}"
    yield from (f"{name}: {attrs[name]}" for name in _NOTES if attrs.get(name))


def _print_dataset(console: Terminal, data: xr.Dataset) -> None:
    sizes = ", ".join(f"{name} {size}" for name, size in data.sizes.items())
    console.print(f"  dimensions: {sizes or 'none'}", soft_wrap=True)
    shown = [name for name in map(str, data.variables) if not _is_shown_elsewhere(data, name)]
    if {"estimator", "quantity"} <= set(data.dims):
        console.print(_estimates(data))
    if "fitted_value" in data:
        console.print(_fit(data))
    console.print(_variables(data, shown))
    remarks = str(data.attrs.get("remarks", "")).splitlines()
    for remark in remarks[:_MOST_REMARKS]:
        console.print(f"- {remark}", soft_wrap=True)
    if len(remarks) > _MOST_REMARKS:
        console.print(f"{len(remarks) - _MOST_REMARKS} more remarks are in the file.")


def _is_shown_elsewhere(data: xr.Dataset, name: str) -> bool:
    """Tell whether a variable stands in a table of its own, or is the standard error of another variable."""
    if {"estimator", "quantity"} <= set(data.dims) and name in _ESTIMATES:
        return True
    if "fitted_value" in data and name in _FITTED:
        return True
    return any(name.endswith(ending) and name.removesuffix(ending) in data for ending in _ERRORS)


def _estimates(data: xr.Dataset) -> Table:
    """Return the table of quantities by methods."""
    methods = [str(name) for name in data["estimator"].values]
    rows = table("Estimates", "<quantity", "<unit", *(f">{name.replace('_', ' ')}" for name in methods))
    for place, quantity in enumerate(data["quantity"].values):
        one = data.isel(quantity=place)
        pairs = zip(one["estimate"].values, one["standard_error"].values, strict=True)
        cells = ["" if np.isnan(value) else with_error(float(value), float(error)) for value, error in pairs]
        rows.add_row(str(quantity).replace("_", " "), written_unit(str(one["unit"].values)), *cells)
    return rows


def _fit(data: xr.Dataset) -> Table:
    """Return the table of the scene's numbers that a replay fitted."""
    rows = table("Fit", "<number", ">found", ">began with")
    columns = (data[name].values for name in _FITTED)
    for key, value, start, error in zip(*columns, strict=True):
        rows.add_row(str(key), with_error(float(value), float(error)), f"{float(start):.6g}")
    return rows


def _variables(data: xr.Dataset, names: list[str]) -> Table:
    rows = table("Variables", "<name", "<meaning", "<dimensions", "<unit", "<values")
    for name in names:
        variable = data[name]
        unit = written_unit(str(variable.attrs.get("units", "1")))
        meaning = str(variable.attrs.get("long_name", ""))
        rows.add_row(name, meaning, ", ".join(map(str, variable.dims)), unit, _values(data, name))
    return rows


def _values(data: xr.Dataset, name: str) -> str:
    """Return the value of a variable with its standard error, or the range of its values."""
    variable = data[name]
    values = np.atleast_1d(variable.values).ravel()
    if values.dtype.kind not in "fiu":
        return _texts(values)
    if "flag_meanings" in variable.attrs:
        return _flags(variable, values)
    finite = values[np.isfinite(values)]
    if not len(finite):
        return "none"
    error = next((data[name + ending] for ending in _ERRORS if name + ending in data), None)
    if len(values) == 1:
        standard_error = np.nan if error is None else float(np.ravel(error.values)[0])
        return with_error(float(values[0]), standard_error)
    least, most = finite.min(), finite.max()
    text = f"{least:.6g}" if least == most else f"{least:.6g} to {most:.6g}"
    if error is not None:
        text += f", each ± {_range(np.ravel(error.values))}"
    missing = len(values) - len(finite)
    return f"{text}; {missing} missing" if missing else text


def _range(errors: np.ndarray[Any, Any]) -> str:
    finite = errors[np.isfinite(errors)]
    if not len(finite):
        return "?"
    least, most = f"{finite.min():.2g}", f"{finite.max():.2g}"
    return least if least == most else f"{least} to {most}"


def _flags(variable: xr.DataArray, values: np.ndarray[Any, Any]) -> str:
    meanings = str(variable.attrs["flag_meanings"]).split()
    masked = "flag_masks" in variable.attrs
    flags = np.atleast_1d(variable.attrs["flag_masks" if masked else "flag_values"])
    hits = (values & flag if masked else values == flag for flag in flags)
    counts = {word: int(np.count_nonzero(hit)) for word, hit in zip(meanings, hits, strict=True)}
    return ", ".join(f"{count} {word}" for word, count in counts.items() if count) or "none"


def _texts(values: np.ndarray[Any, Any]) -> str:
    different = [text for text in dict.fromkeys(map(str, values)) if text]
    more = len(different) - _MOST_TEXTS
    return ", ".join(different[:_MOST_TEXTS]) + (f" and {more} more" if more > 0 else "") or "none"
