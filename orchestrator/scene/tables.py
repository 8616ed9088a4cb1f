"""From a TOML document to validated tables, with a list of everything that is wrong in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vibroimpact.orchestrator.scene.draft import Draft
from vibroimpact.orchestrator.scene.fields import known_keys
from vibroimpact.orchestrator.scene.general.scene import GeneralScene
from vibroimpact.orchestrator.scene.keys import parse_key
from vibroimpact.orchestrator.scene.models import (
    BODY_MODELS,
    STOP_MODELS,
    Body,
    Execution,
    Forcing,
    Record,
    SceneHeader,
    Sensor,
    Stop,
)
from vibroimpact.orchestrator.scene.problems import (
    Problem,
    choice_problem,
    key_path,
    quoted,
    unknown_key,
)
from vibroimpact.orchestrator.scene.replay_models import Replay
from vibroimpact.orchestrator.scene.rules.replay import recording_axis
from vibroimpact.orchestrator.scene.rules.scene import rule_problems
from vibroimpact.orchestrator.scene.sweep import SweepAxis
from vibroimpact.orchestrator.scene.sweep_table import read_sweep
from vibroimpact.orchestrator.scene.table_reader import Table, read_table

_SHORT_TABLES = ("body", "forcing", "stop", "sensor", "replay")
_GENERAL_TABLES = ("component", "connection", "event")
_COMMON_TABLES = ("record", "sweep", "execution")
_OPTIONAL_TABLES = ("load_cell", "exciter", "noise", "daq")


@dataclass(frozen=True, slots=True)
class Tables:
    """All tables of a scene, valid by themselves and together; it has a body or is a general scene."""

    header: SceneHeader
    body: Body | None
    forcing: Forcing | None
    stops: tuple[Stop, ...]
    record: Record
    sweep: tuple[SweepAxis, ...]
    execution: Execution
    general: GeneralScene | None = None
    sensor: Sensor | None = None
    replay: Replay | None = None


def read_tables(document: Mapping[str, Any], folder: Path) -> tuple[Tables | None, list[Problem]]:
    """Validate the tables of a document.

    Parameters
    ----------
    document : mapping
        A parsed TOML document, whatever is in it.
    folder : Path
        The folder of the scene file, from which the paths in it count.

    Returns
    -------
    tables : Tables or None
        None when there is a problem.
    problems : list of Problem
        All of them, in the order of the tables.
    """
    general = [name for name in _GENERAL_TABLES if name in document]
    short = [name for name in _SHORT_TABLES if name in document]
    if general and short:
        return None, [_mixed_problem(general, short)]
    return _read_general(document, folder) if general else _read_short(document)


def _mixed_problem(general: list[str], short: list[str]) -> Problem:
    expected = "[component.NAME], [[connection]] and [[event]], or [body], [forcing] and [[stop]]"
    got = " beside ".join(", ".join(f"[{name}]" for name in names) for names in (general, short))
    hint = 'Remove those of one form; the body of the short form is fmu = "Oscillator" in the general one.'
    return Problem(general[0], expected, got, hint)


def _read_general(document: Mapping[str, Any], folder: Path) -> tuple[Tables | None, list[Problem]]:
    # What reads model descriptions takes time to load, and the short form does not need it.
    from vibroimpact.orchestrator.scene.general.tables import read_general

    unknown = list(_table_problems(document, ("scene", *_GENERAL_TABLES, *_COMMON_TABLES)))
    tables, problems = read_general(document, folder)
    if tables is None or unknown:
        return None, unknown + problems
    general, record = tables.general, tables.record
    return Tables(tables.header, None, None, (), record, tables.sweep, tables.execution, general), []


def _read_short(document: Mapping[str, Any]) -> tuple[Tables | None, list[Problem]]:
    axes, sweep_problems = read_sweep(document)
    reader = _Reader(_with_swept_keys(document, axes))
    reader.problems += _table_problems(document, ("scene", *_SHORT_TABLES, *_COMMON_TABLES))
    header, body, forcing = reader.header(), reader.body(), reader.forcing()
    stops, record, execution = reader.stops(), reader.record(), reader.execution()
    sensor, replay = reader.sensor(), reader.replay()
    draft = Draft(reader.document, header, body, forcing, stops, record, axes, sensor, replay)
    problems = reader.problems + sweep_problems + rule_problems(draft)
    if problems or header is None or body is None or record is None or execution is None:
        return None, problems
    whole = tuple(stop for stop in stops if stop is not None)
    axes += recording_axis(replay)
    return Tables(
        header, body, forcing, whole, _applicable(record), axes, execution, None, sensor, replay
    ), []


def _table_problems(document: Mapping[str, Any], known: tuple[str, ...]) -> Iterator[Problem]:
    for name, value in document.items():
        if name in _OPTIONAL_TABLES:
            hint = f"[{name}] is not available in this version: remove it."
            yield Problem(name, f"a scene without [{name}]", "one", hint)
        elif name not in known:
            problem = unknown_key((name,), known)
            what = "table" if isinstance(value, dict | list) else "key outside any table"
            yield Problem(problem.key, "a known table", f"the unknown {what} {quoted(name)}", problem.hint)


def _with_swept_keys(document: Mapping[str, Any], axes: tuple[SweepAxis, ...]) -> dict[str, Any]:
    """Return the document with the first swept value wherever the swept key itself is not written."""
    filled = dict(document)
    for axis in axes:
        key = parse_key(axis.key)
        assert key is not None
        table = filled[key.table]
        owner = table if key.place is None else table[key.place]
        if isinstance(owner, dict):
            owner = {key.name: axis.values[0], **owner}
            filled[key.table] = (
                owner if key.place is None else [*table[: key.place], owner, *table[key.place + 1 :]]
            )
    return filled


def _applicable(record: Record) -> Record:
    """Return the record without the per-period variables where there are no periods."""
    if record.recorded_periods:
        return record
    return record.model_copy(update={"extrema": False, "strobe": False})


def _keys_of_other_kinds(
    raw: object, models: Mapping[str, type[Table]], tag: str, kind: str, path: tuple[str | int, ...]
) -> dict[str, str]:
    """Return advice for each key, by its path, that a table of another kind has and one of this kind has not."""
    advice = {}
    for name in raw if isinstance(raw, dict) else ():
        owners = [quoted(other) for other, model in models.items() if name in known_keys(model)]
        if owners and name not in known_keys(models[kind]):
            listed = " or ".join([", ".join(owners[:-1]), owners[-1]] if len(owners) > 1 else owners)
            advice[key_path((*path, name))] = f"It belongs to {tag} = {listed}."
    return advice


class _Reader:
    """Reads tables of one document and collects the problems of all of them."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document = document
        self.problems: list[Problem] = []

    def header(self) -> SceneHeader | None:
        return self._table(SceneHeader, self.document.get("scene", {}), ("scene",))

    def body(self) -> Body | None:
        if "body" not in self.document:
            hint = "Add [body] with mass, stiffness and damping."
            self.problems.append(Problem("body", "one [body] table", "nothing", hint))
            return None
        return self._variant(BODY_MODELS, "kind", "oscillator", self.document["body"], ("body",))

    def forcing(self) -> Forcing | None:
        if "forcing" not in self.document:
            return None
        return self._table(Forcing, self.document["forcing"], ("forcing",))

    def sensor(self) -> Sensor | None:
        if "sensor" not in self.document:
            return None
        return self._table(Sensor, self.document["sensor"], ("sensor",))

    def replay(self) -> Replay | None:
        if "replay" not in self.document:
            return None
        return self._table(Replay, self.document["replay"], ("replay",))

    def stops(self) -> tuple[Stop | None, ...]:
        stops = self.document.get("stop", [])
        if not isinstance(stops, list):
            hint = "Write [[stop]], with two brackets, for each stop."
            self.problems.append(Problem("stop", "[[stop]] tables", quoted(stops), hint))
            return ()
        return tuple(
            self._variant(STOP_MODELS, "law", "restitution", stop, ("stop", index))
            for index, stop in enumerate(stops)
        )

    def record(self) -> Record | None:
        return self._table(Record, self.document.get("record", {}), ("record",))

    def execution(self) -> Execution | None:
        return self._table(Execution, self.document.get("execution", {}), ("execution",))

    def _variant(
        self,
        models: Mapping[str, type[Table]],
        tag: str,
        default: str,
        raw: object,
        path: tuple[str | int, ...],
    ) -> Table | None:
        """Read a table whose kind decides its keys; of an unknown kind nothing else is judged."""
        kind = raw.get(tag, default) if isinstance(raw, dict) else default
        if isinstance(kind, str) and kind in models:
            there = len(self.problems)
            table = self._table(models[kind], raw, path)
            belongs = _keys_of_other_kinds(raw, models, tag, kind, path)
            self.problems[there:] = [
                replace(problem, hint=belongs[problem.key]) if problem.key in belongs else problem
                for problem in self.problems[there:]
            ]
            return table
        model = models[default]
        self.problems.append(choice_problem((*path, tag), model.model_fields[tag], kind, models))
        return None

    def _table(self, model: type[Table], raw: object, path: tuple[str | int, ...]) -> Table | None:
        return read_table(model, raw, path, self.problems)
