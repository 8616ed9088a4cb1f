"""modelDescription.xml of FMI 2.0 and 3.0: the same content in different words.

FMI 3.0 names unknowns by their value references, FMI 2.0 by their position, counted from 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from vibroimpact.fmus.packaging.description.lean import Edition, Experiment
from vibroimpact.fmus.packaging.description.model import (
    ComponentDescription,
    Enumeration,
    Number,
    UnitDefinition,
    Variable,
)

LOG_CATEGORIES = {
    "logStatusError": "Why a call failed",
    "logStatusWarning": "What is unusual but was dealt with",
    "logEvents": "Contacts, sticking and release, as they happen",
}
#: Highest order of the derivatives over time of outputs in co-simulation; VI_MOST_ORDER of component.h.
MOST_OUTPUT_DERIVATIVES = 2
FMI2_TYPES = {"Float64": "Real", "Int64": "Integer", "Boolean": "Boolean", "Enumeration": "Enumeration"}


def model_description(
    component: ComponentDescription,
    fmi: str,
    edition: Edition | None = None,
    source_files: Sequence[str] = (),
) -> str:
    """Return a component's model description; the same component gives the same bytes.

    `2.0` leaves out variables that only FMI 3.0 has. The edition, of an export, adds version and date, and the knowns
    of each unknown of initialization. `source_files` are C files to list in `2.0`; FMI 3.0 lists them in a separate
    file.
    """
    version = int(fmi[0])
    identity = {"fmiVersion": fmi, "guid" if version == 2 else "instantiationToken": component.token}
    head = {
        "modelName": component.name,
        "description": component.description,
        "author": "vibroimpact developers",
        "license": "BSD-3-Clause",
        "generationTool": "vibroimpact",
        "variableNamingConvention": "structured",
    }
    if edition is not None:
        origin = {"copyright": "vibroimpact developers", "generationDateAndTime": edition.date_and_time}
        head |= {"version": edition.version, **_present(origin)}
    root = Element("fmiModelDescription", identity | head)
    if version == 2 and component.model_exchange:
        root.set("numberOfEventIndicators", str(len(component.event_indicators())))
    for kind in ("ModelExchange", "CoSimulation") if component.model_exchange else ("CoSimulation",):
        interface = SubElement(root, kind, _capabilities(component, version, kind))
        if version == 2 and source_files:
            files = SubElement(interface, "SourceFiles")
            for name in source_files:
                SubElement(files, "File", name=name)
    if component.units:
        root.append(unit_definitions(component.units))
    _add_types(root, component.enumerations, version)
    categories = SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=description)
    SubElement(root, "DefaultExperiment", _experiment(edition.experiment if edition else Experiment()))
    variables = SubElement(root, "ModelVariables")
    references = _references(component, version)
    for variable in component.variables_of(version):
        _add_variable(variables, variable, version, references)
    _add_structure(root, component, version, initial_dependencies=edition is not None)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def literal(value: Number) -> str:
    """Return a value as XML Schema spells it: `true`, `INF`, `NaN`, and the shortest exact decimal."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if math.isfinite(value):
        return repr(value)
    return "NaN" if math.isnan(value) else ("INF" if value > 0 else "-INF")


def _experiment(experiment: Experiment) -> dict[str, str]:
    return {
        "startTime": literal(experiment.start_time),
        "stopTime": literal(experiment.stop_time),
        "tolerance": literal(experiment.tolerance),
        "stepSize": literal(experiment.step_size),
    }


def _references(component: ComponentDescription, version: int) -> dict[str, str]:
    """Return the name by which other elements refer to each variable."""
    variables = component.variables_of(version)
    if version == 2:
        return {v.name: str(place) for place, v in enumerate(variables, 1)}
    return {v.name: str(v.value_reference) for v in variables}


def _capabilities(component: ComponentDescription, version: int, kind: str) -> dict[str, str]:
    state = "state" if version == 2 else "State"
    common = {
        "modelIdentifier": component.name,
        "canBeInstantiatedOnlyOncePerProcess": "false",
        f"canGetAndSetFMU{state}": "true",
        f"canSerializeFMU{state}": "true",
        **_derivative_capabilities(component, version),
    }
    if kind == "ModelExchange":
        without = "completedIntegratorStepNotNeeded" if version == 2 else "needsCompletedIntegratorStep"
        return {**common, without: literal(version == 2)}
    if component.partial_derivatives:
        common["maxOutputDerivativeOrder"] = str(MOST_OUTPUT_DERIVATIVES)
    if version == 2:
        return {**common, "canHandleVariableCommunicationStepSize": "true"}
    events = literal(component.event_mode)
    return {
        **common,
        "canHandleVariableCommunicationStepSize": "true",
        "mightReturnEarlyFromDoStep": events,
        "canReturnEarlyAfterIntermediateUpdate": "false",
        "hasEventMode": events,
    }


def _derivative_capabilities(component: ComponentDescription, version: int) -> dict[str, str]:
    if not component.partial_derivatives:
        return {}
    if version == 2:
        return {"providesDirectionalDerivative": "true"}
    return {"providesDirectionalDerivatives": "true", "providesAdjointDerivatives": "true"}


def unit_definitions(units: Iterable[UnitDefinition]) -> Element:
    """Return UnitDefinitions, which are the same in both versions."""
    definitions = Element("UnitDefinitions")
    for unit in units:
        base = {name: str(exponent) for name, exponent in unit.base.items() if exponent}
        if unit.factor != 1.0:
            base["factor"] = literal(float(unit.factor))
        if unit.offset != 0.0:
            base["offset"] = literal(float(unit.offset))
        SubElement(SubElement(definitions, "Unit", name=unit.name), "BaseUnit", base)
    return definitions


def _add_types(root: Element, enumerations: tuple[Enumeration, ...], version: int) -> None:
    if not enumerations:
        return
    definitions = SubElement(root, "TypeDefinitions")
    for enumeration in enumerations:
        named = _present({"name": enumeration.name, "description": enumeration.description})
        if version == 2:
            element = SubElement(SubElement(definitions, "SimpleType", named), "Enumeration")
        else:
            element = SubElement(definitions, "EnumerationType", named)
        for item in enumeration.items:
            values = {"name": item.name, "value": str(item.value), "description": item.description}
            SubElement(element, "Item", _present(values))


def _add_variable(parent: Element, variable: Variable, version: int, references: Mapping[str, str]) -> None:
    attributes = {
        "name": variable.name,
        "valueReference": str(variable.value_reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
        "initial": variable.initial,
    }
    if version == 2:
        scalar = SubElement(parent, "ScalarVariable", _present(attributes))
        SubElement(scalar, FMI2_TYPES[variable.type], _value_attributes(variable, references))
        return
    values = _value_attributes(variable, references)
    if variable.type == "Clock":
        values["intervalVariability"] = "triggered"
    element = SubElement(parent, variable.type, _present(attributes) | values)
    for size in variable.dimensions:
        SubElement(element, "Dimension", start=str(size))


def _value_attributes(variable: Variable, references: Mapping[str, str]) -> dict[str, str]:
    """Return the attributes of a variable's value: declared type, unit, bounds, start, derivative."""
    attributes = {"declaredType": variable.enumeration, "unit": variable.unit}
    for key, value in (("min", variable.minimum), ("max", variable.maximum), ("start", variable.start)):
        if value is not None:  # TOML's `1` means `1.0` for a Float64
            attributes[key] = literal(float(value) if variable.type == "Float64" else value)
    attributes["derivative"] = references.get(variable.derivative, "")
    attributes["clocks"] = references.get(variable.clock, "")
    return _present(attributes)


def _present(attributes: Mapping[str, str | None]) -> dict[str, str]:
    """Return the attributes that have a value."""
    return {key: value for key, value in attributes.items() if value}


def _add_structure(
    root: Element, component: ComponentDescription, version: int, *, initial_dependencies: bool
) -> None:
    variables = component.variables_of(version)
    key = "index" if version == 2 else "valueReference"
    references = _references(component, version)
    states = "Derivative" if version == 2 else "ContinuousStateDerivative"
    structure = SubElement(root, "ModelStructure")
    for kind, unknowns in (
        ("Output", [v for v in variables if v.causality == "output"]),
        (states, list(component.derivatives())),
        ("InitialUnknown", [v for v in variables if v.is_initial_unknown]),
        ("EventIndicator", list(component.event_indicators()) if version == 3 else []),
    ):
        # FMI 2.0 has a list for each kind, and forbids empty lists
        parent = SubElement(structure, f"{kind}s") if version == 2 and unknowns else structure
        for variable in unknowns:
            unknown = SubElement(
                parent, "Unknown" if version == 2 else kind, {key: references[variable.name]}
            )
            if kind == "InitialUnknown":
                knowns = component.knowns_at_start(variable, version) if initial_dependencies else None
            else:
                knowns = component.direct_knowns(variable, version)
            if knowns is not None:  # an unknown without a list may depend on all knowns
                unknown.set("dependencies", " ".join(references[name] for name in knowns))
