"""modelDescription.xml of FMI 3.0: unknowns are named by their value references."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from vibroimpact.fmus.packaging.description.model import ComponentDescription, Enumeration, Variable
from vibroimpact.fmus.packaging.description.xml_text import (
    add_log_categories_and_experiment,
    add_units,
    head_attributes,
    literal,
    present,
    to_text,
    value_attributes,
)


def fmi3_xml(component: ComponentDescription) -> str:
    """Return the FMI 3.0 model description of a component."""
    identity = {"fmiVersion": "3.0", "instantiationToken": component.token}
    root = Element("fmiModelDescription", identity | head_attributes(component))
    SubElement(root, "CoSimulation", _capabilities(component))
    add_units(root, component.units)
    _add_types(root, component.enumerations)
    add_log_categories_and_experiment(root)
    variables = SubElement(root, "ModelVariables")
    for variable in component.variables_of(3):
        _add_variable(variables, variable)
    _add_structure(root, component)
    return to_text(root)


def _capabilities(component: ComponentDescription) -> dict[str, str]:
    events = literal(component.event_mode)
    return {
        "modelIdentifier": component.name,
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "canHandleVariableCommunicationStepSize": "true",
        "mightReturnEarlyFromDoStep": events,
        "canReturnEarlyAfterIntermediateUpdate": "false",
        "hasEventMode": events,
    }


def _add_types(root: Element, enumerations: tuple[Enumeration, ...]) -> None:
    if not enumerations:
        return
    definitions = SubElement(root, "TypeDefinitions")
    for enumeration in enumerations:
        named = present({"name": enumeration.name, "description": enumeration.description})
        element = SubElement(definitions, "EnumerationType", named)
        for item in enumeration.items:
            values = {"name": item.name, "value": str(item.value), "description": item.description}
            SubElement(element, "Item", present(values))


def _add_variable(parent: Element, variable: Variable) -> None:
    attributes = {
        "name": variable.name,
        "valueReference": str(variable.value_reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
        "initial": variable.initial,
    }
    element = SubElement(parent, variable.type, present(attributes) | value_attributes(variable))
    for size in variable.dimensions:
        SubElement(element, "Dimension", start=str(size))


def _add_structure(root: Element, component: ComponentDescription) -> None:
    structure = SubElement(root, "ModelStructure")
    variables = component.variables_of(3)
    references = {v.name: str(v.value_reference) for v in variables}
    for variable in variables:
        if variable.causality == "output":
            unknown = SubElement(structure, "Output", valueReference=references[variable.name])
            if variable.dependencies is not None:
                inputs = component.direct_inputs(variable, 3)
                unknown.set("dependencies", " ".join(references[name] for name in inputs))
    for variable in variables:
        if variable.is_initial_unknown:
            SubElement(structure, "InitialUnknown", valueReference=references[variable.name])
