"""The parts of a scene in either form of its file: bodies, contacts, forcing, record.

A file with `[body]` has one body of the package, which meets its own stops. A file with `[component.NAME]` has a body
for each FMU, connections between them, and contacts of any two.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Any, Literal, Self, cast

from pydantic import BaseModel, Field, SerializerFunctionWrapHandler, model_serializer
from pydantic.fields import FieldInfo

from vibroimpact.analysis.dataset.sample_forms import SampleForm
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.importer.specification import (
    COUPLING_TOLERANCE,
    ComponentSpec,
    ConnectionSpec,
    EventSpec,
    PairSpec,
    StopContactSpec,
)
from vibroimpact.orchestrator.scene.body_models import Body, StructureBody
from vibroimpact.orchestrator.scene.component_numbers import ComponentNumbers, is_step
from vibroimpact.orchestrator.scene.execution_model import Execution
from vibroimpact.orchestrator.scene.fields import field_of, known_keys
from vibroimpact.orchestrator.scene.forcing_clock import Clock, clock_of, sweeps_frequencies
from vibroimpact.orchestrator.scene.forcing_models import (
    Force,
    Forcing,
    TableForcing,
    forces_in_words,
    forcing_keys,
    is_one_sine,
)
from vibroimpact.orchestrator.scene.keys import (
    CHAIN_TABLES,
    Key,
    number_of,
    numbers_of,
    numeric_key,
    replacement,
)
from vibroimpact.orchestrator.scene.measuring_models import (
    Daq,
    Exciter,
    LoadCell,
    Noise,
    Sensor,
)
from vibroimpact.orchestrator.scene.models import (
    MOTION_KEYS,
    ContactTable,
    Record,
    SceneTable,
    Stop,
)
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY, Replay
from vibroimpact.orchestrator.scene.sampled_names import channels_in
from vibroimpact.orchestrator.scene.several_bodies import is_left_out
from vibroimpact.orchestrator.scene.sweep import SweepAxis, run_count

_NAMED_BY_FORM = (
    *("bodies", "contacts", "connections", "events"),
    *("sample_forms", "declared_units", "doubts", "remarks", "start_time"),
)
"""Parts with different names, or no name, in the documents of the two forms."""
_OWN_TABLES = ("sensor", *CHAIN_TABLES)
"""Tables with numbers besides those of bodies, forces, stops and contacts."""


def _without_defaults(connection: dict[str, Any]) -> dict[str, Any]:
    """Return the document of a connection without an empty mapping: campaigns of versions without it go on."""
    return {key: value for key, value in connection.items() if key != "mapping" or value}


class Parts(SceneTable):
    """The parts of a scene, and the questions about them."""

    source: str
    title: str
    units: Literal["SI", "nondimensional"]
    bodies: tuple[Body | ComponentSpec, ...]
    contacts: tuple[Stop | StopContactSpec | PairSpec, ...] = ()
    connections: tuple[ConnectionSpec, ...] = ()
    events: tuple[EventSpec, ...] = ()
    forces: tuple[Force, ...] = ()
    sensor: Sensor | None = None
    load_cell: LoadCell | None = None
    exciter: Exciter | None = None
    noise: Noise | None = None
    daq: Daq | None = None
    record: Record
    sweep: tuple[SweepAxis, ...]
    execution: Execution
    replay: Replay | None = None
    start_time: float = 0.0
    sample_forms: Mapping[str, SampleForm] = Field(default_factory=dict, repr=False)
    declared_units: Mapping[str, str] = Field(default_factory=dict, repr=False)
    doubts: tuple[str, ...] = Field((), repr=False)
    remarks: Mapping[str, int] = Field(default_factory=dict, repr=False)

    @model_serializer(mode="wrap")
    def _by_form(self, serialized: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Return the document by which campaigns identify a scene, with the original part names of each form."""
        document: dict[str, Any] = serialized(self)
        parts = {name: document.pop(name, None) for name in _NAMED_BY_FORM}
        if not self.record.observed:
            del document["record"]["observed"]
        for table, key in ((document["replay"], "at"), (parts["bodies"][0], "driven")):
            if table and table.get(key, "") is None:
                del table[key]
        forces = document.pop("forces")
        document["forcing"] = forces if len(forces) > 1 else next(iter(forces), None)
        if self.is_one_body:
            for table in (*forces, *parts["contacts"]):
                if table.get("at", "") is None:
                    del table["at"]  # so that campaigns of versions without it go on
                if table.get("signal") == "sine":
                    del table["signal"]
            for table, stop in zip(parts["contacts"], self.stops, strict=True):
                for key in () if stop.moves else MOTION_KEYS:
                    table.pop(key, None)
            return document | {"body": parts["bodies"][0], "stops": parts["contacts"], "general": None}
        document["record"]["time_series"] = None
        return document | {"body": None, "stops": [], "general": self._components_document()}

    def _components_document(self) -> dict[str, Any]:
        """Return the components in the form for campaigns: FMU files without their folders, so scenes can move."""
        series = self.record.time_series
        components = [asdict(component) for component in self.components]
        for component in components:
            component["fmu"] = component["fmu"].name
        swept = (axis.key for axis in self.sweep)
        document = {
            "components": components,
            "connections": [_without_defaults(asdict(connection)) for connection in self.connections],
            "events": [asdict(event) for event in self.events],
            "variables": self.sampled,
            "rate": None if series is None else series.rate,
            "macro_step": self.macro_step,
            "exchange": self.execution.exchange,
            "guard": self.execution.guard,
            "units": {key: self.declared_units[key] for key in (*self.sampled, *swept)},
            "doubts": self.doubts,
            "remarks": dict(self.remarks),
        }
        if self.start_time != 0.0:
            document["start_time"] = self.start_time
        if self.execution.adapts:
            document["coupling_tolerance"] = self.execution.coupling_tolerance or COUPLING_TOLERANCE
        if self.contacts:  # so that campaigns of versions without contacts go on
            document["contacts"] = [asdict(contact) for contact in self.meetings]
        return document

    # ---- questions about the parts ----

    @property
    def is_one_body(self) -> bool:
        """Whether the scene has one body, or one structure, of the package with its stops, not components."""
        return not isinstance(self.bodies[0], ComponentSpec)

    @property
    def is_lone_body(self) -> bool:
        """Whether the scene has one body and no recording: its start, force and time are its own."""
        return self.replay is None and self.is_one_body

    @property
    def body(self) -> Body:
        """The body of a scene of one body.

        Raises
        ------
        UsageError
            The scene has components.
        """
        if not self.is_one_body:
            raise UsageError(f"{self.source}: body: expected a scene with [body], got a general scene.")
        return cast(Body, self.bodies[0])

    @property
    def components(self) -> tuple[ComponentSpec, ...]:
        """The components; none in a scene of one body."""
        return () if self.is_one_body else cast(tuple[ComponentSpec, ...], self.bodies)

    @property
    def stops(self) -> tuple[Stop, ...]:
        """The stops of the body, then the contacts of its points; none in a scene of components."""
        return cast(tuple[Stop, ...], self.contacts) if self.is_one_body else ()

    @property
    def stop_keys(self) -> tuple[str, ...]:
        """The key of the table of each of `stops`: `stop[1]`, `contact[1]`."""
        stops = self.stops
        own = sum(not isinstance(stop, ContactTable) for stop in stops)
        numbers = range(1, len(stops) + 1)
        return tuple(f"stop[{n}]" if n <= own else f"contact[{n - own}]" for n in numbers)

    @property
    def meetings(self) -> tuple[StopContactSpec | PairSpec, ...]:
        """Contacts between components; none in a scene of one body."""
        return () if self.is_one_body else cast(tuple[StopContactSpec | PairSpec, ...], self.contacts)

    @property
    def stop_contacts(self) -> tuple[StopContactSpec, ...]:
        """Contacts of components with stops that are components, too."""
        return tuple(contact for contact in self.contacts if isinstance(contact, StopContactSpec))

    @property
    def pairs(self) -> tuple[PairSpec, ...]:
        """Contacts between two bodies that are components."""
        return tuple(contact for contact in self.contacts if isinstance(contact, PairSpec))

    @property
    def has_several_forces(self) -> bool:
        """Whether the forces are several, or one that is no sine: the component Structure then has the body."""
        return not is_one_sine(self.forces)

    @property
    def moving_stop(self) -> str:
        """The key of the first stop that moves; empty where none does."""
        moving = (key for key, stop in zip(self.stop_keys, self.stops, strict=True) if stop.moves)
        return next(moving, "")

    @property
    def lists_forces(self) -> bool:
        """Whether the component Structure has the body with a list of forces: several, or beside a moving stop."""
        return self.has_several_forces or any(stop.moves for stop in self.stops)

    @property
    def forcing(self) -> Forcing | None:
        """The only force, a sine; None without forces.

        Raises
        ------
        UsageError
            The scene has several forces, or one of another signal.
        """
        if self.has_several_forces:
            raise UsageError(
                f"{self.source}: forcing: expected one sine, got {forces_in_words(self.forces)}."
            )
        return cast(Forcing, self.forces[0]) if self.forces else None

    @property
    def forcing_keys(self) -> tuple[str, ...]:
        """The key of the table of each of `forces`: `forcing`, or `forcing[1]` and `forcing[2]`."""
        return forcing_keys(self.forces)

    @property
    def clock(self) -> Clock | None:
        """The clock of the forces, whose periods records count; None without a sine, and under a constant force."""
        return clock_of(self.forces, self.stops, sweeps_frequencies=sweeps_frequencies(self.sweep))

    @property
    def period(self) -> float | None:
        """Period of the clock, s: the forcing period 2 pi / angular_frequency under one sine; None without a clock."""
        if len(self.forces) == 1 and isinstance(
            self.forces[0], Forcing
        ):  # it is asked for at each point of a sweep
            frequency = self.forces[0].angular_frequency
            return None if frequency == 0.0 else 2.0 * math.pi / frequency
        clock = self.clock
        return None if clock is None else clock.period

    @property
    def macro_step(self) -> float:
        """Time between two exchanges of components, s: as given, the first swept value, or the whole run ("auto")."""
        swept = next((axis.values[0] for axis in self.sweep if is_step(self.components, axis.key)), None)
        whole = self.record.transient_time + self.record.recorded_time
        return self.execution.fixed_step or swept or whole

    @property
    def sampling_rate(self) -> float:
        """Nominal rate of the time series, 1/s: the rate of `[daq]` for channels; 0 without a time series."""
        series = self.record.time_series
        if series is None:
            return 0.0
        return self.daq.rate if self.daq is not None and self.channels else series.rate or 0.0

    @property
    def sampled(self) -> tuple[str, ...]:
        """The variables of the time series, in its order; none without a time series."""
        return () if self.record.time_series is None else self.record.time_series.variables

    @property
    def plain_samples(self) -> tuple[str, ...]:
        """The variables of the time series that are plain numbers, in its order."""
        return tuple(name for name in self.sampled if name not in self.sample_forms)

    @property
    def sample_size(self) -> int:
        """The number of values of a sample besides its time: arrays count with all elements."""
        shapes = (form.shape for form in self.sample_forms.values())
        return len(self.plain_samples) + sum(math.prod(shape) for shape in shapes)

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of the measuring chain that the time series samples, in its order."""
        return channels_in(self.sampled) if self.is_one_body else ()

    @property
    def falling_force(self) -> bool:
        """Whether the force of the exciter falls with the distance at any point; it is then held at all points."""
        if self.exciter is None:
            return False
        swept = [axis.values for axis in self.sweep if axis.key == "exciter.distance"]
        return self.exciter.distance > 0.0 or any(map(any, swept))

    @property
    def is_measured(self) -> bool:
        """Whether runs go by blocks of samples; other runs have no cost of a measuring chain."""
        return bool(self.channels) or self.falling_force

    @property
    def files(self) -> tuple[Path, ...]:
        """Further files that a run reads: recordings, tables of forces, and FMUs."""
        folder = Path(self.source).parent
        recordings = self.replay.recordings if self.replay is not None else ()
        tables = (force.file for force in self.forces if isinstance(force, TableForcing) and force.file)
        return (
            *(folder / name for name in (*recordings, *tables)),
            *(component.fmu for component in self.components),
        )

    @property
    def runs(self) -> int:
        """Number of runs of the sweep; 1 without a sweep."""
        return run_count(self.sweep)

    # ---- numbers by their keys ----

    def value(self, key: str) -> float:
        """Return the number of a key such as `stop[1].position` or `ball.e` in this scene.

        Raises
        ------
        UsageError
            The scene has no such number.
        """
        if not self.is_one_body:
            return self._component_numbers().value(key)
        parts = self._key(key)
        return self._number(key, parts, self._numbered_tables().get(parts.owner))

    def field(self, key: str) -> FieldInfo:
        """Return the model field of a numeric key of the short form, for the functions of `fields`.

        Raises
        ------
        UsageError
            The scene has no such key.
        """
        parts = self._key(key)
        owner = self._numbered_tables().get(parts.owner)
        if owner is None or parts.name not in known_keys(type(owner)):
            raise UsageError(f"{self.source}: {key}: expected a key of this scene, got an absent one.")
        return field_of(type(owner), parts.name)

    def _key(self, text: str) -> Key:
        key = numeric_key(text).among(len(self.forces))
        if key.owner != "body" or not self.is_one_body:
            return key
        # a structure of one body has its numbers under `body` or, as one of a list, under `body[1]`
        is_listed = isinstance(self.body, StructureBody) and [*self.body.tables()] == ["body[1]"]
        return key._replace(place=0) if is_listed else key

    def _number(self, key: str, parts: Key, owner: BaseModel | None) -> float:
        number = number_of(owner, parts)
        if number is None:
            raise UsageError(f"{self.source}: {key}: expected a number of this scene, got nothing.")
        return number

    def at(self, values: Mapping[str, float]) -> Self:
        """Return this scene at a point of its sweep: with other numbers, without validation, and the same text.

        Parameters
        ----------
        values : mapping of str to float
            New values of sweepable keys. Values of the scene's own sweep are known to be valid; for other values use
            `with_values`. A new angular_frequency replaces a given frequency, and a new damping a given damping_ratio,
            and vice versa.

        Examples
        --------
        >>> from vibroimpact.orchestrator.scene import Scene
        >>> text = "[body]\\nmass = 1\\nstiffness = 1\\n[record]\\nrecorded_time = 5"
        >>> Scene.from_text(text).at({"body.mass": 2.0}).body.mass
        2.0
        """
        if not self.is_one_body:
            return self._of_components_at(values)
        tables = self._numbered_tables()
        for key, value in values.items():
            if key == RECORDING_KEY:  # the number of the recording is in no table
                continue
            parts = self._key(key)
            owner = tables.get(parts.owner)
            if owner is None:
                raise UsageError(f"{self.source}: {key}: expected a key of this scene, got an absent table.")
            if parts.element is not None:
                self._number(key, parts, owner)
            tables[parts.owner] = owner.model_copy(update=replacement(owner, parts, value))
        others = {name: tables.pop(name) for name in (*_OWN_TABLES, "execution")}
        lists = {
            "bodies": (self._body_of(tables),),
            "contacts": tuple(tables[name] for name in self.stop_keys),
            "forces": tuple(tables[name] for name in self.forcing_keys),
        }
        return self.model_copy(update={**others, **lists})

    def _body_of(self, tables: Mapping[str, BaseModel | None]) -> Body:
        """Return the body whose numbers are in tables by their names in keys."""
        body = self.body
        if not isinstance(body, StructureBody):
            return cast(Body, tables["body"])
        own = body.tables()
        if all(tables[name] is table for name, table in own.items()):
            return body  # with the modes that it has found
        return body.with_tables({name: cast(SceneTable, tables[name]) for name in own})

    def _of_components_at(self, values: Mapping[str, float]) -> Self:
        new = self._component_numbers().at(values)
        parts: dict[str, Any] = {
            "bodies": new.components,
            "connections": new.connections,
            "contacts": new.contacts,
        }
        if new.macro_step != self.macro_step:
            parts["execution"] = self.execution.model_copy(update={"macro_step": new.macro_step})
        return self.model_copy(update=parts)

    def constants(self) -> dict[str, float]:
        """Return the sweepable numbers of the bodies that this sweep does not vary, by key, including defaults."""
        swept = {axis.key for axis in self.sweep}
        return {key: value for key, value in self.numbers() if key not in swept}

    def _component_numbers(self) -> ComponentNumbers:
        return ComponentNumbers(self.components, self.connections, self.meetings, self.macro_step)

    def numbers(self) -> Iterator[tuple[str, float]]:
        """Yield each sweepable number of the bodies and their tables, with its key."""
        if not self.is_one_body:
            return self._component_numbers().numbers()
        tables = [(name, owner) for name, owner in self._numbered_tables().items() if name != "execution"]
        found = chain.from_iterable(numbers_of(owner, name) for name, owner in tables if owner)
        standing = {
            f"{key}.{motion}"
            for key, stop in zip(self.stop_keys, self.stops, strict=True)
            if not stop.moves
            for motion in MOTION_KEYS
        }
        return ((key, number) for key, number in found if not (is_left_out(key) or key in standing))

    def _numbered_tables(self) -> dict[str, BaseModel | None]:
        """Return the tables with numbers, by their name in keys."""
        found: dict[str, BaseModel | None] = dict(zip(self.stop_keys, self.stops, strict=True))
        if self.is_one_body:
            found |= self.body.tables() if isinstance(self.body, StructureBody) else {"body": self.body}
        found |= dict(zip(self.forcing_keys, self.forces, strict=True))
        found |= {name: getattr(self, name) for name in _OWN_TABLES}
        return {**found, "execution": self.execution}
