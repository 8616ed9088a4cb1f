"""The XML of an archive: the description of the system (SSD) and the start values of its components (SSV)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import tomli_w

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.fmus.units import BASE_UNITS, Unit, agree
from vibroimpact.orchestrator.importer.specification import ConnectionSpec
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.component_facts import (
    MODEL_EXCHANGE,
    NUMERIC_KINDS,
    StartValue,
    VariableFacts,
)
from vibroimpact.orchestrator.scene.component_numbers import component_variable, gain_place
from vibroimpact.orchestrator.ssp.members import Part
from vibroimpact.orchestrator.ssp.names import (
    ANNOTATION,
    FMU_TYPE,
    NAMESPACES,
    OMS_ANNOTATION,
    OSP_ANNOTATION,
)
from vibroimpact.orchestrator.ssp.scene_tables import OWN_TABLES

START_VALUES = "start"
"""Name of the parameter set of each component."""
SWEPT_VALUES, SWEPT_MAPPING = "resources/system.sweep.ssv", "resources/system.sweep.ssm"
"""Members with the scene's swept values; no component has a dot in its name."""
KINDS = {
    "1.0": frozenset({"input", "output", "parameter", "calculatedParameter"}),
    "2.0": frozenset({"input", "output", "parameter", "calculatedParameter", "local"}),
}
_NO_IDENTIFIER = re.compile(r"^(?=[0-9])|[^A-Za-z0-9_]")
GIVING = frozenset({"output", "calculatedParameter", "local"})
_TYPES = {
    "real": "Real",
    "integer": "Integer",
    "enumeration": "Integer",
    "boolean": "Boolean",
    "text": "String",
}
"""Types of connectors; an enumeration is its number, which every tool can set."""


def description(scene: Scene, parts: Mapping[str, Part], ssp: str, duration: float) -> bytes:
    """Return the SSD of a scene.

    UsageError: a connection has an end without a form in this version of SSP.
    """
    root = _root("ssd:SystemStructureDescription", ssp, ("ssc", "ssv", "ssm", "osp", "oms", "vibroimpact"))
    # OMSimulator makes a model of this name
    root.set("name", _NO_IDENTIFIER.sub("_", scene.title) or "model")
    root.set("description", scene.title)
    system = SubElement(root, "ssd:System", name="system")
    if swept_values(scene, parts):
        bindings = SubElement(system, "ssd:ParameterBindings")
        binding = SubElement(bindings, "ssd:ParameterBinding", source=SWEPT_VALUES)
        SubElement(binding, "ssd:ParameterMapping", source=SWEPT_MAPPING)
    elements = SubElement(system, "ssd:Elements")
    shown = {part.name: _shown(part, scene, ssp) for part in parts.values()}
    for part in parts.values():
        _component(elements, part, shown[part.name])
    if scene.connections:
        joined = SubElement(system, "ssd:Connections")
        gains = {part.gain_of: part.name for part in parts.values() if part.gain_of is not None}
        for connection in scene.connections:
            if connection in gains:
                _through(joined, connection, gains[connection])
            else:
                _connection(joined, connection, parts)
    _master(system, scene)
    _units(root, [variable for variables in shown.values() for variable in variables])
    start, stop = repr(scene.start_time), repr(scene.start_time + duration)
    experiment = SubElement(root, "ssd:DefaultExperiment", startTime=start, stopTime=stop)
    annotations = SubElement(experiment, "ssd:Annotations")  # OMSimulator accepts none higher up
    if scene.connections:
        step = SubElement(annotations, "ssc:Annotation", type=OSP_ANNOTATION)
        algorithm = SubElement(step, "osp:Algorithm")
        SubElement(algorithm, "osp:FixedStepAlgorithm", baseStepSize=repr(scene.macro_step))
    tables = {name: table for name, table in parse_toml(scene.text).items() if name not in OWN_TABLES}
    own = SubElement(annotations, "ssc:Annotation", type=ANNOTATION)
    noted = SubElement(own, "vibroimpact:Scene")
    SubElement(noted, "vibroimpact:Tables").text = tomli_w.dumps(tables)
    for name, attributes in _notes(scene, parts):
        SubElement(noted, f"vibroimpact:{name}", attributes)
    return _written(root)


def parameter_set(part: Part, ssp: str) -> bytes:
    """Return the SSV of a component's start values."""
    values = {name: (part.facts.variables[name], value) for name, value in part.values.items()}
    return _parameter_set(START_VALUES, values, ssp)


def _parameter_set(name: str, values: Mapping[str, tuple[VariableFacts, StartValue]], ssp: str) -> bytes:
    root = _root("ssv:ParameterSet", ssp, ("ssc",))
    root.set("name", name)
    parameters = SubElement(root, "ssv:Parameters")
    for parameter, (variable, value) in values.items():
        kind, text = _value(variable, value)
        SubElement(SubElement(parameters, "ssv:Parameter", name=parameter), f"ssv:{kind}", value=text)
    return _written(root)


def swept_values(scene: Scene, parts: Mapping[str, Part]) -> dict[str, tuple[str, str]]:
    """Return element and variable of each swept start value of a component, by its coordinate.

    A coordinate is a swept key's name in a dataset: `mass` for `b.mass`. A gain counts if it is a component.
    """
    gains = {part.gain_of: part.name for part in parts.values() if part.gain_of is not None}
    found = {}
    for axis in scene.sweep:
        place = gain_place(axis.key)
        end = component_variable(axis.key)
        if place is not None:
            end = gains.get(scene.connections[place], ""), "gain"
        if end[0] in parts and end[1] in parts[end[0]].values:
            found[scene.sweep_coordinate_name(axis.key)] = end
    return found


def swept_members(scene: Scene, parts: Mapping[str, Part], ssp: str) -> dict[str, bytes]:
    """Return the SSV of the swept values, and the SSM that maps its names to the components; empty without a sweep.

    Another tool varies the sweep in this one set; the values are the components' present ones.
    """
    swept = swept_values(scene, parts)
    if not swept:
        return {}
    values = {
        name: (parts[component].facts.variables[variable], parts[component].values[variable])
        for name, (component, variable) in swept.items()
    }
    mapping = _root("ssm:ParameterMapping", ssp, ("ssc",))
    for name, end in swept.items():
        SubElement(mapping, "ssm:MappingEntry", source=name, target=".".join(end))
    return {SWEPT_VALUES: _parameter_set("sweep", values, ssp), SWEPT_MAPPING: _written(mapping)}


def _notes(scene: Scene, parts: Mapping[str, Part]) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield notes on elements, for parts without a form in SSP; OMSimulator accepts no annotations of elements."""
    for part in parts.values():
        if part.fmu:
            yield "Component", {"name": part.name, "fmu": part.fmu, "fmi": part.fmi}
        elif part.gain_of is not None:
            yield "Gain", {"name": part.name} | _unit(part.gain_of)
    for connection in scene.connections:
        element, connector = connection.target
        if connection.gain_unit is not None:
            yield "Connection", {"endElement": element, "endConnector": connector} | _unit(connection)


def _unit(connection: ConnectionSpec) -> dict[str, str]:
    return {} if connection.gain_unit is None else {"gain_unit": connection.gain_unit}


def _root(name: str, ssp: str, prefixes: tuple[str, ...]) -> Element:
    own = name.partition(":")[0]
    spaces = {f"xmlns:{prefix}": NAMESPACES[prefix] for prefix in (own, *prefixes)}
    tool = f"vibroimpact {metadata.version('vibroimpact')}"
    return Element(name, {**spaces, "version": ssp, "generationTool": tool})


def _written(root: Element) -> bytes:
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _shown(part: Part, scene: Scene, ssp: str) -> list[VariableFacts]:
    """Return the variables that are connectors: connected variables, and recorded outputs."""
    names: dict[str, None] = {}
    for number, connection in enumerate(scene.connections, start=1):
        for end, (component, name) in (("from", connection.source), ("to", connection.target)):
            if component == part.name:
                names[name] = None
                _refuse_no_connector(
                    scene, f"connection[{number}].{end}", end, part.facts.variables[name], ssp
                )
    if part.gain_of is not None:
        names |= {"input": None, "output": None}
    recorded = (component_variable(reference) for reference in scene.sampled)
    for component, name in recorded:
        variable = part.facts.variables.get(name) if component == part.name else None
        is_number = variable is not None and variable.scalar and variable.kind in NUMERIC_KINDS
        if is_number and variable is not None and variable.causality in KINDS[ssp]:
            names[name] = None
    return [part.facts.variables[name] for name in names]


def _refuse_no_connector(scene: Scene, where: str, end: str, variable: VariableFacts, ssp: str) -> None:
    if not variable.scalar:
        got = f"the {variable.shape} {variable.name}"
        raise UsageError(f"{scene.source}: {where}: expected a single value in a system (SSP), got {got}.")
    if end == "to" and variable.causality != "input":
        got = f"the tunable parameter {variable.name}"
        raise UsageError(f"{scene.source}: {where}: expected an input in SSP {ssp}, got {got}.")
    if variable.causality in KINDS[ssp] and (end == "to" or variable.causality in GIVING):
        return
    hint = (
        "Export SSP 2.0, which has such connectors."
        if variable.causality == "local"
        else "Give its value to the input, in the parameters of its component."
    )
    got = f"the {variable.causality} {variable.name}"
    raise UsageError(f"{scene.source}: {where}: expected an output in SSP {ssp}, got {got}. {hint}")


def _component(elements: Element, part: Part, variables: list[VariableFacts]) -> None:
    component = SubElement(
        elements,
        "ssd:Component",
        name=part.name,
        type=FMU_TYPE,
        source=part.member,
        implementation="ModelExchange" if part.facts.kind == MODEL_EXCHANGE else "CoSimulation",
    )
    if variables:
        connectors = SubElement(component, "ssd:Connectors")
        for variable in variables:
            connector = SubElement(connectors, "ssd:Connector", name=variable.name, kind=variable.causality)
            kind = SubElement(connector, f"ssc:{_TYPES[variable.kind]}")
            if variable.kind == "real" and variable.unit is not None:
                kind.set("unit", variable.unit_name)
    if part.values:
        bindings = SubElement(component, "ssd:ParameterBindings")
        SubElement(bindings, "ssd:ParameterBinding", source=part.values_member)


def _connection(joined: Element, spec: ConnectionSpec, parts: Mapping[str, Part]) -> None:
    units = [parts[name].facts.variables[variable].unit for name, variable in (spec.source, spec.target)]
    differ = units[0] is not None and units[1] is not None and not agree(units[0], units[1])
    connection = SubElement(
        joined,
        "ssd:Connection",
        startElement=spec.source[0],
        startConnector=spec.source[1],
        endElement=spec.target[0],
        endConnector=spec.target[1],
    )
    if differ or spec.gain_unit is not None:
        connection.set("suppressUnitConversion", "true")  # the gain is the only change of the number
    if spec.mapping:
        _mapping(
            connection, spec, [parts[end[0]].facts.variables[end[1]] for end in (spec.source, spec.target)]
        )
    elif spec.gain != 1.0 or spec.offset or differ:
        # some tools take 0 for a missing attribute
        SubElement(connection, "ssc:LinearTransformation", factor=repr(spec.gain), offset=repr(spec.offset))


def _mapping(connection: Element, spec: ConnectionSpec, ends: Sequence[VariableFacts]) -> None:
    """Write the mapping of a connection: by items between enumerations, else by numbers or truth values."""
    kinds = {variable.kind for variable in ends}
    if len(kinds) > 1 and "boolean" in kinds:
        where = f"{'.'.join(spec.source)} -> {'.'.join(spec.target)}"
        raise UsageError(
            f"{where}: expected a mapping between values of one type in SSP, got one of truth values."
        )
    kind = {"boolean": "Boolean", "enumeration": "Enumeration"}.get(
        kinds.pop() if len(kinds) == 1 else "", "Integer"
    )
    mapping = SubElement(connection, f"ssc:{kind}MappingTransformation")
    for pair in spec.mapping:
        source, target = (_mapped(kind, variable, value) for variable, value in zip(ends, pair, strict=True))
        SubElement(mapping, "ssc:MapEntry", source=source, target=target)


def _mapped(kind: str, variable: VariableFacts, value: int) -> str:
    if kind == "Boolean":
        return "true" if value else "false"
    names = {number: name for name, number in variable.items.items()}
    return names[value] if kind == "Enumeration" else str(value)


def _through(joined: Element, spec: ConnectionSpec, gain: str) -> None:
    """Write a connection whose gain is a component; its offset follows the gain."""
    for start, end in ((spec.source, (gain, "input")), ((gain, "output"), spec.target)):
        connection = SubElement(
            joined,
            "ssd:Connection",
            startElement=start[0],
            startConnector=start[1],
            endElement=end[0],
            endConnector=end[1],
        )
    if spec.offset:
        SubElement(connection, "ssc:LinearTransformation", factor="1.0", offset=repr(spec.offset))


def _master(system: Element, scene: Scene) -> None:
    """Write OMSimulator's step: the smaller of the exchange interval and the sampling interval."""
    rate = scene.sampling_rate
    step = min(scene.macro_step, 1.0 / rate) if rate else scene.macro_step
    annotations = SubElement(system, "ssd:Annotations")
    own = SubElement(SubElement(annotations, "ssc:Annotation", type=OMS_ANNOTATION), "oms:Annotations")
    about = SubElement(own, "oms:SimulationInformation")
    tolerances = {"absoluteTolerance": "1e-6", "relativeTolerance": "1e-6"}
    SubElement(about, "oms:FixedStepMaster", {"description": "oms-ma", "stepSize": repr(step), **tolerances})


def _units(root: Element, variables: list[VariableFacts]) -> None:
    units = {v.unit_name: v.unit for v in variables if v.kind == "real" and v.unit is not None}
    if units:
        parent = SubElement(root, "ssd:Units")
        for name, unit in units.items():
            base = {key: str(unit.exponents[key]) for key in BASE_UNITS if key in unit.exponents}
            base |= {k: repr(v) for k, v, usual in _scale(unit) if v != usual}
            SubElement(SubElement(parent, "ssc:Unit", name=name), "ssc:BaseUnit", base)


def _scale(unit: Unit) -> Iterator[tuple[str, float, float]]:
    yield "factor", unit.factor, 1.0
    yield "offset", unit.offset, 0.0


def _value(variable: VariableFacts, value: StartValue) -> tuple[str, str]:
    kind = _TYPES[variable.kind]
    if kind == "Boolean":
        return kind, "true" if value else "false"
    return kind, repr(float(value)) if kind == "Real" else str(value)
