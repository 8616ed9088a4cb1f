"""The `[sweep]` table of a scene file: which keys it varies, and over which values."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, TypeAdapter, ValidationError

from vibroimpact.orchestrator.scene_errors import (
    Problem,
    key_path,
    known_keys,
    nearest,
    problems_of,
    quoted,
    value_problem,
)
from vibroimpact.orchestrator.scene_keys import SWEEPABLE, field_name, parse_key
from vibroimpact.orchestrator.scene_models import BODY_MODELS, STOP_MODELS, AxisTable, Forcing
from vibroimpact.orchestrator.sweep import SweepAxis

_MODELS: dict[str, type[BaseModel]] = {
    "body": BODY_MODELS["oscillator"],
    "forcing": Forcing,
    "stop": STOP_MODELS["restitution"],
}
_FORMS = "{ start = 0.6, stop = 1.6, points = 401 } or { values = [0.6, 0.7] }"


def read_sweep(document: Mapping[str, Any]) -> tuple[tuple[SweepAxis, ...], list[Problem]]:
    """Read the sweep of a scene file.

    Parameters
    ----------
    document : mapping
        The parsed TOML document; its other tables need not be valid.

    Returns
    -------
    axes : tuple of SweepAxis
        The axes without a problem, in the order of the file.
    problems : list of Problem
        Everything that is wrong with the others.
    """
    entries, problems = sweep_entries(document)
    axes: list[SweepAxis] = []
    for key, entry in entries.items():
        found = list(_key_problems(key, entry, document))
        if not found:
            axis, found = read_axis(key, entry)
            found += _value_problems(axis) if axis else []
            axes += [axis] if axis and not found else []
        problems += found
    return tuple(axes), problems


def sweep_entries(document: Mapping[str, Any]) -> tuple[Mapping[str, Any], list[Problem]]:
    """Return the entries of the sweep of any form of scene, and what is wrong with the table itself."""
    table = document.get("sweep", {})
    if isinstance(table, dict):
        return table, []
    return {}, [Problem("sweep", "a table", quoted(table), f"Write [sweep] and below it KEY = {_FORMS}.")]


def _key_problems(text: str, entry: object, document: Mapping[str, Any]) -> Iterator[Problem]:
    known = _sweepable_keys(document)
    if text not in known:
        where, expected = key_path(("sweep", text)), "a numeric key of this scene"
        yield Problem(where, expected, quoted(text), _key_hint(text, entry, document, known))


def _sweepable_keys(document: Mapping[str, Any]) -> list[str]:
    """Return the keys that a sweep of this scene may vary; a table that is absent has none."""
    keys = [
        f"{table}.{name}" for table in ("body", "forcing") if table in document for name in SWEEPABLE[table]
    ]
    stops = range(1, _stop_count(document) + 1)
    return keys + [f"stop[{number}].{name}" for number in stops for name in SWEEPABLE["stop"]]


def _stop_count(document: Mapping[str, Any]) -> int:
    stops = document.get("stop", [])
    return len(stops) if isinstance(stops, list) else 0


def _key_hint(text: str, entry: object, document: Mapping[str, Any], known: list[str]) -> str:
    if isinstance(entry, dict) and text in SWEEPABLE and entry:
        return f'Put the whole key in quotes: "{text}.{next(iter(entry))}".'
    table = text.partition(".")[0].partition("[")[0]
    if table == "stop" and table in document:
        key, count = parse_key(text), _stop_count(document)
        if key is None or key.place is None or key.place >= count:
            return f'Indices start at 1 and this scene has {count} [[stop]]: for example "stop[1].position".'
    if table in SWEEPABLE and table not in document:
        return f"This scene has no {'[[stop]]' if table == 'stop' else f'[{table}]'}."
    if text.rpartition(".")[2] in _structural(table):
        return f"{text} is part of the structure of the scene and cannot be swept."
    return nearest(text, known)


def _structural(table: str) -> list[str]:
    keys = known_keys(_MODELS[table]) if table in _MODELS else []
    return [key for key in keys if key not in SWEEPABLE[table]]


def read_axis(key: str, entry: object) -> tuple[SweepAxis | None, list[Problem]]:
    """Return the axis of one entry of a sweep, or what is wrong with its values and path."""
    path = ("sweep", key)
    if not isinstance(entry, dict):
        return None, [Problem(key_path(path), "a table", quoted(entry), f"Write {_FORMS}.")]
    try:
        table = AxisTable.model_validate(entry)
    except ValidationError as error:
        return None, problems_of(error, AxisTable, path)
    problem = _form_problem(key, table)
    if problem:
        return None, [problem]
    values = table.values if table.values is not None else _range_values(table)
    problem = _distinct_problem(key, values)
    if problem:
        return None, [problem]
    ordered = values if table.path == "independent" else tuple(sorted(values))
    return SweepAxis(key, ordered, table.path), []


def _form_problem(key: str, table: AxisTable) -> Problem | None:
    """Return what is wrong with the combination of start, stop, points and values."""
    ends = {"start": table.start, "stop": table.stop, "points": table.points}
    given = [name for name, value in ends.items() if value is not None]
    where = key_path(("sweep", key))
    if table.values is not None:
        if given:
            return Problem(
                where, "start, stop and points, or values", "both", f"Remove values or {_and(given)}."
            )
        return None
    if len(given) < len(ends):
        missing = [name for name in ends if name not in given]
        return Problem(where, _FORMS, _and(given) or "neither", f"Add {_and(missing)}.")
    if table.points == 1 and table.start != table.stop:
        hint = "One point cannot be at both ends; make stop equal to start, or give values."
        return Problem(key_path(("sweep", key, "points")), "a whole number >= 2", "1", hint)
    return None


def _and(words: list[str]) -> str:
    return " and ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)


def _range_values(table: AxisTable) -> tuple[float, ...]:
    assert table.start is not None
    assert table.stop is not None
    assert table.points is not None
    # Halved ends keep the span of the range finite for any two finite numbers; scaling by 2 is exact.
    return tuple((2.0 * np.linspace(table.start / 2.0, table.stop / 2.0, table.points)).tolist())


def _distinct_problem(key: str, values: tuple[float, ...]) -> Problem | None:
    value, times = Counter(values).most_common(1)[0]
    if times == 1:
        return None
    hint = "Each point is run once: remove the repeated value or lower points."
    return Problem(
        key_path(("sweep", key)), "values that differ from each other", f"{quoted(value)} {times} times", hint
    )


def _value_problems(axis: SweepAxis) -> list[Problem]:
    """Return the swept value that breaks the rule of its field.

    All rules of sweepable fields are intervals, so the lowest and the highest value speak for the rest.
    """
    key = parse_key(axis.key)
    assert key is not None
    model = _MODELS[key.table]
    field = model.model_fields[field_name(model, key.name)]
    annotated: Any = Annotated
    rule = TypeAdapter(annotated[(field.annotation, *field.metadata)])
    for value in (min(axis.values), max(axis.values)):
        try:
            rule.validate_python(value, strict=True)
        except ValidationError:
            return [value_problem(("sweep", axis.key), field, value)]
    return []
