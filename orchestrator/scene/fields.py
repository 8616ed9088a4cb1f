"""The rule of a field of a scene: accepted values, unit, FMU variable, and its line in docs/scene.

A field is an annotation with constraints and a `Rule`. It is the source of messages, sweepable keys, units in datasets,
parameters of FMUs, bounds of a fit, and the tables of docs/scene.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo


@dataclass(frozen=True, slots=True)
class Rule:
    """The rule of a field of a scene model, besides its constraints.

    Attributes
    ----------
    expected : str
        Completes "expected ..." in messages; by default the constraints in words: "a number > 0".
    unit : str
        Unit of the field in an SI scene; empty without a unit.
    hint : str
        Advice for a value outside the rule.
    unavailable : tuple of str
        Words of the scene format that this version does not run.
    item : str
        Completes "expected ..." for one item of an array; by default the constraints in words.
    sweepable : bool or None
        Whether a sweep may vary the field, in a table with swept keys; None: real numbers yes, whole numbers no.
    fmu : str
        Real variable of the body's FMU with the same value: `mass`; `mass[i]` with one element for each mass or
        mode. At the port of a stop: `contact[k].stiffness`. Empty without such a variable.
    told_if_given : bool
        Whether the FMU gets the value only if the scene gives it.
    effect : str
        Effect that a value > 0 asks for, in the words of `vibroimpact check`.
    doc : str
        Text in docs/scene after the bounds; by default the hint.
    default : str
        Text in docs/scene on the default, if the value alone is not clear.
    """

    expected: str = ""
    unit: str = ""
    hint: str = ""
    unavailable: tuple[str, ...] = ()
    item: str = ""
    sweepable: bool | None = None
    fmu: str = ""
    told_if_given: bool = False
    effect: str = ""
    doc: str = ""
    default: str = ""


class Bounds(NamedTuple):
    """Lowest and highest number of a field, and whether the lowest itself is excluded."""

    low: float = -math.inf
    high: float = math.inf
    is_open: bool = False


def rule_of(field: FieldInfo) -> Rule:
    """Return the complete rule of a model field, with the texts from its constraints."""
    rule = _written_rule(field)
    item = rule.item or (_number(bounds_of(field)) if _array_of(field) is float else "")
    return replace(rule, expected=rule.expected or _expected(field), item=item)


def _written_rule(field: FieldInfo) -> Rule:
    return next(entry for entry in field.metadata if isinstance(entry, Rule))


def bounds_of(field: FieldInfo) -> Bounds:
    """Return the bounds of a field, or of each of its items."""
    low, high, is_open = Bounds()
    for mark in (*field.metadata, *_marks(field.annotation)):
        low = getattr(mark, "gt", getattr(mark, "ge", low))
        high = getattr(mark, "le", high)
        is_open = is_open or hasattr(mark, "gt")
    return Bounds(low, high, is_open)


def _marks(annotation: Any) -> Iterator[Any]:
    """Yield the constraints within an annotation."""
    for entry in getattr(annotation, "__metadata__", ()):
        yield from entry.metadata if isinstance(entry, FieldInfo) else (entry,)
    for part in get_args(annotation):
        yield from _marks(part)


def forms_of(annotation: Any) -> list[Any]:
    """Return the types of a value, without constraints and None.

    Examples
    --------
    >>> forms_of(Annotated[float, "> 0"] | tuple[float, ...] | None)
    [<class 'float'>, tuple[float, ...]]
    """
    if get_origin(annotation) is Annotated:
        return forms_of(annotation.__origin__)
    if get_origin(annotation) in (Union, UnionType):
        return [form for part in get_args(annotation) for form in forms_of(part)]
    return [] if annotation is NoneType else [annotation]


def choices_of(annotation: Any) -> list[Any]:
    """Return the choices of a field, or of its items; empty if it is not a choice."""
    if get_origin(annotation) is Literal:
        return list(get_args(annotation))
    return [choice for part in get_args(annotation) for choice in choices_of(part)]


def _array_of(field: FieldInfo) -> Any:
    """Return the type of the items of an array; None where a field takes no array."""
    arrays = [form for form in forms_of(field.annotation) if get_origin(form) is tuple]
    return forms_of(get_args(arrays[0])[0])[0] if arrays else None


def is_array_only(field: FieldInfo) -> bool:
    """Return whether a field takes only an array."""
    return all(get_origin(form) is tuple for form in forms_of(field.annotation))


def _expected(field: FieldInfo) -> str:
    """Return the constraints of a field in words."""
    forms, choices, bounds = forms_of(field.annotation), choices_of(field.annotation), bounds_of(field)
    if choices:
        return listed([f'"{choice}"' for choice in choices], "or")
    if forms == [bool]:
        return "true or false"
    if forms == [int]:
        return f"a whole number from {bounds.low} to {bounds.high}"
    if is_array_only(field):
        return f"an array of {_number(bounds, 'numbers').removeprefix('a ')}"
    return _number(bounds) if forms == [float] else f"{_number(bounds)}, or an array of them"


def _number(bounds: Bounds, noun: str = "number") -> str:
    if bounds.low == -math.inf:
        return f"a finite {noun}"
    if bounds.high < math.inf:
        return f"a {noun} from {bounds.low:g} to {bounds.high:g}"
    return f"a {noun} {'>' if bounds.is_open else '>='} {bounds.low:g}"


def listed(words: Sequence[str], last: str) -> str:
    """Return words joined by commas, with `last` before the last word.

    >>> listed(["a", "b", "c"], "or"), listed(["a"], "or"), listed([], "or")
    ('a, b or c', 'a', '')
    """
    return f" {last} ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)


@lru_cache(maxsize=256)
def field_name(model: type[BaseModel], key: str) -> str:
    """Return the attribute of a model that stores a key of the scene file."""
    return next(name for name, field in model.model_fields.items() if key in (field.alias, name))


def field_of(model: type[BaseModel], key: str) -> FieldInfo:
    """Return the field of a key of the scene file."""
    return model.model_fields[field_name(model, key)]


def known_keys(model: type[BaseModel]) -> list[str]:
    """Return the keys of a table in the spelling of a scene file."""
    return [field.alias or name for name, field in model.model_fields.items()]


def numeric_keys(model: type[BaseModel]) -> Iterator[str]:
    """Yield the keys of a table whose numbers, or elements of numbers, a sweep may vary."""
    for name, field in model.model_fields.items():
        is_number = float in forms_of(field.annotation) or _array_of(field) is float
        sweepable = _written_rule(field).sweepable
        if is_number if sweepable is None else sweepable:
            yield field.alias or name


def is_whole(field: FieldInfo) -> bool:
    """Return whether a field takes only whole numbers."""
    forms = forms_of(field.annotation)
    return int in forms and float not in forms


class FmuVariable(NamedTuple):
    """The real variable of an FMU that gets the value of a key; the `name` of an array has no `[i]`. See `Rule`."""

    key: str
    attribute: str
    name: str
    is_array: bool
    is_told_if_given: bool


@lru_cache(maxsize=32)
def fmu_variables_of(model: type[BaseModel]) -> tuple[FmuVariable, ...]:
    """Return the variables of the FMU that get the values of a table's keys."""
    return tuple(
        FmuVariable(
            field.alias or name,
            name,
            rule.fmu.removesuffix("[i]"),
            rule.fmu.endswith("[i]"),
            rule.told_if_given,
        )
        for name, field in model.model_fields.items()
        if (rule := _written_rule(field)).fmu
    )


def named_numbers(table: BaseModel, size: int = 0) -> dict[str, float]:
    """Return the numbers of a table of a scene by their variable names in the FMU, SI.

    Fields without a value and without a default are left out. `size` is the number of elements of each array (masses or
    modes). A single number holds for all elements; missing elements at the end of a list are 0.
    """
    parameters: dict[str, float] = {}
    for variable in fmu_variables_of(type(table)):
        value = getattr(table, variable.key)
        if value is None or (variable.is_told_if_given and variable.attribute not in table.model_fields_set):
            continue
        if not variable.is_array:
            parameters[variable.name] = value
            continue
        each = value + (0.0,) * (size - len(value)) if isinstance(value, tuple) else (value,) * size
        parameters |= {f"{variable.name}[{number}]": one for number, one in enumerate(each, start=1)}
    return parameters
