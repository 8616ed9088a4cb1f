"""All keys of a scene, in both forms: type, unit, default, rule and help text of each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from vibroimpact.orchestrator.scene import component_models, measuring_models, models, sweep_models
from vibroimpact.orchestrator.scene.body_models import BODY_MODELS, LinkTable
from vibroimpact.orchestrator.scene.execution_model import Execution
from vibroimpact.orchestrator.scene.fields import bounds_of, choices_of, forms_of, numeric_keys, rule_of
from vibroimpact.orchestrator.scene.forcing_models import FORCING_MODELS
from vibroimpact.orchestrator.scene.keys import SWEEPABLE
from vibroimpact.orchestrator.scene.replay_models import Replay

Tables = dict[str, type[BaseModel]]

BOTH: Tables = {
    "[scene]": models.SceneHeader,
    "[sweep] KEY": sweep_models.AxisTable,
    "[sweep] sample": sweep_models.SampleTable,
    "[execution]": Execution,
}
SHORT: Tables = {
    **{f"[body] kind = {kind}": model for kind, model in BODY_MODELS.items()},
    **{f"[[forcing]] signal = {signal}": model for signal, model in FORCING_MODELS.items()},
    **{f"[[stop]] law = {law}": model for law, model in models.STOP_MODELS.items()},
    "[[link]]": LinkTable,
    **{f"[[contact]] of [[body]], law = {law}": model for law, model in models.CONTACT_MODELS.items()},
    "[sensor]": measuring_models.Sensor,
    "[load_cell]": measuring_models.LoadCell,
    "[exciter]": measuring_models.Exciter,
    "[noise]": measuring_models.Noise,
    "[daq]": measuring_models.Daq,
    "[replay]": Replay,
    "[record]": models.Record,
}
GENERAL: Tables = {
    "[component.NAME]": component_models.ComponentTable,
    "[[connection]]": component_models.ConnectionTable,
    "[[event]]": component_models.EventTable,
    "[[contact]] stop": component_models.StopContactTable,
    **{f"[[contact]] between, law = {law}": model for law, model in component_models.PAIR_MODELS.items()},
    "[record]": component_models.GeneralRecord,
}
FORMS = {"both forms": BOTH, "short form": SHORT, "general form": GENERAL}


def scene_keys() -> str:
    """Return each table of a scene with a line for each of its keys, then the sweepable keys."""
    lines = [
        line
        for form, tables in FORMS.items()
        for table, model in tables.items()
        for line in (f"{form}: {table}", *_lines_of(model, ""))
    ]
    varied = [f"    {table}: {', '.join(keys)}" for table, keys in SWEEPABLE.items()]
    return "".join(f"{line}\n" for line in (*lines, "numbers that a sweep may vary", *varied))


def _lines_of(model: type[BaseModel], prefix: str) -> Iterator[str]:
    varied = set(numeric_keys(model))
    for name, field in model.model_fields.items():
        key = field.alias or name
        yield f"    {prefix}{key}{' (number)' if key in varied else ''}: {'; '.join(_said(field))}"
        for table in _tables_in(field.annotation):
            yield from _lines_of(table, f"{prefix}{key}.")


def _said(field: FieldInfo) -> Iterator[str]:
    """Yield the known facts of a key: its type, choices and limits, default, and the words of its rule."""
    rule, (low, high, is_open) = rule_of(field), bounds_of(field)
    yield " or ".join(dict.fromkeys(map(_type, forms_of(field.annotation))))
    if choices := choices_of(field.annotation):
        yield f"one of {choices}"
    if (low, high) != (-math.inf, math.inf):
        yield f"{'>' if is_open else '>='} {low:g}, <= {high:g}"
    yield "required" if field.is_required() else f"default {field.get_default(call_default_factory=True)!r}"
    for word in ("expected", "item", "unit", "hint", "unavailable", "fmu", "effect", "doc", "default"):
        if value := getattr(rule, word):
            yield f"{word} {value!r}"
    if rule.told_if_given:
        yield "told if given"


def _type(form: Any) -> str:
    if _is_table(form):
        return "table"
    if get_origin(form) in (tuple, dict):
        items = [" or ".join(map(_type, forms_of(item))) for item in get_args(form) if item is not Ellipsis]
        return f"{get_origin(form).__name__}[{', '.join(items)}]"
    return "choice" if choices_of(form) else form.__name__


def _tables_in(annotation: Any) -> Iterator[type[BaseModel]]:
    for form in forms_of(annotation):
        if _is_table(form):
            yield form
        elif get_origin(form) in (tuple, dict):
            for item in get_args(form):
                yield from _tables_in(item) if item is not Ellipsis else ()


def _is_table(form: Any) -> bool:
    return isinstance(form, type) and issubclass(form, BaseModel)
