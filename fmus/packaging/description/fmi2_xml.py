"""modelDescription.xml of FMI 2.0: unknowns are named by their position, counted from 1."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from vibroimpact.fmus.packaging.description.model import ComponentDescription, Enumeration, Variable
from vibroimpact.fmus.packaging.description.xml_text import (
    add_log_categories_and_experiment,
    add_units,
    head_attributes,
    present,
    to_text,
    value_attributes,
)

TYPE_NAMES = {"Float64": "Real", "Int64": "Integer", "Boolean": "Boolean", "Enumeration": "Enumeration"}


def fmi2_xml(component: ComponentDescription) -> str:
    """Return the FMI 2.0 model description of a component; variables that only FMI 3.0 knows are left out."""
    identity = {"fmiVersion": "2.0", "guid": component.token}
    root = Element("fmiModelDescription", identity | head_attributes(component))
    SubElement(root, "CoSimulation", _capabilities(component))
    add_units(root, component.units)
    _add_types(root, component.enumerations)
    add_log_categories_and_experiment(root)
    variables = SubElement(root, "ModelVariables")
    for variable in component.variables_of(2):
        _add_variable(variables, variable)
    _add_structure(root, component)
    return to_text(root)


def _capabilities(component: ComponentDescription) -> dict[str, str]:
    return {
        "modelIdentifier": component.name,
        "canHandleVariableCommunicationStepSize": "true",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    }


def _add_types(root: Element, enumerations: tuple[Enumeration, ...]) -> None:
    if not enumerations:
        return
    definitions = SubElement(root, "TypeDefinitions")
    for enumeration in enumerations:
        named = present({"name": enumeration.name, "description": enumeration.description})
        element = SubElement(SubElement(definitions, "SimpleType", named), "Enumeration")
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
    scalar = SubElement(parent, "ScalarVariable", present(attributes))
    SubElement(scalar, TYPE_NAMES[variable.type], value_attributes(variable))


def _add_structure(root: Element, component: ComponentDescription) -> None:
    structure = SubElement(root, "ModelStructure")
    variables = component.variables_of(2)
    positions = {v.name: str(i) for i, v in enumerate(variables, 1)}
    outputs = [v for v in variables if v.causality == "output"]
    unknowns = [v for v in variables if v.is_initial_unknown]
    if outputs:
        parent = SubElement(structure, "Outputs")
        for variable in outputs:
            unknown = SubElement(parent, "Unknown", index=positions[variable.name])
            if variable.dependencies is not None:
                inputs = component.direct_inputs(variable, 2)
                unknown.set("dependencies", " ".join(positions[name] for name in inputs))
    if unknowns:
        parent = SubElement(structure, "InitialUnknowns")
        for variable in unknowns:
            SubElement(parent, "Unknown", index=positions[variable.name])
