"""Conformance of an SSP archive to the standard: to the schema of its version, and to rules outside of any schema."""

from __future__ import annotations

import functools
import importlib.util
import zipfile
from collections.abc import Iterator
from pathlib import Path

from lxml import etree

#: The package that contains the schema of a version, and the folder in it.
PLACES = {"1.0": ("fmpy", "ssp/schema"), "2.0": ("pyssp_standard", "resources/ssp2")}
SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
FILES = {
    ".ssd": "SystemStructureDescription.xsd",
    ".ssv": "SystemStructureParameterValues.xsd",
    ".ssm": "SystemStructureParameterMapping.xsd",
}


def missing_schema(version: str) -> str:
    """Return the reason for a missing schema of a version; empty if it is there."""
    package, _ = PLACES[version]
    return "" if importlib.util.find_spec(package) else f"{package}, which has the schema, is not installed"


def problems(archive: Path, version: str) -> list[str]:
    """Return the problems of an archive: violations of the schema, and dangling references."""
    with zipfile.ZipFile(archive) as file:
        roots = {
            name: etree.fromstring(file.read(name)) for name in file.namelist() if Path(name).suffix in FILES
        }
        members = set(file.namelist())
    found = [f"{name}: {line}" for name, root in roots.items() for line in _invalid(name, root, version)]
    found += [
        f"{name}: version {root.get('version')}"
        for name, root in roots.items()
        if root.get("version") != version
    ]
    return [*found, *_leading_nowhere(roots, members)]


def _invalid(name: str, root: etree._Element, version: str) -> Iterator[str]:
    schema = _schema(version, FILES[Path(name).suffix])
    if not schema.validate(root):
        yield from (error.message for error in schema.error_log)


@functools.cache
def _schema(version: str, file: str) -> etree.XMLSchema:
    package, folder = PLACES[version]
    spec = importlib.util.find_spec(package)
    assert spec is not None
    assert spec.submodule_search_locations is not None
    return etree.XMLSchema(etree.parse(Path(spec.submodule_search_locations[0]) / folder / file))


def _leading_nowhere(roots: dict[str, etree._Element], members: set[str]) -> Iterator[str]:
    """Yield sources that are no member, undeclared ends of connections and units, and entries without a value."""
    root = roots["SystemStructure.ssd"]
    for element in root.iterfind(".//{*}*[@source]"):
        if element.get("source") not in members:
            yield f"source {element.get('source')}"
    kinds = {
        (component.get("name"), connector.get("name")): connector.get("kind")
        for component in root.iterfind(f".//{SSD}Component")
        for connector in component.iterfind(".//{*}Connector")
    }
    for connection in root.iterfind(f".//{SSD}Connection"):
        ends = [
            (connection.get(f"{end}Element"), connection.get(f"{end}Connector")) for end in ("start", "end")
        ]
        if kinds.get(ends[0]) not in ("output", "calculatedParameter", "local") or kinds.get(ends[1]) not in (
            "input",
            "parameter",
        ):
            yield f"connection {ends[0]} -> {ends[1]}"
    units = {unit.get("name") for unit in root.iterfind(".//{*}Unit")}
    yield from (
        f"unit {e.get('unit')}" for e in root.iterfind(".//{*}*[@unit]") if e.get("unit") not in units
    )
    names = {component.get("name") for component in root.iterfind(f".//{SSD}Component")}
    for mapped in root.iterfind(".//{*}ParameterMapping[@source]"):
        bound = roots[mapped.getparent().get("source")]
        given = {parameter.get("name") for parameter in bound.iterfind(".//{*}Parameter")}
        for entry in roots[mapped.get("source")].iterfind("{*}MappingEntry"):
            element = entry.get("target").partition(".")[0]
            if entry.get("source") not in given or element not in names:
                yield f"entry {entry.get('source')} -> {entry.get('target')}"
