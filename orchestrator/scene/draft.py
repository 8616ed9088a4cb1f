"""A scene during the checks: its document, its valid tables, and the problems of the others."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from vibroimpact.orchestrator.scene.body_models import (
    BODY_MODELS,
    PART_MODELS,
    Body,
    BodyAlone,
    LinkTable,
    StructureBody,
)
from vibroimpact.orchestrator.scene.body_models.structure import observed_variables
from vibroimpact.orchestrator.scene.execution_model import Execution
from vibroimpact.orchestrator.scene.fields import known_keys, listed
from vibroimpact.orchestrator.scene.forcing_clock import (
    Clock,
    clock_of,
    sines_of,
    sines_of_stops,
    sweeps_frequencies,
)
from vibroimpact.orchestrator.scene.forcing_models import (
    FORCING_MODELS,
    Force,
    Forcing,
    TableForcing,
    forcing_keys,
    is_one_sine,
)
from vibroimpact.orchestrator.scene.keys import MODES, Key, number_of, numeric_key
from vibroimpact.orchestrator.scene.measuring_models import Daq, Exciter, LoadCell, Noise, Sensor
from vibroimpact.orchestrator.scene.models import (
    CONTACT_MODELS,
    STOP_MODELS,
    Contact,
    OwnStop,
    Record,
    SceneHeader,
)
from vibroimpact.orchestrator.scene.problems import (
    KeyPath,
    Problem,
    Table,
    choice_problem,
    key_path,
    quoted,
    read_table,
)
from vibroimpact.orchestrator.scene.replay_models import Replay
from vibroimpact.orchestrator.scene.sampled_names import channels_in
from vibroimpact.orchestrator.scene.several_bodies import (
    axes_of_part,
    is_structure,
    named_bodies,
    of_part,
    part_documents,
)
from vibroimpact.orchestrator.scene.sweep import SweepAxis

FREQUENCY_KEYS = frozenset({"angular_frequency", "frequency"})


class DraftTables:
    """The tables of a document, read one by one: an invalid table is None, and its problems are kept."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document = document
        self.problems: list[Problem] = []
        self.header = self.table(SceneHeader, "scene", {})

    def written(self, table: str) -> Mapping[str, Any]:
        """Return a table as written, or an empty table."""
        raw = self.document.get(table)
        return raw if isinstance(raw, dict) else {}

    def table(self, model: type[Table], name: str, absent: object = None) -> Table | None:
        """Return a table as its model; `absent` stands for a missing table."""
        raw = self.document.get(name, absent)
        return None if raw is None else self.read(model, raw, (name,))

    def read(self, model: type[Table], raw: object, path: KeyPath) -> Table | None:
        """Return the table at a path of the document as a model; None if it is invalid."""
        return read_table(model, raw, path, self.problems)

    def entries(self, name: str) -> list[tuple[object, KeyPath]]:
        """Return the tables of an array `[[name]]`, each with its path."""
        raw = self.document.get(name, [])
        if not isinstance(raw, list):
            hint = f"Write [[{name}]], with two brackets, for each {name}."
            self.problems.append(Problem(name, f"[[{name}]] tables", quoted(raw), hint))
            return []
        return [(table, (name, place)) for place, table in enumerate(raw)]

    def variant(
        self,
        models: Mapping[str, type[Table]],
        tag: str,
        default: str,
        raw: object,
        path: KeyPath,
        further: tuple[str, ...] = (),
    ) -> Table | None:
        """Read a table whose kind decides its keys; an unknown kind is a single problem, which names further kinds."""
        kind = raw.get(tag, default) if isinstance(raw, dict) else default
        if isinstance(kind, str) and kind in models:
            there = len(self.problems)
            table = self.read(models[kind], raw, path)
            if table is None:
                belongs = _keys_of_other_kinds(raw, models, tag, kind, path)
                self.problems[there:] = [
                    replace(problem, hint=belongs.get(problem.key, problem.hint))
                    for problem in self.problems[there:]
                ]
            return table
        model = models[default]
        self.problems.append(choice_problem((*path, tag), model.model_fields[tag], kind, (*models, *further)))
        return None


class Reading(NamedTuple):
    """The result of reading a document: its draft, the problems between its tables, and its parts if there are none."""

    draft: DraftTables
    problems: list[Problem]
    parts: Callable[[], dict[str, Any]]


class Draft(DraftTables):
    """A scene of the short form during the checks; swept keys need not be written.

    Among several bodies each is a draft of its own in `parts`; `names`, `links` and `meetings` are of their tables.
    """

    def __init__(
        self,
        document: Mapping[str, Any],
        axes: tuple[SweepAxis, ...],
        folder: Path = Path(),
        *,
        is_part: bool = False,
    ) -> None:
        super().__init__(with_swept_keys(document, axes))
        self.axes, self._folder, self._is_part = axes, folder, is_part
        self.names: tuple[str | None, ...] = ()
        self.parts: tuple[Draft, ...] = ()
        self.links: tuple[LinkTable | None, ...] = ()
        self.meetings: tuple[Contact | None, ...] = ()
        self.record = _sampling_observed(self.table(Record, "record", {}))
        self.body: Body | None = self._structure() if self.is_structure else self._body()
        self.forces = self._forces()
        self.stops: tuple[OwnStop | None, ...] = tuple(
            self.variant(STOP_MODELS, "law", "restitution", *entry) for entry in self.entries("stop")
        )
        self.execution = self.table(Execution, "execution", {})
        self.sensor = self.table(Sensor, "sensor")
        self.load_cell = self.table(LoadCell, "load_cell")
        self.exciter = self.table(Exciter, "exciter")
        self.noise = self.table(Noise, "noise")
        self.daq = self.table(Daq, "daq")
        self.replay = self.table(Replay, "replay")

    def _body(self) -> Body | None:
        if "body" not in self.document:
            hint = "Add [body] with mass, stiffness and damping."
            self.problems.append(Problem("body", "one [body] table", "nothing", hint))
            return None
        models = PART_MODELS if self._is_part else BODY_MODELS
        return self.variant(models, "kind", "oscillator", self.document["body"], ("body",), ("matrices",))

    def _forces(self) -> tuple[Force | None, ...]:
        raw = self.document.get("forcing")
        if raw is None:
            return ()
        entries = self.entries("forcing") if isinstance(raw, list) else [(raw, ("forcing",))]
        read = [(self.variant(FORCING_MODELS, "signal", "sine", *entry), entry[1]) for entry in entries]
        return tuple(self._with_rows(force, path) for force, path in read)

    def _with_rows(self, force: Force | None, path: KeyPath) -> Force | None:
        """Return a force with the rows of its file, if it names one; None with the problem of a wrong file."""
        if not isinstance(force, TableForcing) or force.file is None:
            return force
        from vibroimpact.orchestrator.scene.forcing_files import rows_of_file  # few scenes need it

        found = rows_of_file(self._folder / force.file, key_path((*path, "file")))
        if isinstance(found, Problem):
            self.problems.append(found)
            return None
        return force.model_copy(update=dict(zip(("times", "values"), found, strict=True)))

    @property
    def forcing(self) -> Forcing | None:
        """The only force, a sine; None where it is invalid, and for other forces."""
        alone = self.forces[0] if len(self.forces) == 1 else None
        return alone if isinstance(alone, Forcing) else None

    def written_forces(self) -> Iterator[tuple[str, Force | None, Mapping[str, Any]]]:
        """Yield the key of each force, its table, and the table as written."""
        raw = self.document.get("forcing")
        tables = raw if isinstance(raw, list) else [raw]
        for key, force, table in zip(forcing_keys(self.forces), self.forces, tables, strict=False):
            yield key, force, table if isinstance(table, dict) else {}

    @property
    def has_several_forces(self) -> bool:
        """Whether the forces are several, or one that is no sine: the body then runs as a structure."""
        return not is_one_sine(self.forces)

    @property
    def has_moving_stops(self) -> bool:
        """Whether a stop moves: the body then runs as a structure."""
        return any(stop is not None and stop.moves for stop in self.stops)

    @property
    def simulated_body(self) -> Body | None:
        """The body in the form that runs: a structure under several forces; None where it is invalid."""
        body = self.body
        alone = not self.has_several_forces and not self.has_moving_stops
        if body is None or isinstance(body, StructureBody) or alone:
            return body
        return BodyAlone.model_construct(names=("body",), parts=(body,), links=(), observed=())

    @property
    def clock(self) -> Clock | None:
        """The clock of valid forces; None without one, and where a frequency is missing, 0 or infinite."""
        sines = [*sines_of(self.forces), *sines_of_stops(self.stops)]
        if any(not 0.0 < sine.angular_frequency < math.inf for sine in sines):
            return None
        return clock_of(self.forces, self.stops, sweeps_frequencies=sweeps_frequencies(self.axes))

    @property
    def is_structure(self) -> bool:
        """Whether the scene has several bodies, or joins points of one."""
        return is_structure(self.document)

    def _structure(self) -> StructureBody | None:
        documents = part_documents(self.document, self.problems)
        self.parts = tuple(
            Draft(part, axes_of_part(number, self.axes), is_part=True)
            for number, part in enumerate(documents, start=1)
        )
        for number, draft in enumerate(self.parts, start=1):
            self.problems += [of_part(number, problem) for problem in draft.problems]
        self.names = named_bodies(self.document, self.problems)
        self.links = tuple(self.read(LinkTable, *entry) for entry in self.entries("link"))
        self.meetings = tuple(
            self.variant(CONTACT_MODELS, "law", "restitution", *entry) for entry in self.entries("contact")
        )
        bodies = [draft.body for draft in self.parts]
        names = [name for name in self.names if name is not None]
        links = [link for link in self.links if link is not None]
        whole = len(names) == len(bodies) and len(links) == len(self.links)
        parts = tuple(body for body in bodies if body is not None and not isinstance(body, StructureBody))
        if not whole or not parts or len(parts) < len(self.names):
            return None
        observed = () if self.record is None else self.record.observed
        driven = self.written("replay").get("at")
        return StructureBody.model_construct(
            names=tuple(names), parts=parts, links=tuple(links), observed=observed, driven=driven
        )

    @property
    def sweeps_modes(self) -> bool:
        """Whether the number of modes differs between points, or is not yet known."""
        return any(axis.key == MODES for axis in self.axes) or self.finds_modes

    @property
    def finds_modes(self) -> bool:
        """Whether the number of modes must still be found (`modes = "auto"`)."""
        return self.body is not None and self.body.finds_modes

    def worst(self, *tables: str) -> str:
        """Return a note for a message, if a number may be the worst value of a sweep over keys of these tables."""
        swept = any(axis.key.startswith(tables) for axis in self.axes)
        return " (the worst of the swept values)" if swept else ""

    @property
    def swept_counts(self) -> str:
        """A note for a message on keys that exclude each other."""
        return "; a swept key counts as given" if self.axes else ""

    def span(self, text: str) -> tuple[float, float] | None:
        """Return the lowest and highest value of a key over all points; None if its table is invalid."""
        for axis in self.axes:
            if axis.key == text:
                return axis.lowest, axis.highest
        key = numeric_key(text)
        number = number_of(self._owner(key), key)
        return None if number is None else (number, number)

    def _owner(self, key: Key) -> object:
        """Return the table of a key; None if it is invalid."""
        if key.table == "forcing":
            return self.forces[key.place or 0]
        if key.place is None:
            return getattr(self, key.table)
        arrays: dict[str, Sequence[object]] = {
            "stop": self.stops,
            "contact": self.meetings,
            "link": self.links,
            "body": [draft.body for draft in self.parts],
        }
        return arrays[key.table][key.place]

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels of the measuring chain in the time series."""
        series = self.record.time_series if self.record else None
        return () if series is None else channels_in(series.variables)

    @property
    def samples_channels(self) -> bool:
        """Whether the clock of `[daq]` samples the time series."""
        return "daq" in self.document and bool(self.channels)

    def sampling_span(self) -> tuple[float, float] | None:
        """Return the lowest and highest rate of the time series, 1/s; None without a valid rate."""
        series = self.record.time_series if self.record else None
        if self.samples_channels:
            return self.span("daq.rate")
        return None if series is None or series.rate is None else (series.rate, series.rate)

    def angular_frequency_span(self) -> tuple[float, float] | None:
        """Return the lowest and highest angular frequency of the clock, rad/s: 0 without one, None if it is invalid."""
        if None in self.forces:
            return None
        spans = [
            self.frequency_span(key) for key, force, _ in self.written_forces() if isinstance(force, Forcing)
        ]
        moved = (
            self.span(f"stop[{number}].motion_angular_frequency")
            for number, stop in enumerate(self.stops, start=1)
            if stop is not None and stop.motion_angular_frequency > 0.0
        )
        spans += [span for span in moved if span is not None]
        if not spans:
            return 0.0, 0.0
        clock = self.clock if len(spans) > 1 else None
        periods = 1 if clock is None else clock.periods  # those of one sine are its own
        return spans[0] and (spans[0][0] / periods, spans[0][1] / periods)

    def frequency_span(self, key: str) -> tuple[float, float] | None:
        """Return the lowest and highest angular frequency of the sine of a key, rad/s; None if it is not given."""
        force, written = next((force, written) for own, force, written in self.written_forces() if own == key)
        if not isinstance(force, Forcing) or not FREQUENCY_KEYS & written.keys():
            return None
        if force.frequency is None:
            return self.span(f"{key}.angular_frequency")
        span = self.span(f"{key}.frequency")
        return span and (2.0 * math.pi * span[0], 2.0 * math.pi * span[1])


def _sampling_observed(record: Record | None) -> Record | None:
    """Return a record whose time series, if it names no variables, samples each observed point."""
    series = None if record is None else record.time_series
    if record is None or series is None or not record.observed or "variables" in series.model_fields_set:
        return record
    variables = observed_variables(record.observed)
    return record.model_copy(update={"time_series": series.model_copy(update={"variables": variables})})


def with_swept_keys(document: Mapping[str, Any], axes: tuple[SweepAxis, ...]) -> dict[str, Any]:
    """Return the document with the first swept value for each swept key that is not written.

    `modes` gets the least swept number, written or not, as keys with modes must suit all swept numbers.
    """
    filled = dict(document)
    for axis in axes:
        key = numeric_key(axis.key)
        filled[key.table] = deepcopy(filled.get(key.table, {}))
        owner = key.owner_in(filled)
        if isinstance(owner, dict) and axis.key == MODES:
            owner[key.name] = key.typed(min(axis.values))
        elif isinstance(owner, dict):
            owner.setdefault(key.name, key.typed(axis.values[0]))
    return filled


def _keys_of_other_kinds(
    raw: object, models: Mapping[str, type[Table]], tag: str, kind: str, path: KeyPath
) -> dict[str, str]:
    """Return advice, by path, for each key that belongs to a table of another kind only."""
    advice = {}
    for name in raw if isinstance(raw, dict) else ():
        owners = [quoted(other) for other, model in models.items() if name in known_keys(model)]
        if owners and name not in known_keys(models[kind]):
            advice[key_path((*path, name))] = f"It belongs to {tag} = {listed(owners, 'or')}."
    return advice
