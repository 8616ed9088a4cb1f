"""From a TOML document to the tables of a scene, or to the list of all its problems."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from vibroimpact.orchestrator.scene.draft import Draft, Reading
from vibroimpact.orchestrator.scene.keys import CHAIN_TABLES, table_named
from vibroimpact.orchestrator.scene.models import Record
from vibroimpact.orchestrator.scene.problems import MODELLED, Problem, quoted, unknown_key
from vibroimpact.orchestrator.scene.rules.scene import rule_problems
from vibroimpact.orchestrator.scene.sweep_table import read_short_sweep, with_realisations

_SHORT_TABLES = ("body", "link", "forcing", "stop", "sensor", "replay")
_GENERAL_TABLES = ("component", "connection", "contact", "event")
_COMMON_TABLES = ("record", "sweep", "execution")


def read_tables(document: Mapping[str, Any], folder: Path) -> tuple[dict[str, Any], list[Problem]]:
    """Return the parts of a scene, empty if there is a problem, and all problems of its tables."""
    general = [name for name in _GENERAL_TABLES if name in document]
    short = [name for name in _SHORT_TABLES if name in document]
    if general == ["contact"] and "body" in document:
        general, short = [], [*short, "contact"]  # points of bodies of the short form
    if general and short:
        return {}, [_mixed_problem(general, short)]
    own = _GENERAL_TABLES if general else (*_SHORT_TABLES, "contact", *CHAIN_TABLES)
    unknown = list(_table_problems(document, ("scene", *own, *_COMMON_TABLES)))
    if general:
        # the import of model descriptions takes time, and the short form does not need it
        from vibroimpact.orchestrator.scene.component_tables import read_components

        reading = read_components(document, folder)
    else:
        reading = _read_body(document, folder)
    problems = [*unknown, *reading.draft.problems, *reading.problems]
    return ({}, problems) if problems else ({**dict(reading.draft.header or {}), **reading.parts()}, [])


def _mixed_problem(general: list[str], short: list[str]) -> Problem:
    expected = (
        "[component.NAME], [[connection]], [[contact]] and [[event]], or [body], [forcing] and [[stop]]"
    )
    got = " beside ".join(", ".join(f"[{name}]" for name in names) for names in (general, short))
    hint = 'Remove those of one form; the body of the short form is fmu = "Oscillator" in the general one.'
    return Problem(general[0], expected, got, hint)


def _read_body(document: Mapping[str, Any], folder: Path) -> Reading:
    document, wrong = with_realisations(document)
    axes, wrong_axes = read_short_sweep(document) if "sweep" in document else ((), [])
    draft = Draft(document, axes, folder)
    return Reading(draft, wrong + wrong_axes + rule_problems(draft), partial(_parts, draft))


def _parts(draft: Draft) -> dict[str, Any]:
    assert draft.record is not None
    return {
        "bodies": (draft.simulated_body,),
        "contacts": (*draft.stops, *draft.meetings),
        "record": _applicable(draft.record),
        "sweep": draft.axes + (draft.replay.axes if draft.replay else ()),
        **{name: getattr(draft, name) for name in ("forces", "sensor", *CHAIN_TABLES, "execution", "replay")},
    }


def _table_problems(document: Mapping[str, Any], known: tuple[str, ...]) -> Iterator[Problem]:
    for name, value in document.items():
        if name in CHAIN_TABLES and name not in known:
            hint = "In a scene of components the measuring chain is made of components too."
            yield Problem(name, f"[{name}] in a scene with [body]", "one beside [component.NAME]", hint)
        elif name not in known:
            problem = unknown_key((name,), known)
            advice = problem.hint
            if named := table_named(name, document):
                key = f".{next(iter(value))}" if isinstance(value, dict) and len(value) == 1 else ""
                advice = f"Did you mean {named}{key}?"
            what = "table" if isinstance(value, dict | list) else "key outside any table"
            general = Problem(problem.key, "a known table", f"the unknown {what} {quoted(name)}", advice)
            yield problem if problem.expected == MODELLED else general


def _applicable(record: Record) -> Record:
    """Return the record without the per-period variables where there are no periods."""
    if record.recorded_periods:
        return record
    return record.model_copy(update={"extrema": False, "strobe": False})
