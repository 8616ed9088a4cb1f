"""Build datasets from runs, and write each as a file that is whole or absent."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.assembling import Described, assembled, loaded_variable, wrapped
from vibroimpact.analysis.dataset.checking import marked
from vibroimpact.analysis.dataset.columns import (
    OF_ALL_PERIODS,
    Ragged,
    RunColumns,
    arrays_of,
    columns_of,
    ragged,
)
from vibroimpact.analysis.dataset.naming import file_names, known_unit, quantity_unit, sample_rule
from vibroimpact.analysis.dataset.registering import accessor  # noqa: F401  # for `ds.vibroimpact`
from vibroimpact.analysis.dataset.sample_forms import SampleForm, axis_names
from vibroimpact.analysis.dataset.schema import (
    CONVENTIONS,
    EVENT_COLUMNS,
    NOT_SWEPT,
    RAGGED,
    RESERVED_NAMES,
    RULES,
    SCHEMA_VERSION,
    SCORE_COLUMNS,
    STEP_COLUMNS,
    TRACE_COLUMNS,
    Direction,
    RunRecord,
    UnitSystem,
    attributes_of,
    known_rule,
    names_list,
    unit_in,
)
from vibroimpact.analysis.dataset.stores.storing import Stored, stored_variables
from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.analysis.files.fingerprints import sealed
from vibroimpact.analysis.files.open_files import netcdf_lock
from vibroimpact.fmus.errors import DatasetError

_TEXT_CHUNK = 4096
"""Number of texts stored together; a chunk of empty texts is not stored."""

_Variables = dict[str, tuple[tuple[str, ...], NDArray[Any], dict[str, Any]]]


def build_dataset(
    runs: Sequence[RunRecord] | RunColumns,
    *,
    coordinates: Mapping[str, NDArray[np.float64]],
    direction: Sequence[Direction] | NDArray[np.int8],
    run_index: Sequence[int] | NDArray[np.integer[Any]],
    sample_variables: Sequence[str] = (),
    units: UnitSystem = "SI",
    attrs: Mapping[str, Any] | None = None,
    unit_of: Mapping[str, str] | None = None,
    omit: Collection[str] = (),
    each_period: bool = True,
    event_components: Sequence[str] = (),
    connections: Sequence[str] = (),
    compared: Sequence[str] = (),
    further: Sequence[str] = (),
    measured: Mapping[str, NDArray[Any]] | None = None,
    constants: Mapping[str, Described] | None = None,
    sample_forms: Mapping[str, SampleForm] | None = None,
) -> xr.Dataset:
    """Build the one-dimensional dataset of some runs, as it is written to a file.

    Parameters
    ----------
    runs : sequence of RunRecord, or RunColumns
        All with the same groups recorded; a failed run may have None where the others have arrays.
    coordinates : mapping of str to ndarray, shape (run,)
        Values of each swept parameter, under its name in the file.
    direction : sequence of Direction, length run
    run_index : ndarray of int, shape (run,)
        Index of each run in its campaign.
    sample_variables : sequence of str
        Names of the sampled variables; `component.variable` in a general scene. In the file they have the names that
        `file_names` gives. Those without a form are in columns 1 on of `RunRecord.samples`, in their order.
    units : {"SI", "nondimensional"}
        Units of the scene.
    attrs : mapping, optional
        Provenance: scene text, versions, hashes; written as global attributes.
    unit_of : mapping of str to str, optional
        SI units of swept parameters, and of sampled variables whose name does not end in a known quantity. A variable
        of one of the `event_components` that is missing here has the unit 1.
    omit : collection of str
        Per-period variables that the scene does not record; they are not stored.
    each_period : bool, optional
        False: `period` has one element, which stands for all recorded periods of its run:
        `columns.of_all_periods`.
    event_components : sequence of str, optional
        Names of all components of a general scene, in the order that `RunRecord.events` counts them.
    connections : sequence of str, optional
        Force-displacement connections, as "body.displacement -> other.force", in the order of
        `RunRecord.energy_residual`. A run without residuals has NaN.
    compared : sequence of str, optional
        Compared pairs of a replay, in the order of `RunRecord.scores`. A run without scores has NaN.
    further : sequence of str, optional
        Names in the file of further observed points, in the order of their columns in `RunRecord.periods`.
    measured : mapping of str to ndarray, shape (run,), optional
        Further columns of runs that a rig has measured, or that are orbits: some of `schema.MEASURED_COLUMNS`, or
        `schema.ORBIT_COLUMNS`.
    constants : mapping of str to tuple, optional
        Numbers that are the same for all runs, as `described_constants` gives them.
    sample_forms : mapping of str to SampleForm, optional
        Forms of sampled variables that are no plain numbers, in the order of `RunRecord.formed_samples`.

    Returns
    -------
    xarray.Dataset
        Dimensions `run`, and `state`, `period`, `impact`, `stick`, `sample`, `event`, `interface` where recorded.
        Not checked yet: `checking.check`.

    Raises
    ------
    DatasetError
        If the parts do not fit together.

    Examples
    --------
    >>> from vibroimpact.analysis.dataset.schema import Outcome
    >>> run = RunRecord(Outcome.ok, "", None, np.empty((0, 5)), None, None, 0.0, 0.0, 0.0, 1e-3)
    >>> dataset = build_dataset([run], coordinates={}, direction=[Direction.independent], run_index=[0])
    >>> dict(dataset.sizes)
    {'run': 1, 'impact': 0}
    """
    _check_lengths(len(runs), coordinates, direction, run_index)
    columns, records = (runs, ()) if isinstance(runs, RunColumns) else (columns_of(runs), runs)
    variables = _described({"run_index": run_index, "direction": direction}, units)
    variables |= _column_variables(columns, units, omit, each_period, further)
    forms = sample_forms or {}
    samples = _Samples(
        sample_variables, event_components, frozenset(coordinates), unit_of or {}, units, forms
    )
    variables |= _sample_variables(columns.samples, [run.formed_samples for run in records], samples)
    variables |= _event_variables(records, event_components, units)
    variables |= _coupling_variables(records, connections, units)
    variables |= _score_variables(records, compared, units)
    variables |= _described(measured or {}, units)
    swept: _Variables = {
        name: (
            ("run",),
            np.asarray(values, dtype=np.float64),
            _quantity_attributes(name, units, unit_of or {}),
        )
        for name, values in coordinates.items()
    }
    described = {
        "Conventions": CONVENTIONS,
        "dataset_schema": SCHEMA_VERSION,
        "units_system": units,
        "history": "simulated by vibroimpact",
    }
    named: tuple[str, ...] = ("run_index", "direction")
    named += (("connection",) if connections else ()) + (("compared",) if compared else ())
    coords = {name: variables.pop(name) for name in named} | swept | dict(constants or {})
    return assembled(variables, coords, described | dict(attrs or {}))


def with_constants(
    dataset: xr.Dataset, constants: Mapping[str, float], *, unit_of: Mapping[str, str] | None = None
) -> xr.Dataset:
    """Return a one-dimensional dataset with the numbers of its scene that all runs share, as scalar coordinates.

    The constants keep the datasets of two scenes apart when these are joined: `xr.concat([...], dim="restitution")`.
    Their names in the file must be new there. Units are SI, and may be left out for sampled quantities. An unknown
    unit raises DatasetError.
    """
    described = described_constants(constants, dataset.attrs["units_system"], unit_of)
    return dataset.assign_coords(wrapped(described))


def described_constants(
    constants: Mapping[str, float], units: UnitSystem, unit_of: Mapping[str, str] | None = None
) -> dict[str, Described]:
    """Return the variables of numbers that are the same for all runs, as `with_constants` adds them."""
    return {
        name: (
            (),
            np.array(value, dtype=float),
            _quantity_attributes(name, units, unit_of or {}) | NOT_SWEPT,
        )
        for name, value in constants.items()
    }


def _check_lengths(
    runs: int,
    coordinates: Mapping[str, NDArray[np.float64]],
    direction: Sequence[Direction] | NDArray[np.int8],
    run_index: Sequence[int] | NDArray[np.integer[Any]],
) -> None:
    """Raise DatasetError if per-run arrays differ in length, or a swept parameter would hide a variable."""
    lengths = {"direction": len(direction), "run_index": len(run_index)}
    lengths |= {name: len(values) for name, values in coordinates.items()}
    problems = [
        f"dataset: {name}: expected one value for each of {runs} runs, got {length}."
        for name, length in lengths.items()
        if length != runs
    ]
    problems += [
        f"dataset: {name}: expected a swept parameter with a name of its own, got that of a variable."
        for name in coordinates
        if name in RESERVED_NAMES
    ]
    if problems:
        raise DatasetError("\n".join(problems))


def _described(values: Mapping[str, Any], units: UnitSystem) -> _Variables:
    """Return values as variables of the schema, with its dimensions, types and attributes."""
    return {
        name: (
            known_rule(name).dims,
            np.ascontiguousarray(column, dtype=known_rule(name).dtype),
            attributes_of(name, units),
        )
        for name, column in values.items()
    }


def _column_variables(
    columns: RunColumns, units: UnitSystem, omit: Collection[str], each_period: bool, further: Sequence[str]
) -> _Variables:
    """Return the variables of the records of runs."""
    variables = _described(arrays_of(columns, omit, each_period=each_period, further=further), units)
    for name in () if each_period else OF_ALL_PERIODS.keys() & variables:
        variables[name][2]["long_name"] = OF_ALL_PERIODS[name]
    return variables


def _ragged_variables(
    dimension: str, rows: Ragged | None, columns: Sequence[str], units: UnitSystem
) -> _Variables:
    """Return a contiguous ragged array (CF-1.11 section 9.3.3): the count of each run, then all rows."""
    if rows is None:
        return {}
    known = rows.rows[:, : len(columns)]
    values = {RAGGED[dimension]: rows.count} | dict(zip(columns, known.T, strict=True))
    return _described(values, units)


@dataclass(frozen=True, slots=True)
class _Samples:
    """Facts about the sampled variables other than their values."""

    names: Sequence[str]
    components: Collection[str]
    swept: Collection[str]
    unit_of: Mapping[str, str]
    units: UnitSystem
    forms: Mapping[str, SampleForm]

    def attributes(self, name: str, stored: str) -> dict[str, Any]:
        """Return the attributes of a variable that is stored under another name than in its component."""
        rule = None if self.components or stored == name else sample_rule(stored)
        if rule is not None:
            return {"long_name": rule.long_name, "units": unit_in(self.units, rule.unit)}
        unit = self.unit_of.get(name) or self.unit_of.get(stored)
        owner, dot, _ = name.partition(".")
        if not unit and (owner in self.components or (dot and known_unit(stored) is None)):
            # The units that foreign FMUs state are the only source: names would only mislead.
            unit = "1"
        attributes = _quantity_attributes(stored, self.units, {stored: unit} if unit else {})
        return attributes if stored == name else attributes | {"long_name": name, "component_variable": name}


def _sample_variables(
    samples: Ragged | None, formed: Sequence[tuple[NDArray[Any], ...] | None], known: _Samples
) -> _Variables:
    """Return the time series: `time` and the sampled variables; `formed` has those with a form, for each run."""
    variables = _ragged_variables("sample", samples, ("time",), known.units)
    if samples is None:
        return {}
    plain = [name for name in known.names if name not in known.forms]
    if samples.rows.shape[1] != 1 + len(plain):
        raise DatasetError(
            f"dataset: samples: expected time and {len(plain)} variables ({names_list(plain)}), "
            f"got {samples.rows.shape[1]} columns."
        )
    taken = RESERVED_NAMES | set(known.swept)
    stored = dict(zip(known.names, file_names(known.names, taken), strict=True))
    own = [stored[name] for name in known.forms]
    taken |= set(stored.values())
    axes = dict(zip(known.forms, axis_names(own, [*known.forms.values()], taken), strict=True))
    tables = dict(zip(known.forms, _formed_tables(formed, samples, known.forms), strict=True))
    columns = iter(samples.rows[:, 1:].T)
    for name, file in stored.items():
        values = tables[name] if name in tables else np.ascontiguousarray(next(columns))
        dims, form = ("sample", *axes.get(name, ())), known.forms.get(name)
        variables[file] = (dims, values, known.attributes(name, file) | (form.attributes() if form else {}))
    return variables


def _formed_tables(
    formed: Sequence[tuple[NDArray[Any], ...] | None], samples: Ragged, forms: Mapping[str, SampleForm]
) -> list[NDArray[Any]]:
    """Return the samples of all runs of each variable with a form."""
    rows = int(samples.count.sum())
    tables = []
    for place, (name, form) in enumerate(forms.items()):
        parts = [form.empty(), *(run[place] for run in formed if run is not None)]
        table = np.concatenate(parts) if all(part.shape[1:] == form.shape for part in parts) else form.empty()
        if len(table) != rows:
            raise DatasetError(
                f"dataset: {name}: expected {rows} samples of the shape {form.shape}, got others."
            )
        tables.append(table)
    return tables


def _event_variables(runs: Sequence[RunRecord], components: Sequence[str], units: UnitSystem) -> _Variables:
    """Return the located events; the components are named by flags."""
    tables = ragged([run.events for run in runs], len(EVENT_COLUMNS))
    variables = _ragged_variables("event", tables, EVENT_COLUMNS, units)
    if not variables:
        return {}
    if not components:
        raise DatasetError(
            "dataset: event_components: expected the names of the components that have the events, got none."
        )
    variables["event_component"][2].update(
        flag_values=np.arange(1, len(components) + 1, dtype=RULES["event_component"].dtype),
        flag_meanings=" ".join(file_names(components, ())),
    )
    return variables


def _coupling_variables(
    runs: Sequence[RunRecord], connections: Sequence[str], units: UnitSystem
) -> _Variables:
    """Return the residuals of the coupling of components."""
    variables: _Variables = {}
    for run in runs:
        if run.energy_residual is not None and len(run.energy_residual) != len(connections):
            raise DatasetError(
                f"dataset: energy_residual: expected one value for each of {len(connections)} connections "
                f"({names_list(connections)}), got {len(run.energy_residual)}."
            )
    if connections:
        missing = np.full(len(connections), np.nan)
        rows = [missing if run.energy_residual is None else run.energy_residual for run in runs]
        values = np.array(rows, dtype=np.float64).reshape(len(runs), len(connections))
        # CF wants numbers in a variable with the name of its dimension, so the dimension has another one.
        variables = _described({"connection": connections, "energy_residual": values}, units)
    if any(run.loop_residual is not None for run in runs):
        loops = [np.nan if run.loop_residual is None else run.loop_residual for run in runs]
        variables |= _described({"loop_residual": loops}, units)
    if any(run.chosen_steps is not None for run in runs):
        none = np.full(len(STEP_COLUMNS), np.nan)
        rows = [none if run.chosen_steps is None else run.chosen_steps for run in runs]
        variables |= _described(dict(zip(STEP_COLUMNS, np.array(rows).T, strict=True)), units)
    tables = ragged([run.step_trace for run in runs], len(TRACE_COLUMNS))
    variables |= _ragged_variables("chosen_step", tables, TRACE_COLUMNS, units)
    return variables


def _score_variables(runs: Sequence[RunRecord], compared: Sequence[str], units: UnitSystem) -> _Variables:
    """Return the scores of replays."""
    if not compared:
        return {}
    missing = np.full((len(compared), len(SCORE_COLUMNS)), np.nan)
    rows = [missing if run.scores is None else run.scores for run in runs]
    values = np.array(rows, dtype=np.float64).reshape(len(runs), *missing.shape)
    columns = dict(zip(SCORE_COLUMNS, np.moveaxis(values, -1, 0), strict=True))
    return _described({"compared": compared} | columns, units)


def _quantity_attributes(name: str, units: UnitSystem, unit_of: Mapping[str, str]) -> dict[str, Any]:
    """Return the attributes of a swept parameter or sampled variable."""
    unit = unit_in(units, unit_of[name]) if name in unit_of else quantity_unit(name, units)
    return {"long_name": name.replace("_", " "), "units": unit}


def write_dataset(dataset: xr.Dataset, path: str | os.PathLike[str], *, compression: int = 0) -> None:
    """Check a dataset and write it as one NetCDF-4 file that is whole or absent.

    A run whose values fail the check is marked (`checking.marked`) and written with the others.

    The SHA-256 of the content follows the content, see `fingerprints`. The file is made in memory and then written in
    one go. Otherwise the HDF5 library would keep the file open on a full disk, and its space taken.

    Parameters
    ----------
    dataset : xarray.Dataset
        One-dimensional, as `build_dataset` and `merge_datasets` make it.
    path : path
        An older file of this name is replaced only when the new one is complete.
    compression : int
        zlib level from 0 (none) to 9.

    Raises
    ------
    DatasetError
        If names, dimensions, types or counts are not those of the schema.
    OSError
        If the file cannot be written (no space, no permission), with the reason of the operating system.
    """
    write_atomically(path, *sealed(image_of(marked(dataset), compression)))


def image_of(dataset: xr.Dataset, compression: int = 0) -> memoryview:
    """Return the bytes of the NetCDF-4 file of a dataset."""
    # values that come from another file need the lock, too
    variables = [replace(one, variable=loaded_variable(one.variable)) for one in stored_variables(dataset)]
    with netcdf_lock():
        file = netCDF4.Dataset("dataset.nc", "w", format="NETCDF4", memory=1)
        # Every value is written below: filling first would write everything twice.
        file.set_fill_off()
        file.setncatts(dict(dataset.attrs))
        for name, size in dataset.sizes.items():
            file.createDimension(str(name), size)
        for variable in variables:
            _store(file, variable, compression)
        return memoryview(file.close())


def _store(file: netCDF4.Dataset, one: Stored, compression: int) -> None:
    """Store one variable with its attributes."""
    variable = one.variable
    placed = define_variable(file, one, variable.size, compression)
    if variable.dtype.kind == "O":
        store_texts(placed, variable.values)
    elif variable.size:
        placed[...] = variable.values


def define_variable(
    file: netCDF4.Dataset, one: Stored, size: int, compression: int = 0
) -> netCDF4.Variable[Any]:
    """Define a variable of `size` elements in a file, with its attributes; floats mark missing values by NaN."""
    variable = one.variable
    is_text = variable.dtype.kind == "O"
    kind: Any = str if is_text else variable.dtype
    level: Any = compression
    further = variable.shape[1:]
    texts = max(1, min(_TEXT_CHUNK, size) // max(1, math.prod(further)))
    placed = file.createVariable(
        one.name,
        kind,
        tuple(map(str, variable.dims)),
        fill_value=np.nan if one.may_miss else None,
        compression="zlib" if compression and not is_text else None,
        complevel=level,
        shuffle=True,
        chunksizes=[texts, *further] if is_text and size else None,
    )
    placed.setncatts({**variable.attrs, "coordinates": one.linked} if one.linked else dict(variable.attrs))
    return placed


def store_texts(placed: netCDF4.Variable[Any], texts: NDArray[Any], first: int = 0) -> None:
    """Store the texts that are not empty, from the element `first` on.

    An element that was never stored reads as empty, and takes no space.
    """
    filled = texts.astype(bool)
    places = np.flatnonzero(filled.any(axis=tuple(range(1, texts.ndim))) if texts.ndim > 1 else filled)
    for block in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1) if places.size else ():
        placed[first + block[0] : first + block[-1] + 1] = texts[block]
