"""The table of the declarations of FMUs: each flag of the schemas has a row, in the code and on the page."""

from __future__ import annotations

import re
from collections.abc import Iterator
from xml.etree.ElementTree import Element, parse

import pytest
from support.places import ROOT

from vibroimpact.fmus.packaging.fmpy_door import schema_folder
from vibroimpact.orchestrator.fmi.capabilities import FLAGS

XS = "{http://www.w3.org/2001/XMLSchema}"
INTERFACES = ("CoSimulation", "ModelExchange", "ScheduledExecution")
NO_FLAGS = {"modelIdentifier"}


def flags_of_schema(version: str) -> Iterator[tuple[str, str]]:
    """Yield the owner and the name of each flag that the schema of a version has."""
    root = schema_folder() / f"fmi{version[0]}"
    for file in sorted(root.glob("*.xsd")):
        for element in parse(file).getroot().iter():
            owner = owner_of(element, version)
            for attribute in element.iter(f"{XS}attribute") if owner in INTERFACES else ():
                if not in_source_files(element, attribute) and attribute.get("name") not in NO_FLAGS:
                    for one in INTERFACES if element.get("name") == "fmi3InterfaceType" else (owner,):
                        yield one, attribute.get("name", "")
            if owner == "CoSimulation" or owner in INTERFACES:
                continue
            for attribute in element.findall(f"{XS}attribute"):
                name = attribute.get("name", "")
                if re.match("can|needs|provides|supports|has|might", name) or name == "intervalVariability":
                    yield ("clock" if "Clock" in element.get("name", "") else "variable"), name


def owner_of(element: Element, version: str) -> str:
    name = element.get("name", "")
    if element.tag == f"{XS}element" and version == "2.0" and name in INTERFACES:
        return name
    if element.tag == f"{XS}complexType" and version == "3.0":
        return "CoSimulation" if name == "fmi3InterfaceType" else name.removeprefix("fmi3")
    return ""


def in_source_files(interface: Element, attribute: Element) -> bool:
    return any(attribute in list(e.iter()) for e in interface.iter(f"{XS}element") if e.get("name") == "File")


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_every_flag_of_the_schema_stands_in_the_table_and_nothing_else_does(version: str) -> None:
    of_schema = {
        (owner, name)
        for owner, name in flags_of_schema(version)
        if owner in (*INTERFACES, "variable", "clock")
    }
    # the attributes of an interface include those of its elements
    interfaces = {name for owner, name in of_schema if owner in INTERFACES}
    of_schema = {(o, n) for o, n in of_schema if o != "variable" or n not in interfaces}
    in_table = {(flag.owner, flag.name) for flag in FLAGS if version in flag.versions.split(", ")}
    assert in_table == of_schema
    assert len(of_schema) > 15


def test_the_table_of_the_page_is_that_of_the_code() -> None:
    page = (ROOT / "docs" / "exchange.md").read_text(encoding="utf-8")
    for flag in FLAGS:
        only_here = flag.owner == "ModelExchange" and re.search(
            "ntegratorStep|GetAndSet|Directional", flag.name
        )
        if flag.owner in ("CoSimulation", "clock") or only_here:
            assert f"| `{flag.name}` | {flag.versions} | {flag.treatment}: {flag.how} |" in page
