"""The tables of keys in docs/scene, made of the fields: `python docs/site/key_tables.py`."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from vibroimpact.orchestrator.scene import (
    body_models,
    component_models,
    execution_model,
    forcing_models,
    measuring_models,
    models,
    replay_models,
    sweep_models,
)
from vibroimpact.orchestrator.scene.fields import bounds_of, choices_of, forms_of, rule_of

DOCS = Path(__file__).parents[1]
PAGES = [DOCS / "scene.md", *sorted((DOCS / "scene").glob("*.md"))]
"""Pages with tables of keys."""
_MARKED = re.compile(
    r"(?P<begin><!-- keys of (?P<model>\w+) -->\n).*?(?P<end><!-- end of keys -->)", re.DOTALL
)
_WORDS = {float: "number", int: "whole number", str: "text", bool: "true/false"}
_PLURALS = {"table": "tables", "pair of numbers": "pairs of numbers", "pair of values": "pairs of values"}


def with_key_tables(page: str) -> str:
    """Return a page with each table between `<!-- keys of MODEL -->` and `<!-- end of keys -->` up to date.

    Raises
    ------
    KeyError
        A marker names no model.
    """
    tables = models_of_tables()
    return _MARKED.sub(
        lambda match: f"{match['begin']}{key_table(tables[match['model']])}\n{match['end']}", page
    )


def models_of_tables() -> dict[str, type[BaseModel]]:
    """Return the models of all tables of a scene, by their names."""
    modules = (
        models,
        forcing_models,
        body_models,
        measuring_models,
        replay_models,
        sweep_models,
        component_models,
        execution_model,
    )
    named = (pair for module in modules for pair in vars(module).items())
    return {name: found for name, found in named if isinstance(found, type) and issubclass(found, BaseModel)}


def key_table(model: type[BaseModel]) -> str:
    """Return the table of the keys of a model in Markdown, with the keys of tables within it."""
    rows = list(_rows(model, ""))
    head = ["key", "type", "unit", "default", "rule"]
    if not any(rule_of(field).unit for field in model.model_fields.values()):
        rows, head = [[*row[:2], *row[3:]] for row in rows], [*head[:2], *head[3:]]
    lines = [f"| {' | '.join(cells)} |".replace("|  |", "| |") for cells in (head, *rows)]
    return "\n".join([lines[0], f"|{'---|' * len(head)}", *lines[1:]])


def _rows(model: type[BaseModel], prefix: str) -> Iterator[list[str]]:
    inherited = {name for base in model.__bases__ for name in getattr(base, "model_fields", ())}
    for name, field in model.model_fields.items():
        if name in inherited:
            continue
        key, form = f"{prefix}{field.alias or name}", forms_of(field.annotation)[0]
        cells = (f"`{key}`", _type(field), _unit(field), _default(field), _said(field))
        yield [cell.replace("|", "\\|") for cell in cells]
        if isinstance(form, type) and issubclass(form, BaseModel):
            yield from _rows(form, f"{key}.")


def _type(field: FieldInfo) -> str:
    return ", or ".join(dict.fromkeys(_word(form) for form in forms_of(field.annotation)))


def _word(form: Any) -> str:
    if get_origin(form) is tuple:
        items = get_args(form)
        word = _word(forms_of(items[0])[0])
        if items[-1] is not Ellipsis:
            return f"pair of {word}s" if len(forms_of(items[0])) == 1 else "pair of values"
        return "array" if word == "number" else f"array of {_PLURALS.get(word, word)}"
    if get_origin(form) is dict or _is_table(form):
        return "table"
    choices = choices_of(form)
    return _WORDS[type(choices[0]) if choices else form]


def _is_table(form: Any) -> bool:
    return isinstance(form, type) and issubclass(form, BaseModel)


def _unit(field: FieldInfo) -> str:
    return rule_of(field).unit or ("1" if float in forms_of(field.annotation) else "")


def _default(field: FieldInfo) -> str:
    rule, value = rule_of(field), field.default
    if rule.default or field.is_required():
        return rule.default or "required"
    match value:
        case None:
            return "none"
        case bool():
            return "true" if value else "false"
        case int() | float():
            return f"{value:.15g}"
    return f"`{_toml(value)}`"


def _toml(value: Any) -> str:
    return f"[{', '.join(map(_toml, value))}]" if isinstance(value, tuple) else f'"{value}"'


def _said(field: FieldInfo) -> str:
    """Return the bounds of a field, then the words of its rule."""
    rule = rule_of(field)
    hint = rule.hint.rstrip(".")
    doc = rule.doc or (hint[:1].lower() + hint[1:])
    bounds = "" if rule.doc and choices_of(field.annotation) else _bounds(field)
    return "; ".join(part for part in (bounds, doc) if part)


def _bounds(field: FieldInfo) -> str:
    choices = choices_of(field.annotation)
    if choices:
        return ", ".join(f"`{_toml(choice)}`" for choice in choices)
    low, high, is_open = bounds_of(field)
    if low == -math.inf or "pair" in _type(field):
        return ""
    if is_open:
        return f"> {_short(low)}" + ("" if high == math.inf else f" and <= {_short(high)}")
    return f">= {_short(low)}" if high == math.inf else f"{_short(low)} to {_short(high)}"


def _short(number: float) -> str:
    """Return a number as text; a large power of ten as a power."""
    power = math.log10(number) if number > 0.0 else 0.0
    return f"10^{power:.0f}" if power > 5.0 and power.is_integer() else f"{number:g}"


if __name__ == "__main__":
    for path in PAGES:
        path.write_text(with_key_tables(path.read_text(encoding="utf-8")), encoding="utf-8")
