"""From a TOML document to validated tables, with a list of everything that is wrong in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from vibroimpact.orchestrator.scene_errors import Problem, problems_of, quoted, unknown_key, value_problem
from vibroimpact.orchestrator.scene_keys import parse_key
from vibroimpact.orchestrator.scene_models import (
    BODY_MODELS,
    STOP_MODELS,
    Execution,
    Forcing,
    OscillatorBody,
    Record,
    RestitutionStop,
    SceneHeader,
)
from vibroimpact.orchestrator.scene_rules import Draft, rule_problems
from vibroimpact.orchestrator.sweep import SweepAxis
from vibroimpact.orchestrator.sweep_table import read_sweep

_TABLES = ("scene", "body", "forcing", "stop", "record", "sweep", "execution")
_GENERAL_TABLES = ("component", "connection", "event")
_OPTIONAL_TABLES = ("sensor", "load_cell", "exciter", "noise", "daq", "replay")

Table = TypeVar("Table", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class Tables:
    """All tables of a scene, valid by themselves and together."""

    header: SceneHeader
    body: OscillatorBody
    forcing: Forcing | None
    stops: tuple[RestitutionStop, ...]
    record: Record
    sweep: tuple[SweepAxis, ...]
    execution: Execution


def read_tables(document: Mapping[str, Any]) -> tuple[Tables | None, list[Problem]]:
    """Validate the tables of a document.

    Parameters
    ----------
    document : mapping
        A parsed TOML document, whatever is in it.

    Returns
    -------
    tables : Tables or None
        None when there is a problem.
    problems : list of Problem
        All of them, in the order of the tables.
    """
    general = [name for name in _GENERAL_TABLES if name in document]
    if general:
        return None, [_general_problem(general)]
    axes, sweep_problems = read_sweep(document)
    reader = _Reader(_with_swept_keys(document, axes))
    reader.problems += _table_problems(document)
    header, body, forcing = reader.header(), reader.body(), reader.forcing()
    stops, record, execution = reader.stops(), reader.record(), reader.execution()
    draft = Draft(reader.document, header, body, forcing, stops, record, axes)
    problems = reader.problems + sweep_problems + rule_problems(draft)
    if problems or header is None or body is None or record is None or execution is None:
        return None, problems
    whole = tuple(stop for stop in stops if stop is not None)
    return Tables(header, body, forcing, whole, _applicable(record), axes, execution), []


def _general_problem(tables: list[str]) -> Problem:
    got = " and ".join(f"[{name}]" for name in tables)
    hint = "General scenes ([component.NAME], [[connection]], [[event]]) are not available in this version."
    return Problem(tables[0], "a scene of [body], [forcing] and [[stop]] tables", got, hint)


def _table_problems(document: Mapping[str, Any]) -> Iterator[Problem]:
    for name, value in document.items():
        if name in _OPTIONAL_TABLES:
            hint = f"[{name}] is not available in this version: remove it."
            yield Problem(name, f"a scene without [{name}]", "one", hint)
        elif name not in _TABLES:
            problem = unknown_key((name,), _TABLES)
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


class _Reader:
    """Reads tables of one document and collects the problems of all of them."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document = document
        self.problems: list[Problem] = []

    def header(self) -> SceneHeader | None:
        return self._table(SceneHeader, self.document.get("scene", {}), ("scene",))

    def body(self) -> OscillatorBody | None:
        if "body" not in self.document:
            hint = "Add [body] with mass, stiffness and damping."
            self.problems.append(Problem("body", "one [body] table", "nothing", hint))
            return None
        return self._variant(BODY_MODELS, "kind", "oscillator", self.document["body"], ("body",))

    def forcing(self) -> Forcing | None:
        if "forcing" not in self.document:
            return None
        return self._variant(
            {"force": Forcing, "base_acceleration": Forcing},
            "kind",
            "force",
            self.document["forcing"],
            ("forcing",),
        )

    def stops(self) -> tuple[RestitutionStop | None, ...]:
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
            return self._table(models[kind], raw, path)
        model = models[default]
        self.problems.append(value_problem((*path, tag), model.model_fields[tag], kind))
        return None

    def _table(self, model: type[Table], raw: object, path: tuple[str | int, ...]) -> Table | None:
        if not isinstance(raw, dict):
            name = str(path[0])
            brackets = (
                f"[[{name}]], with two brackets"
                if name == "stop"
                else f"[{name}], with single brackets, once"
            )
            self.problems.append(Problem(name, "a table", quoted(raw), f"Write {brackets}."))
            return None
        try:
            return model.model_validate(raw)
        except ValidationError as error:
            self.problems += problems_of(error, model, path)
            return None
