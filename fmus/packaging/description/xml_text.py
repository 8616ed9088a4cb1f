"""What both versions of modelDescription.xml share: literals, units, the head, indentation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from vibroimpact.fmus.packaging.description.model import (
    ComponentDescription,
    Number,
    UnitDefinition,
    Variable,
)

LOG_CATEGORIES = {
    "logStatusError": "Why a call failed",
    "logStatusWarning": "What is unusual but was dealt with",
    "logEvents": "Contacts, sticking and release, as they happen",
}
#: Start and stop time and step that a tool offers first, s.
DEFAULT_EXPERIMENT = {"startTime": "0", "stopTime": "10", "stepSize": "0.01"}


def literal(value: Number) -> str:
    """Return a value as XML Schema spells it: `true`, `INF`, `NaN`, and the shortest exact decimal."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if math.isfinite(value):
        return repr(value)
    return "NaN" if math.isnan(value) else ("INF" if value > 0 else "-INF")


def number_literal(variable: Variable, value: Number) -> str:
    """Return a start, min or max of a variable; TOML's `1` is `1.0` for a Float64."""
    return literal(float(value) if variable.type == "Float64" else value)


def head_attributes(component: ComponentDescription) -> dict[str, str]:
    """Return the attributes that both versions give to the root, without version and token."""
    return {
        "modelName": component.name,
        "description": component.description,
        "author": "vibroimpact developers",
        "license": "BSD-3-Clause",
        "generationTool": "vibroimpact",
        "variableNamingConvention": "structured",
    }


def add_units(root: Element, units: tuple[UnitDefinition, ...]) -> None:
    """Append UnitDefinitions, which are the same in both versions."""
    if not units:
        return
    definitions = SubElement(root, "UnitDefinitions")
    for unit in units:
        base = {name: str(exponent) for name, exponent in unit.base.items() if exponent}
        if unit.factor != 1.0:
            base["factor"] = literal(float(unit.factor))
        if unit.offset != 0.0:
            base["offset"] = literal(float(unit.offset))
        SubElement(SubElement(definitions, "Unit", name=unit.name), "BaseUnit", base)


def add_log_categories_and_experiment(root: Element) -> None:
    """Append LogCategories and DefaultExperiment."""
    categories = SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=description)
    SubElement(root, "DefaultExperiment", DEFAULT_EXPERIMENT)


def value_attributes(variable: Variable) -> dict[str, str]:
    """Return the attributes of a variable's value: declared type, unit, bounds, start."""
    attributes = {"declaredType": variable.enumeration, "unit": variable.unit}
    bounds = {"min": variable.minimum, "max": variable.maximum, "start": variable.start}
    attributes |= {key: number_literal(variable, value) for key, value in bounds.items() if value is not None}
    return present(attributes)


def present(attributes: Mapping[str, str | None]) -> dict[str, str]:
    """Return the attributes that have a value."""
    return {key: value for key, value in attributes.items() if value}


def to_text(root: Element) -> str:
    """Return the indented document; the same component gives the same bytes."""
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
