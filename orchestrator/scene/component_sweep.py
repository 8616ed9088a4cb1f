"""The sweep of a general scene: over start values of any component, gains of connections, numbers of contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from pydantic.fields import FieldInfo

from vibroimpact.orchestrator.scene.component_facts import Misfit, swept_value
from vibroimpact.orchestrator.scene.component_numbers import component_variable, contact_key, gain_place
from vibroimpact.orchestrator.scene.components import GeneralDraft, settable_names, start_problems
from vibroimpact.orchestrator.scene.fields import bounds_of, field_of, numeric_keys, rule_of
from vibroimpact.orchestrator.scene.keys import coordinate_name
from vibroimpact.orchestrator.scene.models import Execution
from vibroimpact.orchestrator.scene.problems import Problem, key_path, nearest, quoted
from vibroimpact.orchestrator.scene.rules.components import reference_problem
from vibroimpact.orchestrator.scene.rules.scene import sweep_problems
from vibroimpact.orchestrator.scene.sweep import SweepAxis
from vibroimpact.orchestrator.scene.sweep_table import read_sweep


def read_general_sweep(draft: GeneralDraft) -> tuple[tuple[SweepAxis, ...], list[Problem]]:
    """Return the sound axes of a scene of components, and what is wrong with the others and between them."""
    axes, problems = read_sweep(
        draft.document,
        lambda key, entry: _key_problems(key, entry, draft),
        lambda axis: _axis_problems(axis, draft),
    )
    return axes, [*problems, *sweep_problems(axes), *_names_differ(axes), *_events_tell_motions(axes, draft)]


def _events_tell_motions(axes: Sequence[SweepAxis], draft: GeneralDraft) -> Iterator[Problem]:
    is_adaptive = any(axis.adaptive is not None for axis in axes)
    if is_adaptive and draft.record is not None and not draft.record.events:
        hint = "Without them nothing but outcomes is compared."
        yield Problem("record.events", "true beside an adaptive axis", "false", hint)


def _key_problems(key: str, entry: object, draft: GeneralDraft) -> Iterator[Problem]:
    where = key_path(("sweep", key))
    hint = _quotes_hint(key, entry, draft)
    if hint:
        yield Problem(where, "a start value or a gain of this scene", quoted(key), hint)
    elif draft.names_step(key):
        return
    elif _names_an_entry(key, "connection", draft):
        yield from _gain_problems(key, where, draft)
    elif _names_an_entry(key, "contact", draft):
        yield from _contact_problems(key, where, draft)
    else:
        yield from _start_value_problems(key, where, draft)


def _names_an_entry(key: str, name: str, draft: GeneralDraft) -> bool:
    table = component_variable(key)[0]
    return table.partition("[")[0] == name and table not in draft.components


def _quotes_hint(key: str, entry: Any, draft: GeneralDraft) -> str:
    """Return the advice for a key without quotes, which TOML took for tables in each other."""
    if "." in key or key not in draft.components or not isinstance(entry, dict) or not entry:
        return ""
    words = [key]
    while isinstance(entry, dict) and len(entry) == 1:
        word, entry = next(iter(entry.items()))
        words += [] if word == "values" else [word]
    return f"Put the whole key in quotes: {quoted('.'.join(words))}." if len(words) > 1 else ""


def _gain_problems(key: str, where: str, draft: GeneralDraft) -> Iterator[Problem]:
    place, count = gain_place(key), len(draft.connections)
    if place is None or place >= count:
        has = f"Indices start at 1 and this scene has {count} [[connection]]"
        hint = f'{has}: for example "connection[1].gain".'
        yield Problem(where, "the gain of a connection", quoted(key), hint)
        return
    connection = draft.connections[place]
    source = draft.variable(connection.source) if connection else None
    if source and source.kind != "real":
        got = f"one between {source.type} variables"
        yield Problem(where, "the gain of a connection of real numbers", got)


def _contact_problems(key: str, where: str, draft: GeneralDraft) -> Iterator[Problem]:
    named, count = contact_key(key), len(draft.contacts)
    if named is None or named[0] >= count:
        hint = f"Indices start at 1 and this scene has {count} [[contact]]."
        yield Problem(where, "a number of a contact", quoted(key), hint)
        return
    place, name = named
    table = draft.contacts[place]
    if table is not None and name not in (known := list(numeric_keys(type(table)))):
        near = partial(nearest, name, known, f"contact[{place + 1}].")
        yield Problem(where, "a number of this contact", quoted(key), near)


def _start_value_problems(key: str, where: str, draft: GeneralDraft) -> Iterator[Problem]:
    problem = reference_problem(draft, where, key)
    facts, variable = draft.facts(key), draft.variable(key)
    if problem:
        component, name = component_variable(key)
        near = (
            partial(nearest, name, settable_names(facts), f"{component}.") if facts and name else problem.hint
        )
        yield Problem(where, problem.expected, problem.got, near)
    elif variable:
        found = list(start_problems(variable, where))
        yield from found
        if not found and variable.kind in ("boolean", "text"):
            yield Problem(where, "a number", f"the {variable.type} {key}", "Run a scene for each value.")


def _axis_problems(axis: SweepAxis, draft: GeneralDraft) -> Iterator[Problem]:
    if axis.continuation:
        where = key_path(("sweep", axis.key, "path"))
        hint = "What a general scene carries from point to point is not known: every point starts anew."
        yield Problem(where, '"independent" in a general scene', quoted(axis.path), hint)
        return
    if draft.names_step(axis.key):
        yield from _number_problems(axis, field_of(Execution, "macro_step"))
        return
    variable = draft.variable(axis.key)
    if variable is None:
        yield from _contact_values(axis, draft)
        return
    for value in axis.values:
        fitted = swept_value(variable, value)
        if isinstance(fitted, Misfit):
            yield Problem(key_path(("sweep", axis.key)), fitted.expected, quoted(value), fitted.hint)
            return


def _contact_values(axis: SweepAxis, draft: GeneralDraft) -> Iterator[Problem]:
    named = contact_key(axis.key)
    table = None if named is None else draft.contacts[named[0]]
    if named is None or table is None or named[1] not in type(table).model_fields:
        return
    yield from _number_problems(axis, field_of(type(table), named[1]))


def _number_problems(axis: SweepAxis, field: FieldInfo) -> Iterator[Problem]:
    rule, (low, high, is_open) = rule_of(field), bounds_of(field)
    for value in axis.values:
        if not low <= value <= high or (is_open and value == low):
            yield Problem(key_path(("sweep", axis.key)), rule.expected, quoted(value), rule.hint)
            return


def _names_differ(axes: tuple[SweepAxis, ...]) -> Iterator[Problem]:
    keys = [axis.key for axis in axes]
    named: dict[str, str] = {}
    for key in keys:
        name = coordinate_name(key, keys)
        other = named.setdefault(name, key)
        if other != key:
            hint = f"Both would be the coordinate {name} of the dataset: rename a component."
            yield Problem(key_path(("sweep", key)), f"a name of its own beside {other}", quoted(key), hint)
