"""The dataset of runs: names, units and groups of a scene, handed to the dataset's writer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import (
    RESERVED_NAMES,
    Outcome,
    RunRecord,
    build_dataset,
    file_names,
    marked,
)
from vibroimpact.analysis.dataset.assembling import Described, wrapped
from vibroimpact.analysis.dataset.columns import OF_ALL_PERIODS, RunColumns, arrays_of
from vibroimpact.analysis.dataset.sample_forms import axis_names
from vibroimpact.analysis.dataset.schema import POINT_COLUMNS, RAGGED, RULES, SWEPT_ALONG, unit_in
from vibroimpact.analysis.dataset.writing import described_constants
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.units import si_unit
from vibroimpact.orchestrator.run.empty_record import empty_record, records_impacts
from vibroimpact.orchestrator.run.measuring.conversion import channel_attributes, converted_records
from vibroimpact.orchestrator.run.points import PointColumns, columns_of_points
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.scene.body_models.structure import (
    MOTIONS,
    label_of,
    observed_variables,
)
from vibroimpact.orchestrator.scene.fields import rule_of
from vibroimpact.orchestrator.scene.keys import coordinate_name
from vibroimpact.orchestrator.scene.models import ContactTable
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY
from vibroimpact.orchestrator.scene.sweep import expand, shared_dimensions

EXTREMA = ("displacement_max", "displacement_min")
STROBE = ("strobe_displacement", "strobe_velocity")
FORCING_UNITS = {"force": "N", "base_acceleration": "m s-2", "uniform": "N m-1", "mode": "N"}
_OF_MOTION = dict(zip(MOTIONS, ("m", "m s-1"), strict=True))
_STATE_OF_MODES = "displacements (kg1/2 m), then velocities (kg1/2 m s-1), of all mass-normalised modes"


class DatasetForm:
    """The names, units, groups and constants of a scene's dataset, found once.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._names = coordinate_names(scene)
        self._said: dict[str, Any] = {
            "sample_variables": scene.sampled,
            "units": scene.units,
            "unit_of": _units(scene, self._names),
            "omit": _omitted(scene),
            "each_period": scene.record.each_period,
            "event_components": [component.name for component in scene.components],
            "connections": _energy_connections(scene),
            "compared": compared_names(scene),
            "further": further_points(scene),
            "sample_forms": scene.sample_forms,
        }
        stored = dict(zip(scene.sampled, stored_samples(scene), strict=True))
        of_channels = channel_attributes(scene).items()
        self._attributes = {stored[name]: own for name, own in of_channels} | _described(scene, self._names)
        if scene.is_one_body and isinstance(scene.body, StructureBody):
            self._attributes["final_state"] = {"long_name": _STATE_OF_MODES}
            known = scene.body.long_names(scene.stops)
            own = {stored[name]: {"long_name": known[name]} for name in scene.sampled if name in known}
            self._attributes |= own | self._of_further(scene.body)
            if records_impacts(scene) and any(isinstance(stop, ContactTable) for stop in scene.stops):
                for name, words in (
                    ("impact_contact", "that is hit"),
                    ("stick_contact", "that is rested on"),
                ):
                    named = _named_contacts(scene.stop_keys)
                    named["long_name"] = f"number of the stop or contact {words}, from 1"
                    self._attributes[name] = named
        own = _attributes_of_forces(scene)
        self._attributes |= {stored[name]: own[name] for name in scene.sampled if name in own}
        if not scene.is_one_body and records_impacts(scene):
            self._attributes["impact_contact"] = _named_contacts([each.name for each in scene.meetings])

    def _of_further(self, body: StructureBody) -> dict[str, dict[str, Any]]:
        """Return the long names of the variables of each period of further observed points."""
        scene, found = self._scene, {}
        periods = scene.period is not None and (scene.record.extrema or scene.record.strobe)
        for point, words in zip(self._said["further"], body.further_words if periods else (), strict=False):
            for name in POINT_COLUMNS:
                if name not in self.omitted:
                    own = RULES[name].long_name if scene.record.each_period else OF_ALL_PERIODS[name]
                    found[f"{name}_{point}"] = {"long_name": f"{words}: {own}"}
        return found

    def dataset(
        self,
        points: PointColumns,
        records: Sequence[RunRecord] | RunColumns,
        attrs: Mapping[str, Any],
        *,
        constants: bool = False,
    ) -> xr.Dataset:
        """Return the one-dimensional dataset of points and their results; impossible values are marked.

        Parameters
        ----------
        points : PointColumns
        records : sequence of RunRecord, or RunColumns
            Results of the points, in their order.
        attrs : mapping
            Attributes of the file.
        constants : bool
            Whether numbers that are not swept are among the coordinates.
        """
        scene = self._scene
        if scene.channels and not isinstance(records, RunColumns):
            records = converted_records(scene, points.values, points.direction, records)
        dataset = build_dataset(
            records,
            coordinates={name: points.values[key] for key, name in self._names.items()},
            direction=points.direction,
            run_index=points.index,
            attrs=attrs,
            constants=self.constants() if constants else None,
            **self._said,
        )
        for name, attributes in self._attributes.items():
            dataset.variables[name].attrs.update(attributes)
        return marked(dataset)

    @property
    def omitted(self) -> tuple[str, ...]:
        """Variables of each period that the scene does not record."""
        omitted: tuple[str, ...] = self._said["omit"]
        return omitted

    def arrays(self, columns: RunColumns) -> dict[str, Any]:
        """Return the results of points as arrays, with the names and the types of the dataset."""
        found = arrays_of(
            columns, self.omitted, each_period=self._said["each_period"], further=self._said["further"]
        )
        if columns.samples is not None:
            found[RAGGED["sample"]] = columns.samples.count.astype(RULES[RAGGED["sample"]].dtype)
            names = ("time", *stored_samples(self._scene))
            found |= dict(zip(names, map(np.ascontiguousarray, columns.samples.rows.T), strict=True))
        return found

    def refuse_impossible(self) -> None:
        """Raise DatasetError unless the scene can have a dataset, whatever its points record."""
        point = columns_of_points(expand(self._scene), 0, 1)
        self.dataset(point, [empty_record(self._scene, Outcome.error, "", 0.0)], {}, constants=True)

    def constants(self) -> dict[str, Described]:
        """Return the numbers that the scene does not sweep as scalar coordinates."""
        return {
            name: (dims, value.copy(), dict(attrs)) for name, (dims, value, attrs) in self._constants.items()
        }

    @cached_property
    def _constants(self) -> dict[str, Described]:
        scene, numbers = self._scene, self._scene.constants()
        names = constant_file_names(scene, numbers)
        named = {file: numbers[key] for key, file in names.items()}
        found = described_constants(named, scene.units, _units(scene, names))
        own = _described(scene, names)
        return {
            name: (dims, value, {**attrs, **own.get(name, {})})
            for name, (dims, value, attrs) in found.items()
        }


def dataset_of(
    scene: Scene,
    points: PointColumns,
    records: Sequence[RunRecord] | RunColumns,
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """Return the one-dimensional dataset of points of a scene, see `DatasetForm.dataset`."""
    return DatasetForm(scene).dataset(points, records, attrs)


def empty_dataset(scene: Scene) -> xr.Dataset:
    """Return the dataset of one run of a scene that has no results: its names, dimensions and attributes."""
    point = columns_of_points(expand(scene), 0, 1)
    return dataset_of(scene, point, [empty_record(scene, Outcome.error, "", 0.0)], {})


def tally(dataset: xr.Dataset) -> dict[str, int]:
    """Count the runs of each outcome."""
    values, counts = np.unique(dataset.outcome.values, return_counts=True)
    return {Outcome(value).name: int(count) for value, count in zip(values, counts, strict=True)}


def has_messages(dataset: xr.Dataset) -> bool:
    """Return whether any run has a message: it failed, or it warns."""
    return any(dataset.variables["message"].values.tolist())


def _described(scene: Scene, names: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Return further attributes of a scene's numbers, besides name and unit, by their names in the file."""
    found = {file: {"long_name": long_name} for file, long_name in _long_names(scene, names).items()}
    for key, dimension in shared_dimensions(scene.sweep).items():
        if key in names:
            found.setdefault(names[key], {})[SWEPT_ALONG] = dimension
    return found


def with_constants_of(dataset: xr.Dataset, scene: Scene) -> xr.Dataset:
    """Return the dataset of a scene's runs with the numbers that are not swept as scalar coordinates."""
    return dataset.assign_coords(wrapped(DatasetForm(scene).constants()))


def constant_file_names(scene: Scene, keys: Iterable[str]) -> dict[str, str]:
    """Return the name in the file of each key that is not swept, named like a swept key."""
    every = [*keys, *(axis.key for axis in scene.sweep)]
    short = {key: coordinate_name(key, every) for key in keys}
    twice = Counter(short.values())
    taken = _taken(scene) | set(coordinate_names(scene).values()) | set(stored_samples(scene))
    taken |= _sample_axes(scene)
    preferred = [name if twice[name] == 1 else key for key, name in short.items()]
    return dict(zip(short, file_names(preferred, taken), strict=True))


def coordinate_names(scene: Scene) -> dict[str, str]:
    """Return the name in the file of each swept key, by key."""
    keys = [axis.key for axis in scene.sweep]
    preferred = [scene.sweep_coordinate_name(key) for key in keys]
    return dict(zip(keys, file_names(preferred, _taken(scene)), strict=True))


def _taken(scene: Scene) -> frozenset[str]:
    """Return the names that no number of a scene may have in the file, among them the names of dimensions."""
    return RESERVED_NAMES | set(shared_dimensions(scene.sweep).values())


def stored_samples(scene: Scene) -> tuple[str, ...]:
    """Return the name in the file of each sampled variable, in the order of the scene."""
    return file_names(scene.sampled, _taken(scene) | set(coordinate_names(scene).values()))


def _sample_axes(scene: Scene) -> set[str]:
    """Return the names of the dimensions of sampled arrays."""
    stored = dict(zip(scene.sampled, stored_samples(scene), strict=True))
    taken = RESERVED_NAMES | set(coordinate_names(scene).values()) | set(stored.values())
    own = [stored[name] for name in scene.sample_forms]
    return {name for axes in axis_names(own, [*scene.sample_forms.values()], taken) for name in axes}


def _units(scene: Scene, names: Mapping[str, str]) -> dict[str, str]:
    """Return the units that the dataset cannot derive from the names alone, by name in the file."""
    if not scene.is_one_body:
        units = dict(scene.declared_units)
        stored = {file: units[key] for key, file in names.items() if key in units}
        return units | stored if scene.units == "SI" else stored
    forcing = None if scene.has_several_forces else scene.forcing
    units = {} if forcing is None else {"forcing": FORCING_UNITS[forcing.kind]}
    units |= dict.fromkeys(scene.channels, "V")
    if isinstance(scene.body, StructureBody):
        units |= {
            name: _OF_MOTION[name.partition("[")[0]] for name in observed_variables(scene.record.observed)
        }
    return units | {file: cf_unit(scene, key) or "1" for key, file in names.items()}


def _attributes_of_forces(scene: Scene) -> dict[str, dict[str, Any]]:
    """Return names and units of the samples of several forces, by name in a time series."""
    forces = enumerate(scene.forces if scene.has_several_forces else (), start=1)
    return {
        f"forcing[{number}]": {
            "long_name": f"force {number} of the scene, {force.signal}",
            "units": unit_in(scene.units, FORCING_UNITS[force.kind]),
        }
        for number, force in forces
    }


def cf_unit(scene: Scene, key: str) -> str | None:
    """Return the unit of a number of the short form in CF notation; None where CF has no notation for it."""
    if key == RECORDING_KEY:
        return "1"
    for table, force in zip(scene.forcing_keys, scene.forces, strict=True):
        if key.startswith(f"{table}.amplitude"):
            return "V" if scene.exciter is not None else FORCING_UNITS[force.kind]
    try:
        return si_unit(_unit(scene, key).replace("^", "")).cf
    except UsageError:  # UDUNITS has no broken exponents, and a wrong unit would be worse than none
        return None


def _unit(scene: Scene, key: str) -> str:
    return rule_of(scene.field(key)).unit


def _long_names(scene: Scene, names: Mapping[str, str]) -> dict[str, str]:
    """Return long names with the unit, for keys whose unit CF cannot write, by name in the file."""
    if not scene.is_one_body or scene.units != "SI":
        return {}
    unsaid = {file: key for key, file in names.items() if cf_unit(scene, key) is None}
    return {file: f"{file.replace('_', ' ')} in {_unit(scene, key)}" for file, key in unsaid.items()}


def _named_contacts(names: Sequence[str]) -> dict[str, Any]:
    """Return the attributes of the number of a contact, with the meaning of each number."""
    return {
        "long_name": "number of the contact of the scene, from 1",
        "flag_values": np.arange(1, len(names) + 1, dtype=RULES["impact_contact"].dtype),
        "flag_meanings": " ".join(file_names(names, ())),
    }


def further_points(scene: Scene) -> tuple[str, ...]:
    """Return the names in the file of the observed points besides the first."""
    return file_names([label_of(each) for each in scene.record.observed[1:]], ()) if scene.is_one_body else ()


def _omitted(scene: Scene) -> tuple[str, ...]:
    record = scene.record
    return (() if record.extrema else EXTREMA) + (() if record.strobe else STROBE)


def compared_names(scene: Scene) -> tuple[str, ...]:
    """Return the names of the pairs that a replay compares."""
    if scene.replay is None:
        return ()
    return tuple(f"{pair.simulated} ~ {pair.measured}" for pair in scene.replay.compare)


def _energy_connections(scene: Scene) -> tuple[str, ...]:
    if scene.is_one_body:
        return ()
    # only general scenes need FMPy, which takes long to import
    from vibroimpact.orchestrator.importer.energy import force_connections

    return force_connections(scene.components, scene.connections, scene.stop_contacts)
