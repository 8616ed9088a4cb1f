"""The `[sweep]` table of a scene file: its keys and their values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Annotated, Any

from pydantic import BaseModel, TypeAdapter, ValidationError

from vibroimpact.orchestrator.scene.body_models import BODY_MODELS, PART_MODELS
from vibroimpact.orchestrator.scene.fields import (
    bounds_of,
    field_of,
    is_array_only,
    is_whole,
    known_keys,
    rule_of,
)
from vibroimpact.orchestrator.scene.forcing_models import FORCING_MODELS
from vibroimpact.orchestrator.scene.keys import (
    ARRAY_TABLES,
    SINGLE_TABLES,
    SWEEPABLE,
    model_of,
    numeric_key,
    parse_key,
    table_named,
)
from vibroimpact.orchestrator.scene.models import CONTACT_MODELS, STOP_MODELS
from vibroimpact.orchestrator.scene.not_modelled import effect_not_modelled
from vibroimpact.orchestrator.scene.problems import (
    Problem,
    key_path,
    nearest,
    quoted,
    value_problem,
)
from vibroimpact.orchestrator.scene.several_bodies import is_left_out
from vibroimpact.orchestrator.scene.sweep import SweepAxis
from vibroimpact.orchestrator.scene.sweep_axes import FORMS, SAMPLE, axes_of, read_axis_table
from vibroimpact.orchestrator.scene.sweep_models import AxisTable

REALISATIONS, MOST_REALISATIONS = "realisations", 10**6
"""Key of `[sweep]` for the number of signals of each random force, and the most of them."""


def read_sweep(
    document: Mapping[str, Any],
    key_problems: Callable[[str, object], Iterable[Problem]],
    axis_problems: Callable[[SweepAxis], Iterable[Problem]],
) -> tuple[tuple[SweepAxis, ...], list[Problem]]:
    """Return the valid axes of a scene of any form, in the order of the file, and the problems of all other axes."""
    table = document.get("sweep", {})
    if not isinstance(table, dict):
        hint = f"Write [sweep] and below it KEY = {FORMS}."
        return (), [Problem("sweep", "a table", quoted(table), hint)]
    problems: list[Problem] = []
    tables: dict[str, AxisTable] = {}
    for key, entry in table.items():
        if key != SAMPLE:
            found = list(key_problems(key, entry))
            if not found and (read := read_axis_table(key, entry, found)):
                tables[key] = read
            problems += found
    # a design whose keys are all invalid does not get the problem "none" in addition
    expects_keys = not any(isinstance(entry, dict) and "distribution" in entry for entry in table.values())
    axes, found = axes_of(tables, table.get(SAMPLE), expects_keys=expects_keys)
    sound = []
    for axis in axes:
        wrong = list(axis_problems(axis))
        sound += [] if wrong else [axis]
        found += wrong
    return tuple(sound), [*problems, *found]


def with_realisations(document: Mapping[str, Any]) -> tuple[Mapping[str, Any], list[Problem]]:
    """Return the document with realisations as an axis over the seeds of its random forces, and the problems."""
    sweep, forces = document.get("sweep"), document.get("forcing")
    if not isinstance(sweep, dict) or REALISATIONS not in sweep:
        return document, []
    count, others = sweep[REALISATIONS], {key: sweep[key] for key in sweep if key != REALISATIONS}
    tables = (
        {"forcing": forces}
        if not isinstance(forces, list)
        else {f"forcing[{number}]": force for number, force in enumerate(forces, start=1)}
    )
    seeds = {
        f"{key}.seed": force.get("seed", 0)
        for key, force in tables.items()
        if isinstance(force, dict) and force.get("signal") == "random"
    }
    where = key_path(("sweep", REALISATIONS))
    problems = []
    if type(count) is not int or not 2 <= count <= MOST_REALISATIONS:
        problems.append(Problem(where, f"a whole number from 2 to {MOST_REALISATIONS}", quoted(count)))
    if not seeds:
        hint = 'Add a [[forcing]] with signal = "random".'
        problems.append(Problem(where, "a random force beside realisations", "none", hint))
    problems += [
        Problem(where, f"no axis over {key} beside it", "one") for key in seeds.keys() & sweep.keys()
    ]
    if problems or not all(type(seed) is int for seed in seeds.values()):
        return {**document, "sweep": others}, problems
    together = {"zip": "realisation"} if len(seeds) > 1 else {}
    axes = {
        key: {"start": seed, "stop": seed + count - 1, "points": count, **together}
        for key, seed in seeds.items()
    }
    return {**document, "sweep": {**others, **axes}}, []


def read_short_sweep(document: Mapping[str, Any]) -> tuple[tuple[SweepAxis, ...], list[Problem]]:
    """Return the valid axes of a scene of the short form, and the problems of all other axes."""
    known = dict.fromkeys(_sweepable_keys(document))
    return read_sweep(
        document,
        lambda key, entry: _key_problems(key, entry, document, known),
        lambda axis: _value_problems(axis, document),
    )


def _key_problems(
    text: str, entry: object, document: Mapping[str, Any], known: Mapping[str, None]
) -> Iterator[Problem]:
    if text not in known:
        where, expected = key_path(("sweep", text)), "a numeric key of this scene"
        hint = partial(_key_hint, text, entry, document, list(known))
        yield Problem(where, expected, quoted(text), hint)


def _sweepable_keys(document: Mapping[str, Any]) -> list[str]:
    """Return the keys that a sweep of this scene may vary; absent tables, except `execution`, have none."""
    return [key for name, table in _tables(document) for key in _keys_in(name, table)]


def _tables(document: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the tables with numbers, by name; an array such as `stop` as `stop[1]`, `stop[2]`, ..."""
    for name in SINGLE_TABLES:
        if name in document and not isinstance(document[name], list):
            yield name, document[name]
    yield "execution", document.get("execution", {})
    for name in ARRAY_TABLES:
        for number in range(1, _count(document, name) + 1):
            yield f"{name}[{number}]", document[name][number - 1]


def _keys_in(name: str, table: Any) -> Iterator[str]:
    model = _model_of(name, table)
    for word in SWEEPABLE[name.partition("[")[0]]:
        if model is not None and word not in known_keys(model):
            continue
        if is_left_out(f"{name}.{word}"):
            continue
        written = table.get(word) if isinstance(table, dict) else None
        if isinstance(written, list):
            yield from (f"{name}.{word}[{number}]" for number in range(1, len(written) + 1))
        elif model is None or not is_array_only(field_of(model, word)):
            yield f"{name}.{word}"


def _model_of(name: str, table: Any) -> type[BaseModel] | None:
    """Return the model of a table; None if its kind or law is unknown."""
    written = table if isinstance(table, dict) else {}
    table, _, place = name.partition("[")
    if table == "body":
        return (PART_MODELS if place else BODY_MODELS).get(str(written.get("kind", "oscillator")))
    if table == "forcing":
        return FORCING_MODELS.get(str(written.get("signal", "sine")))
    if table in ("stop", "contact"):
        models: Mapping[str, type[BaseModel]] = STOP_MODELS if table == "stop" else CONTACT_MODELS
        return models.get(str(written.get("law", "restitution")))
    return model_of(table)


def _count(document: Mapping[str, Any], name: str) -> int:
    tables = document.get(name, [])
    return len(tables) if isinstance(tables, list) else 0


def _key_hint(text: str, entry: object, document: Mapping[str, Any], known: list[str]) -> str:
    if isinstance(entry, dict) and text in SWEEPABLE and entry:
        return f'Put the whole key in quotes: "{text}.{next(iter(entry))}".'
    owner, _, rest = text.partition(".")
    if named := table_named(owner, document):
        return f"Did you mean {named}.{rest}?"
    table = owner.partition("[")[0]
    if said := effect_not_modelled(table, text.rpartition(".")[2].partition("[")[0]):
        return said
    if table in ARRAY_TABLES and isinstance(document.get(table), list):
        key, count = parse_key(text), _count(document, table)
        if key is None or key.place is None or key.place >= count:
            example = f"{table}[1].{SWEEPABLE[table][0]}"
            return f'Indices start at 1 and this scene has {count} [[{table}]]: for example "{example}".'
    if table in SWEEPABLE and table not in (*document, "execution"):
        return f"This scene has no {f'[[{table}]]' if table not in SINGLE_TABLES else f'[{table}]'}."
    return _element_hint(text, document, known) or _nearest_key(text, known)


def _nearest_key(text: str, known: list[str]) -> str:
    """Return a hint for a key of a present table: the nearest key of the table, or all its keys."""
    where, _, name = text.rpartition(".")
    names = [key.rpartition(".")[2] for key in known if key.rpartition(".")[0] == where]
    return nearest(name, names, f"{where}.") if names else nearest(text, known)


def _element_hint(text: str, document: Mapping[str, Any], known: list[str]) -> str:
    """Return a hint for a key of a present table, if it is an array: a sweep varies elements of arrays."""
    where, _, name = text.rpartition(".")
    model = next((_model_of(own, table) for own, table in _tables(document) if own == where), None)
    word = name.partition("[")[0]
    if model is None or word not in known_keys(model):
        return ""
    if word not in SWEEPABLE[where.partition("[")[0]]:
        return f"{text} is part of the structure of the scene and cannot be swept."
    elements = [key for key in known if key.startswith(f"{where}.{word}[")]
    if elements:
        return f'It is an array of {len(elements)}: sweep an element of it, such as "{elements[0]}".'
    if "[" in name or is_array_only(field_of(model, word)):
        return f"Write {word} as an array first, then its elements can be swept."
    return ""


def _value_problems(axis: SweepAxis, document: Mapping[str, Any]) -> list[Problem]:
    """Return the problem of a swept value that breaks the rule of its field, if there is one.

    All rules of sweepable fields are intervals, so checks of the lowest and the highest value are enough.
    """
    key = numeric_key(axis.key)
    model = (
        model_of("execution") if key.table == "execution" else _model_of(key.owner, key.owner_in(document))
    )
    if model is None:
        return []
    field = field_of(model, key.name)
    if is_whole(field):
        if axis.adaptive is not None:
            where = key_path(("sweep", axis.key, "adaptive"))
            return [Problem(where, "a key between whose values there are others", "whole numbers")]
        low, high, _ = bounds_of(field)
        broken = [value for value in axis.values if not (value.is_integer() and low <= value <= high)]
        if broken:
            expected = f"a whole number from {low} to {high}"
            return [replace(value_problem(("sweep", axis.key), field, broken[0]), expected=expected)]
    annotated: Any = Annotated
    rule = TypeAdapter(annotated[(field.annotation, *field.metadata)])
    for value in (axis.lowest, axis.highest):
        try:
            rule.validate_python(key.typed(value) if key.element is None else (value,), strict=True)
        except ValidationError:
            problem = value_problem(("sweep", axis.key), field, value)
            return [problem if key.element is None else replace(problem, expected=rule_of(field).item)]
    return []
